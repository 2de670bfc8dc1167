//! Finite choices that are summed out: which scores each of them reaches, and the parts
//! of the log joint that follow.
//!
//! Choices that no score has in common are summed one by one; those that share one are a
//! group, whose joint values are enumerated. The log joint is then a base plus one term
//! for each group, so that the log of its sum over all joint values of all choices is the
//! base plus, for each group, a log-sum-exp over the values of that group alone. Not
//! here: what the sums are for.

mod explore;
mod hold;
mod partition;
mod reads;

pub(crate) use explore::Explored;

use super::node::*;
use super::{Change, ChoiceKind, Selector, Target, Trace};
use crate::dist::{Datum, Support};
use crate::lang::code::Op;
use crate::lang::error::{FaultKind, RunError};
use crate::num::ExactSum;
use partition::Partition;
use reads::{Label, Reader};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Choices that are summed out, and what is known of them where a step begins.
#[derive(Clone, Debug, Default)]
pub(crate) struct Marginal {
    /// The choices with their values, of which each support consists.
    sites: Vec<Target>,
    values: Vec<Vec<Datum>>,
    supports: Vec<Support>,
    /// The choices that the kernel moves.
    moving: Vec<NodeId>,
    partition: Partition,
    /// How a place is looked at that has the structure of the one where the step begins.
    pub elimination: Arc<Elimination>,
}

/// The groups of the choices, and which looks at a place show all that there is to see.
#[derive(Clone, Debug, Default)]
pub(crate) struct Elimination {
    groups: Vec<Group>,
    /// By look: the joint value of each group, by its number.
    pub looks: Vec<Vec<usize>>,
    /// By score, or by the node that observations and factors are below: its group.
    reached: FxHashMap<NodeId, usize>,
    owners: FxHashMap<NodeId, usize>,
    /// Whether this holds for the place alone, since what is read depends on choices that
    /// the kernel moves.
    pub structure_moves: bool,
    /// Whether the distributions of the choices depend on choices that the kernel moves.
    values_move: bool,
}

/// Choices that are read together.
#[derive(Clone, Debug, Default)]
struct Group {
    sites: Vec<usize>,
    scores: Vec<NodeId>,
    owners: Vec<NodeId>,
    /// How many joint values they have.
    values: usize,
    /// By joint value: the look in which it is seen first; `None` if the program has no
    /// value there.
    seen: Vec<Option<usize>>,
}

impl Marginal {
    /// The changes that put each group at a joint value, given by its number, appended to
    /// a list.
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

    /// The same by these sums.
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
    /// By group: in which look each joint value is seen first.
    pub fn seen(&self) -> impl Iterator<Item = &[Option<usize>]> {
        self.groups.iter().map(|g| &g.seen[..])
    }
}

impl Trace {
    /// Whether what is read, and so which choices there are, depends on choices of a
    /// kind, as far as this state shows.
    pub(crate) fn structure_depends_on(&self, kind: ChoiceKind) -> bool {
        let selector = Selector::Kind(kind);
        let moving =
            self.all_targets().iter().filter(|t| self.graph.selects(&self.code, &selector, t));
        let own = moving.map(|t| (t.node, Label { site: NONE, moves: true })).collect();
        let mut partition = Partition::default();
        partition.grow(1);
        let mut reader = Reader::new(&self.graph, &self.code, &own, &mut partition);
        reader.read_all(std::iter::empty());
        reader.found.structure_moves
    }

    /// The group that a score belongs to.
    pub(crate) fn group_of(&self, elimination: &Elimination, score: u32) -> Option<usize> {
        if let Some(group) = elimination.reached.get(&score) {
            return Some(*group);
        }
        if elimination.owners.is_empty()
            || matches!(self.graph.op(&self.code, score), Op::Draw { .. })
        {
            return None;
        }
        let mut n = score;
        let mut found = None;
        while n != NONE {
            found = elimination.owners.get(&n).copied().or(found);
            n = self.graph.frames[self.graph.nodes[n as usize].frame as usize].owner;
        }
        found
    }

