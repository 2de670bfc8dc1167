//! How many runs work at a time; the others wait in turn.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// How often a waiting run looks whether it was stopped.
const PATIENCE: Duration = Duration::from_millis(100);

/// Places for runs to work.
pub struct Slots {
    free: Mutex<usize>,
    freed: Condvar,
}

/// A place that is taken until it is dropped.
pub struct Slot<'a>(&'a Slots);

impl Slots {
    /// Makes `count` places.
    pub fn new(count: usize) -> Slots {
        Slots { free: Mutex::new(count), freed: Condvar::new() }
    }

    /// Waits for a place; `None` if the run was stopped meanwhile.
    pub fn take(&self, is_over: impl Fn() -> bool) -> Option<Slot<'_>> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        while *free == 0 {
            if is_over() {
                return None;
            }
            let woken = self.freed.wait_timeout(free, PATIENCE);
            free = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
        *free -= 1;
        Some(Slot(self))
    }
}

impl Drop for Slot<'_> {
    fn drop(&mut self) {
        *self.0.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.0.freed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_free_again_when_it_is_left() {
        let slots = Slots::new(2);
        let one = slots.take(|| true).unwrap();
        let _two = slots.take(|| true).unwrap();
        assert!(slots.take(|| true).is_none(), "stopped while it waits");
        drop(one);
        assert!(slots.take(|| true).is_some());
    }
}
