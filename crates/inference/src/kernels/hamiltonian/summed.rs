//! Densities and gradients with finite choices summed out, and their draw from the
//! conditional afterwards.
//!
//! A point is evaluated several times ([`Elimination::assignments`]), each time with every
//! group of choices at one of its joint values, until each group has been at all of its
//! joint values. The force is the mean of the log joint density's gradient over the
//! conditional of the choices. Drawing the choices from that conditional at the end
//! leaves the joint density of both invariant. Choices that exist only for other values
//! (a component of a mixture that no label points at) are drawn from their prior for the
//! duration of the move, and removed after it. A point that needs any further choices has
//! no density, from wherever it is reached.

use super::memory::Layout;
use super::point::Point;
use crate::calls::error::fail;
use crate::kernel::{Outcome, StepContext, recoverable};
use pcadlang_engine::trace::{
    Change, Elimination, Explored, Marginal, Selection, Target, Trace, TraceResult, Weight,
};
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::Stream;
use std::sync::Arc;

/// The choices that a system sums out.
#[derive(Debug)]
pub(super) struct Summed {
    marginal: Marginal,
    layout: Arc<Layout>,
    /// The changes that lead back to where the system began, and the evaluation and log
    /// density there.
    start: Vec<(Target, Change)>,
    begun: Option<View>,
    origin: f64,
    /// The last evaluation, and its point.
    last: Option<(Vec<f64>, View)>,
}

/// A point evaluated with the summed-out choices at each of their values.
#[derive(Debug)]
struct View {
    elimination: Arc<Elimination>,
    log_density: f64,
    /// By group and joint value: the log probability given the point.
    conditional: Vec<Vec<f64>>,
}

/// Makes a step while all choices exist that any value of the summed-out choices
/// requires, and passes the marginalisation to it.
pub(super) fn with_alternatives(
    (sites, moving): (Selection, Selection),
    trace: &mut Trace,
    at: &StepContext,
    step: impl FnOnce(&mut Trace, Option<Marginal>) -> TraceResult<Outcome>,
) -> TraceResult<Outcome> {
    if trace.targets(sites).is_empty() {
        return step(trace, None);
    }
    let (marginal, held) = trace.marginalise(sites, moving, at.within(1).draws(0))?;
    let outcome = step(trace, Some(marginal));
    trace.release_held(held)?;
    outcome
}

impl Summed {
    /// Sums choices out from now on, and fills in the force at the present point; `None`
    /// if there is no finite density and gradient.
    pub fn begin(
        marginal: Marginal,
        trace: &mut Trace,
        at: &StepContext,
        layout: &Arc<Layout>,
        point: &mut Point,
    ) -> TraceResult<Option<Self>> {
        let here = |t: &Target| Some((*t, Change::Set(trace.stored(*t)?)));
        let start = layout.targets.iter().filter_map(here).collect();
        let layout = Arc::clone(layout);
        let mut summed = Summed { marginal, layout, start, begun: None, origin: 0.0, last: None };
        summed.begun = summed.view_with_force(trace, at, point)?;
        trace.rollback();
        summed.origin = std::mem::take(&mut point.log_density);
        Ok(summed.begun.is_some().then_some(summed))
    }

    /// The changes that set these coordinates.
    fn changes(&self, y: &[f64]) -> Vec<(Target, Change)> {
        let mut changes = Vec::new();
        self.layout.changes(y, &mut changes);
        changes
    }

    /// Proposes a point with the groups at these joint values.
    fn put(
        &self,
        (trace, at): (&mut Trace, &StepContext),
        elimination: &Elimination,
        to: &[(Target, Change)],
        values: &[usize],
    ) -> TraceResult<Option<Weight>> {
        let mut changes = to.to_vec();
        self.marginal.changes(elimination, values, &mut changes);
        let w = recoverable(trace.propose(&changes, at.draws(0)))?;
        Ok(w.filter(|w| w.appeared + w.vanished == 0))
    }

    /// Evaluates a point; `None` if it has no density.
    fn view(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        to: &[(Target, Change)],
    ) -> TraceResult<Option<View>> {
        let known = Arc::clone(&self.marginal.elimination);
        if !known.structure_moves
            && let Some(view) = self.look(trace, at, known, to)?
        {
            return Ok(Some(view));
        }
        // The structure at the point may be different.
        match trace.explore(to, true, &mut self.marginal, at.draws(0))? {
            Explored::Elimination(elimination) => self.look(trace, at, elimination.into(), to),
            Explored::Structure(_) | Explored::Impossible => Ok(None),
        }
    }

