//! Traces: one execution of a program as a dependency graph with dynamic structure.
//!
//! All access goes through one small interface: *propose* changes at addresses, get the
//! weight of the incremental update, then *commit* or *roll back*. A choice that no
//! observation depends on is not part of a trace; a [`query`](Trace::query) that needs it
//! draws it from its prior given the rest.

mod choices;
mod coarse;
mod eval;
mod explain;
mod gradient;
mod graph;
mod inspect;
mod journal;
mod limits;
mod marginal;
mod node;
mod observed;
mod operations;
mod path;
mod propose;
mod query;
mod save;
mod score;
mod select;
mod shortcuts;
mod stages;
mod store;
mod surrogate;
mod terms;
mod update;

pub use crate::lang::address::{Address, AddressSegment, AddressTextError};
pub use choices::{Selection, Target};
#[doc(hidden)]
pub use coarse::CoarseState;
#[doc(hidden)]
pub use explain::{Dependent, Dependents, Effect, Term};
pub use limits::{Limits, Stop};
pub use observed::{Observation, Replicate};
pub use operations::{Given, Update};
pub use propose::{Change, Constraint, Draws, Weight};
pub use save::{SaveError, SavedTrace};
pub use select::{ChoiceKind, Pattern, PatternSegment, Selector};

use crate::lang::code::Code;
pub use crate::lang::error::RunError;
pub use crate::lang::ids::NodeId;
use crate::lang::value::Value;
use coarse::Coarse;
#[doc(hidden)]
pub use gradient::Recording;
use graph::Graph;
use journal::Before;
pub use marginal::{Elimination, Explored, Marginal, Tabulated, Tabulation};
use node::{FrameId, NONE};
use pcadlang_numerics::dist::Datum;
use std::sync::Arc;

/// One execution of a program: the values of its choices and everything computed from
/// them.
#[derive(Debug)]
pub struct Trace {
    code: Arc<Code>,
    graph: Graph,
    update: Option<Before>,
    coarse: Coarse,
    /// Identifies the trace that selections belong to; a clone gets its own.
    identity: Arc<()>,
}

impl Clone for Trace {
    fn clone(&self) -> Self {
        let (code, graph) = (Arc::clone(&self.code), self.graph.clone());
        let (update, coarse) = (self.update.clone(), self.coarse.clone());
        Trace { code, graph, update, coarse, identity: Arc::new(()) }
    }
}

/// The result of an operation on a trace; if it fails, the trace is unchanged.
pub type TraceResult<T> = Result<T, Box<RunError>>;

impl Trace {
    /// Returns a trace in which nothing has run: queries draw from the prior, and
    /// observations are ignored.
    pub fn prior(code: Arc<Code>, limits: Limits) -> Self {
        let graph = Graph::new(Arc::clone(&code), limits);
        Trace { code, graph, update: None, coarse: Coarse::default(), identity: Arc::new(()) }
    }

    /// Runs a program and draws the choices that its observations depend on.
    ///
    /// # Errors
    /// If the program fails, with the location of the fault.
    pub fn simulate(code: Arc<Code>, draws: Draws, limits: Limits) -> TraceResult<Self> {
        Trace::generate(code, std::iter::empty(), draws, limits).map(|(t, _)| t)
    }

    /// Runs a program with the values of some choices given. The weight is the log joint
    /// minus the log density of the choices that were drawn: the importance weight of the
    /// trace.
    ///
    /// # Errors
    /// If the program fails, with the location of the fault.
    pub fn generate(
        code: Arc<Code>,
        constraints: impl IntoIterator<Item = (u64, Constraint)>,
        draws: Draws,
        limits: Limits,
    ) -> TraceResult<(Self, Weight)> {
        Trace::started(code, constraints, None, draws, limits)
    }

