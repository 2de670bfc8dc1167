//! Limits on what a program may build and how long one evaluation may take. Exceeding one
//! is an error with a location in the program, instead of exhausted memory or an endless
//! run. The numbers are in `docs/reference/limits.md`.

use pcadlang_numerics::platform::clock::Instant;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Limits on what a program may build.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Depth of nested calls.
    pub depth: u32,
    /// Nodes of the trace: at 100 to 200 bytes each, most of its memory.
    pub nodes: u32,
    /// Elements of all arrays that one update makes, and numbers of its meshes: about
    /// eight bytes each.
    pub elements: u64,
    /// Nodes that one update evaluates.
    pub operations: u64,
    /// When to interrupt an update.
    pub stop: Stop,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            depth: 10_000,
            nodes: 20_000_000,
            elements: 500_000_000,
            operations: u64::MAX,
            stop: Stop::default(),
        }
    }
}

impl Limits {
    /// The names of the numeric limits.
    pub const NAMES: [&str; 4] = ["depth", "nodes", "elements", "operations"];

    /// Sets the limit with this name.
    ///
    /// # Errors
    /// If the name is not in [`Limits::NAMES`], or the number is too large.
    pub fn with(mut self, name: &str, number: u64) -> Result<Limits, String> {
        let small =
            || u32::try_from(number).map_err(|_| format!("{name} may be at most {}", u32::MAX));
        match name {
            "depth" => self.depth = small()?,
            "nodes" => self.nodes = small()?,
            "elements" => self.elements = number,
            "operations" => self.operations = number,
            _ => {
                return Err(format!(
                    "there is no limit `{name}`; the limits are {}",
                    Limits::NAMES.join(", ")
                ));
            }
        }
        Ok(self)
    }
}

/// Returns a hint on how to raise a limit.
pub(super) fn raise(name: &str) -> String {
    format!("raise it with --limit {name}=N")
}

/// When to interrupt an update: some time after a stop was requested or time is up. Until
/// then the update may finish by itself, so that the state it leaves is complete.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    asked: Vec<Arc<AtomicBool>>,
    /// The start and length of the available time.
    time: Option<(Instant, Duration)>,
    pub(super) patience: Duration,
}

/// The default time for which an update may continue after a stop request.
const PATIENCE: Duration = Duration::from_secs(2);
/// An operation that may render a picture counts as this many.
const LARGE: u32 = 1 << 8;

impl Stop {
    /// Stops two seconds after this flag is set.
    pub fn when(asked: Arc<AtomicBool>) -> Stop {
        Stop { asked: vec![asked], time: None, patience: PATIENCE }
    }

    /// Also stops when this flag is set; two seconds after it if there was no stop
    /// condition before.
    #[must_use]
    pub fn or(mut self, asked: Arc<AtomicBool>) -> Stop {
        if self.asked.is_empty() && self.time.is_none() {
            return Stop::when(asked);
        }
        self.asked.push(asked);
        self
    }

    /// Also stops when this much time has passed from now.
    #[must_use]
    pub fn or_within(self, time: Option<Duration>) -> Stop {
        let time = time.map(|t| (Instant::now(), t)).or(self.time);
        Stop { time, ..self }
    }

    /// Moves the start of the available time, after a pause.
    #[must_use]
    pub fn later(self, by: Duration) -> Stop {
        let time = self.time.map(|(from, t)| (from.checked_add(by).unwrap_or(from), t));
        Stop { time, ..self }
    }

    /// Replaces the two seconds in which an update may finish by itself.
    #[must_use]
    pub fn after(self, patience: Duration) -> Stop {
        Stop { patience, ..self }
    }

    /// Whether a flag is set.
    pub fn is_set(&self) -> bool {
        self.asked.iter().any(|a| a.load(Ordering::Relaxed))
    }

    /// Whether a stop was requested or time is up.
    pub fn is_asked(&self) -> bool {
        self.has_used(1.0)
    }

    /// Whether a stop was requested or this fraction of the time has passed.
    pub fn has_used(&self, share: f64) -> bool {
        self.is_set()
            || self
                .time
                .is_some_and(|(from, t)| from.elapsed().as_secs_f64() >= share * t.as_secs_f64())
    }
}

/// How much of its limits an update has used.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spent {
    pub(super) operations: u64,
    pub(super) elements: u64,
    /// Evaluations since the last check of the clock, across updates: many short ones
    /// take time as well.
    pub(super) since_look: u32,
    /// The time at which it should have stopped.
    pub(super) late: Option<Instant>,
}

impl Spent {
    /// Resets the counts at the start of an update.
    pub fn renew(&mut self) {
        (self.operations, self.elements) = (0, 0);
    }

    /// Counts an operation that may take as long as many.
    pub fn count_large(&mut self) {
        self.since_look += LARGE;
    }
}
