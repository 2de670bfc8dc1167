//! What is read when someone needs it, is shared while anyone does, and is freed after that:
//! decoded networks take more memory than all else in a run.

use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Something that is read from the program.
pub(crate) struct Shared<T>(Mutex<Weak<T>>);

impl<T> Shared<T> {
    pub const fn new() -> Shared<T> {
        Shared(Mutex::new(Weak::new()))
    }

    /// Returns it, by `read` if nobody has it.
    ///
    /// # Errors
    /// Those of `read`.
    pub fn get(&self, read: impl FnOnce() -> Result<T, String>) -> Result<Arc<T>, String> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(shared) = known.upgrade() {
            return Ok(shared);
        }
        let shared = Arc::new(read()?);
        *known = Arc::downgrade(&shared);
        Ok(shared)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_read_again_after_nobody_had_it() {
        let (shared, reads) = (Shared::new(), std::cell::Cell::new(0));
        let read = || {
            reads.set(reads.get() + 1);
            Ok(reads.get())
        };
        let first = shared.get(read).unwrap();
        assert!(Arc::ptr_eq(&first, &shared.get(read).unwrap()));
        drop(first);
        assert_eq!(shared.get(|| Err("unreadable".into())), Err("unreadable".into()));
        assert_eq!(*shared.get(read).unwrap(), 2);
    }
}
