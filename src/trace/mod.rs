//! Traces: one execution of a program as a dependency graph with dynamic structure.
//!
//! Everything is an operation on traces through one small interface: *propose* changes at
//! addresses, get the weight of the incremental update, *commit* or *roll back*. A choice
//! that no observation asks for is not part of a trace; it is drawn when a
//! [`query`](Trace::query) asks for it, from its prior given the rest.

#![doc = include_str!("guide.md")]

mod choices;
mod enumeration;
mod eval;
mod explain;
mod gradient;
mod graph;
mod inspect;
mod invalidate;
mod journal;
mod limits;
mod local_density;
mod marginal;
mod node;
mod observed;
mod operations;
mod path;
mod propagate;
mod propose;
mod query;
mod save;
mod scaffold;
mod select;
mod set_in_place;
mod surrogate;

pub use crate::lang::address::{Address, AddressSegment, AddressTextError};
pub use choices::{Selection, Target};
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
use crate::lang::value::Value;
pub(crate) use enumeration::Enumeration;
#[doc(hidden)]
pub use gradient::Recording;
use graph::Graph;
use journal::Before;
pub(crate) use marginal::{Elimination, Explored, Marginal};
use node::NONE;
use std::sync::Arc;

/// One execution of a program: the values of its choices and all that follows from them.
#[derive(Debug)]
pub struct Trace {
    code: Arc<Code>,
    graph: Graph,
    update: Option<Before>,
    /// What selections belong to: a clone registers its own.
    identity: Arc<()>,
}

impl Clone for Trace {
    fn clone(&self) -> Self {
        let (code, graph) = (Arc::clone(&self.code), self.graph.clone());
        Trace { code, graph, update: self.update.clone(), identity: Arc::new(()) }
    }
}

/// A failure of an operation on a trace; the trace is as it was before.
pub type TraceResult<T> = Result<T, Box<RunError>>;

impl Trace {
    /// A trace in which nothing has run: queries draw from the prior, observations are
    /// ignored.
    pub fn prior(code: Arc<Code>, limits: Limits) -> Self {
        let graph = Graph::new(&code, limits);
        Trace { code, graph, update: None, identity: Arc::new(()) }
    }

    /// Runs a program: draws what its observations ask for.
    ///
    /// # Errors
    /// What the program does wrong, with its place.
    pub fn simulate(code: Arc<Code>, draws: Draws, limits: Limits) -> TraceResult<Self> {
        Trace::generate(code, std::iter::empty(), draws, limits).map(|(t, _)| t)
    }

    /// Runs a program with the values of some choices given. The weight is the log joint
    /// less the log density of what was drawn: the importance weight of the trace.
    ///
    /// # Errors
    /// What the program does wrong, with its place.
    pub fn generate(
        code: Arc<Code>,
        constraints: impl IntoIterator<Item = (u64, Constraint)>,
        draws: Draws,
        limits: Limits,
    ) -> TraceResult<(Self, Weight)> {
        let mut trace = Trace::prior(code, limits);
        let g = &mut trace.graph;
        g.constraints = constraints.into_iter().collect();
        g.draws = draws;
        let before = g.begin();
        let effects = &trace.code.blocks[0].effects;
        for s in effects {
            g.nodes[*s as usize].refs = 1;
        }
        g.effects.extend(effects);
        g.starting = true;
        g.propagate(&trace.code)?;
        g.starting = false;
        let weight = g.weight(&before.prior, &before.likelihood);
        g.commit(&trace.code);
        g.constraints.clear();
        g.revision = 0;
        Ok((trace, weight))
    }

    /// The program.
    pub fn code(&self) -> &Arc<Code> {
        &self.code
    }

    /// Proposes changes and updates what depends on them. The update is pending until
    /// [`Trace::commit`] or [`Trace::rollback`]; a second proposal rolls the first back,
    /// and its targets must be of the state before that.
    ///
    /// # Errors
    /// What goes wrong under the proposed values; the trace is then as before.
    pub fn propose(&mut self, changes: &[(Target, Change)], draws: Draws) -> TraceResult<Weight> {
        self.propose_constrained(changes, &[], draws)
    }