    /// As [`Trace::generate`]; with a `spread`, continuous choices that are not given are
    /// uniform between minus this and this in the unconstrained space.
    ///
    /// # Errors
    /// As [`Trace::generate`].
    #[doc(hidden)]
    pub fn started(
        code: Arc<Code>,
        constraints: impl IntoIterator<Item = (u64, Constraint)>,
        spread: Option<f64>,
        draws: Draws,
        limits: Limits,
    ) -> TraceResult<(Self, Weight)> {
        let mut trace = Trace::prior(code, limits);
        let g = &mut trace.graph;
        g.update.spread = spread;
        g.update.constraints = constraints.into_iter().collect();
        g.update.draws = draws;
        let before = g.begin();
        let effects = &trace.code.blocks[0].effects;
        for s in effects {
            let n = g.store[FrameId::ROOT].base + *s;
            g.store[n].refs = 1;
            g.update.effects.push(n);
        }
        g.update.starting = true;
        g.propagate(&trace.code)?;
        (g.update.starting, g.update.spread) = (false, None);
        let weight = g.weight(&before);
        g.commit();
        g.update.constraints.clear();
        g.revision = 0;
        Ok((trace, weight))
    }

    /// Returns the program.
    pub fn code(&self) -> &Arc<Code> {
        &self.code
    }

    /// Proposes changes and updates everything that depends on them. The update is
    /// pending until [`Trace::commit`] or [`Trace::rollback`]. A second proposal rolls
    /// the first one back, so its targets must belong to the state before the first.
    ///
    /// # Errors
    /// If the program fails under the proposed values; the trace is then unchanged.
    pub fn propose(&mut self, changes: &[(Target, Change)], draws: Draws) -> TraceResult<Weight> {
        self.propose_constrained(changes, &[], draws)
    }

    /// Does the same as [`Trace::propose`]; `constraints` are values that choices take if
    /// they appear.
    ///
    /// # Errors
    /// As [`Trace::propose`].
    pub fn propose_constrained(
        &mut self,
        changes: &[(Target, Change)],
        constraints: &[(u64, Constraint)],
        draws: Draws,
    ) -> TraceResult<Weight> {
        self.propose_observed(changes, constraints, &[], draws)
    }

    /// Does the same as [`Trace::propose_constrained`], and replaces observed values,
    /// given by the hashes of the observations' addresses.
    fn propose_observed(
        &mut self,
        changes: &[(Target, Change)],
        constraints: &[(u64, Constraint)],
        observed: &[(u64, Value)],
        draws: Draws,
    ) -> TraceResult<Weight> {
        self.rollback();
        let before = self.graph.begin();
        self.graph.update.draws = draws;
        self.graph.update.constraints.extend(constraints.iter().cloned());
        self.put_observed(observed);
        self.graph.update.queue(&mut self.graph.store, &self.code, changes);
        let propagated = self.graph.propagate(&self.code);
        self.graph.update.constraints.clear();
        self.pend(before, propagated)
    }

    /// Sets a choice once more within the pending proposal, and returns the weight of both
    /// changes together: what differs from the pending proposal is computed, not from the state
    /// before it. `None`, with the proposal as it was, if it has changed which choices there are
    /// or drawn any.
    ///
    /// # Errors
    /// If the program fails under the value; the trace is then as before the proposal.
    #[doc(hidden)]
    pub fn propose_further(
        &mut self,
        target: Target,
        value: Datum,
        draws: Draws,
    ) -> Option<TraceResult<Weight>> {
        let before = self.update.take_if(|_| self.graph.update.is_fixed())?;
        if self.graph.update.renew() {
            self.graph.store.forget_changes();
        }
        self.graph.update.draws = draws;
        let change = [(target, Change::Set(value))];
        self.graph.update.queue(&mut self.graph.store, &self.code, &change);
        let propagated = self.graph.propagate(&self.code);
        Some(self.pend(before, propagated))
    }

    /// Leaves a successful update pending, and undoes one that failed.
    fn pend(&mut self, before: Before, propagated: TraceResult<()>) -> TraceResult<Weight> {
        match propagated {
            Ok(()) => {
                let weight = self.graph.weight(&before);
                self.update = Some(before);
                Ok(weight)
            }
            Err(e) => {
                self.graph.rollback(before);
                Err(e)
            }
        }
    }

