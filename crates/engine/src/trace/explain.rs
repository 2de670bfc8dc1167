//! Explanations of a trace: what an update of a choice would affect, and which choices
//! something depends on.
//!
//! The affected part is found by invalidation, as in an update (`invalidate.rs`), which is
//! then undone. Nothing is evaluated.

use super::node::*;
use super::store::Store;
use super::{Address, Target, Trace};
use crate::lang::code::Op;
use pcadlang_numerics::num::ExactSum;
use pcadlang_syntax::span::Span;
use rustc_hash::FxHashSet;
use std::sync::Arc;

/// The kind of a term of the log joint density.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// A random choice.
    Choice,
    /// An observation.
    Observation,
    /// A factor.
    Factor,
}

/// The effect of an update on a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Its density is recomputed; a choice keeps its value.
    Scored,
    /// Its value may change as well: it moves with its distribution, or is resampled if
    /// its form changes.
    Moved,
    /// It may vanish, or another term may appear: its existence depends on what changes.
    Structural,
}

/// A term of the log joint density that an update affects.
#[derive(Clone, Debug)]
pub struct Dependent {
    /// Its address.
    pub address: Address,
    /// Its kind.
    pub term: Term,
    /// The effect of the update on it.
    pub effect: Effect,
    /// Its current log density.
    pub log_density: f64,
}

/// Everything that an update of a choice would affect.
#[derive(Clone, Debug, Default)]
pub struct Dependents {
    /// Terms of the log joint density, by address.
    pub terms: Vec<Dependent>,
    /// Top-level names, in program order.
    pub names: Vec<Arc<str>>,
    /// How many values would be recomputed if everything they read changed.
    pub values: usize,
}

impl Trace {
    /// Returns what an update of a choice would affect.
    pub fn dependents(&mut self, t: Target) -> Dependents {
        self.rollback();
        let before = self.graph.begin();
        self.graph.update.invalidate_target(&mut self.graph.store, &self.code, t.node);
        let reach = self.graph.dependents_of(t.node);
        self.graph.rollback(before);
        reach
    }

    /// Returns the choices that a choice's distribution depends on and those that decide
    /// whether it exists, by address.
    pub fn origins(&self, t: Target) -> Vec<Address> {
        self.graph.origins(t.node)
    }
}

impl Trace {
    /// Returns the source spans of draws that have no choice in this state because no
    /// observation depends on them, in source order.
    pub fn undrawn(&self) -> Vec<Span> {
        let there: FxHashSet<OpId> = self.graph.clean().map(|n| self.graph.store[n].op).collect();
        let written =
            self.code.blocks.iter().flat_map(|b| b.slots().map(|s| b.first + s).zip(&b.spans));
        let is_choice = |op: &OpId| matches!(self.code.ops.get(op.index()), Some(Op::Draw { .. }));
        let absent = written.filter(|(op, _)| is_choice(op) && !there.contains(op));
        let mut spans: Vec<Span> = absent.map(|(_, span)| *span).collect();
        spans.sort_by_key(|s| (s.file, s.start));
        spans
    }
}

impl Store {
    /// Collects the stale nodes, except the choice at which invalidation started.
    fn dependents_of(&self, from: NodeId) -> Dependents {
        let mut reach = Dependents::default();
        let mut add = |n: NodeId, term, effect| {
            let address = self.address(n);
            reach.terms.push(Dependent { address, term, effect, log_density: self.term_score(n) });
        };
        for (n, node) in self.nodes() {
            let is_marked = node.state == State::Stale;
            if n == from || !(is_marked || node.state == State::Clean) {
                continue;
            }
            let term = match self.op(n) {
                Op::Draw { .. } => Term::Choice,
                Op::Observe { .. } => Term::Observation,
                Op::Factor { .. } => Term::Factor,
                _ => {
                    reach.values += usize::from(is_marked);
                    reach.names.extend(self.name_of(n).filter(|_| is_marked));
                    continue;
                }
            };
            if self.hangs_on_marked(n) {
                add(n, term, Effect::Structural);
            } else if is_marked {
                let moves = term == Term::Choice && self.may_be_redrawn(n);
                add(n, term, if moves { Effect::Moved } else { Effect::Scored });
            }
        }
        reach.terms.sort_by(|a, b| a.address.cmp(&b.address));
        reach
    }

    /// Returns the log density of a choice with all its elements, an observation or a
    /// factor.
    fn term_score(&self, n: NodeId) -> f64 {
        let mut sum = ExactSum::default();
        match self[n].side.as_deref() {
            Some(Side::Choice(c)) if c.elements != NONE => {
                c.scores.iter().for_each(|s| sum.add(*s))
            }
            _ => self.put_score(n, &mut sum),
        }
        sum.value()
    }

