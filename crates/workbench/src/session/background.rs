//! A running chain, and the results of one that has ended.

use super::draws::{DrawCounts, SampledDraws};
use pcadlang_inference::draws::{KernelStats, SiteStats};
use pcadlang_inference::{ChainError, ChainResult, Progress};
use pcadlang_library::model::Model;
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_report::{ChainDraws, number, quantities, table};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::Duration;

/// A running chain.
pub(super) struct Background {
    /// The plan, as described in messages.
    pub(super) what: String,
    pub(super) number: u32,
    /// The session's model at the start, to which the result belongs.
    pub(super) base: Arc<Model>,
    /// The model that is run; it differs from `base` if the plan was typed.
    pub(super) model: Arc<Model>,
    pub(super) progress: Arc<Progress>,
    /// The number of steps after which the run ends, if given.
    pub(super) steps: Option<u64>,
    pub(super) kept: SampledDraws,
    pub(super) began: Instant,
    /// Receives a message when the run is over; `is_done` is then true.
    pub(super) done: Receiver<()>,
    pub(super) is_done: Arc<AtomicBool>,
    pub(super) thread: JoinHandle<Result<ChainResult, ChainError>>,
}

/// The results of the last run.
pub(super) struct Finished {
    pub(super) what: String,
    pub(super) steps: u64,
    pub(super) warmup: u64,
    pub(super) counts: DrawCounts,
    pub(super) kernels: Vec<KernelStats>,
    pub(super) sites: Vec<SiteStats>,
    pub(super) seconds: f64,
    pub(super) draws: ChainDraws,
}

/// The progress of inference.
#[derive(Clone, Debug)]
pub struct Status {
    /// Kernel applications so far.
    pub steps: u64,
    /// Draws so far.
    pub draws: u64,
    /// The best log joint density of the draws.
    pub best: Option<f64>,
    /// The elapsed time.
    pub elapsed: Duration,
    /// The phase: starting, warm-up or sampling.
    pub phase: &'static str,
    /// How much of the phase is done, and the total: steps while sampling a given number
    /// of them, otherwise passes of the plan's loop. The total is 0 if it is unknown.
    pub done: (u64, u64),
    /// True if the run has ended.
    pub is_done: bool,
}

impl Status {
    /// Formats the phase and its progress, such as "warm-up, 300 of 1000".
    pub fn part(&self) -> String {
        match self.done {
            (_, 0) => self.phase.to_owned(),
            (done, of) => format!("{}, {done} of {of}", self.phase),
        }
    }
}

impl Background {
    pub(super) fn status(&self) -> Status {
        let seen = self.kept.counts();
        Status {
            steps: self.progress.steps.load(Ordering::Relaxed),
            draws: seen.draws,
            best: seen.best,
            elapsed: self.began.elapsed(),
            phase: self.phase(),
            done: self.part(),
            is_done: self.is_done.load(Ordering::SeqCst),
        }
    }

    fn phase(&self) -> &'static str {
        match &self.progress {
            p if p.started.load(Ordering::Relaxed) == 0 => "starting",
            p if p.warming.load(Ordering::Relaxed) > 0 => "warm-up",
            _ => "sampling",
        }
    }

    /// Returns how much of the phase is done, and the total.
    fn part(&self) -> (u64, u64) {
        let number = |n: &AtomicU64| n.load(Ordering::Relaxed);
        match self.steps {
            Some(steps) if self.phase() == "sampling" => (self.kept.counts().last_step, steps),
            _ => (number(&self.progress.pass), number(&self.progress.passes)),
        }
    }

    /// Explains why there are no draws yet.
    pub(super) fn no_draws(&self) -> String {
        format!("run {} has no draws yet: {}\n", self.number, self.status().part())
    }

    /// Describes the run in one line.
    pub(super) fn line(&self) -> String {
        let (s, seen) = (self.status(), self.kept.counts());
        let state = match s.is_done {
            true => "done; `:stop` keeps its state".to_owned(),
            false => s.part(),
        };
        let mut line = format!("run {}, {}: {} steps", self.number, self.what, s.steps);
        line += &drawn(&seen);
        format!("{line}; {state}\n")
    }
}

/// Formats the number of draws, the fraction of new states, and the best log joint
/// density.
fn drawn(seen: &DrawCounts) -> String {
    let Some(best) = seen.best.filter(|_| seen.draws > 0) else { return String::new() };
    let share = 100.0 * seen.moved as f64 / seen.draws as f64;
    format!(", {} draws ({share:.0}% new states), best log joint {}", seen.draws, number(best))
}

/// The number of quantities in the table after inference.
const MEANS: usize = 12;

impl Finished {
    /// Formats means and intervals of the recorded quantities.
    pub(super) fn means(&self) -> String {
        if self.draws.rows.len() < 2 {
            return String::new();
        }
        let mut all = quantities(std::slice::from_ref(&self.draws));
        let left_out = all.len().saturating_sub(MEANS);
        all.truncate(MEANS);
        let more = match left_out {
            0 => String::new(),
            n => format!("… and {n} more: `:plot NAME`\n"),
        };
        table::means(&all) + &more
    }

    /// Describes the run in one line.
    pub(super) fn line(&self) -> String {
        let warmup = if self.warmup > 0 {
            format!(" after {} of warm-up", self.warmup)
        } else {
            String::new()
        };
        let (tried, accepted) =
            self.kernels.iter().fold((0, 0), |(p, a), k| (p + k.proposals, a + k.accepted));
        let accepted = match tried {
            0 => String::new(),
            _ => format!(", {:.0}% of proposals accepted", 100.0 * accepted as f64 / tried as f64),
        };
        format!("{}: {} steps{warmup}{accepted}{}\n", self.what, self.steps, drawn(&self.counts))
    }
}