    /// Resamples the targets jointly from the prior.
    ///
    /// # Errors
    /// As [`Trace::propose`].
    pub fn regenerate(&mut self, targets: &[Target], draws: Draws) -> TraceResult<Weight> {
        let changes: Vec<_> = targets.iter().map(|t| (*t, Change::Resample)).collect();
        self.propose(&changes, draws)
    }

    /// Returns the choices that vanish in the pending proposal, with their previous
    /// values.
    pub fn removed(&self) -> Vec<(u64, Constraint)> {
        self.graph
            .update
            .removed
            .iter()
            .map(|(_, h, d)| (*h, Constraint::Stored(d.clone())))
            .collect()
    }

    /// True if the pending proposal removes a choice. This includes a choice that is
    /// resampled at the same address because its form changed; the value proposed for it
    /// had no effect.
    pub fn was_removed(&self, t: Target) -> bool {
        self.graph.update.removed.iter().any(|(n, _, _)| *n == t.node)
    }

    /// Moves to a saved state (see [`Trace::constraints`]); selections stay valid.
    ///
    /// # Errors
    /// As [`Trace::propose`].
    pub fn restore(&mut self, saved: &[(u64, Constraint)], draws: Draws) -> TraceResult<()> {
        self.rollback();
        let values: rustc_hash::FxHashMap<u64, &Constraint> =
            saved.iter().map(|(h, c)| (*h, c)).collect();
        let here = self.all_targets();
        let changes: Vec<_> = here
            .iter()
            .filter_map(|t| match values.get(&self.address_hash(*t)) {
                Some(Constraint::Stored(d)) => Some((*t, Change::Set(d.clone()))),
                _ => None,
            })
            .collect();
        self.propose_constrained(&changes, saved, draws)?;
        self.commit();
        Ok(())
    }

    /// Commits the pending proposal, if there is one; after its last stage, since observations
    /// that wait would be lost.
    pub fn commit(&mut self) {
        debug_assert!(!self.observations_wait());
        if self.update.take().is_some() {
            self.keep_pending();
            self.graph.commit();
        }
    }

    /// Undoes the pending proposal, if there is one.
    pub fn rollback(&mut self) {
        if let Some(before) = self.update.take() {
            self.graph.rollback(before);
        }
    }

    /// Returns the log joint density of choices, observations and factors.
    pub fn log_joint(&self) -> f64 {
        self.graph.score.log_joint()
    }

    /// Returns the prior part of the log joint: the choices.
    pub fn log_prior(&self) -> f64 {
        self.graph.score.prior.value()
    }

    /// Returns the likelihood part of the log joint: observations and factors.
    pub fn log_likelihood(&self) -> f64 {
        self.graph.score.likelihood.value()
    }

    /// Returns the sum of the log densities of the selected choices: their part of the
    /// log prior.
    pub fn score(&mut self, selector: &Selector) -> f64 {
        let selection = self.select(selector);
        let mut sum = pcadlang_numerics::num::ExactSum::default();
        for t in self.targets(selection).to_vec() {
            sum.add(self.score_of(t));
        }
        sum.value()
    }

    /// Returns the log density of a choice under its prior given the rest, in the current
    /// state (including a pending proposal).
    pub fn score_of(&self, t: Target) -> f64 {
        let node = &self.graph.store[t.node];
        match node.side.as_deref() {
            Some(node::Side::Choice(c)) if t.element != NONE => c.scores[t.element as usize],
            _ => node.score,
        }
    }

    /// Appends to `out` the gradient of the log prior plus `power` times the log
    /// likelihood with respect to the unconstrained coordinates of these choices, one
    /// choice after the other. It includes the log Jacobians of their transforms (see
    /// [`Change::Free`]) and is taken in the current state (including a pending
    /// proposal). Discrete choices have no coordinates.
    ///
    /// # Errors
    /// If an operation between a choice and a score has no known derivative; a recoverable
    /// one if a density is not finite in this state.
    pub fn gradient(&self, targets: &[Target], power: f64, out: &mut Vec<f64>) -> TraceResult<()> {
        self.weighted_gradient(targets, power, &|_| 1.0, out)
    }

