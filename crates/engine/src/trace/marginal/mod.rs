//! Finite choices that are summed out: which scores depend on each of them, and the
//! resulting parts of the log joint.
//!
//! Choices without a common score are summed independently; those that share one form a
//! group, whose joint values are enumerated. The log joint is then a base plus one term
//! per group, so the log of its sum over all joint values of all choices is the base
//! plus, for each group, a log-sum-exp over the values of that group alone. How the sums
//! are used is up to the kernels.

mod explore;
mod hold;
mod partition;
mod reads;
mod recorded;
mod states;
mod tabulated;

pub use explore::Explored;
pub use tabulated::{Tabulated, Tabulation};

use super::node::*;
use super::{Change, ChoiceKind, Selector, Target, Trace};
use crate::lang::code::Op;
use crate::lang::error::{FaultKind, RunError};
use partition::Partition;
use pcadlang_numerics::dist::{Datum, Support};
use pcadlang_numerics::num::ExactSum;
use reads::{Label, Reader};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Choices that are summed out, and the facts found about them at the start of a step.
#[derive(Clone, Debug, Default)]
pub struct Marginal {
    /// The choices, and the values of the support of each.
    sites: Vec<Target>,
    values: Vec<Vec<Datum>>,
    supports: Vec<Support>,
    /// The choices that the kernel moves.
    moving: Vec<NodeId>,
    partition: Partition,
    /// The elimination for all points with the same structure as the start of the step.
    pub elimination: Arc<Elimination>,
}

/// The groups of the choices, and the assignments whose evaluations cover all their joint
/// values.
#[derive(Clone, Debug, Default)]
pub struct Elimination {
    groups: Vec<Group>,
    /// By assignment: the joint value of each group, by its number.
    pub assignments: Vec<Vec<usize>>,
    /// The group of each score, and of each node that has observations and factors below
    /// it.
    reached: FxHashMap<NodeId, usize>,
    owners: FxHashMap<NodeId, usize>,
    /// True if this is valid at a single point only, because what is read depends on
    /// choices that the kernel moves.
    pub structure_moves: bool,
    /// True if the distributions of the choices depend on choices that the kernel moves.
    values_move: bool,
}

/// Choices that are read together.
#[derive(Clone, Debug, Default)]
struct Group {
    sites: Vec<usize>,
    scores: Vec<NodeId>,
    owners: Vec<NodeId>,
    /// The number of joint values.
    values: usize,
    /// By joint value: the first assignment in which it occurs; `None` if the program
    /// fails at that value.
    seen: Vec<Option<usize>>,
}

impl Marginal {
    /// Appends the changes that set each group to a joint value, given by its number.
    fn put(&self, groups: &[Group], values: &[usize], out: &mut Vec<(Target, Change)>) {
        for (g, value) in groups.iter().zip(values) {
            let mut rest = *value;
            for i in &g.sites {
                let values = &self.values[*i];
                out.push((self.sites[*i], Change::Set(values[rest % values.len()].clone())));
                rest /= values.len();
            }
        }
    }

    /// Appends the changes that set each group of an elimination to a joint value, given
    /// by its number.
    pub fn changes(
        &self,
        elimination: &Elimination,
        values: &[usize],
        out: &mut Vec<(Target, Change)>,
    ) {
        self.put(&elimination.groups, values, out);
    }
}

impl Elimination {
    /// By group: the first assignment in which each joint value occurs.
    pub fn seen(&self) -> impl Iterator<Item = &[Option<usize>]> {
        self.groups.iter().map(|g| &g.seen[..])
    }
}

impl Trace {
    /// True if what is read, and thus which choices exist, depends on choices of a kind,
    /// as far as the current state shows.
    pub fn structure_depends_on(&self, kind: ChoiceKind) -> bool {
        let selector = Selector::Kind(kind);
        let moving = self.all_targets().iter().filter(|t| self.graph.selects(&selector, t));
        let own = moving.map(|t| (t.node, Label { site: NONE, moves: true, set: 0 })).collect();
        let mut partition = Partition::default();
        partition.grow(1);
        let mut reader = Reader::new(&self.graph, &own, &mut partition);
        reader.read_all(std::iter::empty());
        reader.found.structure_moves
    }

