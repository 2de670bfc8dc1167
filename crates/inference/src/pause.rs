//! A pause of a run: its chains wait between two kernel applications, and their clocks
//! stand still.

use pcadlang_numerics::platform::clock::Instant;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// How often a waiting chain looks whether its run was cancelled.
const PATIENCE: Duration = Duration::from_millis(50);

/// True if the chains of a run are to wait. A paused chain goes on where it was: its draws
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
