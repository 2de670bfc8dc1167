//! Chains of one run: spread over calls, and paused.

use pcadlang::{Model, RunOptions};
use pcadlang_inference::draws::Sink;
use pcadlang_inference::{Callbacks, Progress};
use pcadlang_report::Memory;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

const TEXT: &str = "assume x ~ normal(0, 1); observe normal(x, 1) = 2;
     infer { warmup 10 { mh(@x); } repeat 200 { mh(@x); collect x; } }";

/// Runs a chain that is paused for a while at its hundredth step.
fn paused(options: &RunOptions) -> (Vec<f64>, u64) {
    let (progress, steps) = (Arc::new(Progress::default()), Arc::new(AtomicU64::new(0)));
    let (held, seen) = (Arc::clone(&progress), Arc::clone(&steps));
    let callbacks = Callbacks::new().on_step(move |_, n, _| {
        seen.store(n, Ordering::SeqCst);
        if n == 100 {
            held.pause.begin();
        }
        ControlFlow::Continue(())
    });
    let model = Model::from_text(TEXT).unwrap();
    let options = RunOptions { callback: Some(Arc::new(callbacks)), ..options.clone() };
    let memory = Memory::default();
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(memory.clone())];
    std::thread::scope(|s| {
        let run = s.spawn(|| model.run_into(&options, 1, &progress, sinks));
        while !progress.pause.is_on() {
            std::thread::yield_now();
        }
        std::thread::sleep(Duration::from_millis(300));
        let before = steps.load(Ordering::SeqCst);
        assert_eq!(before, 100, "the chain waits after the step of the pause");
        progress.pause.end();
        assert!(run.join().unwrap().unwrap()[0].is_ok());
    });
    let all = memory.draws().rows.iter().map(|r| r.log_joint).collect();
    (all, steps.load(Ordering::SeqCst))
}

#[test]
fn a_paused_chain_goes_on_where_it_was() {
    let options = RunOptions { seed: 5, ..RunOptions::default() };
    let plain = Model::from_text(TEXT).unwrap().run(&options, 1, 1).unwrap();
    let expected: Vec<f64> = plain.draws[0].rows.iter().map(|r| r.log_joint).collect();
    assert_eq!(paused(&options).0, expected);
}

#[test]
fn the_pause_does_not_count_for_a_time_limit() {
    // The pause alone is longer than the limit.
    let time = Some(Duration::from_millis(200));
    let (_, steps) = paused(&RunOptions { seed: 5, time, ..RunOptions::default() });
    assert!(steps > 1000, "{steps} steps: the time was not used after the pause");
}

#[test]
fn chains_can_be_spread_over_calls() {
    let model = Model::from_text("assume x ~ normal(0, 1); observe normal(x, 1) = 1;").unwrap();
    let run = |first_chain, chains| {
        let options = RunOptions { seed: 3, steps: Some(50), first_chain, ..RunOptions::default() };
        model.run(&options, chains, 2).unwrap().quantity("x").unwrap().chains
    };
    let together = run(0, 3);
    assert_eq!([run(0, 1), run(1, 2)].concat(), together);
    assert_ne!(together[0], together[1]);
}
