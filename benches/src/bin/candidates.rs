//! Measures how well candidate regions of objects of revolution are found in photographs
//! with known masks.
//!
//!     cargo run --release -p pcadlang-benches --bin candidates -- FOLDER... [most=64] [size=128]
//!
//! A folder holds `image.png` and the ground truth `mask.png`. Prints for each folder the
//! best intersection over union of the first 1, 5 and 20 candidates and of all
//! candidates, their number, and the seconds; and finally how many folders reach 0.8 and
//! 0.9.

use pcadlang_scene::vision::candidates::{CandidateOptions, candidates};
use pcadlang_scene::vision::{Limits, mask, photo};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The numbers of candidates for which the best overlap is printed.
const FIRST: [usize; 4] = [1, 5, 20, usize::MAX];

/// The results of a folder: the best overlaps, the number of candidates, and the seconds.
struct Outcome {
    best: [f64; FIRST.len()],
    count: usize,
    seconds: f64,
}

fn look(folder: &Path, options: &CandidateOptions) -> Result<Outcome, String> {
    let read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
    let (limits, image, truth) = (Limits::default(), read("image.png")?, read("mask.png")?);
    let photo = photo::decode(&image, &limits).map_err(|e| e.to_string())?;
    let truth = mask::decode(&truth, None, &limits).map_err(|e| e.to_string())?;
    let start = Instant::now();
    let found = candidates(&photo, options);
    let seconds = start.elapsed().as_secs_f64();
    let overlaps: Vec<f64> = found.iter().map(|c| c.mask.overlap(&truth)).collect();
    let best = FIRST.map(|n| overlaps.iter().take(n).copied().fold(0.0, f64::max));
    Ok(Outcome { best, count: found.len(), seconds })
}

fn main() -> Result<(), String> {
    let mut options = CandidateOptions { most: 64, ..Default::default() };
    let mut folders = Vec::new();
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            Some(("most", n)) => {
                options.most = n.parse().map_err(|_| format!("{argument} is not a number"))?
            }
            Some(("size", n)) => {
                options.size = n.parse().map_err(|_| format!("{argument} is not a number"))?
            }
            _ => folders.push(PathBuf::from(argument)),
        }
    }
    if folders.is_empty() {
        return Err("usage: candidates FOLDER... [most=64] [size=128]".into());
    }
    println!("{:20}  first    of 5   of 20     all  count  seconds", "");
    let (mut reached, mut seconds) = ([[0; FIRST.len()]; 2], 0.0);
    for folder in &folders {
        let o = look(folder, &options)?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let [a, b, c, d] = o.best;
        println!("{name:20} {a:6.3}  {b:6.3}  {c:6.3}  {d:6.3} {:6} {:8.3}", o.count, o.seconds);
        for (counts, least) in reached.iter_mut().zip([0.8, 0.9]) {
            (0..FIRST.len()).for_each(|i| counts[i] += usize::from(o.best[i] >= least));
        }
        seconds += o.seconds / folders.len() as f64;
    }
    println!(
        "of {}: at 0.8 {:?}, at 0.9 {:?}; {seconds:.3} s each",
        folders.len(),
        reached[0],
        reached[1]
    );
    Ok(())
}
