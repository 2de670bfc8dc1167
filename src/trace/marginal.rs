//! Finite choices that are summed out: which scores each of them reaches, and the parts of the log joint that follow.
//!
//! Choices whose changes reach no score in common are summed one by one; those that share one are a group, whose joint
//! values are enumerated. The log joint is then a base plus one term for each group, so that the log of its sum over all
//! joint values of all choices is the base plus, for each group, a log-sum-exp over the values of that group alone. What a choice
//! reaches is found by proposing its values, each time with all choices at a value of theirs, so a dependence that only
//! one branch has is found too. Not here: what the sums are for.

use super::node::*;
use super::{Change, Draws, Target, Trace, TraceResult};
use crate::dist::Datum;
use crate::lang::code::Op;
use crate::lang::error::{FaultKind, RunError};
use rustc_hash::FxHashMap;

/// The most joint values of one group.
const MOST_VALUES: usize = 1000;

/// Choices that are summed out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sums {
    groups: Vec<Group>,
    /// By score: the group that reaches it.
    reached: FxHashMap<NodeId, usize>,
    /// The most values of any group.
    passes: usize,
}

/// The values of each of some choices, and the scores it reaches.
type Reached = (Vec<Vec<Datum>>, Vec<Vec<NodeId>>);

/// Choices that reach scores in common.
#[derive(Clone, Debug, Default)]
struct Group {
    sites: Vec<(Target, Vec<Datum>)>,
    sinks: Vec<NodeId>,
    /// How many joint values they have.
    values: usize,
}

impl Sums {
    /// How many times the trace must be looked at to have seen every group at all its joint values.
    pub fn passes(&self) -> usize {
        self.passes
    }

    /// How many joint values each group has.
    pub fn counts(&self) -> impl Iterator<Item = usize> {
        self.groups.iter().map(|g| g.values)
    }

    /// The changes that put each group at a joint value, given by its number.
    pub fn changes(&self, value: impl Fn(usize) -> usize) -> Vec<(Target, Change)> {
        let mut all = Vec::new();
        for (i, g) in self.groups.iter().enumerate() {
            let mut rest = value(i);
            for (t, values) in &g.sites {
                all.push((*t, Change::Set(values[rest % values.len()].clone())));
                rest /= values.len();
            }
        }
        all
    }

    /// The group that reaches a score.
    pub fn group_of(&self, score: NodeId) -> Option<usize> {
        self.reached.get(&score).copied()
    }
}

/// Choices that stay although nothing may ask for them.
#[derive(Debug)]
pub(crate) struct Held(Vec<NodeId>);

impl Trace {
    /// Makes the choices that any value of some others asks for exist, drawn from their prior given the rest, and stay until
    /// [`Trace::let_go`]: a component of a mixture that no label points at now.
    ///
    /// # Errors
    /// As [`Trace::sums`].
    pub(crate) fn hold_alternatives(&mut self, sites: &[Target], draws: Draws) -> TraceResult<Held> {
        self.rollback();
        let values = self.finite_values(sites)?;
        let mut held = Held(Vec::new());
        self.hold_all(&mut held);
        let original = self.present(sites);
        let mut found = Ok(());
        for k in 0..values.iter().map(Vec::len).max().unwrap_or(0) {
            let set = |(t, v): (&Target, &Vec<Datum>)| (*t, Change::Set(v[k % v.len()].clone()));
            let all: Vec<_> = sites.iter().zip(&values).map(set).collect();
            found = match self.propose(&all, draws) {
                Ok(w) if w.vanished > 0 => Err(self.cannot_sum(sites[0], "other choices vanish with it")),
                Ok(_) => Ok(()),
                Err(e) => Err(e),
            };
            if found.is_err() {
                self.rollback();
                break;
            }
            self.commit();
            self.hold_all(&mut held);
        }
        self.propose(&original, draws)?;
        self.commit();
        match found {
            Ok(()) => Ok(held),
            Err(e) => {
                self.let_go(held)?;
                Err(e)
            }
        }
    }

    fn hold_all(&mut self, held: &mut Held) {
        let mut new: Vec<NodeId> = self.all_targets().iter().map(|t| t.node).collect();
        new.sort_unstable();
        new.dedup();
        new.retain(|n| held.0.binary_search(n).is_err());
        self.graph.begin();
        new.iter().for_each(|n| self.graph.acquire(*n, *n, false));
        self.graph.commit(&self.code);
        held.0.extend(new);
        held.0.sort_unstable();
    }

    /// Lets choices go that were held: those nothing asks for vanish.
    ///
    /// # Errors
    /// Those of the program.
    pub(crate) fn let_go(&mut self, held: Held) -> TraceResult<()> {
        self.rollback();
        let before = self.graph.begin();
        held.0.iter().for_each(|n| self.graph.release(*n, false));
        let settled = self.graph.settle(&self.code);
        self.pend(before, settled)?;
        self.commit();
        Ok(())
    }

    /// The changes that leave choices as they are.
    fn present(&self, sites: &[Target]) -> Vec<(Target, Change)> {
        sites.iter().filter_map(|t| Some((*t, Change::Set(self.stored(*t)?)))).collect()
    }

    /// Finds what choices reach. The trace is left as it was.
    ///
    /// # Errors
    /// If one of them is not finite, if structure depends on one, or if too many depend on each other.
    pub(crate) fn sums(&mut self, sites: &[Target]) -> TraceResult<Sums> {
        self.rollback();
        let original = self.present(sites);
        // Running everything would seem to reach everything.
        let incremental = std::mem::replace(&mut self.graph.incremental, true);
        let found = self.reach(sites);
        self.rollback();
        self.graph.incremental = incremental;
        self.propose(&original, Draws::default())?;
        self.commit();
        let (values, sinks) = found?;
        self.grouped(sites, values, sinks)
    }

