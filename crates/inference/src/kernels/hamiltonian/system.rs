//! The dynamical system of a trace: positions, densities and forces, and leapfrog steps.
//!
//! Densities and forces come from a tape of the trace if there is one (see
//! [`super::memory`]), otherwise from pending proposals and reverse passes through the
//! trace, with bit-for-bit equal densities. A transition ends with a proposal, or with
//! values and scores that the trace takes from the tape, which are the same.

use super::memory::{Layout, Memory};
use super::metric::Metric;
use super::point::Point;
use super::summed::Summed;
use crate::kernel::{StepContext, recoverable};
use pcadlang_engine::trace::{Marginal, Selection, Target, Trace, TraceResult};
use pcadlang_numerics::num::ExactSum;
use pcadlang_numerics::rng::Stream;
use std::sync::Arc;

/// A trace as a dynamical system; proposals are pending until [`System::finish_at`].
pub(super) struct System<'a> {
    trace: &'a mut Trace,
    at: &'a StepContext,
    memory: &'a mut Memory,
    layout: Arc<Layout>,
    /// True if the memory has a tape of the trace's state.
    taped: bool,
    jacobian: f64,
    summed: Option<Summed>,
    /// The choices summed out by the tape, and those that move.
    sums: Option<(Selection, Selection)>,
}

impl<'a> System<'a> {
    /// Like [`System::begin`], with the choices of the first selection summed out by the
    /// tape while those of the second move; `None` if there is no such tape.
    pub fn begin_summed(
        trace: &'a mut Trace,
        at: &'a StepContext,
        all: &[Target],
        sums: (Selection, Selection),
        memory: &'a mut Memory,
    ) -> TraceResult<Option<(Self, Arc<Point>)>> {
        trace.rollback();
        let sites = trace.targets(sums.0).to_vec();
        let (layout, here) = match memory.stand(trace, all, (&sites, at.power)) {
            Some(known) => known,
            None => {
                let mut here = memory.point();
                let Some(point) = Arc::get_mut(&mut here) else { return Ok(None) };
                point.log_density = 0.0;
                let layout = Arc::new(Self::layout(trace, all, &mut point.y).0);
                let taped = !point.y.is_empty()
                    && memory.record(trace, &layout, (&sites, at), &mut point.y)?;
                let known = taped && memory.gradient(&point.y, at.power, &mut point.gradient);
                memory.keep(&here);
                if !known {
                    if taped {
                        memory.give_up();
                    }
                    return Ok(None);
                }
                (layout, here)
            }
        };
        let (jacobian, sums) = (memory.log_jacobian(), Some(sums));
        let system =
            System { trace, at, layout, memory, taped: true, jacobian, summed: None, sums };
        Ok(system.usable(here))
    }

    /// The choices that move, and their coordinates and log Jacobian.
    fn layout(trace: &Trace, all: &[Target], y: &mut Vec<f64>) -> (Layout, ExactSum) {
        let (mut layout, mut jacobian) = (Layout::new(all), ExactSum::default());
        y.clear();
        for t in all {
            let Some((own, j)) = trace.free_to_move(*t).filter(|(own, _)| !own.is_empty()) else {
                continue;
            };
            layout.add(trace, *t, own.len());
            jacobian.add(j);
            y.extend(own);
        }
        (layout, jacobian)
    }

    /// The continuous choices among `all`, their position, and the choices to sum out.
    /// `None` if there are no continuous choices, or the density has no gradient there.
    ///
    /// # Errors
    /// If an operation has no derivative, or choices cannot be summed out.
    pub fn begin(
        trace: &'a mut Trace,
        at: &'a StepContext,
        all: &[Target],
        marginal: Option<Marginal>,
        memory: &'a mut Memory,
    ) -> TraceResult<Option<(Self, Arc<Point>)>> {
        trace.rollback();
        if marginal.is_none()
            && let Some((layout, here)) = memory.stand(trace, all, (&[], at.power))
        {
            let jacobian = memory.log_jacobian();
            let (taped, summed, sums) = (true, None, None);
            let system = System { trace, at, layout, memory, taped, jacobian, summed, sums };
            return Ok(system.usable(here));
        }
        let mut here = memory.point();
        let Some(point) = Arc::get_mut(&mut here) else { return Ok(None) };
        point.log_density = 0.0;
        let (layout, jacobian) = Self::layout(trace, all, &mut point.y);
        if point.y.is_empty() {
            return Ok(None);
        }
        let layout = Arc::new(layout);
        let taped = marginal.is_none()
            && memory.record(trace, &layout, (&[], at), &mut point.y)?
            && memory.gradient(&point.y, at.power, &mut point.gradient);
        let (jacobian, summed, sums) = (jacobian.value(), None, None);
        let mut system = System { trace, at, memory, layout, taped, jacobian, summed, sums };
        if let Some(marginal) = marginal {
            system.summed = Summed::begin(marginal, system.trace, at, &system.layout, point)?;
            system.memory.keep(&here);
            return Ok(if system.summed.is_some() { system.usable(here) } else { None });
        }
        if !taped {
            system.memory.give_up();
            if !system.force(point)? {
                system.memory.keep(&here);
                return Ok(None);
            }
        }
        system.memory.keep(&here);
        Ok(system.usable(here))
    }

