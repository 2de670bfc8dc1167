//! What a comparator keeps from one score to the next.

use pcadlang_engine::lang::builtins::PreviousEvaluation;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

/// Sums over the contours that stay, of the comparator that counted them last. Likelihoods
/// of one node of a trace share them, as their views share a canvas.
pub(super) struct SharedTally<C, T>(Mutex<(Option<Arc<C>>, T)>);

impl<C, T> fmt::Debug for SharedTally<C, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SharedTally")
    }
}

impl<C: Send + Sync + 'static, T: Default + Send + 'static> SharedTally<C, T> {
    /// What the previous evaluation kept. While another thread counts, nothing: forks that
    /// run side by side would disturb each other.
    pub fn after(previous: Option<&PreviousEvaluation>) -> Arc<SharedTally<C, T>> {
        let kept = previous.and_then(|p| Arc::clone(&p.state).downcast::<SharedTally<C, T>>().ok());
        kept.filter(|kept| !matches!(kept.0.try_lock(), Err(TryLockError::WouldBlock)))
            .unwrap_or_else(|| Arc::new(SharedTally(Mutex::default())))
    }

    /// Calls a function with the sums of a comparator, empty ones if they were of another
    /// one.
    pub fn with<R>(&self, comparator: &Arc<C>, f: impl FnOnce(&mut T) -> R) -> R {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !kept.0.as_ref().is_some_and(|of| Arc::ptr_eq(of, comparator)) {
            *kept = (Some(Arc::clone(comparator)), T::default());
        }
        f(&mut kept.1)
    }
}
