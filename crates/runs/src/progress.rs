//! The progress line of a run on a terminal; elsewhere, one line every few seconds. The end
//! of a run, and Ctrl-C.

use crate::term;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pcadlang_inference::Progress;
use pcadlang_report::{number, seconds};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

/// The polling interval.
const PAUSE: Duration = Duration::from_millis(100);

/// The interval between lines if the output is not a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// The end of a run, which other threads wait for.
#[derive(Default)]
pub struct Ending {
    ended: Mutex<bool>,
    changed: Condvar,
}

impl Ending {
    /// Runs the work whose end this is. The end is signalled even if the work panics, as
    /// waiting threads would otherwise keep the process alive.
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

    /// Waits for the end, at most for this time. Returns whether it has come.
    pub fn within(&self, time: Duration) -> bool {
        let ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.changed.wait_timeout_while(ended, time, |ended| !*ended);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// Shows progress until the end, as a bar if there is a time limit. `chains` is the
/// number of chains (or replicates), and what they are called.
pub fn watch(
    progress: &Progress,
    chains: (u32, &'static str),
    ending: &Ending,
    limit: Option<Duration>,
    quiet: bool,
) {
    if quiet {
        return;
    }
    let begun = Instant::now();
    if !term::is_live() {
        while !ending.within(BETWEEN_LINES) {
            error_line!("{}", line(&Known::of(progress, chains), begun.elapsed(), limit));
        }
        return;
    }
    let length = limit.map(|t| u64::try_from(t.as_millis()).unwrap_or(u64::MAX));
    let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr());
    let template = if limit.is_some() { "{bar:10} {wide_msg}" } else { "{spinner} {wide_msg}" };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    while !ending.within(PAUSE) {
        let elapsed = begun.elapsed();
        if limit.is_some() {
            bar.set_position(u64::try_from(elapsed.as_millis()).unwrap_or(u64::MAX));
        }
        bar.set_message(line(&Known::of(progress, chains), elapsed, limit));
        bar.tick();
    }
    bar.finish_and_clear();
}

/// Asks the chains for checkpoints at regular intervals, until the end.
pub fn ask_for_checkpoints(progress: &Progress, ending: &Ending, every: Duration) {
    while !ending.within(every) {
        progress.checkpoints.fetch_add(1, Ordering::Relaxed);
    }
}

/// Shows how many of `of` items are done, until `over`.
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

/// The state of a run at one time.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    steps: u64,
    best: Option<f64>,
    started: u32,
    warming: u32,
    ended: u32,
    /// The number of chains, and what they are called.
    chains: (u32, &'static str),
}

impl Known {
    fn of(progress: &Progress, chains: (u32, &'static str)) -> Known {
        let number = |n: &AtomicU32| n.load(Ordering::Relaxed);
        // Zero bits mean that there is no best state yet.
        let best = Some(progress.best.load(Ordering::Relaxed))
            .filter(|bits| *bits != 0)
            .map(f64::from_bits);
        Known {
            steps: progress.steps.load(Ordering::Relaxed),
            best,
            started: number(&progress.started),
            warming: number(&progress.warming),
            ended: number(&progress.ended),
            chains,
        }
    }

    /// Returns the phase of the chains.
    fn phase(&self) -> &'static str {
        match self {
            Known { started, ended, .. } if started == ended && *ended < self.chains.0 => "starts",
            Known { started, ended, .. } if started == ended => "finishing",
            Known { warming, .. } if *warming > 0 => "warm-up",
            _ => "sampling",
        }
    }
}

/// Formats the progress line, the most important parts first, since narrow terminals cut
/// off the end: the phase, the time left (or elapsed, without a limit), the best score,
/// the steps and their rate.
fn line(k: &Known, elapsed: Duration, limit: Option<Duration>) -> String {
    let mut s = k.phase().to_owned();
    if k.ended > 0 {
        s.push_str(&format!(", {} of {} {}", k.ended, k.chains.0, k.chains.1));
    }
    match limit {
        Some(limit) if elapsed < limit => s.push_str(&format!(", {} left", whole(limit - elapsed))),
        Some(_) => {}
        None => s.push_str(&format!(", {}", whole(elapsed))),
    }
    if let Some(best) = k.best.filter(|b| b.is_finite()) {
        s.push_str(&format!(", best {best:.1}"));
    }
    s.push_str(&format!(", {} steps", k.steps));
    if elapsed.as_secs_f64() >= 0.5 {
        s.push_str(&format!(
            ", {} per second",
            number((k.steps as f64 / elapsed.as_secs_f64()).round())
        ));
    }
    s
}

/// Formats a time in whole seconds, so that the line does not flicker.
fn whole(t: Duration) -> String {
    if t.as_secs() < 120 { format!("{} s", t.as_secs()) } else { seconds(t.as_secs_f64()) }
}

/// Ctrl-C, which ends all current runs.
#[derive(Default)]
pub struct Interrupt {
    asked: AtomicBool,
    runs: Mutex<Vec<Weak<Progress>>>,
}

impl Interrupt {
    /// Handles Ctrl-C from now on, until the command ends.
    pub fn listen() -> Arc<Interrupt> {
        let interrupt = Arc::new(Interrupt::default());
        let heard = Arc::clone(&interrupt);
        // If no handler can be set, the system's default stays. A second Ctrl-C exits
        // without waiting for the end of the step; the files on the disk are complete
        // then.
        let _ = ctrlc::set_handler(move || {
            if heard.asked.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            heard.pass_on();
        });
        interrupt
    }

    /// Returns whether the user has interrupted the command.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Makes a run end at its next step after an interrupt, or at once if there was one
    /// already.
    pub fn ends(&self, run: &Arc<Progress>) {
        let mut runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        runs.retain(|r| r.strong_count() > 0);
        runs.push(Arc::downgrade(run));
        drop(runs);
        if self.asked() {
            self.pass_on();
        }
    }

    fn pass_on(&self) {
        let runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        for run in runs.iter().filter_map(Weak::upgrade) {
            run.cancelled.store(true, Ordering::Relaxed);
        }
    }
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
        let mut k = Known { chains: (4, "chains"), ..Known::default() };
        assert_eq!(line(&k, s(0), None), "starts, 0 s, 0 steps");
        (k.started, k.warming, k.steps, k.best) = (2, 2, 500, Some(-12.34));
        assert_eq!(
            line(&k, s(2), Some(s(300))),
            "warm-up, 4 min 58 s left, best -12.3, 500 steps, 250 per second"
        );
        (k.started, k.warming, k.ended, k.steps) = (4, 0, 2, 12_345_678);
        let said = line(&k, s(2), Some(s(300)));
        assert!(
            said.starts_with(
                "sampling, 2 of 4 chains, 4 min 58 s left, best -12.3, 12345678 steps"
            ),
            "{said}"
        );
        // The bar and the line, except for the rate, fit a terminal of 80 columns.
        assert!(said.find(" steps").is_some_and(|i| i + 6 + 11 <= 80), "{said}");
        (k.ended, k.best) = (4, Some(f64::NEG_INFINITY));
        assert_eq!(
            line(&k, s(3), Some(s(3))),
            "finishing, 4 of 4 chains, 12345678 steps, 4.12e6 per second"
        );
    }
}