    /// The same, with the values that some choices take if they appear.
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

    /// The same, with values in place of observed ones, by the hashes of the
    /// observations' addresses.
    fn propose_observed(
        &mut self,
        changes: &[(Target, Change)],
        constraints: &[(u64, Constraint)],
        observed: &[(u64, Value)],
        draws: Draws,
    ) -> TraceResult<Weight> {
        self.rollback();
        let before = self.graph.begin();
        self.graph.draws = draws;
        self.graph.constraints.extend(constraints.iter().cloned());
        self.put_observed(observed);
        let scaffold = match changes {
            [(target, change)] if observed.is_empty() => {
                self.graph.scaffold_of(&self.code, *target).map(|s| (*target, change, s))
            }
            _ => None,
        };
        let settled = match scaffold {
            Some((target, change, scaffold)) => {
                self.graph.update_along_scaffold(&self.code, target, change, scaffold)
            }
            None => {
                self.graph.queue(&self.code, changes);
                self.graph.propagate(&self.code)
            }
        };
        self.graph.constraints.clear();
        self.pend(before, settled)
    }

    /// Leaves an update pending, or undoes one that failed.
    fn pend(&mut self, before: Before, settled: TraceResult<()>) -> TraceResult<Weight> {
        match settled {
            Ok(()) => {
                let weight = self.graph.weight(&before.prior, &before.likelihood);
                self.update = Some(before);
                Ok(weight)
            }
            Err(e) => {
                self.graph.rollback(&self.code, before);
                Err(e)
            }
        }
    }

    /// Draws the targets anew from the prior, together.
    ///
    /// # Errors
    /// As [`Trace::propose`].
    pub fn regenerate(&mut self, targets: &[Target], draws: Draws) -> TraceResult<Weight> {
        let changes: Vec<_> = targets.iter().map(|t| (*t, Change::Resample)).collect();
        self.propose(&changes, draws)
    }

    /// The choices that vanish in the pending proposal, with the values they had.
    pub fn removed(&self) -> Vec<(u64, Constraint)> {
        self.graph.removed.iter().map(|(_, h, d)| (*h, Constraint::Stored(d.clone()))).collect()
    }

    /// Whether the pending proposal takes away a choice: also one that is drawn anew at
    /// the same place, because its form changed. What was proposed for it had no effect.
    pub fn was_removed(&self, t: Target) -> bool {
        self.graph.removed.iter().any(|(n, _, _)| *n == t.node)
    }

    /// Goes over to a saved state (see [`Trace::constraints`]); selections stay valid.
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

    /// Keeps the pending proposal, if there is one.
    pub fn commit(&mut self) {
        if self.update.take().is_some() {
            self.graph.commit(&self.code);
        }
    }

    /// Undoes the pending proposal, if there is one.
    pub fn rollback(&mut self) {
        if let Some(before) = self.update.take() {
            self.graph.rollback(&self.code, before);
        }
    }

    /// The log joint density of choices, observations and factors.
    pub fn log_joint(&self) -> f64 {
        self.graph.log_joint()
    }

    /// Its prior part: the choices.
    pub fn log_prior(&self) -> f64 {
        self.graph.prior.value()
    }

    /// Its observed part: observations and factors.
    pub fn log_likelihood(&self) -> f64 {
        self.graph.likelihood.value()
    }

    /// The log density of what a selection selects: its share of the log prior.
    pub fn score(&mut self, selector: &Selector) -> f64 {
        let selection = self.select(selector);
        let mut sum = crate::num::ExactSum::default();
        for t in self.targets(selection).to_vec() {
            sum.add(self.score_of(t));
        }
        sum.value()
    }

    /// The log density of a choice under its prior given the rest, in the present state,
    /// also that of a pending proposal.
    pub fn score_of(&self, t: Target) -> f64 {
        let node = &self.graph.nodes[t.node as usize];
        match node.side.as_deref() {
            Some(node::Side::Choice(c)) if t.element != NONE => c.scores[t.element as usize],
            _ => node.score,
        }
    }

