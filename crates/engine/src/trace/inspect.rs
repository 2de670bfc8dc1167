//! The contents of a trace: selections, choices by address, values, distributions,
//! observations.

use super::node::{self, NONE, NodeId, State};
use super::{Address, Selection, Selector, Target, Trace};
use super::{eval, terms};
use crate::lang::code::{DistSpec, Op};
use crate::lang::value::{Likelihood, Located, Value};
use pcadlang_numerics::dist::{Datum, Dist, Support};
use std::sync::Arc;

impl Trace {
    /// Registers a selection, whose members are kept up to date from then on.
    pub fn select(&mut self, selector: &Selector) -> Selection {
        self.rollback();
        self.graph.choices.selection(&self.graph.store, selector)
    }

    /// Returns the current members of a selection.
    pub fn targets(&self, selection: Selection) -> &[Target] {
        self.graph.choices.selections[selection.0 as usize].targets()
    }

    /// Returns the identity of the trace that selections belong to.
    #[doc(hidden)]
    pub fn identity(&self) -> &Arc<()> {
        &self.identity
    }

    /// Returns the current members of a selection as a shared list, which is replaced
    /// when they change.
    #[doc(hidden)]
    pub fn listed(&self, selection: Selection) -> &Arc<Vec<Target>> {
        self.graph.choices.selections[selection.0 as usize].listed()
    }

    /// Returns the current members of a selection in program order: by position in the
    /// text and pass of the enclosing loops.
    pub fn in_program_order(&self, selection: Selection) -> Vec<Target> {
        self.graph.in_program_order(self.targets(selection))
    }

    /// Returns all active choices, in the order of the hashes of their addresses.
    pub fn all_targets(&self) -> &[Target] {
        self.graph.choices.selections[0].targets()
    }

    /// Returns the choice at an address, if it is active. The address of an element of a
    /// choice has the element's index as its last key.
    pub fn find(&self, address: &Address) -> Option<Target> {
        if let Some(n) = self.graph.choices.find(address.hash64()) {
            return Some(Target { node: n, element: NONE });
        }
        let mut whole = address.clone();
        let key = whole.segments.last_mut()?.keys.pop()?;
        let n = self.graph.choices.find(whole.hash64())?;
        let elements = self.graph.choice_of(n).map(|c| c.elements).filter(|e| *e != NONE)?;
        let element = key.as_index().filter(|i| *i < elements as usize)?;
        Some(Target { node: n, element: element as u32 })
    }

    /// Returns the address of a choice.
    pub fn address(&self, t: Target) -> Address {
        let mut a = self.graph.address(t.node);
        if t.element != NONE {
            terms::push_key(&mut a, t.element);
        }
        a
    }

    /// Returns a hash of the address of a choice, stable between runs.
    pub fn address_hash(&self, t: Target) -> u64 {
        let h = self.graph.choice_hash(t.node);
        if t.element == NONE { h } else { eval::choice::element_hash(h, t.element as usize) }
    }

    /// True if a target that was listed earlier is still a choice of this trace.
    pub fn is_active(&self, t: Target) -> bool {
        let node = self.graph.store.get(t.node);
        node.is_some_and(|n| n.state == State::Clean)
            && matches!(self.graph.op(t.node), Op::Draw { .. })
    }

    /// Returns the value of a choice as the program sees it.
    pub fn value(&self, t: Target) -> Value {
        let v = &self.graph.store[t.node].value;
        if t.element == NONE {
            v.clone()
        } else {
            v.element(t.element as usize).unwrap_or_default()
        }
    }

    /// Returns the value of a choice in stored form.
    pub fn stored(&self, t: Target) -> Option<Datum> {
        if t.element == NONE { self.graph.stored(t.node) } else { self.value(t).to_datum() }
    }

    /// Returns the point of a continuous choice in the unconstrained space and the log
    /// Jacobian of the transform there, from which a
    /// [`Change::Free`](super::Change::Free) starts. `None` for a discrete choice.
    pub fn free(&self, t: Target) -> Option<(Vec<f64>, f64)> {
        self.free_unless(t, Support::is_discrete)
    }

    fn free_unless(&self, t: Target, kept: impl Fn(&Support) -> bool) -> Option<(Vec<f64>, f64)> {
        let (support, stored) = (self.dist(t)?.stored_support(), self.stored(t)?);
        if kept(&support) {
            return None;
        }
        let mut y = Vec::with_capacity(support.free_dim());
        support.to_free(&stored, &mut y);
        if let (Support::Pole { .. }, Datum::Num(x), [y]) = (&support, &stored, &mut y[..]) {
            *y = self.coarse_coordinate(t, &support, *x).unwrap_or(*y);
        }
        let jacobian = support.from_free(&y).1;
        Some((y, jacobian))
    }

    /// [`Trace::free`] for choices that moves in the unconstrained space can reach in all
    /// parts: `None` also for a partly discrete choice, which a [`Change::Free`] sets to
    /// its smallest value.
    #[doc(hidden)]
    pub fn free_to_move(&self, t: Target) -> Option<(Vec<f64>, f64)> {
        self.free_unless(t, Support::has_discrete_part)
    }

    /// Returns the current distribution of a choice.
    pub fn dist(&self, t: Target) -> Option<Dist> {
        let d = self.graph.dist_of(t.node)?;
        Some(if t.element == NONE { d } else { d.element(t.element as usize) })
    }

    /// Returns the number of elements, if a choice is an array of separately addressed
    /// elements.
    pub fn elements(&self, t: Target) -> Option<usize> {
        let elements = self.graph.choice_of(t.node)?.elements;
        (elements != NONE && t.element == NONE).then_some(elements as usize)
    }