    /// True if a node that decides whether `n` exists is stale: the condition of a branch
    /// around it, or what a loop runs over.
    fn hangs_on_marked(&self, n: NodeId) -> bool {
        let mut found = false;
        for owner in self.owners(n) {
            self.deciders(owner, |d| found |= self[d].state == State::Stale);
        }
        found
    }

    fn origins(&self, n: NodeId) -> Vec<Address> {
        let mut seen = vec![false; self.len()];
        let mut open = Vec::new();
        self.each_dep(n, |d, _| open.push(d));
        self.owners(n).for_each(|owner| self.deciders(owner, |d| open.push(d)));
        let mut found = Vec::new();
        while let Some(d) = open.pop() {
            if std::mem::replace(&mut seen[d], true) {
                continue;
            }
            match self.op(d) {
                Op::Draw { .. } if d != n => found.push(self.address(d)),
                _ => self.each_dep(d, |e, _| open.push(e)),
            }
        }
        found.sort();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Change;

    fn trace(text: &str) -> Trace {
        crate::testing::trace(text, 3)
    }

    fn at(t: &Trace, address: &str) -> Target {
        t.find(&address.parse().unwrap()).unwrap_or_else(|| panic!("{address}"))
    }

    #[test]
    fn what_nothing_asks_for_is_not_drawn() {
        let text = "assume a ~ normal(0, 1); assume idle ~ normal(0, 1); assume c ~ flip(0.5);
             assume x = if c { b ~ normal(0, 1); b } else { d ~ normal(5, 1); d }; observe normal(a + x, 1) = 2;";
        let mut t = trace(text);
        for c in [true, false] {
            t.set("@c", c, Default::default()).unwrap();
            let absent: Vec<&str> =
                t.undrawn().iter().map(|s| &text[s.start as usize..s.end as usize]).collect();
            // The span of a draw is that of its distribution.
            assert_eq!(absent, ["normal(0, 1)", if c { "normal(5, 1)" } else { "normal(0, 1)" }]);
        }
    }

    fn spelt(r: &Dependents) -> Vec<String> {
        r.terms.iter().map(|t| format!("{} {:?} {:?}", t.address, t.term, t.effect)).collect()
    }

    const TEXT: &str = "assume a ~ normal(0, 1); assume b ~ normal(a, 1); assume c ~ normal(0, 1);
         let mu = a + c; let other = b * 2;
         assume deep = if c > -100 { d ~ normal(a, 1); d } else { 0 };
         observe normal(mu, 1) = 2 as y; observe normal(other + deep, 1) = 1 as z; factor(-c * c) as soft;";

    #[test]
    fn what_is_reached_is_what_an_update_scores_again() {
        let mut t = trace(TEXT);
        let before = t.log_joint();
        let a = at(&t, "@a");
        let reach = t.dependents(a);
        assert_eq!(
            spelt(&reach),
            ["@b Choice Scored", "@deep/d Choice Scored", "@y Observation Scored"],
            "deep keeps its value, so z is not in question"
        );
        assert_eq!(reach.names.iter().map(|n| &**n).collect::<Vec<_>>(), ["mu"]);
        let c = at(&t, "@c");
        let reach = t.dependents(c);
        let terms = spelt(&reach);
        assert!(terms.contains(&"@deep/d Choice Structural".to_owned()), "{terms:?}");
        assert!(
            terms.contains(&"@soft Factor Scored".to_owned())
                && !terms.iter().any(|t| t.starts_with("@b"))
        );
        assert_eq!(t.log_joint().to_bits(), before.to_bits(), "nothing has happened");
        // The densities agree with those of the trace.
        let y = reach.terms.iter().find(|r| r.address.to_string() == "@y").unwrap();
        let known = t.observations().into_iter().find(|(a, _)| a.to_string() == "@y").unwrap();
        assert_eq!(y.log_density, known.1);
        // The trace still works.
        t.propose(
            &[(a, Change::Value(pcadlang_numerics::dist::Datum::Num(0.5)))],
            Default::default(),
        )
        .unwrap();
        t.commit();
        assert_eq!(t.log_joint().to_bits(), t.rerun().unwrap().log_joint().to_bits());
    }

    #[test]
    fn origins_are_the_choices_behind_a_choice() {
        let t = trace(TEXT);
        let of = |a: &str| t.origins(at(&t, a)).iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(of("@b"), ["@a"]);
        assert_eq!(of("@deep/d"), ["@a", "@c"], "one by its mean, one by the branch");
        assert!(of("@a").is_empty());
    }
}
