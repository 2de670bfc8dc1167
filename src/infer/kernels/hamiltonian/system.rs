//! The dynamical system behind a trace: positions, densities and forces, and leapfrog steps.

use super::summed::Summed;
use crate::infer::kernel::{At, recoverable};
use crate::rng::Stream;
use crate::trace::{Change, Target, Trace, TraceResult};
use std::ops::Range;

/// A place with its log density and force.
#[derive(Clone, Debug, Default)]
pub(super) struct Point {
    pub y: Vec<f64>,
    pub gradient: Vec<f64>,
    /// The log density in the unconstrained space, less that of the state the trace is in.
    pub log_density: f64,
}

/// The momentum, by coordinate.
pub(super) type Momentum = Vec<f64>;

/// A trace as a system; proposals are pending until [`System::settle`].
pub(super) struct System<'a> {
    pub(super) trace: &'a mut Trace,
    pub(super) at: &'a At,
    pub(super) targets: Vec<Target>,
    /// By target: where its coordinates are.
    pub(super) ranges: Vec<Range<usize>>,
    jacobian: f64,
    pub(super) summed: Option<Summed>,
}

impl<'a> System<'a> {
    /// The continuous ones of some choices, and where they are; `sites` are summed out. `None` if there are no continuous ones,
    /// or the density there has no slope.
    ///
    /// # Errors
    /// An operation that has no derivative; choices that cannot be summed out.
    pub fn begin(
        trace: &'a mut Trace,
        at: &'a At,
        all: &[Target],
        sites: &[Target],
    ) -> TraceResult<Option<(Self, Point)>> {
        trace.rollback();
        let mut system = System {
            trace,
            at,
            targets: Vec::with_capacity(all.len()),
            ranges: Vec::with_capacity(all.len()),
            jacobian: 0.0,
            summed: None,
        };
        let mut y = Vec::with_capacity(all.len());
        for t in all {
            let Some((own, jacobian)) = system.trace.free(*t).filter(|(own, _)| !own.is_empty()) else { continue };
            system.targets.push(*t);
            system.ranges.push(y.len()..y.len() + own.len());
            system.jacobian += jacobian;
            y.extend(own);
        }
        if y.is_empty() {
            return Ok(None);
        }
        if !sites.is_empty() {
            return Ok(system.sum_out(sites, y)?.map(|point| (system, point)));
        }
        let mut point = Point { y, gradient: Vec::new(), log_density: 0.0 };
        system.force(&mut point)?;
        let usable = point.gradient.iter().all(|g| g.is_finite());
        Ok(usable.then_some((system, point)))
    }

    pub fn dimensions(&self) -> usize {
        self.ranges.last().map_or(0, |r| r.end)
    }

    /// The addresses of the choices, and how many coordinates each has: what a metric belongs to.
    pub fn signature(&self) -> Vec<(u64, usize)> {
        self.targets.iter().zip(&self.ranges).map(|(t, r)| (self.trace.address_hash(*t), r.len())).collect()
    }

    fn force(&mut self, point: &mut Point) -> TraceResult<()> {
        point.gradient.clear();
        self.trace.gradient(&self.targets, self.at.power, &mut point.gradient)
    }

    /// Goes to a place: its log density, and with `force` its gradient. `None` where there is none.
    pub fn go(&mut self, y: Vec<f64>, force: bool) -> TraceResult<Option<Point>> {
        if y.iter().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        if self.summed.is_some() {
            return self.go_summed(y, force);
        }
        let parts = self.ranges.iter().map(|r| y[r.clone()].to_vec());
        let changes: Vec<(Target, Change)> = self.targets.iter().copied().zip(parts.map(Change::Free)).collect();
        let Some(w) = recoverable(self.trace.propose(&changes, self.at.draws(0)))? else { return Ok(None) };
        let log_density = self.at.tempered(&w) + w.log_jacobian - self.jacobian;
        if w.appeared + w.vanished > 0 || !log_density.is_finite() {
            return Ok(None);
        }
        let mut point = Point { y, gradient: Vec::new(), log_density };
        if force {
            self.force(&mut point)?;
            if point.gradient.iter().any(|g| !g.is_finite()) {
                return Ok(None);
            }
        }
        Ok(Some(point))
    }

    /// One leapfrog step with these inverse masses.
    pub fn leapfrog(
        &mut self,
        from: &Point,
        momentum: &Momentum,
        step: f64,
        inverse_mass: &[f64],
    ) -> TraceResult<Option<(Point, Momentum)>> {
        let mut p: Momentum = momentum.iter().zip(&from.gradient).map(|(p, g)| p + 0.5 * step * g).collect();
        let y = from.y.iter().zip(&p).zip(inverse_mass).map(|((y, p), m)| y + step * m * p).collect();
        let Some(to) = self.go(y, true)? else { return Ok(None) };
        p.iter_mut().zip(&to.gradient).for_each(|(p, g)| *p += 0.5 * step * g);
        Ok(Some((to, p)))
    }

    /// Makes a place the state of the trace, or leaves it where it was; draws what was summed out.
    pub fn settle(mut self, to: Option<&Point>) -> TraceResult<bool> {
        if let Some(summed) = self.summed.take() {
            return self.settle_summed(summed, to);
        }
        match to {
            Some(point) => {
                let there = self.go(point.y.clone(), false)?.is_some();
                if there {
                    self.trace.commit()
                } else {
                    self.trace.rollback()
                }
                Ok(there)
            }
            None => {
                self.trace.rollback();
                Ok(false)
            }
        }
    }
}

/// A momentum drawn for these inverse masses.
pub(super) fn draw(inverse_mass: &[f64], rng: &mut Stream) -> Momentum {
    inverse_mass.iter().map(|m| rng.standard_normal() / m.sqrt()).collect()
}

/// The kinetic energy.
pub(super) fn kinetic(momentum: &Momentum, inverse_mass: &[f64]) -> f64 {
    0.5 * momentum.iter().zip(inverse_mass).map(|(p, m)| p * p * m).sum::<f64>()
}
