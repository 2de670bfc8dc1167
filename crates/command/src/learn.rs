//! `pcadlang learn`: a bank of scenes from the prior.

use super::args::{FeatureKind, Learn};
use pcadlang_engine::lang::load::reason;
use pcadlang_report::seconds;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{inputs, job, progress};
use pcadlang_workbench::bank::{self, BankError, Features};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// Draws scenes and writes the bank.
pub fn learn(a: &Learn) -> Result<(), Failure> {
    let begun = Instant::now();
    if !a.join.is_empty() {
        return bank::join(&a.join, &a.out).map_err(|e| told(a, e));
    }
    a.inputs.hint.none_for("learn")?;
    let model = inputs::program(&a.inputs, a.quiet)?.without_data().compile()?;
    let size = a.features_size;
    let features = match (&a.features_from, a.features) {
        (Some(command), _) => Features::Command { command: command.clone(), size },
        (None, FeatureKind::Contours) => Features::Contours { size },
        (None, FeatureKind::Keypoints) => Features::Keypoints { names: Vec::new() },
    };
    let how = bank::Learn {
        name: &a.inputs.program,
        first: u64::from(a.first),
        count: u64::from(a.n),
        seed: a.seed,
        threads: a.threads.map_or_else(job::machine_threads, |n| n as usize),
        features,
    };
    let (done, over) = (AtomicU64::new(0), AtomicBool::new(false));
    let learnt = std::thread::scope(|scope| {
        scope.spawn(|| progress::count(&done, how.count, &over, a.quiet));
        let learnt = bank::learn(&model, &how, &a.out, &done);
        over.store(true, Ordering::Relaxed);
        learnt
    });
    learnt.map_err(|e| match e {
        BankError::Run(e) => Failure::from(model.run_error(*e)),
        other => told(a, other),
    })?;
    if !a.quiet {
        let took = seconds(begun.elapsed().as_secs_f64());
        print_line!(
            "{}: {} scenes from the prior in {took}, seed {}",
            a.out.display(),
            a.n,
            a.seed
        );
    }
    Ok(())
}

/// Names the file that cannot be written.
fn told(a: &Learn, e: BankError) -> Failure {
    match e {
        BankError::Io(e) => plain(format!("cannot write {}: {}", a.out.display(), reason(&e))),
        other => plain(other.to_string()),
    }
}