    /// Does the same as [`Trace::gradient`], with the log density of each choice,
    /// observation and factor multiplied by a weight; the log Jacobians are not weighted.
    ///
    /// # Errors
    /// As [`Trace::gradient`].
    #[doc(hidden)]
    pub fn weighted_gradient(
        &self,
        targets: &[Target],
        power: f64,
        weight: &dyn Fn(NodeId) -> f64,
        out: &mut Vec<f64>,
    ) -> TraceResult<()> {
        let mut scored: Vec<NodeId> = self.all_targets().iter().map(|t| t.node).collect();
        scored.dedup();
        let mut observed: Vec<NodeId> = self.scored_nodes().collect();
        self.graph.sort_by_place(&mut observed);
        // Where the data count nothing, a state that they exclude has a gradient.
        if power != 0.0 {
            scored.extend(observed);
        }
        scored.retain(|n| weight(*n) != 0.0);
        self.graph.gradient(targets, &scored, (power, weight), out)
    }

    /// True if nothing has been committed since the program was run.
    #[doc(hidden)]
    pub fn is_new(&self) -> bool {
        self.graph.revision == 0
    }

    /// Turns incremental updates off (every proposal then re-runs the whole program) or
    /// on again; chains are the same either way.
    pub fn set_incremental(&mut self, on: bool) {
        self.graph.store.incremental = on;
    }

    /// Replaces the limits on what updates may build.
    #[doc(hidden)]
    pub fn set_limits(&mut self, limits: Limits) {
        self.graph.budget.limits = limits;
    }

    /// Returns the limits on what updates may build.
    pub fn limits(&self) -> &Limits {
        &self.graph.budget.limits
    }

    /// Returns the condition that interrupts updates, and searches that consist of many
    /// updates.
    #[doc(hidden)]
    pub fn stop(&self) -> &Stop {
        &self.graph.budget.limits.stop
    }

    /// Starts to record which operations are executed.
    #[doc(hidden)]
    pub fn record_execution(&mut self) {
        self.graph.execution_log = Some(Vec::new());
    }

    /// Returns the source spans of the expressions that were executed since
    /// [`Trace::record_execution`].
    #[doc(hidden)]
    pub fn executed(&mut self) -> Vec<pcadlang_syntax::span::Span> {
        let log = self.graph.execution_log.take().unwrap_or_default();
        log.into_iter().map(|(b, s)| self.code.blocks[b].spans[s]).collect()
    }

    /// Runs the program again from scratch with the same choices, to check the
    /// incremental updates and the structure.
    ///
    /// # Errors
    /// If the program fails.
    pub fn rerun(&self) -> TraceResult<Trace> {
        Trace::generate(
            self.present_code(),
            self.constraints(),
            Draws::default(),
            self.graph.budget.limits.clone(),
        )
        .map(|(t, _)| t)
    }

    /// Generates another trace of the same program under the same observations, with the
    /// values of some choices given.
    ///
    /// # Errors
    /// If the program fails.
    #[doc(hidden)]
    pub fn another(
        &self,
        constraints: impl IntoIterator<Item = (u64, Constraint)>,
        draws: Draws,
    ) -> TraceResult<Trace> {
        let mut trace = Trace::generate(
            self.present_code(),
            constraints,
            draws,
            self.graph.budget.limits.clone(),
        )?
        .0;
        trace.graph.store.incremental = self.graph.store.incremental;
        Ok(trace)
    }

    /// The program, with the values that are currently observed.
    fn present_code(&self) -> Arc<Code> {
        match Arc::ptr_eq(&self.graph.store.observed, &self.code.observed) {
            true => Arc::clone(&self.code),
            false => Arc::new(self.code.with_observed(Arc::clone(&self.graph.store.observed))),
        }
    }

    /// Returns the choices as constraints for [`Trace::generate`].
    pub fn constraints(&self) -> Vec<(u64, Constraint)> {
        let targets = self.all_targets();
        let stored =
            targets.iter().filter_map(|t| self.stored(*t).map(|d| (self.address_hash(*t), d)));
        stored.map(|(h, d)| (h, Constraint::Stored(d))).collect()
    }
}
