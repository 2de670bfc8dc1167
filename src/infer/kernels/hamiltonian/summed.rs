//! Densities and forces with finite choices summed out, and their draw from the conditional afterwards.
//!
//! A place is looked at once for each joint value of the largest group of choices (see [`Sums`]), all groups at a value of
//! theirs at a time. The force is the mean, over the conditional of the choices, of that of the log joint. Drawing the choices
//! from that conditional at the end leaves the joint density of both invariant. Choices that only other values ask for (a component
//! of a mixture that no label points at) are drawn from their prior for the time of the move, and forgotten after it.

use super::{Point, System};
use crate::infer::kernel::{At, Outcome, recoverable};
use crate::infer::selection::fail;
use crate::num::log_sum_exp;
use crate::rng::Stream;
use crate::trace::{Sums, Target, Trace, TraceResult, Weight};
use std::sync::Arc;

/// What a system sums out.
#[derive(Debug)]
pub(super) struct Summed {
    sums: Arc<Sums>,
    /// Where the system began, and the log density there.
    start: Vec<f64>,
    origin: f64,
}

/// A place with all choices that are summed out at each of their values.
struct View {
    log_density: f64,
    /// By group and joint value: the log probability given the place.
    conditional: Vec<Vec<f64>>,
}

/// Makes a step with all choices there that the values of what is summed out ask for, and gives it what that is.
pub(super) fn with_alternatives(
    sites: Vec<Target>,
    trace: &mut Trace,
    at: &At,
    step: impl FnOnce(&mut Trace, &[Target]) -> TraceResult<Outcome>,
) -> TraceResult<Outcome> {
    if sites.is_empty() {
        return step(trace, &sites);
    }
    let held = trace.hold_alternatives(&sites, at.within(1).draws(0))?;
    let outcome = step(trace, &sites);
    trace.let_go(held)?;
    outcome
}

impl System<'_> {
    /// Sums choices out from now on, and fills in the force at the present place; false if the density has no slope there then.
    pub(super) fn sum_out(&mut self, sites: &[Target], point: &mut Point) -> TraceResult<bool> {
        let sums = Arc::new(self.trace.sums(sites)?);
        self.summed = Some(Summed { sums, start: point.y.clone(), origin: 0.0 });
        let there = self.evaluate_summed(point)?;
        self.trace.rollback();
        if let Some(summed) = &mut self.summed {
            summed.origin = point.log_density;
        }
        point.log_density = 0.0;
        Ok(there)
    }

    /// Goes to a place, with the choices at joint values given by group.
    fn put(&mut self, sums: &Sums, y: &[f64], value: impl Fn(usize) -> usize) -> TraceResult<Option<Weight>> {
        let mut changes = self.memory.changes(y, false, &self.layout).to_vec();
        changes.extend(sums.changes(value));
        let w = recoverable(self.trace.propose(&changes, self.at.draws(0)))?;
        Ok(w.filter(|w| w.appeared + w.vanished == 0))
    }

    fn view(&mut self, sums: &Sums, y: &[f64]) -> TraceResult<Option<View>> {
        let counts: Vec<usize> = sums.counts().collect();
        let mut conditional: Vec<Vec<f64>> = counts.iter().map(|n| Vec::with_capacity(*n)).collect();
        let (mut log_density, mut jacobian, mut terms) = (0.0, 0.0, Vec::new());
        for k in 0..sums.passes() {
            let Some(w) = self.put(sums, y, |i| if k < counts[i] { k } else { 0 })? else { return Ok(None) };
            let base = self.trace.parts(sums, self.at.power, &mut terms);
            if k == 0 {
                (log_density, jacobian) = (base + w.log_jacobian, w.log_jacobian);
            } else if w.log_jacobian.to_bits() != jacobian.to_bits() {
                let message = "the bounds of a choice depend on one that is summed out";
                return Err(fail(Default::default(), message.into()));
            }
            let open = conditional.iter_mut().zip(&terms).zip(&counts).filter(|(_, n)| k < **n);
            open.for_each(|((c, t), _)| c.push(*t));
        }
        for c in &mut conditional {
            let total = log_sum_exp(c);
            log_density += total;
            c.iter_mut().for_each(|t| *t -= total);
        }
        Ok(log_density.is_finite().then_some(View { log_density, conditional }))
    }

    /// The log density and force at a place, with the choices summed out; which of their values is pending is of no account.
    /// False where there is none.
    pub(super) fn evaluate_summed(&mut self, point: &mut Point) -> TraceResult<bool> {
        let Some(summed) = &self.summed else { return Ok(false) };
        let (sums, origin) = (Arc::clone(&summed.sums), summed.origin);
        let Some(view) = self.view(&sums, &point.y)? else { return Ok(false) };
        point.log_density = view.log_density - origin;
        point.gradient.clear();
        point.gradient.resize(point.y.len(), 0.0);
        let layout = Arc::clone(&self.layout);
        let mut part = Vec::with_capacity(point.y.len());
        for k in (0..sums.passes()).rev() {
            if k + 1 < sums.passes() {
                let value = |i: usize| if k < view.conditional[i].len() { k } else { 0 };
                if self.put(&sums, &point.y, value)?.is_none() {
                    return Ok(false);
                }
            }
            let weight = |n: u32| match sums.group_of(n) {
                Some(i) => view.conditional[i].get(k).map_or(0.0, |l| libm::exp(*l)),
                None => f64::from(u8::from(k == 0)),
            };
            part.clear();
            self.trace.weighted_gradient(&layout.targets, self.at.power, &weight, &mut part)?;
            point.gradient.iter_mut().zip(&part).for_each(|(g, p)| *g += p);
        }
        // Each pass has the Jacobians in it, and one is enough.
        part.clear();
        self.trace.weighted_gradient(&layout.targets, self.at.power, &|_| 0.0, &mut part)?;
        let more = sums.passes() as f64 - 1.0;
        point.gradient.iter_mut().zip(&part).for_each(|(g, p)| *g -= more * p);
        Ok(point.gradient.iter().all(|g| g.is_finite()))
    }

    /// Makes a place, or the one it began in, the state of the trace, with the choices drawn from their conditional there.
    pub(super) fn settle_summed(mut self, summed: Summed, to: Option<&Point>) -> TraceResult<bool> {
        let y = to.map_or(&summed.start, |p| &p.y);
        let mut rng = self.at.within(0).stream();
        let Some(view) = self.view(&summed.sums, y)? else {
            self.trace.rollback();
            return Ok(false);
        };
        let drawn: Vec<usize> = view.conditional.iter().map(|c| draw(c, &mut rng)).collect();
        let there = self.put(&summed.sums, y, |i| drawn[i])?.is_some();
        if there {
            self.trace.commit()
        } else {
            self.trace.rollback()
        }
        Ok(there && to.is_some())
    }
}

/// A value drawn with these log probabilities.
fn draw(log: &[f64], rng: &mut Stream) -> usize {
    let probabilities: Vec<f64> = log.iter().map(|l| libm::exp(*l)).collect();
    rng.weighted(&probabilities, 1.0)
}
