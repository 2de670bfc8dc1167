//! The memory of a Hamiltonian kernel between steps: the tape of the density, and points and
//! lists for reuse.
//!
//! A tape is valid for one state of a trace, up to the kernel's own choices. If other
//! kernels move the trace in between, or every step moves other choices, it has to be
//! recorded again, which costs about as much as two gradients. If that does not pay off,
//! the kernel works without a tape for a while. This affects results only in the last
//! bits of gradients.

use super::point::Point;
use crate::kernel::StepContext;
use pcadlang_engine::trace::{Change, Recording, Target, Trace, TraceResult, Weight};
use pcadlang_numerics::rng::Stream;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

/// The longest wait, in steps, before the next attempt at recording.
const LONGEST: u32 = 1024;
/// The fewest evaluations for which a tape was worth recording.
const WORTH: u32 = 3;

/// The choices of a step and the indices of their coordinates.
#[derive(Debug)]
pub(super) struct Layout {
    /// All selected choices, including those that do not move.
    asked: Vec<Target>,
    pub targets: Vec<Target>,
    ranges: Vec<Range<usize>>,
    /// For each choice, its address and number of coordinates.
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

    /// Appends the proposal of these coordinates to a list.
    pub fn changes(&self, y: &[f64], out: &mut Vec<(Target, Change)>) {
        let free = |r: &Range<usize>| Change::Free(y.get(r.clone()).unwrap_or_default().to_vec());
        out.extend(self.targets.iter().copied().zip(self.ranges.iter().map(free)));
    }
}

/// The tape as a checkpoint records it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Kept {
    #[default]
    None,
    /// There was a tape of the trace's state.
    Present,
    /// There was a tape of an earlier state.
    Past,
}

/// The state of the recording policy. It is part of checkpoints because the last bits of
/// gradients depend on it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct RecordingState {
    runs: u32,
    wait: u32,
    waited: u32,
    kept: Kept,
}

/// The data kept between steps.
#[derive(Debug, Default)]
pub(super) struct Memory {
    tape: Option<(Recording, Arc<Layout>)>,
    /// How many times the tape was evaluated.
    runs: u32,
    /// The number of recordings still to be skipped, and the number skipped the last
    /// time.
    wait: u32,
    waited: u32,
    kept: Kept,
    /// Where the trace is, with the force there, if a step of this tape led there; and the
    /// power of the likelihood for which the force is.
    here: Option<(Arc<Point>, f64)>,
    /// The coordinates at which the last step ended in place.
    ended: Vec<f64>,
    changes: Vec<(Target, Change)>,
    points: Vec<Arc<Point>>,
    lists: Vec<Arc<Vec<f64>>>,
}

/// A clone, for another chain, starts empty.
impl Clone for Memory {
    fn clone(&self) -> Self {
        Memory::default()
    }
}

impl Memory {
    /// The state for a checkpoint.
    pub fn recording_state(&self, trace: &Trace) -> RecordingState {
        let kept = match &self.tape {
            None if self.kept == Kept::Present && !trace.is_new() => Kept::Past,
            None => self.kept,
            Some((tape, _)) if tape.holds(trace) => Kept::Present,
            Some(_) => Kept::Past,
        };
        RecordingState { runs: self.runs, wait: self.wait, waited: self.waited, kept }
    }

    /// Restores the state of a checkpoint.
    pub fn with(recording_state: RecordingState) -> Memory {
        let RecordingState { runs, wait, waited, kept } = recording_state;
        Memory { runs, wait, waited, kept, ..Memory::default() }
    }