    /// Evaluates a point with an elimination that may not be valid there; `None` if it is
    /// not, or if there is no density.
    fn look(
        &self,
        trace: &mut Trace,
        at: &StepContext,
        elimination: Arc<Elimination>,
        to: &[(Target, Change)],
    ) -> TraceResult<Option<View>> {
        let mut conditional: Vec<Vec<f64>> =
            elimination.seen().map(|s| vec![f64::NEG_INFINITY; s.len()]).collect();
        let (mut base, mut jacobian, mut terms) = (0.0, 0.0, Vec::new());
        for (k, values) in elimination.assignments.iter().enumerate() {
            let Some(w) = self.put((trace, at), &elimination, to, values)? else {
                return Ok(None);
            };
            if !trace.has_same_values(&self.marginal) {
                return Ok(None);
            }
            let rest = trace.parts(&elimination, at.power, &mut terms);
            if k == 0 {
                (base, jacobian) = (rest, w.log_jacobian);
            } else if w.log_jacobian.to_bits() != jacobian.to_bits() {
                let message = "the bounds of a choice depend on a choice that is summed out";
                return Err(fail(Default::default(), message.into()));
            } else if rest.to_bits() != base.to_bits() {
                let message = "internal error: an undetected dependence of a score on choices that are summed out; please report this";
                return Err(fail(Default::default(), message.into()));
            }
            for (((c, t), seen), v) in
                conditional.iter_mut().zip(&terms).zip(elimination.seen()).zip(values)
            {
                if seen[*v] == Some(k) {
                    c[*v] = *t;
                }
            }
        }
        let mut log_density = base + jacobian;
        for c in &mut conditional {
            let total = log_sum_exp(c);
            log_density += total;
            c.iter_mut().for_each(|t| *t -= total);
        }
        Ok(log_density.is_finite().then_some(View { elimination, log_density, conditional }))
    }

    /// Fills in the log density and force at a point with the choices summed out,
    /// whichever of their values are pending. Returns the evaluation; `None` if there is
    /// no finite density or gradient.
    fn view_with_force(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        point: &mut Point,
    ) -> TraceResult<Option<View>> {
        let to = self.changes(&point.y);
        let Some(view) = self.view(trace, at, &to)? else { return Ok(None) };
        point.log_density = view.log_density - self.origin;
        point.gradient.clear();
        point.gradient.resize(point.y.len(), 0.0);
        let (elimination, targets) = (&view.elimination, &self.layout.targets);
        let mut part = Vec::with_capacity(point.y.len());
        for (k, values) in elimination.assignments.iter().enumerate().rev() {
            // The last evaluation is still pending.
            if k + 1 < elimination.assignments.len()
                && self.put((trace, at), elimination, &to, values)?.is_none()
            {
                return Ok(None);
            }
            let first = elimination.seen().zip(values).map(|(seen, v)| seen[*v] == Some(k));
            let weights = first.zip(&view.conditional).zip(values);
            let weights: Vec<f64> =
                weights.map(|((first, c), v)| if first { libm::exp(c[*v]) } else { 0.0 }).collect();
            let base = f64::from(u8::from(k == 0));
            let weight = |n| trace.group_of(elimination, n).map_or(base, |i| weights[i]);
            part.clear();
            let force = trace.weighted_gradient(targets, at.power, &weight, &mut part);
            if recoverable(force)?.is_none() {
                return Ok(None);
            }
            point.gradient.iter_mut().zip(&part).for_each(|(g, p)| *g += p);
        }
        // Each evaluation includes the Jacobians, which count only once.
        part.clear();
        trace.weighted_gradient(targets, at.power, &|_| 0.0, &mut part)?;
        let more = elimination.assignments.len() as f64 - 1.0;
        point.gradient.iter_mut().zip(&part).for_each(|(g, p)| *g -= more * p);
        Ok(point.gradient.iter().all(|g| g.is_finite()).then_some(view))
    }

    /// Fills in the log density and force at a point; false if they do not exist.
    pub fn evaluate(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        point: &mut Point,
    ) -> TraceResult<bool> {
        let view = self.view_with_force(trace, at, point)?;
        self.last = view.map(|v| (point.y.clone(), v));
        Ok(self.last.is_some())
    }

    /// Makes a point, or the initial one, the state of the trace, with the choices drawn
    /// from their conditional there.
    pub fn finish_at(
        mut self,
        trace: &mut Trace,
        at: &StepContext,
        to: Option<&Point>,
    ) -> TraceResult<bool> {
        let mut rng = at.within(0).stream();
        let changes = match to {
            Some(p) => self.changes(&p.y),
            None => std::mem::take(&mut self.start),
        };
        let view = match (to, self.last.take()) {
            (None, _) => self.begun.take(),
            (Some(p), Some((y, view))) if bits(&y).eq(bits(&p.y)) => Some(view),
            _ => self.view(trace, at, &changes)?,
        };
        let Some(view) = view else {
            trace.rollback();
            return Ok(false);
        };
        let drawn: Vec<usize> = view.conditional.iter().map(|c| draw(c, &mut rng)).collect();
        let there = self.put((trace, at), &view.elimination, &changes, &drawn)?.is_some();
        if there {
            trace.commit()
        } else {
            trace.rollback()
        }
        Ok(there && to.is_some())
    }
}

fn bits(y: &[f64]) -> impl Iterator<Item = u64> {
    y.iter().map(|x| x.to_bits())
}

/// Draws an index with these log probabilities.
fn draw(log: &[f64], rng: &mut Stream) -> usize {
    let probabilities: Vec<f64> = log.iter().map(|l| libm::exp(*l)).collect();
    rng.weighted(&probabilities, 1.0)
}
