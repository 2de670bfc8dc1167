//! Limits on what a program may build and how long one evaluation may take. Exceeding one
//! is an error with a location in the program, instead of exhausted memory or an endless
//! run. The numbers are in `docs/reference/limits.md`.

use super::node::NodeId;
use super::store::Store;
use super::update::Failure;
use crate::lang::error::FaultKind;
use crate::lang::value::{Extent, MOST_ELEMENTS, MOST_NESTED, Value};
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
    patience: Duration,
}

/// The default time for which an update may continue after a stop request.
const PATIENCE: Duration = Duration::from_secs(2);
/// The number of operations between two checks of flags and clock.
const BETWEEN_LOOKS: u32 = 1 << 12;
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

    /// True if a flag is set.
    pub fn is_set(&self) -> bool {
        self.asked.iter().any(|a| a.load(Ordering::Relaxed))
    }

    /// True if a stop was requested or time is up.
    pub fn is_asked(&self) -> bool {
        self.has_used(1.0)
    }

    /// True if a stop was requested or this fraction of the time has passed.
    pub fn has_used(&self, share: f64) -> bool {
        self.is_set()
            || self
                .time
                .is_some_and(|(from, t)| from.elapsed().as_secs_f64() >= share * t.as_secs_f64())
    }
}

/// The limits of a trace, and how much of them an update has used.
#[derive(Clone, Debug)]
pub(crate) struct Budget {
    pub limits: Limits,
    operations: u64,
    elements: u64,
    /// Evaluations since the last check of the clock, across updates: many short ones
    /// take time as well.
    since_look: u32,
    /// The time at which it should have stopped.
    late: Option<Instant>,
}

impl Budget {
    /// Nothing has been used yet.
    pub fn new(limits: Limits) -> Budget {
        Budget { limits, operations: 0, elements: 0, since_look: 0, late: None }
    }

    /// Resets the counts at the start of an update.
    pub fn renew(&mut self) {
        (self.operations, self.elements) = (0, 0);
    }

    /// Counts an operation that may take as long as many.
    pub fn count_large(&mut self) {
        self.since_look += LARGE;
    }

    /// Counts one evaluation.
    #[inline]
    pub fn count_operation(&mut self, store: &Store, n: NodeId) -> Result<(), Failure> {
        self.operations += 1;
        self.since_look += 1;
        let looks = self.operations > self.limits.operations || self.since_look >= BETWEEN_LOOKS;
        if looks { self.look(store, n) } else { Ok(()) }
    }

    /// Fails if there were too many operations, or if it is too late.
    #[cold]
    fn look(&mut self, store: &Store, n: NodeId) -> Result<(), Failure> {
        if self.operations > self.limits.operations {
            let message =
                format!("one evaluation took more than {} operations", self.limits.operations);
            return Err(store.fail(n, FaultKind::Limit, message, Some(raise("operations"))));
        }
        self.since_look = 0;
        if !self.limits.stop.is_asked() {
            self.late = None;
            return Ok(());
        }
        let since = *self.late.get_or_insert_with(Instant::now);
        if since.elapsed() < self.limits.stop.patience {
            return Ok(());
        }
        let message = "stopped in the middle of an evaluation".to_owned();
        let hint = "one evaluation of the program took longer than the remaining time".to_owned();
        Err(store.fail(n, FaultKind::Stopped, message, Some(hint)))
    }

    /// Counts the elements of a value that a node made, and rejects values that are too
    /// large or too deeply nested.
    #[inline]
    pub fn count_elements(
        &mut self,
        store: &Store,
        n: NodeId,
        value: &Value,
    ) -> Result<(), Failure> {
        let made = match value {
            Value::Num(_) | Value::Bool(_) => return Ok(()),
            Value::Array(xs) => xs.len(),
            Value::Str(s) => s.len() / 8,
            Value::List(_) | Value::Record(_) => {
                check_extent(store, n, value)?;
                value.len().unwrap_or(0)
            }
            Value::Object(o) => {
                self.count_large();
                o.own_numbers()
            }
            _ => return Ok(()),
        };
        self.elements += made as u64;
        if self.elements > self.limits.elements {
            let message = format!(
                "the values made by one evaluation have more than {} elements",
                self.limits.elements
            );
            return Err(store.fail(n, FaultKind::Limit, message, Some(raise("elements"))));
        }
        Ok(())
    }
}

fn check_extent(store: &Store, n: NodeId, value: &Value) -> Result<(), Failure> {
    let (message, hint) = match value.extent() {
        Extent::Fits => return Ok(()),
        Extent::TooDeep => (
            format!("arrays and records are nested more than {MOST_NESTED} deep"),
            "collect growing values in one array: append(xs, x)",
        ),
        Extent::TooLarge => (
            format!("a value with more than {MOST_ELEMENTS} elements, counting nested ones"),
            "an array that is used several times counts each time",
        ),
    };
    Err(store.fail(n, FaultKind::Limit, message, Some(hint.into())))
}