    fn usable(self, here: Arc<Point>) -> Option<(Self, Arc<Point>)> {
        here.gradient.iter().all(|g| g.is_finite()).then_some((self, here))
    }

    pub fn dimensions(&self) -> usize {
        self.layout.dimensions()
    }

    /// The addresses of the choices and their numbers of coordinates, which identify a
    /// metric.
    pub fn signature(&self) -> &[(u64, usize)] {
        &self.layout.signature
    }

    /// Fills in the force; false if it does not exist in this state.
    fn force(&mut self, point: &mut Point) -> TraceResult<bool> {
        point.gradient.clear();
        let force = self.trace.gradient(&self.layout.targets, self.at.power, &mut point.gradient);
        Ok(recoverable(force)?.is_some() && point.gradient.iter().all(|g| g.is_finite()))
    }

    /// Fills in the log density and force at a point; false if they do not exist.
    fn evaluate(&mut self, point: &mut Point) -> TraceResult<bool> {
        if point.y.iter().any(|x| !x.is_finite()) {
            return Ok(false);
        }
        if let Some(summed) = &mut self.summed {
            return summed.evaluate(self.trace, self.at, point);
        }
        if self.taped
            && let Some(w) = self.memory.weigh(&point.y)
        {
            point.log_density = self.at.tempered(&w) + w.log_jacobian - self.jacobian;
            if !point.log_density.is_finite() {
                return Ok(false);
            }
            if self.memory.gradient(&point.y, self.at.power, &mut point.gradient) {
                return Ok(point.gradient.iter().all(|g| g.is_finite()));
            }
        }
        if self.sums.is_some() {
            let there = self.by_states(|mut s, trace, at| s.evaluate(trace, at, point))?;
            return Ok(there.unwrap_or(false));
        }
        let Some(log_density) = self.propose(&point.y, false)? else { return Ok(false) };
        point.log_density = log_density;
        self.force(point)
    }

    /// Does something with proposals of all values of the choices that are summed out, for
    /// points at which the tape has no density; `None` if there is none at the start. There
    /// is none either if only a tape can sum the choices out: then the chain moves among
    /// the points at which the tape has a density.
    fn by_states<R>(
        &mut self,
        work: impl FnOnce(Summed, &mut Trace, &StepContext) -> TraceResult<R>,
    ) -> TraceResult<Option<R>> {
        let Some((sites, moving)) = self.sums else { return Ok(None) };
        let mut here = Point::default();
        self.memory.coordinates(self.trace, &mut here.y);
        let draws = self.at.within(1).draws(0);
        let Ok((marginal, held)) = self.trace.marginalise(sites, moving, draws) else {
            return Ok(None);
        };
        let done = match Summed::begin(marginal, self.trace, self.at, &self.layout, &mut here) {
            Ok(Some(summed)) => work(summed, self.trace, self.at).map(Some),
            Ok(None) => Ok(None),
            Err(e) => Err(e),
        };
        self.trace.release_held(held)?;
        self.memory.moved(self.trace);
        done
    }

    /// Proposes a point and returns its log density; `None` if it has none.
    fn propose(&mut self, y: &[f64], as_values: bool) -> TraceResult<Option<f64>> {
        let changes = self.memory.changes(y, as_values, &self.layout);
        let Some(w) = recoverable(self.trace.propose(changes, self.at.draws(0)))? else {
            return Ok(None);
        };
        let log_density = self.at.tempered(&w) + w.log_jacobian - self.jacobian;
        Ok((w.appeared + w.vanished == 0 && log_density.is_finite()).then_some(log_density))
    }