    /// The gradient of the log prior plus `power` times the log likelihood, by the
    /// unconstrained coordinates of these choices one after the other, the log Jacobians
    /// of their transforms included (see [`Change::Free`]): in the present state, also
    /// that of a pending proposal. Discrete choices have no coordinates. Appended to
    /// `out`.
    ///
    /// # Errors
    /// An operation between a choice and the score of which no derivative is known.
    pub fn gradient(&self, targets: &[Target], power: f64, out: &mut Vec<f64>) -> TraceResult<()> {
        self.weighted_gradient(targets, power, &|_| 1.0, out)
    }

    /// The same with the log density of each choice, observation and factor weighed;
    /// Jacobians are not.
    ///
    /// # Errors
    /// As [`Trace::gradient`].
    pub(crate) fn weighted_gradient(
        &self,
        targets: &[Target],
        power: f64,
        weight: &dyn Fn(u32) -> f64,
        out: &mut Vec<f64>,
    ) -> TraceResult<()> {
        let mut scored: Vec<u32> = self.all_targets().iter().map(|t| t.node).collect();
        scored.dedup();
        let mut observed: Vec<u32> = self.scored_nodes().collect();
        self.graph.sort_by_place(&mut observed);
        scored.extend(observed);
        scored.retain(|n| weight(*n) != 0.0);
        self.graph.gradient(&self.code, targets, &scored, (power, weight), out)
    }

    /// Whether nothing was committed since the program was run.
    pub(crate) fn is_new(&self) -> bool {
        self.graph.revision == 0
    }

    /// Turns incremental updates off (every proposal re-runs the whole program) or on
    /// again; chains are the same either way.
    pub fn set_incremental(&mut self, on: bool) {
        self.graph.incremental = on;
    }

    /// Sets other bounds on what updates may build.
    #[doc(hidden)]
    pub fn set_limits(&mut self, limits: Limits) {
        self.graph.limits = limits;
    }

    /// What ends its updates, and the searches among them.
    pub(crate) fn stop(&self) -> &Stop {
        &self.graph.limits.stop
    }

    /// Starts to note which operations are executed.
    #[doc(hidden)]
    pub fn record_execution(&mut self) {
        self.graph.execution_log = Some(Vec::new());
    }

    /// What was executed since [`Trace::record_execution`]: the text of each expression, where the
    /// source is at hand by its span.
    #[doc(hidden)]
    pub fn executed(&mut self) -> Vec<crate::syntax::span::Span> {
        let log = self.graph.execution_log.take().unwrap_or_default();
        log.into_iter().map(|(b, s)| self.code.blocks[b as usize].spans[s as usize]).collect()
    }

    /// Runs the program again from scratch with the same choices: a check that increments
    /// and structure are right.
    ///
    /// # Errors
    /// What the program does wrong.
    pub fn rerun(&self) -> TraceResult<Trace> {
        Trace::generate(
            self.present_code(),
            self.constraints(),
            Draws::default(),
            self.graph.limits.clone(),
        )
        .map(|(t, _)| t)
    }

    /// Another execution of the same program under the same observations, with the values
    /// of some choices given.
    ///
    /// # Errors
    /// What the program does wrong.
    pub(crate) fn another(
        &self,
        constraints: impl IntoIterator<Item = (u64, Constraint)>,
        draws: Draws,
    ) -> TraceResult<Trace> {
        let mut trace =
            Trace::generate(self.present_code(), constraints, draws, self.graph.limits.clone())?.0;
        trace.graph.incremental = self.graph.incremental;
        Ok(trace)
    }

    /// The program, with the values that are observed now.
    fn present_code(&self) -> Arc<Code> {
        match Arc::ptr_eq(&self.graph.observed, &self.code.observed) {
            true => Arc::clone(&self.code),
            false => Arc::new(self.code.with_observed(Arc::clone(&self.graph.observed))),
        }
    }

    /// The choices as constraints for [`Trace::generate`].
    pub fn constraints(&self) -> Vec<(u64, Constraint)> {
        let targets = self.all_targets();
        let stored =
            targets.iter().filter_map(|t| self.stored(*t).map(|d| (self.address_hash(*t), d)));
        stored.map(|(h, d)| (h, Constraint::Stored(d))).collect()
    }
}
