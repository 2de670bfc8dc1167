//! The live line of a run: only on a terminal.

use super::term;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pcadlang::infer::Progress;
use pcadlang::report::{number, seconds};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Between two looks at the chains.
const PAUSE: Duration = Duration::from_millis(100);

/// The end of a run, which others wait for.
#[derive(Default)]
pub struct Ending {
    ended: Mutex<bool>,
    changed: Condvar,
}

impl Ending {
    /// Does what it is the end of. It comes even where that panics: who waits for it would keep the process.
    pub fn of<T>(&self, work: impl FnOnce() -> T) -> T {
        struct Comes<'a>(&'a Ending);
        impl Drop for Comes<'_> {
            fn drop(&mut self) {
                *self.0.ended.lock().unwrap_or_else(PoisonError::into_inner) = true;
                self.0.changed.notify_all();
            }
        }
        let _comes = Comes(self);
        work()
    }

    /// Waits for it, but not longer than this; whether it came.
    pub fn within(&self, time: Duration) -> bool {
        let ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.changed.wait_timeout_while(ended, time, |ended| !*ended);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// Shows progress until the end; a limit of time makes it a bar.
pub fn watch(progress: &Progress, ending: &Ending, limit: Option<Duration>, quiet: bool) {
    if quiet || !term::is_live() {
        return;
    }
    let begun = Instant::now();
    let length = limit.map(|t| u64::try_from(t.as_millis()).unwrap_or(u64::MAX));
    let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr());
    let template = if limit.is_some() { "{bar:24} {wide_msg}" } else { "{spinner} {wide_msg}" };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    while !ending.within(PAUSE) {
        let elapsed = begun.elapsed();
        let steps = progress.steps.load(Ordering::Relaxed);
        // No bits: nothing is known yet.
        let best = Some(progress.best.load(Ordering::Relaxed)).filter(|bits| *bits != 0).map(f64::from_bits);
        if limit.is_some() {
            bar.set_position(u64::try_from(elapsed.as_millis()).unwrap_or(u64::MAX));
        }
        bar.set_message(line(steps, elapsed, best, limit));
        bar.tick();
    }
    bar.finish_and_clear();
}

/// Has the chains hand over checkpoints at even distances of time, until the end.
pub fn ask_for_checkpoints(progress: &Progress, ending: &Ending, every: Duration) {
    while !ending.within(every) {
        progress.checkpoints.fetch_add(1, Ordering::Relaxed);
    }
}

/// Shows how many of so many things are done, until `over`.
pub fn count(done: &AtomicU64, of: u64, over: &AtomicBool, quiet: bool) {
    if quiet || !term::is_live() {
        return;
    }
    let bar = ProgressBar::with_draw_target(Some(of), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:24} {pos} of {len}, {eta} left") {
        bar.set_style(style);
    }
    while !over.load(Ordering::Relaxed) {
        bar.set_position(done.load(Ordering::Relaxed));
        std::thread::sleep(PAUSE);
    }
    bar.finish_and_clear();
}

/// What is said: steps and their rate, the best score, the time left (or the time taken, if there is no limit).
fn line(steps: u64, elapsed: Duration, best: Option<f64>, limit: Option<Duration>) -> String {
    let mut s = format!("{steps} steps");
    if elapsed.as_secs_f64() >= 0.5 {
        s.push_str(&format!(", {} a second", number((steps as f64 / elapsed.as_secs_f64()).round())));
    }
    if let Some(best) = best.filter(|b| b.is_finite()) {
        s.push_str(&format!(", best log joint {best:.1}"));
    }
    match limit {
        Some(limit) if elapsed < limit => s.push_str(&format!(", {} left", whole(limit - elapsed))),
        Some(_) => s.push_str(", finishing"),
        None => s.push_str(&format!(", {}", whole(elapsed))),
    }
    s
}

/// A time in whole seconds, so that the line does not flicker.
fn whole(t: Duration) -> String {
    if t.as_secs() < 120 { format!("{} s", t.as_secs()) } else { seconds(t.as_secs_f64()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_comes_where_work_panics() {
        let ending = Ending::default();
        let work = std::panic::AssertUnwindSafe(|| ending.of(|| panic!("an internal error")));
        assert!(std::panic::catch_unwind(work).is_err());
        assert!(ending.within(Duration::ZERO));
    }

    #[test]
    fn the_line_says_what_is_known() {
        let s = Duration::from_secs;
        assert_eq!(line(0, s(0), None, None), "0 steps, 0 s");
        assert_eq!(
            line(500, s(2), Some(-12.34), Some(s(300))),
            "500 steps, 250 a second, best log joint -12.3, 4 min 58 s left"
        );
        assert_eq!(line(9, s(3), Some(f64::NEG_INFINITY), Some(s(3))), "9 steps, 3 a second, finishing");
    }
}