    /// Returns the number of active choices, counting elements separately.
    pub fn choice_count(&self) -> usize {
        self.all_targets().len()
    }

    /// Returns the addresses, without their `@`, of the choices that are numbers of categories.
    #[doc(hidden)]
    pub fn categories(&self) -> Vec<String> {
        let is = |t: &&Target| {
            matches!(self.dist(**t), Some(Dist::Categorical(_) | Dist::CategoricalLogits(_)))
        };
        let all = self.all_targets().iter().filter(is);
        all.map(|t| self.address(*t).to_string().split_off(1)).collect()
    }

    /// True if the state has observations or factors; otherwise draws are those of the prior.
    #[doc(hidden)]
    pub fn is_conditioned(&self) -> bool {
        self.scored_nodes().next().is_some()
    }

    /// Returns named points of the scene at the positions that the observations give them
    /// (see [`crate::lang::value::Likelihood::located`]).
    pub fn located(&self) -> Vec<Located> {
        self.likelihoods().flat_map(|(l, observed)| l.located(observed)).collect()
    }

    /// Returns every observation and factor with its log density, in the order of the
    /// program's blocks.
    pub fn observations(&self) -> Vec<(Address, f64)> {
        self.scored().into_iter().map(|(n, s)| (self.graph.address(n), s)).collect()
    }

    /// Returns everything with log density -∞ and its source span: observations and
    /// factors first, then choices.
    pub fn impossible(&self) -> Vec<(Address, pcadlang_syntax::span::Span)> {
        let observed =
            self.scored().into_iter().filter(|(_, s)| *s == f64::NEG_INFINITY).map(|(n, _)| n);
        let mut found: Vec<_> = observed.map(|n| (self.graph.address(n), self.span(n))).collect();
        let targets = self.all_targets();
        let zero = targets.iter().filter(|t| self.score_of(**t) == f64::NEG_INFINITY);
        let mut chosen: Vec<_> = zero.map(|t| (self.address(*t), self.span(t.node))).collect();
        chosen.sort_by(|a, b| a.0.cmp(&b.0));
        found.extend(chosen);
        found
    }

    /// Returns the observations whose values are outside the support of their
    /// distributions, by address, with the reason.
    #[doc(hidden)]
    pub fn outside_support(&self) -> Vec<(Address, String)> {
        let zero = self.scored().into_iter().filter(|(_, s)| *s == f64::NEG_INFINITY);
        let why = |(n, _)| Some((self.graph.address(n), self.graph.outside_support(n)?));
        zero.filter_map(why).collect()
    }

    pub(super) fn span(&self, n: NodeId) -> pcadlang_syntax::span::Span {
        let frame = &self.graph.store[self.graph.store[n].frame];
        self.code.blocks[frame.block].spans[n - frame.base]
    }

    /// True if an observation has an unnormalised likelihood, whose scale is a modelling
    /// decision.
    pub fn is_pseudo(&self) -> bool {
        self.likelihoods().any(|(l, _)| !l.is_proper())
    }

    /// Returns descriptions of what is approximate in the likelihoods under their
    /// settings, each once.
    pub fn approximations(&self) -> Vec<String> {
        let mut all: Vec<String> = Vec::new();
        for (l, _) in self.likelihoods() {
            let said = l.approximations().into_iter().map(|what| format!("{}: {what}", l.name()));
            for what in said {
                if !all.contains(&what) {
                    all.push(what);
                }
            }
        }
        all
    }

    /// Iterates over the observations and factors.
    pub(super) fn scored_nodes(&self) -> impl Iterator<Item = NodeId> {
        self.graph
            .clean()
            .filter(|n| matches!(self.graph.op(*n), Op::Observe { .. } | Op::Factor { .. }))
    }

    pub(super) fn scored(&self) -> Vec<(NodeId, f64)> {
        self.scored_nodes().map(|n| (n, self.score_at(n))).collect()
    }

    /// Returns the log density of an observation or factor.
    pub(super) fn score_at(&self, n: NodeId) -> f64 {
        let n = &self.graph.store[n];
        match n.side.as_deref() {
            Some(node::Side::Total(t)) if n.score == 0.0 => t.sum.value(),
            _ => n.score,
        }
    }

    /// Returns the addresses of the observations whose density has steps (see
    /// [`Likelihood::has_steps`]).
    #[doc(hidden)]
    pub fn with_steps(&self) -> Vec<Address> {
        let stepped = self.likelihoods_at().filter(|(_, l, _)| l.has_steps());
        stepped.map(|(n, ..)| self.graph.address(n)).collect()
    }

    /// Iterates over the likelihoods that are not distributions, with the value observed
    /// under each.
    fn likelihoods(&self) -> impl Iterator<Item = (&dyn Likelihood, &Value)> {
        self.likelihoods_at().map(|(_, l, observed)| (l, observed))
    }

    /// The same, with the nodes of the observations.
    fn likelihoods_at(&self) -> impl Iterator<Item = (NodeId, &dyn Likelihood, &Value)> {
        self.scored_nodes().filter_map(|n| {
            let Op::Observe { dist: DistSpec::Value(o), .. } = self.graph.op(n) else {
                return None;
            };
            let frame = self.graph.store[n].frame;
            let Value::Likelihood(l) = self.graph.value(frame, *o) else { return None };
            let observed = self.graph.observed_value(n);
            Some((n, &**l, observed))
        })
    }

    /// Returns every active choice with its address, value and log density, by address.
    pub fn choices(&self) -> Vec<(Address, Value, f64)> {
        let targets = self.all_targets();
        let mut all: Vec<_> =
            targets.iter().map(|t| (self.address(*t), self.value(*t), self.score_of(*t))).collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    }
}
