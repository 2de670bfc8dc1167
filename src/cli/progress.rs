//! The live line of a run: only on a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pcadlang::infer::Progress;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Shows progress until `done`; a limit of time makes it a bar.
pub fn watch(progress: &Progress, done: &AtomicBool, limit: Option<Duration>, quiet: bool) {
    if quiet || !std::io::stderr().is_terminal() {
        return;
    }
    let begun = Instant::now();
    let bar = ProgressBar::with_draw_target(limit.map(|t| t.as_millis() as u64), ProgressDrawTarget::stderr());
    let template = if limit.is_some() { "{wide_bar} {msg}" } else { "{spinner} {msg}" };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    while !done.load(Ordering::Relaxed) {
        let steps = progress.steps.load(Ordering::Relaxed);
        let elapsed = begun.elapsed();
        let best = f64::from_bits(progress.best.load(Ordering::Relaxed));
        let mut message = format!("{steps} steps, {:.0} a second", steps as f64 / elapsed.as_secs_f64().max(1e-3));
        if steps > 0 && best.is_finite() && best != 0.0 {
            message.push_str(&format!(", best log joint {best:.1}"));
        }
        if let Some(limit) = limit {
            message.push_str(&format!(", {:.0} s left", limit.saturating_sub(elapsed).as_secs_f64()));
            bar.set_position(elapsed.as_millis() as u64);
        }
        bar.set_message(message);
        bar.tick();
        std::thread::sleep(Duration::from_millis(100));
    }
    bar.finish_and_clear();
}
