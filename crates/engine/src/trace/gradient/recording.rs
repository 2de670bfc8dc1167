//! A recorded density, and the state of the trace for which it is valid.
//!
//! A recording is valid as long as nothing else changes the trace: every commit
//! increments the trace's revision, and code that moves only the choices that the density
//! is a function of reports that ([`Recording::moved`]). A clone of a trace has its own
//! identity.

use super::in_place::InPlace;
use crate::lang::tape::{ScoreSums, Tape};
use crate::trace::{Change, Draws, NONE, Target, Trace, Weight};
use pcadlang_numerics::dist::{Datum, Support};
use pcadlang_numerics::num::ExactSum;
use pcadlang_numerics::rng::Stream;
use std::sync::Arc;

/// The log density of a trace as a function of the unconstrained coordinates of some of
/// its choices.
#[derive(Debug)]
pub struct Recording {
    tape: Tape,
    in_place: Option<InPlace>,
    targets: Vec<Target>,
    identity: Arc<()>,
    revision: u64,
    /// The sums of scores in the state to which densities are relative.
    start: ScoreSums,
    /// The coordinates of that state, if the tape was last run there.
    here: Option<Vec<f64>>,
    summed: SummedChoices,
    /// The indices of the values that the choices summed out have in the trace, if it is
    /// still at this revision.
    drawn: Option<(u64, Vec<usize>)>,
}

/// Finite choices that are summed out of a recorded density.
#[derive(Debug, Default)]
pub(in crate::trace) struct SummedChoices {
    pub sites: Vec<Target>,
    /// The values of each.
    pub values: Vec<Vec<Datum>>,
    /// The number of scores in a sum over the choices: of the entries of all tables.
    pub entries: usize,
    /// The number of scores that a sweep over the choices evaluates, one choice at a time.
    pub sweep: usize,
}

impl SummedChoices {
    /// The choices with the values that have these indices.
    fn at<'a>(&'a self, indices: &'a [usize]) -> impl Iterator<Item = (Target, &'a Datum)> {
        let values = self.values.iter().zip(indices).map(|(values, i)| &values[*i]);
        self.sites.iter().copied().zip(values)
    }
}

impl Trace {
    /// Records the log density as a function of the unconstrained coordinates of some
    /// continuous choices, to be evaluated many times without proposals; `None` if it
    /// cannot be recorded as a straight-line program. [`Recording::begin`] must be called
    /// before it is evaluated.
    pub fn record(&mut self, targets: &[Target]) -> Option<Recording> {
        self.rollback();
        let recorded = self.record_tape(targets)?;
        Some(Recording::new(self, recorded, targets, SummedChoices::default()))
    }
}

impl Recording {
    /// A recording of the current state: a tape, and how it moves the trace in place.
    pub(in crate::trace) fn new(
        trace: &Trace,
        (tape, in_place): (Tape, Option<InPlace>),
        targets: &[Target],
        summed: SummedChoices,
    ) -> Recording {
        Recording {
            tape,
            in_place,
            targets: targets.to_vec(),
            identity: Arc::clone(&trace.identity),
            revision: trace.graph.revision,
            start: ScoreSums::default(),
            here: None,
            summed,
            drawn: None,
        }
    }

    /// The choices that are summed out.
    pub fn summed(&self) -> &[Target] {
        &self.summed.sites
    }

    /// Sets the power of the likelihood for sums over choices; densities are then
    /// tempered within these sums, and not outside.
    pub fn set_power(&mut self, power: f64) {
        if self.tape.set_power(power) {
            self.here = None;
        }
    }

    /// The number of scores in a sum over the choices, and in a sweep that updates one of
    /// them at a time.
    pub fn scores(&self) -> (usize, usize) {
        (self.summed.entries, self.summed.sweep)
    }

    /// Appends the changes that set the choices that are summed out to a draw from their
    /// conditional at coordinates. False if the density does not exist there.
    pub fn draw(&mut self, y: &[f64], rng: &mut Stream, out: &mut Vec<(Target, Change)>) -> bool {
        if self.summed.sites.is_empty() {
            return true;
        }
        self.here = None;
        if !self.tape.run(y) {
            return false;
        }
        let drawn = self.tape.draw(rng);
        out.extend(self.summed.at(&drawn).map(|(t, x)| (t, Change::Set(x.clone()))));
        true
    }

    /// True if it is valid for the current state of a trace.
    pub fn holds(&self, trace: &Trace) -> bool {
        self.revision == trace.graph.revision && Arc::ptr_eq(&self.identity, &trace.identity)
    }

    /// Marks it as valid after a commit that moved only its choices.
    pub fn moved(&mut self, trace: &Trace) {
        self.revision = trace.graph.revision;
    }

    /// Makes the current state of the trace the one to which densities are relative, and
    /// returns its coordinates in `y`. False if the recording does not cover that state,
    /// because a guarded condition has changed.
    pub fn begin(&mut self, trace: &Trace, y: &mut Vec<f64>) -> bool {
        if let Some(here) = self.here.as_ref().filter(|_| self.holds(trace)) {
            y.clone_from(here);
            return true;
        }
        let targets = &self.targets;
        let now = |i: usize| {
            let t = targets[i];
            match (trace.graph.stored_value(t.node), t.element) {
                (v, NONE) => v,
                (v, i) => v.element(i as usize).unwrap_or_default(),
            }
        };
        let coarse =
            |i: usize, support: &Support, x: f64| trace.coarse_coordinate(targets[i], support, x);
        let recorded = self.tape.run_at_values(now, coarse, y);
        self.start.clone_from(self.tape.sums());
        recorded
    }

