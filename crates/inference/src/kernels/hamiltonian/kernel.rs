//! The common part of kernels that follow trajectories: choices, marginalisation,
//! adaptation and memory.

use super::adapt::Adaptation;
use super::memory::Memory;
use super::metric::Metric;
use super::point::Point;
use super::summed::with_alternatives;
use super::system::System;
use crate::kernel::{Kernel, Outcome, Pick, Registered, SiteSelection, StepContext};
use crate::kernels::exact::Exact;
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Marginal, Selection, Selector, Trace, TraceResult};
use pcadlang_numerics::rng::Stream;
use std::sync::Arc;

/// The energy error from which a trajectory counts as divergent (Stan's bound).
pub(super) const DIVERGENT: f64 = 1000.0;

/// How a kernel follows a trajectory.
pub(super) trait Trajectory {
    fn name(&self) -> &'static str;

    /// Moves from one point to another by a transition that leaves the density invariant.
    fn walk(&self, path: &mut Path) -> TraceResult<End>;
}

/// The inputs of a trajectory.
pub(super) struct Path<'s, 'a> {
    pub system: &'s mut System<'a>,
    pub here: &'s Point,
    pub step: f64,
    pub metric: &'s Metric,
    pub rng: &'s mut Stream,
}

/// The end of a trajectory.
#[derive(Default)]
pub(super) struct End {
    /// The point that was drawn, if it is a new one.
    pub to: Option<Arc<Point>>,
    /// The mean acceptance probability along the trajectory, from which the step size is
    /// adapted.
    pub acceptance: f64,
    /// True if the trajectory reached a point where the program is undefined.
    pub failed: bool,
    pub divergent: bool,
}

/// A kernel of Hamiltonian dynamics, with trajectories of one kind.
#[derive(Clone, Debug)]
pub struct Hamiltonian<T> {
    trajectory: T,
    scope: Registered,
    /// Finite choices that are summed out.
    summed: Registered,
    /// Draws them where nothing else moves.
    exact: Exact,
    adaptation: Adaptation,
    memory: Memory,
}

impl<T> Hamiltonian<T> {
    /// For these choices: `target` is the target acceptance rate; the step size is
    /// adapted if it is `None`.
    pub(super) fn along(
        trajectory: T,
        scope: SiteSelection,
        target: f64,
        step: Option<f64>,
    ) -> Self {
        let (scope, summed) = (Registered::new(scope), Registered::nothing());
        Hamiltonian {
            trajectory,
            scope,
            summed,
            exact: Exact::new(Selector::Nothing),
            adaptation: Adaptation::new(target, step),
            memory: Memory::default(),
        }
    }

    /// The same kernel with these finite choices summed out of its density.
    #[must_use]
    pub fn summing_out(self, choices: Selector) -> Self {
        Hamiltonian {
            exact: Exact::new(choices.clone()),
            summed: Registered::new(SiteSelection { selector: choices, pick: Pick::All }),
            ..self
        }
    }
}

#[allow(private_bounds)]
impl<T: Trajectory> Hamiltonian<T> {
    fn go(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        marginal: Option<Marginal>,
    ) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, _) = self.scope.members(trace, &mut rng);
        match System::begin(trace, at, &targets, marginal, &mut self.memory)? {
            Some(begun) => {
                Self::follow(&self.trajectory, &mut self.adaptation, begun, at, &mut rng)
            }
            None => Ok(Outcome::default()),
        }
    }

    /// Like `go`, with choices summed out by a tape; `None` if there is no such tape.
    fn go_summed(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        sums: (Selection, Selection),
    ) -> TraceResult<Option<Outcome>> {
        let mut rng = at.stream();
        let (targets, _) = self.scope.members(trace, &mut rng);
        match System::begin_summed(trace, at, &targets, sums, &mut self.memory)? {
            Some(begun) => {
                Self::follow(&self.trajectory, &mut self.adaptation, begun, at, &mut rng).map(Some)
            }
            None => Ok(None),
        }
    }

    fn follow(
        trajectory: &T,
        adaptation: &mut Adaptation,
        (mut system, here): (System, Arc<Point>),
        at: &StepContext,
        rng: &mut Stream,
    ) -> TraceResult<Outcome> {
        let step = adaptation.step(&mut system, &here, at.adapting, rng)?;
        let metric = &adaptation.metric;
        let mut path = Path { system: &mut system, here: &here, step, metric, rng };
        let end = trajectory.walk(&mut path)?;
        let moved = system.finish_at(end.to.as_deref())?;
        if at.adapting {
            let there = end.to.as_ref().filter(|_| moved).unwrap_or(&here);
            adaptation.learn(end.acceptance, &there.y, &there.gradient);
        }
        Ok(Outcome {
            failed: u32::from(end.failed),
            divergent: u32::from(end.divergent),
            ..Outcome::one(moved)
        })
    }
}

impl<T: Trajectory + Send> Kernel for Hamiltonian<T> {
    fn name(&self) -> String {
        self.trajectory.name().into()
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn step_size(&self) -> Option<f64> {
        self.adaptation.step_size()
    }

    fn log_evidence(&self) -> Option<f64> {
        self.exact.log_evidence()
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        pack(&(&self.adaptation, self.memory.recording_state(trace)))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let (adaptation, recording_state) = unpack(state)?;
        self.memory = Memory::with(recording_state);
        self.adaptation.take_up(adaptation)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let selections = (self.summed.selection(trace), self.scope.selection(trace));
        if trace.targets(selections.0).is_empty() {
            return self.go(trace, at, None);
        }
        // Where sums are not possible, choices to move may exist at other values.
        if trace.targets(selections.1).is_empty()
            && let Ok(outcome) = self.exact.draw(trace, at)?
        {
            return Ok(outcome);
        }
        if let Some(outcome) = self.go_summed(trace, at, selections)? {
            return Ok(outcome);
        }
        let go = |trace: &mut Trace, marginal| self.go(trace, at, marginal);
        let outcome = with_alternatives(selections, trace, at, go);
        // Long chains can be summed out by a tape only, whether or not recording one pays.
        if outcome.is_err()
            && self.memory.stop_waiting()
            && let Some(outcome) = self.go_summed(trace, at, selections)?
        {
            return Ok(outcome);
        }
        outcome
    }
}
