//! Determines which tests reach which mutants, from one run of all tests.

use crate::Failure;
use crate::build::TestProgram;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A test program, its running time, and the mutants that it reaches.
pub struct Reached {
    pub test: TestProgram,
    pub takes: Duration,
    /// For each mutant, the tests whose own threads reached it.
    pub tests: Vec<BTreeSet<String>>,
    /// For each mutant, whether a thread without a test's name reached it.
    pub unnamed: Vec<bool>,
}

/// Runs all test programs. Returns those that pass without a mutant, the fastest first.
/// The mutants that a program reaches are kept beside the copy's builds, until it is
/// rebuilt.
pub fn reached(
    copy: &Path,
    tests: &[TestProgram],
    mutants: usize,
) -> Result<Vec<Reached>, Failure> {
    let mut all = Vec::new();
    for test in tests {
        // The library and the command have the same name.
        let folder = copy.join("target/reached").join(test.path.file_name().unwrap_or_default());
        let took = folder.with_extension("seconds");
        if !is_newer(&took, &test.path) && !run(copy, test, &folder, &took)? {
            println!("{} fails without a mutant: left out", test.name);
            continue;
        }
        let takes = Duration::from_secs_f64(std::fs::read_to_string(&took)?.trim().parse()?);
        let (test, tests) = (test.clone(), vec![BTreeSet::new(); mutants]);
        let mut r = Reached { test, takes, tests, unnamed: vec![false; mutants] };
        for file in std::fs::read_dir(&folder)? {
            for line in std::fs::read_to_string(file?.path())?.lines() {
                let Some((id, name)) = line.split_once('\t') else { continue };
                let Some(id) = id.parse::<usize>().ok().filter(|id| *id < mutants) else {
                    continue;
                };
                if name.is_empty() || name == "main" {
                    r.unnamed[id] = true;
                } else {
                    r.tests[id].insert(name.to_owned());
                }
            }
        }
        let count = (0..mutants).filter(|id| r.unnamed[*id] || !r.tests[*id].is_empty()).count();
        println!("{}: {:.1} s, comes by {count} mutants", r.test.name, takes.as_secs_f64());
        all.push(r);
    }
    all.sort_by_key(|r| r.takes);
    Ok(all)
}

fn is_newer(file: &Path, than: &Path) -> bool {
    let time = |p: &Path| std::fs::metadata(p).and_then(|m| m.modified()).ok();
    time(file).zip(time(than)).is_some_and(|(a, b)| a > b)
}

/// Runs a test program that records the mutants it reaches. Returns whether it passes.
fn run(copy: &Path, test: &TestProgram, folder: &Path, took: &Path) -> Result<bool, Failure> {
    let _ = std::fs::remove_dir_all(folder);
    std::fs::create_dir_all(folder)?;
    let before = Instant::now();
    let done = Command::new(&test.path)
        .current_dir(copy)
        .env("MUTANTS_REACHED", folder)
        .env("INSTA_UPDATE", "no")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()?;
    if done.success() {
        std::fs::write(took, before.elapsed().as_secs_f64().to_string())?;
    }
    Ok(done.success())
}
