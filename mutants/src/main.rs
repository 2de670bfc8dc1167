//! Mutation testing by schemata: many small errors are built into one copy of the
//! library, each with a number, and the tests run once for each number. A mutant that no
//! test notices survives: a test is missing, or the error makes no difference.
//!
//!     cargo run --release --manifest-path mutants/Cargo.toml -- [--mutants N] [--minutes M] [--patience SECONDS] [--jobs J]
//!         [--work DIR]
//!
//! Run it from the project's root. Results are kept in `mutants/results.jsonl`, one line
//! per mutant, and mutants with results are not run again, so that a stopped run can be
//! resumed. A mutant is identified by its file, function and text, so edits elsewhere do
//! not affect it.

#![forbid(unsafe_code)]

mod build;
mod find;
mod reach;
mod results;
mod rewrite;
mod run;

use results::Results;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The mutated folders.
const FOLDERS: [&str; 6] = [
    "crates/inference/src",
    "crates/engine/src/trace",
    "crates/numerics/src/dist",
    "crates/numerics/src/rng",
    "crates/scene/src/render",
    "crates/scene/src/vision",
];

/// The sources of the crates that are mutated.
const CRATES: [&str; 4] =
    ["crates/engine/src", "crates/inference/src", "crates/numerics/src", "crates/scene/src"];

pub type Failure = Box<dyn std::error::Error + Send + Sync>;

struct Options {
    mutants: usize,
    minutes: u64,
    /// The time limit for all tests of a mutant that do not notice it, in seconds.
    patience: u64,
    jobs: usize,
    work: PathBuf,
}

fn options() -> Result<Options, Failure> {
    let mut o = Options {
        mutants: 480,
        minutes: 24 * 60,
        patience: 3600,
        jobs: 1,
        work: PathBuf::from("target/mutants"),
    };
    let mut args = std::env::args().skip(1);
    while let Some(name) = args.next() {
        let value = args.next().ok_or_else(|| format!("{name} needs a value"))?;
        match &*name {
            "--mutants" => o.mutants = value.parse()?,
            "--minutes" => o.minutes = value.parse()?,
            "--patience" => o.patience = value.parse()?,
            "--jobs" => o.jobs = value.parse()?,
            "--work" => o.work = value.into(),
            _ => {
                return Err(
                    format!("no option {name}: there are --mutants, --minutes, --patience, --jobs and --work").into()
                );
            }
        }
    }
    Ok(o)
}

fn main() -> Result<(), Failure> {
    let o = options()?;
    let until = Instant::now() + Duration::from_secs(60 * o.minutes);
    let root = std::env::current_dir()?;
    if !root.join("mutants/Cargo.toml").exists() {
        return Err("run this from the project's root".into());
    }
    let copy = if o.work.is_absolute() { o.work.clone() } else { root.join(&o.work) };
    let mut mutants = find::select(&root, &FOLDERS, o.mutants)?;
    println!("{} mutants chosen", mutants.len());
    let libraries = CRATES.map(|of| root.join(of).join("lib.rs"));
    let rewritten: Vec<PathBuf> =
        mutants.iter().map(|m| m.file.clone()).chain(libraries).collect();
    build::copy(&root, &copy, &rewritten)?;
    let tests = build::build(&root, &copy, &mut mutants)?;
    println!("{} of them compile; {} test programs", mutants.len(), tests.len());
    let reached = reach::reached(&copy, &tests, mutants.len())?;
    let results = Results::open(&root.join("mutants/results.jsonl"))?;
    let patience = Duration::from_secs(o.patience);
    run::all(&copy, &mutants, &reached, &results, o.jobs, until, patience)?;
    results.report(&mutants);
    Ok(())
}

/// Returns the path in the form that results use.
pub fn within(root: &Path, file: &Path) -> String {
    file.strip_prefix(root).unwrap_or(file).to_string_lossy().replace('\\', "/")
}
