//! Finds the candidates of pictures, for counting instructions and for comparing versions:
//! prints for each picture a checksum of all that was found, and the time.
//!
//!     cargo run --release -p pcadlang-benches --bin candidate_search PICTURE …

use pcadlang_scene::vision::Limits;
use pcadlang_scene::vision::candidates::{CandidateOptions, candidates};
use pcadlang_scene::vision::photo::decode;
use std::error::Error;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        let photo = decode(&std::fs::read(&path)?, &Limits::default())?;
        let start = Instant::now();
        let found = candidates(&photo, &CandidateOptions::default());
        let seconds = start.elapsed().as_secs_f64();
        let mut sum = DefaultHasher::new();
        for c in &found {
            format!("{:.12e} {:?} {:?}", c.score, c.mask, c.axes).hash(&mut sum);
        }
        println!("{:016x} {:3} {seconds:.3} s {path}", sum.finish(), found.len());
    }
    Ok(())
}