    /// Returns the weight of a proposal of these coordinates; `None` if only an actual
    /// proposal can give it.
    pub fn weigh(&mut self, y: &[f64]) -> Option<Weight> {
        self.here = None;
        if !self.tape.run(y) {
            return None;
        }
        let (new, old, none) = (self.tape.sums(), &self.start, &ExactSum::default());
        let log_weight = ExactSum::difference_of_sums(
            [&new.prior, &new.likelihood, none],
            [&old.prior, &old.likelihood, none],
        );
        Some(Weight {
            log_weight,
            log_joint: log_weight,
            log_likelihood: ExactSum::difference(&new.likelihood, &old.likelihood),
            log_jacobian: new.jacobian.value(),
            ..Weight::default()
        })
    }

    /// Appends the changes that move the state to these coordinates.
    pub fn changes(&self, y: &[f64], out: &mut Vec<(Target, Change)>) {
        // A value need not tell its coordinate.
        let change = |(x, coarse): (Datum, Option<f64>)| match coarse {
            Some(y) => Change::Free(vec![y]),
            None => Change::Set(x),
        };
        let all = self.tape.images(y).zip(self.tape.coarse(y)).map(change);
        out.extend(self.targets.iter().copied().zip(all));
    }

    /// Moves the trace to these coordinates in place, with the same result as a proposal of
    /// [`Recording::changes`] and a commit, and makes that the state to which densities
    /// are relative, with its coordinates in `here`. False, with the trace unchanged, if
    /// only a proposal can do that.
    pub fn move_to(&mut self, trace: &mut Trace, y: &[f64], here: &mut Vec<f64>) -> bool {
        trace.rollback();
        self.here = None;
        let Some(in_place) = &mut self.in_place else { return false };
        let moved =
            self.tape.run_at_images(y, here) && in_place.fits(&trace.graph, &self.tape, &[]);
        if moved {
            in_place.apply(&mut trace.graph, &self.tape, &[], Some(&self.start));
            trace.keep_moved(&self.targets, self.tape.coarse(here));
            self.start.clone_from(self.tape.sums());
            self.revision = trace.graph.revision;
            self.here = Some(here.clone());
        }
        moved
    }

    /// Gives the choices that are summed out a draw from their conditional at these
    /// coordinates, or where the trace is, by an update of those that change, and moves the
    /// trace there in place, as [`Recording::move_to`] does. False, with the trace
    /// unchanged, if that is not possible.
    pub fn draw_and_move_to(
        &mut self,
        trace: &mut Trace,
        y: Option<&[f64]>,
        here: &mut Vec<f64>,
        rng: &mut Stream,
        draws: Draws,
    ) -> bool {
        trace.rollback();
        self.here = None;
        let there = match y {
            Some(y) => self.tape.run_at_images(y, here),
            None => self.begin(trace, here),
        };
        if !there || self.in_place.is_none() {
            return false;
        }
        let drawn = self.tape.draw(rng);
        let changed = self.changed(trace, &drawn);
        // Where the trace is, these values may be impossible.
        let possible = |w: Weight| w.appeared + w.vanished == 0 && w.log_joint.is_finite();
        if !changed.is_empty() && !trace.propose(&changed, draws).is_ok_and(possible) {
            trace.rollback();
            return false;
        }
        if y.is_some()
            && let Some(in_place) = &mut self.in_place
        {
            if !in_place.fits(&trace.graph, &self.tape, &drawn) {
                trace.rollback();
                return false;
            }
            trace.commit();
            in_place.apply(&mut trace.graph, &self.tape, &drawn, None);
            trace.keep_moved(&self.targets, self.tape.coarse(here));
            self.start.clone_from(self.tape.sums());
        }
        trace.commit();
        self.revision = trace.graph.revision;
        self.drawn = Some((self.revision, drawn));
        self.here = Some(here.clone());
        true
    }

    /// The changes that give the choices summed out the values with these indices.
    fn changed(&self, trace: &Trace, drawn: &[usize]) -> Vec<(Target, Change)> {
        let set = |(t, x): (Target, &Datum)| (t, Change::Set(x.clone()));
        let all = self.summed.at(drawn);
        match &self.drawn {
            Some((revision, now)) if *revision == trace.graph.revision && self.holds(trace) => {
                let differs = now.iter().zip(drawn).map(|(now, drawn)| now != drawn);
                all.zip(differs).filter(|(_, differs)| *differs).map(|(one, _)| set(one)).collect()
            }
            _ => all.filter(|(t, x)| trace.stored(*t).as_ref() != Some(*x)).map(set).collect(),
        }
    }

    /// Returns the log Jacobian in the state to which densities are relative.
    pub fn log_jacobian(&self) -> f64 {
        self.start.jacobian.value()
    }

    /// [`Trace::gradient`] at the coordinates of the last run. False if a derivative is
    /// not known.
    pub fn gradient(&mut self, y: &[f64], power: f64, out: &mut Vec<f64>) -> bool {
        self.tape.gradient(y, power, out)
    }
}