    /// The log density and force at a point; `None` if they do not exist.
    pub fn go(&mut self, y: impl Iterator<Item = f64>) -> TraceResult<Option<Arc<Point>>> {
        let mut shared = self.memory.point();
        let Some(point) = Arc::get_mut(&mut shared) else { return Ok(None) };
        point.y.clear();
        point.y.extend(y);
        let there = self.evaluate(point)?;
        self.memory.keep(&shared);
        Ok(there.then_some(shared))
    }

    /// Makes one leapfrog step in the space of a metric.
    pub fn leapfrog(
        &mut self,
        from: &Point,
        step: f64,
        metric: &Metric,
    ) -> TraceResult<Option<Arc<Point>>> {
        let mut shared = self.memory.point();
        let Some(to) = Arc::get_mut(&mut shared) else { return Ok(None) };
        let half = 0.5 * step;
        to.momentum.clear();
        to.momentum.extend(from.momentum.iter().zip(&from.force).map(|(p, f)| p + half * f));
        metric.push(&from.y, step, &to.momentum, &mut to.y);
        let there = self.evaluate(to)?;
        if there {
            metric.pull(&to.gradient, &mut to.force);
            to.momentum.iter_mut().zip(&to.force).for_each(|(p, f)| *p += half * f);
        }
        self.memory.keep(&shared);
        Ok(there.then_some(shared))
    }

    /// The same point with a momentum drawn in the space of a metric.
    pub fn launch(&mut self, here: &Point, metric: &Metric, rng: &mut Stream) -> Arc<Point> {
        let mut shared = self.memory.point();
        if let Some(point) = Arc::get_mut(&mut shared) {
            point.y.clone_from(&here.y);
            point.gradient.clone_from(&here.gradient);
            point.log_density = here.log_density;
            metric.pull(&here.gradient, &mut point.force);
            point.momentum.clear();
            point.momentum.extend((0..metric.dimensions()).map(|_| rng.standard_normal()));
        }
        self.memory.keep(&shared);
        shared
    }

    /// A list of these numbers.
    pub fn numbers(&mut self, from: impl Iterator<Item = f64>) -> Arc<Vec<f64>> {
        self.memory.numbers(from)
    }

    /// Makes a point the state of the trace, or leaves the trace where it was; draws the
    /// choices that were summed out.
    pub fn finish_at(mut self, to: Option<&Point>) -> TraceResult<bool> {
        if let Some(summed) = self.summed.take() {
            return summed.finish_at(self.trace, self.at, to);
        }
        if self.sums.is_some() {
            return self.finish_with_draws(to);
        }
        let Some(point) = to else {
            self.trace.rollback();
            return Ok(false);
        };
        if self.taped && self.memory.move_to(self.trace, point, self.at.power) {
            return Ok(true);
        }
        // The value of the density no longer matters, only whether it is positive.
        let there = self.propose(&point.y, self.taped)?.is_some();
        if there {
            self.trace.commit();
            self.memory.moved(self.trace);
        } else {
            self.trace.rollback();
        }
        Ok(there)
    }

    /// Makes a point, or the initial one, the state of the trace, with the choices summed
    /// out drawn from their conditional there.
    fn finish_with_draws(mut self, to: Option<&Point>) -> TraceResult<bool> {
        if self.memory.draw_and_move_to(self.trace, to, self.at, &mut self.at.within(0).stream()) {
            return Ok(to.is_some());
        }
        self.trace.rollback();
        // The same draws as above: which of them are possible must not decide.
        let mut rng = self.at.within(0).stream();
        let mut here = Vec::new();
        if to.is_none() {
            self.memory.coordinates(self.trace, &mut here);
        }
        let y = to.map_or(&here, |point| &point.y);
        let Some(changes) = self.memory.changes_with_draws(self.trace, y, &mut rng) else {
            return Ok(self.by_states(|s, trace, at| s.finish_at(trace, at, to))?.unwrap_or(false));
        };
        let draws = self.at.draws(0);
        let Some(w) = recoverable(self.trace.propose(changes, draws))? else { return Ok(false) };
        if w.appeared + w.vanished == 0 {
            self.trace.commit();
            self.memory.moved(self.trace);
            return Ok(to.is_some());
        }
        // Nothing depends on some of the choices at these values: they may vanish after the
        // move, which then was one between states that have all of them.
        self.trace.rollback();
        let held = self.trace.hold_choices()?;
        let w = recoverable(self.trace.propose(changes, draws))?;
        let there = w.is_some_and(|w| w.appeared + w.vanished == 0);
        if there {
            self.trace.commit();
        } else {
            self.trace.rollback();
        }
        self.trace.release_held(held)?;
        Ok(there && to.is_some())
    }
}