    /// The values of each choice, and the scores it reaches.
    fn reach(&mut self, sites: &[Target]) -> TraceResult<Reached> {
        let values = self.finite_values(sites)?;
        let mut sinks = vec![Vec::new(); sites.len()];
        for k in 0..values.iter().map(Vec::len).max().unwrap_or(0) {
            let set = |(t, v): (&Target, &Vec<Datum>)| (*t, Change::Set(v[k % v.len()].clone()));
            let all: Vec<_> = sites.iter().zip(&values).map(set).collect();
            let w = self.propose(&all, Draws::default())?;
            if w.appeared + w.vanished > 0 {
                return Err(self.cannot_sum(sites[0], "other choices appear or vanish with it"));
            }
            self.commit();
            if self.finite_values(sites)? != values {
                return Err(
                    self.cannot_sum(sites[0], "what values there are depends on another choice that is summed out")
                );
            }
            for (i, t) in sites.iter().enumerate() {
                let other = Change::Set(values[i][(k + 1) % values[i].len()].clone());
                let w = self.propose(&[(*t, other)], Draws::default())?;
                if w.appeared + w.vanished > 0 {
                    return Err(self.cannot_sum(*t, "other choices appear or vanish with it"));
                }
                sinks[i].push(t.node);
                sinks[i].extend(self.graph.journaled().filter(|n| self.is_score(*n)));
                self.rollback();
            }
        }
        Ok((values, sinks))
    }

    fn finite_values(&self, sites: &[Target]) -> TraceResult<Vec<Vec<Datum>>> {
        let one = |t: &Target| self.dist(*t)?.stored_support().finite_values();
        let not = |t: &Target| self.cannot_sum(*t, "it is not a discrete choice of finitely many values");
        sites.iter().map(|t| one(t).filter(|v| !v.is_empty()).ok_or_else(|| not(t))).collect()
    }

    /// Puts choices that reach a score in common into groups.
    fn grouped(&self, sites: &[Target], values: Vec<Vec<Datum>>, sinks: Vec<Vec<NodeId>>) -> TraceResult<Sums> {
        let mut parent: Vec<usize> = (0..sites.len()).collect();
        let root = |parent: &[usize], mut i: usize| {
            while parent[i] != i {
                i = parent[i];
            }
            i
        };
        let mut first: FxHashMap<NodeId, usize> = FxHashMap::default();
        for (i, n) in sinks.iter().enumerate().flat_map(|(i, all)| all.iter().map(move |n| (i, *n))) {
            let other = *first.entry(n).or_insert(i);
            let (a, b) = (root(&parent, i), root(&parent, other));
            parent[a.max(b)] = a.min(b);
        }
        let (mut sums, mut places) = (Sums::default(), FxHashMap::default());
        for (i, ((t, values), sinks)) in sites.iter().zip(values).zip(sinks).enumerate() {
            let place = *places.entry(root(&parent, i)).or_insert_with(|| {
                sums.groups.push(Group { values: 1, ..Group::default() });
                sums.groups.len() - 1
            });
            let group = &mut sums.groups[place];
            group.values = group.values.saturating_mul(values.len());
            group.sites.push((*t, values));
            group.sinks.extend(sinks);
            if group.values > MOST_VALUES {
                let what = format!("it and others depend on each other, with more than {MOST_VALUES} joint values");
                return Err(self.cannot_sum(*t, &what));
            }
        }
        for (i, g) in sums.groups.iter_mut().enumerate() {
            g.sinks.sort_unstable();
            g.sinks.dedup();
            sums.reached.extend(g.sinks.iter().map(|n| (*n, i)));
            sums.passes = sums.passes.max(g.values);
        }
        Ok(sums)
    }

    /// The parts of the log prior plus `power` times the log likelihood in the present state, also that of a pending proposal:
    /// the base, and in `terms` what each group reaches.
    pub(crate) fn parts(&self, sums: &Sums, power: f64, terms: &mut Vec<f64>) -> f64 {
        let tempered = |x: f64| if power == 0.0 { 0.0 } else { power * x };
        let (mut prior, mut likelihood) = (self.graph.prior.clone(), self.graph.likelihood.clone());
        terms.clear();
        for group in &sums.groups {
            let (mut own_prior, mut own_likelihood) = (0.0, 0.0);
            for n in &group.sinks {
                let node = &self.graph.nodes[*n as usize];
                match (self.graph.op(&self.code, *n), node.side.as_deref()) {
                    (Op::Draw { .. }, Some(Side::Choice(c))) if !c.scores.is_empty() => {
                        for s in &c.scores {
                            prior.sub(*s);
                            own_prior += s;
                        }
                    }
                    (Op::Draw { .. }, _) => {
                        prior.sub(node.score);
                        own_prior += node.score;
                    }
                    _ => {
                        self.graph.take_score(*n, &mut likelihood);
                        own_likelihood += self.score_at(*n);
                    }
                }
            }
            terms.push(own_prior + tempered(own_likelihood));
        }
        prior.value() + tempered(likelihood.value())
    }

    fn is_score(&self, n: NodeId) -> bool {
        self.graph.nodes[n as usize].state == State::Clean
            && matches!(self.graph.op(&self.code, n), Op::Draw { .. } | Op::Observe { .. } | Op::Factor { .. })
    }

    fn cannot_sum(&self, t: Target, why: &str) -> Box<RunError> {
        Box::new(RunError {
            kind: FaultKind::Type,
            message: format!("{} cannot be summed out: {why}", self.address(t)),
            span: self.span(t.node),
            address: self.address(t),
            calls: Vec::new(),
            hint: Some("select finite discrete choices with `marginal`, and move others by gibbs".into()),
        })
    }
}
