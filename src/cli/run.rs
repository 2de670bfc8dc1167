//! `pcadlang run`: one run, its folder, and what is said of it at the end.

use super::args::Run;
use super::job::{self, Interrupt, Outcome};
use super::{Failure, plain};
use pcadlang::report::{RunDir, seconds, table};
use serde_json::json;
use std::path::Path;

/// Runs a program and leaves its folder.
pub fn run(a: &Run) -> Result<(), Failure> {
    let ready = job::prepare(&a.job, a.quiet)?;
    let (_, default_plan) = ready.model.plan()?;
    if let (Some(text), false) = (&default_plan, a.quiet) {
        eprintln!("note: the program has no `infer` block; this plan is used, copy and edit it:\n{text}");
    }
    let dir = match &a.out {
        Some(path) => RunDir::create(path),
        None => RunDir::fresh(Path::new("runs"), stem(&a.job.given.program)),
    };
    let dir = dir.map_err(|e| plain(e.to_string()))?;
    let interrupt = Interrupt::listen();
    let record = job::record(&a.job, ready.model.hash());
    let outcome = job::perform(&a.job, &ready, &dir, &record, &interrupt, !(a.quiet || a.json))?;
    show(a, &dir, &outcome);
    if outcome.interrupted { Err(Failure::Interrupted) } else { Ok(()) }
}

/// The name of a program without folder and ending.
fn stem(path: &str) -> &str {
    Path::new(path).file_stem().and_then(|s| s.to_str()).unwrap_or("run")
}

/// The end of a run on the terminal.
fn show(a: &Run, dir: &RunDir, o: &Outcome) {
    let seed = a.job.sampling.seed;
    if a.json {
        let all: serde_json::Map<_, _> = o.quantities.iter().map(|q| (q.name.clone(), json!(q.summary))).collect();
        println!(
            "{}",
            json!({ "out": dir.path(), "seed": seed, "quantities": all, "kernels": o.kernels, "warnings": o.warnings })
        );
        return;
    }
    if a.quiet {
        return;
    }
    print!("{}\n{}", table::quantities(&o.quantities), table::kernels(&o.kernels));
    for w in &o.warnings {
        println!("warning: {w}");
    }
    if o.chains.first().is_some_and(|c| c.last.is_pseudo()) {
        println!(
            "note: a likelihood is no density over its data, so intervals depend on its scale (a pseudo-posterior)"
        );
    }
    let steps: u64 = o.chains.iter().map(|c| c.steps + c.warmup).sum();
    let most = o.chains.iter().map(|c| (c.steps, c.warmup)).max().unwrap_or_default();
    println!("seed {seed}, {} chains, {steps} steps in {}", o.chains.len(), seconds(o.seconds));
    if a.job.sampling.time.is_some() {
        println!("the longest chain again: --steps {} --warmup {}", most.0, most.1);
    }
    if o.interrupted {
        println!("interrupted: every draw so far is kept");
    }
    println!("{}", dir.path().display());
}
