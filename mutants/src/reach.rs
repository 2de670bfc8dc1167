//! Which tests come by which mutants, from one run of all tests.

use crate::Failure;
use crate::build::TestProgram;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A program of tests, how long it takes, and what it comes by.
pub struct Reached {
    pub test: TestProgram,
    pub takes: Duration,
    /// By mutant: the tests whose own threads came by it.
    pub tests: Vec<BTreeSet<String>>,
    /// By mutant: whether a thread without a test's name did.
    pub unnamed: Vec<bool>,
}

/// Runs all test programs that pass without a mutant, the quick ones first. What a
/// program came by is kept beside the copy's builds, until it is built anew.
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

/// Runs a test program that notes what it comes by; whether it passes.
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
