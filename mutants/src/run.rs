//! Runs the tests on each mutant, first those that reach it, until one fails.

use crate::Failure;
use crate::find::Mutant;
use crate::reach::Reached;
use crate::results::Results;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// If more tests than this reach a mutant, the whole program is run.
const SINGLE: usize = 60;

/// Runs the mutants without a result until the time is up. A mutant that is not caught
/// within `patience` counts as a survivor.
pub fn all(
    copy: &Path,
    mutants: &[Mutant],
    reached: &[Reached],
    results: &Results,
    jobs: usize,
    until: Instant,
    patience: Duration,
) -> Result<(), Failure> {
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
    // Spread the mutants over files, so that an interrupted run covers some of each.
    let mut order: Vec<usize> = (0..mutants.len()).collect();
    order.sort_by_key(|i| i.wrapping_mul(0x9e37_79b9) % mutants.len().max(1));
    let work = || {
        while let Some(id) = order.get(next.fetch_add(1, Ordering::Relaxed)) {
            if Instant::now() > until {
                return;
            }
            if results.knows(&mutants[*id]) {
                continue;
            }
            let done = one(copy, *id, reached, patience).and_then(|caught| {
                println!("{}: {}", mutants[*id].key, caught.as_deref().unwrap_or("NOT CAUGHT"));
                results.put(&mutants[*id], caught)
            });
            if let (Err(e), Ok(mut f)) = (done, failed.lock()) {
                *f = Some(e);
                return;
            }
        }
    };
    std::thread::scope(|s| (0..jobs.max(1)).for_each(|_| drop(s.spawn(work))));
    failed.into_inner().ok().flatten().map_or(Ok(()), Err)
}

/// Returns the test that catches a mutant: first single tests that reach it, then whole
/// programs if other threads may reach it.
fn one(
    copy: &Path,
    id: usize,
    reached: &[Reached],
    patience: Duration,
) -> Result<Option<String>, Failure> {
    let few = |r: &&Reached| r.tests[id].len() <= SINGLE;
    let until = Instant::now() + patience;
    for r in reached.iter().filter(|r| !r.tests[id].is_empty()).filter(few) {
        if Instant::now() > until {
            break;
        }
        if let Some(by) = fails(copy, id, r, r.tests[id].iter().map(String::as_str).collect())? {
            return Ok(Some(by));
        }
    }
    for r in reached.iter().filter(|r| r.unnamed[id] || !few(r)) {
        if Instant::now() > until {
            break;
        }
        if let Some(by) = fails(copy, id, r, Vec::new())? {
            return Ok(Some(by));
        }
    }
    Ok(None)
}

/// Runs tests of a program. Returns the first that fails.
fn fails(copy: &Path, id: usize, r: &Reached, tests: Vec<&str>) -> Result<Option<String>, Failure> {
    let mut command = Command::new(&r.test.path);
    if !tests.is_empty() {
        command.arg("--exact").args(tests);
    }
    let mut child = command
        .current_dir(copy)
        .env("MUTANT", id.to_string())
        .env("INSTA_UPDATE", "no")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let (send, receive) = channel();
    if let Some(out) = child.stdout.take() {
        std::thread::spawn(move || {
            for line in BufReader::new(out).lines().map_while(Result::ok) {
                if let Some(name) =
                    line.strip_prefix("test ").and_then(|l| l.strip_suffix(" ... FAILED"))
                {
                    let _ = send.send(name.to_owned());
                }
            }
        });
    }
    let limit = Instant::now() + Duration::from_secs(30) + 6 * r.takes;
    let left = limit.saturating_duration_since(Instant::now());
    let caught = match receive.recv_timeout(left) {
        Ok(name) => Some(format!("{}::{name}", r.test.name)),
        Err(RecvTimeoutError::Timeout) => Some("time".to_owned()),
        // The process ended, possibly by a signal or a stack overflow.
        Err(RecvTimeoutError::Disconnected) if child.wait()?.success() => None,
        Err(RecvTimeoutError::Disconnected) => Some(r.test.name.clone()),
    };
    let _ = child.kill();
    let _ = child.wait();
    Ok(caught)
}