    /// Uses the tape of the last step, if it is still valid for this state and these
    /// choices, and returns the point there; `None` if there is no such tape, or no force.
    pub fn stand(
        &mut self,
        trace: &Trace,
        asked: &[Target],
        (sites, power): (&[Target], f64),
    ) -> Option<(Arc<Layout>, Arc<Point>)> {
        let (tape, layout) = self.tape.as_mut()?;
        if !tape.holds(trace) || layout.asked != asked || tape.summed() != sites {
            return None;
        }
        tape.set_power(power);
        if let Some((here, _)) = self.here.as_ref().filter(|(_, at)| *at == power) {
            return Some((Arc::clone(layout), Arc::clone(here)));
        }
        let layout = Arc::clone(layout);
        let mut here = self.point();
        let point = Arc::get_mut(&mut here)?;
        let (tape, _) = self.tape.as_mut()?;
        point.log_density = 0.0;
        let known =
            tape.begin(trace, &mut point.y) && tape.gradient(&point.y, power, &mut point.gradient);
        self.keep(&here);
        known.then(|| {
            self.here = Some((Arc::clone(&here), power));
            (layout, here)
        })
    }

    /// Records a tape with the choices of `sites` summed out, if that has paid off so far;
    /// false if there is no tape.
    pub fn record(
        &mut self,
        trace: &mut Trace,
        layout: &Arc<Layout>,
        (sites, at): (&[Target], &StepContext),
        y: &mut Vec<f64>,
    ) -> TraceResult<bool> {
        self.here = None;
        let kept = std::mem::take(&mut self.kept);
        // Re-recording a tape that a checkpoint had does not count as a new recording.
        if kept != Kept::Present || !trace.is_new() {
            if self.tape.take().is_some() || kept != Kept::None {
                if self.runs < WORTH { self.back_off() } else { (self.wait, self.waited) = (0, 0) }
            }
            if self.wait > 0 {
                self.wait -= 1;
                return Ok(false);
            }
            self.runs = 0;
        }
        let tape = match sites {
            [] => trace.record(&layout.targets),
            sites => trace.record_summed(&layout.targets, sites, at.draws(0))?,
        };
        self.tape = tape.map(|tape| (tape, Arc::clone(layout)));
        let told = self.tape.as_mut().is_some_and(|(tape, _)| {
            tape.set_power(at.power);
            tape.begin(trace, y)
        });
        if !told {
            self.tape = None;
            self.back_off();
        }
        Ok(told)
    }

    /// Drops a tape that cannot evaluate what is needed.
    pub fn give_up(&mut self) {
        if self.tape.take().is_some() {
            self.back_off();
        }
    }

    /// Makes the next attempt now; false if it would have been made anyway.
    pub fn stop_waiting(&mut self) -> bool {
        std::mem::take(&mut self.wait) > 0
    }

    /// Delays the next attempt, by ever longer waits.
    fn back_off(&mut self) {
        self.waited = self.waited.saturating_mul(2).clamp(1, LONGEST);
        self.wait = self.waited;
    }

    /// Moves the trace to a point in place, without a proposal. False, with the trace
    /// unchanged, if only a proposal can do that.
    pub fn move_to(&mut self, trace: &mut Trace, to: &Point, power: f64) -> bool {
        let there = self.end_in_place(true, |tape, here| tape.move_to(trace, &to.y, here));
        if there {
            self.stay_at(to, power);
        }
        there
    }

    /// Draws the choices that are summed out at a point, or where the trace is, and moves the
    /// trace there without a proposal of the other choices. False, with the trace unchanged,
    /// if only a proposal can do that.
    pub fn draw_and_move_to(
        &mut self,
        trace: &mut Trace,
        to: Option<&Point>,
        at: &StepContext,
        rng: &mut Stream,
    ) -> bool {
        let y = to.map(|to| &to.y[..]);
        let draws = at.draws(0);
        let there = self.end_in_place(y.is_some(), |tape, here| {
            tape.draw_and_move_to(trace, y, here, rng, draws)
        });
        if let (true, Some(to)) = (there, to) {
            self.stay_at(to, at.power);
        }
        there
    }

