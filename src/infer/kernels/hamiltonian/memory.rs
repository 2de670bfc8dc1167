//! What a Hamiltonian kernel keeps from step to step: the tape of the density, and places
//! to be used again.
//!
//! A tape belongs to one state of a trace but for the kernel's own choices. Where other
//! kernels move the trace in between, or every step moves other choices, it has to be
//! recorded again, which costs about as much as two gradients: where that does not pay,
//! the kernel goes on without for a while. None of this changes a result but in the last
//! bits of gradients.

use super::system::Point;
use crate::trace::{Change, Recording, Target, Trace, Weight};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

/// The longest wait, in steps, before the next recording is tried.
const LONGEST: u32 = 1024;
/// A tape that is run fewer times than this was not worth recording.
const WORTH: u32 = 3;

/// The choices of a step and the places of their coordinates.
#[derive(Debug)]
pub(super) struct Layout {
    /// All choices that were asked for, also those that do not move.
    asked: Vec<Target>,
    pub targets: Vec<Target>,
    ranges: Vec<Range<usize>>,
    /// By choice: its address and how many coordinates it has.
    pub signature: Vec<(u64, usize)>,
}

impl Layout {
    pub fn new(asked: &[Target]) -> Self {
        let n = asked.len();
        let (targets, ranges, signature) =
            (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
        Layout { asked: asked.to_vec(), targets, ranges, signature }
    }

    pub fn add(&mut self, trace: &Trace, t: Target, dimension: usize) {
        let from = self.dimensions();
        self.targets.push(t);
        self.ranges.push(from..from + dimension);
        self.signature.push((trace.address_hash(t), dimension));
    }

    pub fn dimensions(&self) -> usize {
        self.ranges.last().map_or(0, |r| r.end)
    }

    /// The proposal of these coordinates, appended to a list.
    pub fn changes(&self, y: &[f64], out: &mut Vec<(Target, Change)>) {
        let free = |r: &Range<usize>| Change::Free(y.get(r.clone()).unwrap_or_default().to_vec());
        out.extend(self.targets.iter().copied().zip(self.ranges.iter().map(free)));
    }
}

/// What a checkpoint knows of a tape that there was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Kept {
    #[default]
    None,
    /// One of the state the trace was in.
    Present,
    /// One of an earlier state.
    Past,
}

/// How often tapes are recorded, which comes back with a checkpoint: the last bits of
/// gradients hang on it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Habits {
    runs: u32,
    wait: u32,
    waited: u32,
    kept: Kept,
}

/// What a kernel keeps.
#[derive(Debug, Default)]
pub(super) struct Memory {
    tape: Option<(Recording, Arc<Layout>)>,
    /// How often the tape was run.
    runs: u32,
    /// How many recordings are left out, and how many were the last time.
    wait: u32,
    waited: u32,
    kept: Kept,
    changes: Vec<(Target, Change)>,
    points: Vec<Arc<Point>>,
    lists: Vec<Arc<Vec<f64>>>,
}

/// Another chain begins with nothing.
impl Clone for Memory {
    fn clone(&self) -> Self {
        Memory::default()
    }
}

impl Memory {
    /// What a checkpoint needs to know.
    pub fn habits(&self, trace: &Trace) -> Habits {
        let kept = match &self.tape {
            None if self.kept == Kept::Present && !trace.is_new() => Kept::Past,
            None => self.kept,
            Some((tape, _)) if tape.holds(trace) => Kept::Present,
            Some(_) => Kept::Past,
        };
        Habits { runs: self.runs, wait: self.wait, waited: self.waited, kept }
    }

    /// Goes on from a checkpoint.
    pub fn with(habits: Habits) -> Memory {
        let Habits { runs, wait, waited, kept } = habits;
        Memory { runs, wait, waited, kept, ..Memory::default() }
    }

