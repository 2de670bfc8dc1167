//! A pause of a run: its chains wait between two kernel applications, and their clocks
//! stand still.

use pcadlang_numerics::platform::clock::Instant;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// How often a waiting chain looks whether its run was cancelled.
const PATIENCE: Duration = Duration::from_millis(50);

/// Whether the chains of a run are to wait. A paused chain goes on where it was: its draws
/// are those of a run without the pause, and the pause does not count for a time limit.
#[derive(Debug, Default)]
pub struct Pause {
    asked: AtomicBool,
    ended: Condvar,
    lock: Mutex<()>,
}

impl Pause {
    /// Makes the chains wait from their next kernel application on.
    pub fn begin(&self) {
        self.asked.store(true, Ordering::SeqCst);
    }

    /// Lets the chains go on.
    pub fn end(&self) {
        let _held = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        self.asked.store(false, Ordering::SeqCst);
        self.ended.notify_all();
    }

    /// Returns whether the chains are to wait.
    pub fn is_on(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Waits for the end of the pause, or until `is_over`. Returns the time waited.
    pub(super) fn wait(&self, is_over: impl Fn() -> bool) -> Duration {
        let begun = Instant::now();
        let mut held = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
        while self.is_on() && !is_over() {
            let woken = self.ended.wait_timeout(held, PATIENCE);
            held = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
        begun.elapsed()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Callbacks, Progress};
    use crate::{Model, RunOptions};
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
        let memory = pcadlang_report::Memory::default();
        let sinks: Vec<Box<dyn crate::draws::Sink>> = vec![Box::new(memory.clone())];
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
}