    /// Keeps the force at a point where a step ended. Not if the trace is elsewhere in the
    /// last bits, since the values there do not have exactly these coordinates: then the
    /// force is computed when the next step begins there, if one does.
    fn stay_at(&mut self, to: &Point, power: f64) {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        if self.ended.len() != to.y.len() || !self.ended.iter().zip(&to.y).all(same) {
            return;
        }
        let mut here = self.point();
        if let Some(point) = Arc::get_mut(&mut here) {
            point.y.clone_from(&to.y);
            point.gradient.clone_from(&to.gradient);
            point.log_density = 0.0;
            self.here = Some((Arc::clone(&here), power));
        }
        self.keep(&here);
    }

    /// Ends a step in place by `go`, which tells whether it could.
    fn end_in_place(
        &mut self,
        moves: bool,
        go: impl FnOnce(&mut Recording, &mut Vec<f64>) -> bool,
    ) -> bool {
        if moves {
            self.here = None;
        }
        self.tape.as_mut().is_some_and(|(tape, _)| go(tape, &mut self.ended))
    }

    /// Updates the tape after a commit of these choices.
    pub fn moved(&mut self, trace: &Trace) {
        self.here = None;
        if let Some((tape, _)) = &mut self.tape {
            tape.moved(trace);
        }
    }

    /// The weight of a proposal of these coordinates; `None` if only a proposal can
    /// determine it.
    pub fn weigh(&mut self, y: &[f64]) -> Option<Weight> {
        self.runs = self.runs.saturating_add(1);
        self.tape.as_mut().and_then(|(tape, _)| tape.weigh(y))
    }

    /// The gradient at the last point at which the tape was evaluated; false if it is
    /// unknown.
    pub fn gradient(&mut self, y: &[f64], power: f64, out: &mut Vec<f64>) -> bool {
        self.tape.as_mut().is_some_and(|(tape, _)| tape.gradient(y, power, out))
    }

    /// The coordinates of the state of the trace.
    pub fn coordinates(&mut self, trace: &Trace, y: &mut Vec<f64>) {
        if let Some((tape, _)) = &mut self.tape {
            tape.begin(trace, y);
        }
    }

    /// The log Jacobian at the state of the trace.
    pub fn log_jacobian(&self) -> f64 {
        self.tape.as_ref().map_or(0.0, |(tape, _)| tape.log_jacobian())
    }

    /// The changes that set these coordinates: values, if a tape knows them, to avoid
    /// allocations.
    pub fn changes(&mut self, y: &[f64], taped: bool, layout: &Layout) -> &[(Target, Change)] {
        self.changes.clear();
        match &self.tape {
            Some((tape, _)) if taped => tape.changes(y, &mut self.changes),
            _ => layout.changes(y, &mut self.changes),
        }
        &self.changes
    }

    /// The changes that make a point the state of the trace: the values at these
    /// coordinates, and choices summed out drawn from their conditional there. `None` if
    /// they have none.
    pub fn changes_with_draws(
        &mut self,
        trace: &Trace,
        y: &[f64],
        rng: &mut Stream,
    ) -> Option<&[(Target, Change)]> {
        let (tape, _) = self.tape.as_mut()?;
        self.changes.clear();
        tape.changes(y, &mut self.changes);
        let there = tape.draw(y, rng, &mut self.changes);
        self.changes.retain(|(t, change)| match change {
            Change::Set(x) => trace.stored(*t).as_ref() != Some(x),
            _ => true,
        });
        there.then_some(&self.changes)
    }

    /// A point to fill in, to which there is no other reference.
    pub fn point(&mut self) -> Arc<Point> {
        unused(&mut self.points)
    }

    /// Keeps a point for reuse once there is no other reference to it.
    pub fn keep(&mut self, point: &Arc<Point>) {
        self.points.push(Arc::clone(point));
    }

    /// A list of these numbers, reusing memory.
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

/// Takes an entry without other references out of a pool, or creates one.
fn unused<T: Default>(pool: &mut Vec<Arc<T>>) -> Arc<T> {
    match pool.iter().position(|p| Arc::strong_count(p) == 1) {
        Some(i) => pool.swap_remove(i),
        None => Arc::default(),
    }
}
