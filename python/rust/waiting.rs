//! Waiting for chains while Python stays responsive.

use crate::model::Compiled;
use pcadlang_inference::Progress;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often the calling thread looks.
pub const PAUSE: Duration = Duration::from_millis(20);

/// Does work on a thread of its own. The calling thread, which must not hold the interpreter's
/// lock, looks now and then whether Python was interrupted or code of a host has failed, and calls
/// `look`; any of these ends the run. Returns the result, and whether Ctrl-C ended the run.
///
/// # Errors
/// That of `look`.
pub fn wait<T: Send>(
    compiled: &Compiled,
    progress: &Progress,
    mut look: impl FnMut(Python<'_>) -> PyResult<()>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<(T, bool)> {
    let (over, caller) = (AtomicBool::new(false), std::thread::current());
    let (result, failed) = std::thread::scope(|scope| {
        let running = scope.spawn(|| {
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
            over.store(true, Ordering::SeqCst);
            caller.unpark();
            result
        });
        let mut failed: Option<PyErr> = None;
        while !over.load(Ordering::SeqCst) {
            std::thread::park_timeout(PAUSE);
            if compiled.has_failed() {
                progress.cancelled.store(true, Ordering::Relaxed);
            }
            let looked = Python::attach(|py| py.check_signals().and_then(|()| look(py)));
            if let Err(e) = looked {
                progress.cancelled.store(true, Ordering::Relaxed);
                failed = failed.or(Some(e));
            }
        }
        (running.join().and_then(|result| result), failed)
    });
    let result = result.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    // An interrupt keeps the draws; a failure of the caller's own function is an error.
    Python::attach(|py| match failed {
        Some(e) if e.is_instance_of::<PyKeyboardInterrupt>(py) => Ok((result, true)),
        Some(e) => Err(e),
        None => Ok((result, false)),
    })
}