    /// Whether the choices have the values in the present state that they have elsewhere,
    /// also in that of a pending proposal.
    pub(crate) fn has_same_values(&self, m: &Marginal) -> bool {
        !m.elimination.values_move || self.moved_support(m).is_none()
    }

    /// The first choice whose values are others in the present state.
    fn moved_support(&self, m: &Marginal) -> Option<Target> {
        let moved =
            |(t, s): &(&Target, &Support)| self.dist(**t).is_none_or(|d| d.stored_support() != **s);
        m.sites.iter().zip(&m.supports).find(moved).map(|(t, _)| *t)
    }

    /// The parts of the log prior plus `power` times the log likelihood in the present
    /// state, also that of a pending proposal: the base, and in `terms` what each group
    /// reaches.
    pub(crate) fn parts(&self, elimination: &Elimination, power: f64, terms: &mut Vec<f64>) -> f64 {
        let tempered = |prior: &ExactSum, likelihood: &ExactSum| {
            prior.value() + if power == 0.0 { 0.0 } else { power * likelihood.value() }
        };
        let (mut prior, mut likelihood) = (self.graph.prior.clone(), self.graph.likelihood.clone());
        terms.clear();
        for group in &elimination.groups {
            let (mut own_prior, mut own_likelihood) = (ExactSum::default(), ExactSum::default());
            for n in &group.scores {
                match self.graph.op(&self.code, *n) {
                    Op::Draw { .. } => self.put_prior(*n, &mut own_prior),
                    _ => self.graph.put_score(*n, &mut own_likelihood),
                }
            }
            group.owners.iter().for_each(|n| self.put_scores_below(*n, &mut own_likelihood));
            terms.push(tempered(&own_prior, &own_likelihood));
            prior.unmerge(&own_prior);
            likelihood.unmerge(&own_likelihood);
        }
        tempered(&prior, &likelihood)
    }

    fn put_prior(&self, n: NodeId, to: &mut ExactSum) {
        let node = &self.graph.nodes[n as usize];
        match node.side.as_deref() {
            Some(Side::Choice(c)) if c.elements != NONE => c.scores.iter().for_each(|s| to.add(*s)),
            _ => to.add(node.score),
        }
    }

    /// Adds the scores of the observations and factors in the frames of a node.
    fn put_scores_below(&self, owner: NodeId, to: &mut ExactSum) {
        let mut open = vec![owner];
        while let Some(n) = open.pop() {
            let mut frame = |f: FrameId| {
                let frame = &self.graph.frames[f as usize];
                let effects = &self.code.blocks[frame.block as usize].effects;
                for m in effects.iter().map(|s| frame.base + s).filter(|m| self.is_clean(*m)) {
                    match self.graph.op(&self.code, m) {
                        Op::Observe { .. } | Op::Factor { .. } => self.graph.put_score(m, to),
                        _ => open.push(m),
                    }
                }
            };
            match self.graph.nodes[n as usize].side.as_deref() {
                Some(Side::Child(c)) => frame(c.frame),
                Some(Side::Loop(l)) => {
                    l.frames.iter().filter(|f| **f != NONE).for_each(|f| frame(*f))
                }
                Some(Side::Memo(m)) => m.entries.values().for_each(|(f, _)| frame(*f)),
                _ => {}
            }
        }
    }

    fn is_clean(&self, n: NodeId) -> bool {
        self.graph.nodes[n as usize].state == State::Clean
    }

    fn cannot_sum(&self, t: Target, why: &str) -> Box<RunError> {
        Box::new(RunError {
            kind: FaultKind::Type,
            message: format!("{} cannot be summed out: {why}", self.address(t)),
            span: self.span(t.node),
            address: self.address(t),
            calls: Vec::new(),
            hint: Some("select only finite discrete choices with `marginal`, and update the others with gibbs".into()),
        })
    }
}