    /// Returns the group that a score belongs to.
    pub fn group_of(&self, elimination: &Elimination, score: NodeId) -> Option<usize> {
        if let Some(group) = elimination.reached.get(&score) {
            return Some(*group);
        }
        if elimination.owners.is_empty() || matches!(self.graph.op(score), Op::Draw { .. }) {
            return None;
        }
        let around = std::iter::once(score).chain(self.graph.owners(score));
        around.filter_map(|n| elimination.owners.get(&n).copied()).last()
    }

    /// True if the choices have the same supports in the current state (including a
    /// pending proposal) as at the start of the step.
    pub fn has_same_values(&self, m: &Marginal) -> bool {
        !m.elimination.values_move || self.moved_support(m).is_none()
    }

    /// Returns the first choice whose support differs in the current state.
    fn moved_support(&self, m: &Marginal) -> Option<Target> {
        let moved =
            |(t, s): &(&Target, &Support)| self.dist(**t).is_none_or(|d| d.stored_support() != **s);
        m.sites.iter().zip(&m.supports).find(moved).map(|(t, _)| *t)
    }

    /// Splits the log prior plus `power` times the log likelihood in the current state
    /// (including a pending proposal): returns the base, and in `terms` the part of each
    /// group.
    pub fn parts(&self, elimination: &Elimination, power: f64, terms: &mut Vec<f64>) -> f64 {
        let tempered = |prior: &ExactSum, likelihood: &ExactSum| {
            prior.value() + if power == 0.0 { 0.0 } else { power * likelihood.value() }
        };
        let (mut prior, mut likelihood) =
            (self.graph.score.prior.clone(), self.graph.score.likelihood.clone());
        terms.clear();
        for group in &elimination.groups {
            let (mut own_prior, mut own_likelihood) = (ExactSum::default(), ExactSum::default());
            for n in &group.scores {
                self.graph.put_scored(*n, &mut own_prior, &mut own_likelihood);
            }
            group.owners.iter().for_each(|n| self.put_scores_below(*n, &mut own_likelihood));
            terms.push(tempered(&own_prior, &own_likelihood));
            prior.unmerge(&own_prior);
            likelihood.unmerge(&own_likelihood);
        }
        tempered(&prior, &likelihood)
    }

    /// Adds the scores of the observations and factors in the frames of a node.
    fn put_scores_below(&self, owner: NodeId, to: &mut ExactSum) {
        let mut open = vec![owner];
        while let Some(n) = open.pop() {
            let mut frame = |f: FrameId| {
                let frame = &self.graph.store[f];
                let effects = &self.code.blocks[frame.block].effects;
                for m in effects.iter().map(|s| frame.base + *s).filter(|m| self.is_clean(*m)) {
                    match self.graph.op(m) {
                        Op::Observe { .. } | Op::Factor { .. } => self.graph.put_score(m, to),
                        _ => open.push(m),
                    }
                }
            };
            match self.graph.store[n].side.as_deref() {
                Some(Side::Child(c)) => frame(c.frame),
                Some(Side::Loop(l)) => {
                    l.frames.iter().filter(|f| **f != FrameId::NONE).for_each(|f| frame(*f))
                }
                Some(Side::Memo(m)) => m.entries.values().for_each(|(f, _)| frame(*f)),
                _ => {}
            }
        }
    }

    fn is_clean(&self, n: NodeId) -> bool {
        self.graph.store[n].state == State::Clean
    }

    fn cannot_sum(&self, t: Target, why: &str) -> Box<RunError> {
        Box::new(RunError {
            kind: FaultKind::Type,
            message: format!("{} cannot be summed out: {why}", self.address(t)),
            span: self.span(t.node),
            address: self.address(t),
            calls: Vec::new(),
            hint: Some("select only finite discrete choices that do not decide which others exist, and leave the rest to gibbs or mh".into()),
        })
    }
}

#[cfg(test)]
mod tests;