    /// Takes up the tape of the last step, if it is still of this state and these
    /// choices, and gives the coordinates.
    pub fn stand(
        &mut self,
        trace: &Trace,
        asked: &[Target],
        y: &mut Vec<f64>,
    ) -> Option<Arc<Layout>> {
        let (tape, layout) = self.tape.as_mut()?;
        let holds = tape.holds(trace) && layout.asked == asked && tape.begin(trace, y);
        holds.then(|| Arc::clone(layout))
    }

    /// Records a tape, if that has paid so far; false if there is none.
    pub fn record(&mut self, trace: &mut Trace, layout: &Arc<Layout>, y: &mut Vec<f64>) -> bool {
        let kept = std::mem::take(&mut self.kept);
        // One that a checkpoint had is no new one.
        if kept != Kept::Present || !trace.is_new() {
            if self.tape.take().is_some() || kept != Kept::None {
                if self.runs < WORTH { self.back_off() } else { (self.wait, self.waited) = (0, 0) }
            }
            if self.wait > 0 {
                self.wait -= 1;
                return false;
            }
            self.runs = 0;
        }
        self.tape = trace.record(&layout.targets).map(|tape| (tape, Arc::clone(layout)));
        let told = self.tape.as_mut().is_some_and(|(tape, _)| tape.begin(trace, y));
        if !told {
            self.tape = None;
            self.back_off();
        }
        told
    }

    /// Gives up a tape that cannot tell what is asked of it.
    pub fn give_up(&mut self) {
        if self.tape.take().is_some() {
            self.back_off();
        }
    }

    /// The next try comes later, and ever later.
    fn back_off(&mut self) {
        self.waited = self.waited.saturating_mul(2).clamp(1, LONGEST);
        self.wait = self.waited;
    }

    /// Goes on after a commit of these choices.
    pub fn moved(&mut self, trace: &Trace) {
        if let Some((tape, _)) = &mut self.tape {
            tape.moved(trace);
        }
    }

    /// What a proposal of these coordinates would weigh; `None` if only a proposal can
    /// tell.
    pub fn weigh(&mut self, y: &[f64]) -> Option<Weight> {
        self.runs = self.runs.saturating_add(1);
        self.tape.as_mut().and_then(|(tape, _)| tape.weigh(y))
    }

    /// The gradient where the tape was last run; false if it is not known.
    pub fn gradient(&mut self, y: &[f64], power: f64, out: &mut Vec<f64>) -> bool {
        self.tape.as_mut().is_some_and(|(tape, _)| tape.gradient(y, power, out))
    }

    /// The log Jacobian of the state the trace is in.
    pub fn log_jacobian(&self) -> f64 {
        self.tape.as_ref().map_or(0.0, |(tape, _)| tape.log_jacobian())
    }

    /// The changes that make these coordinates the state: values, where a tape knows
    /// them, so that nothing is allocated for them.
    pub fn changes(&mut self, y: &[f64], taped: bool, layout: &Layout) -> &[(Target, Change)] {
        self.changes.clear();
        match &self.tape {
            Some((tape, _)) if taped => tape.changes(y, &mut self.changes),
            _ => layout.changes(y, &mut self.changes),
        }
        &self.changes
    }

    /// A place to fill in, that nothing else refers to.
    pub fn point(&mut self) -> Arc<Point> {
        unused(&mut self.points)
    }

    /// Remembers a place, so that it can be used again when nothing refers to it any
    /// more.
    pub fn keep(&mut self, point: &Arc<Point>) {
        self.points.push(Arc::clone(point));
    }

    /// A list of these numbers.
    pub fn numbers(&mut self, from: impl Iterator<Item = f64>) -> Arc<Vec<f64>> {
        let mut list = unused(&mut self.lists);
        if let Some(list) = Arc::get_mut(&mut list) {
            list.clear();
            list.extend(from);
        }
        self.lists.push(Arc::clone(&list));
        list
    }
}

/// One that nothing else refers to, taken out of a pool; a new one if there is none.
fn unused<T: Default>(pool: &mut Vec<Arc<T>>) -> Arc<T> {
    match pool.iter().position(|p| Arc::strong_count(p) == 1) {
        Some(i) => pool.swap_remove(i),
        None => Arc::default(),
    }
}
