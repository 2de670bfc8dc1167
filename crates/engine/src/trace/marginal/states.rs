//! The states in which the scores of finite choices take all their values.
//!
//! Scores that depend on the same choices are a factor, with an entry for each joint value of
//! these. If no factor depends on two choices of one colour, all entries occur among the
//! states that give all choices of a colour their values together: as many as joint values of
//! the colours, however many choices there are. The trace is brought into each of these.
//!
//! As in [`super::explore`], what a factor depends on is what its evaluation reads, in any of
//! the states; if a state shows that it reads more, the states are visited again.

use super::Partition;
use super::reads::{Label, Reader, Sets};
use crate::lang::code::Op;
use crate::trace::gradient::Given;
use crate::trace::node::*;
use crate::trace::{Change, Draws, Target, Trace};
use pcadlang_numerics::dist::{Datum, Support};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;

/// Finite choices that are summed out, and what was found about them.
pub(super) struct Sites {
    pub targets: Vec<Target>,
    pub values: Vec<Vec<Datum>>,
    supports: Vec<Support>,
    /// The labels of these choices, and of those that move.
    own: FxHashMap<NodeId, Label>,
    colours: Vec<usize>,
    /// By factor: the choices that it depends on, in ascending order.
    pub scopes: BTreeMap<NodeId, Vec<usize>>,
    /// True if what is read is known to be the same in all states.
    same: bool,
}

/// Why not all states can be visited.
#[derive(Debug)]
pub(super) enum Halt {
    /// In this state other choices appear or vanish.
    Structure(Vec<(Target, Change)>),
    /// The program fails in a state.
    Fails,
    /// Other reasons.
    Cannot(&'static str),
}

/// A state that is being visited.
pub(super) struct Visited<'a> {
    /// True if it is the first one.
    pub first: bool,
    /// The index of each choice's value.
    pub indices: &'a [usize],
    /// All choices of the trace; none if what is read is the same as in the state before.
    pub choices: &'a [NodeId],
    /// The choices that observations and factors depend on; none like `choices`.
    pub asked: &'a [NodeId],
    /// Through which of their values the choices determine each node, if that was asked for.
    pub given: &'a FxHashMap<NodeId, Option<Given>>,
}

impl Trace {
    /// The choices of `sites` with their values, for a kernel that moves those of `targets`.
    pub(super) fn sites(
        &self,
        targets: &[Target],
        sites: &[Target],
    ) -> Result<Sites, &'static str> {
        let mut own: FxHashMap<NodeId, Label> = FxHashMap::default();
        own.extend(targets.iter().map(|t| (t.node, Label { site: NONE, moves: true, set: 0 })));
        let (mut values, mut supports) = (Vec::new(), Vec::new());
        for (i, t) in sites.iter().enumerate() {
            let support = self.dist(*t).map(|d| d.stored_support()).filter(Support::is_finite);
            let all = support.as_ref().and_then(Support::finite_values).unwrap_or_default();
            let (Some(support), false) = (support, all.is_empty()) else {
                return Err("it is not a discrete choice with finitely many values");
            };
            let label = Label { site: i as u32, moves: false, set: i as u32 + 1 };
            if t.element != NONE || own.insert(t.node, label).is_some() {
                return Err("it is an element of a larger choice");
            }
            values.push(all);
            supports.push(support);
        }
        let (colours, scopes) = (vec![0; sites.len()], BTreeMap::new());
        let targets = sites.to_vec();
        Ok(Sites { targets, values, supports, own, colours, scopes, same: false })
    }

    /// Brings the trace into at most `most` states in which all entries of all factors occur,
    /// and calls `at` in each of them once all that factors depend on is known. If that turns
    /// out not to be known, it is called again for all states, beginning with a first one.
    pub(super) fn visit_states(
        &mut self,
        sites: &mut Sites,
        (most, with_given): (usize, bool),
        draws: Draws,
        mut at: impl FnMut(&mut Trace, &Sites, Visited) -> Result<(), Halt>,
    ) -> Result<(), Halt> {
        loop {
            let counts = sites.colour();
            let states = counts.iter().try_fold(1, |n: usize, c| n.checked_mul(*c));
            let states = states.filter(|n| *n <= most);
            let states = states.ok_or(Halt::Cannot("too many choices depend on each other"))?;
            let mut known = true;
            let nothing = FxHashMap::default();
            for state in 0..states {
                let indices = sites.indices(&counts, state);
                self.go_to(sites, &indices, draws)?;
                if known && sites.same && state > 0 && !with_given {
                    let (first, indices) = (false, &indices[..]);
                    let (choices, asked) = (&[][..], &[][..]);
                    at(self, sites, Visited { first, indices, choices, asked, given: &nothing })?;
                    continue;
                }
                let mut partition = Partition::default();
                partition.grow(sites.targets.len());
                let choices: Vec<NodeId> = self.all_targets().iter().map(|t| t.node).collect();
                let mut reader = Reader::new(&self.graph, &sites.own, &mut partition);
                reader.sets = Some(Sets::singletons(sites.targets.len()));
                reader.read_all(choices.iter().copied());
                let found = &reader.found;
                let sets = reader.sets.as_ref().filter(|s| !s.overflow);
                let sets = sets.ok_or(Halt::Cannot("too many choices depend on each other"))?;
                if found.structure_moves {
                    return Err(Halt::Cannot("which choices exist depends on others that move"));
                }
                if found.anywhere || found.unclear {
                    return Err(Halt::Cannot("observations are made in a `mem` function"));
                }
                sites.same = !found.structure_varies;
                known &= !widen(&mut sites.scopes, &found.factors, sets);
                if !known {
                    if sites.same {
                        break;
                    }
                    continue;
                }
                let given = if with_given { reader.given(&indices) } else { FxHashMap::default() };
                let asked = std::mem::take(&mut reader.found.asked);
                let (first, indices) = (state == 0, &indices[..]);
                let (choices, asked) = (&choices[..], &asked[..]);
                at(self, sites, Visited { first, indices, choices, asked, given: &given })?;
            }
            if known {
                return Ok(());
            }
        }
    }

    /// Gives the choices their values in a state.
    fn go_to(&mut self, sites: &Sites, indices: &[usize], draws: Draws) -> Result<(), Halt> {
        let values = sites.values.iter().zip(indices).map(|(v, i)| &v[*i]);
        let all = sites.targets.iter().zip(values);
        let new = all.filter(|(t, v)| self.stored(**t).as_ref() != Some(v));
        let changes: Vec<_> = new.map(|(t, v)| (*t, Change::Set(v.clone()))).collect();
        let weight = self.propose(&changes, draws).map_err(|_| Halt::Fails)?;
        let same =
            |(t, s): (&Target, &Support)| self.dist(*t).is_some_and(|d| d.stored_support() == *s);
        let halt = if self.detaches_held() {
            Some(Halt::Cannot("other choices are created or removed with it"))
        } else if weight.appeared + weight.vanished > 0 {
            Some(Halt::Structure(changes))
        } else if !sites.targets.iter().zip(&sites.supports).all(same) {
            Some(Halt::Cannot("its possible values depend on other choices"))
        } else {
            None
        };
        match halt {
            None => self.commit(),
            Some(_) => self.rollback(),
        }
        halt.map_or(Ok(()), Err)
    }

    /// Returns all nodes with scores, each with the factor that it is part of.
    pub(super) fn scores_by_factor(
        &self,
        scopes: &BTreeMap<NodeId, Vec<usize>>,
        choices: &[NodeId],
    ) -> Vec<(Option<NodeId>, NodeId)> {
        let is_score =
            |n: &NodeId| matches!(self.graph.op(*n), Op::Observe { .. } | Op::Factor { .. });
        let mut all: Vec<NodeId> = self.graph.clean().filter(is_score).collect();
        all.extend(choices);
        all.sort_unstable();
        all.dedup();
        let factor = |n: NodeId| {
            if matches!(self.graph.op(n), Op::Draw { .. }) {
                return scopes.contains_key(&n).then_some(n);
            }
            std::iter::once(n)
                .chain(self.graph.owners(n))
                .filter(|at| scopes.contains_key(at))
                .last()
        };
        all.into_iter().map(|n| (factor(n), n)).collect()
    }
}

impl Sites {
    /// Colours the choices so that no factor depends on two of one colour. Returns the
    /// number of values by colour.
    fn colour(&mut self) -> Vec<usize> {
        let n = self.targets.len();
        let mut near: Vec<FxHashSet<usize>> = vec![FxHashSet::default(); n];
        for scope in self.scopes.values() {
            for x in scope {
                near[*x].extend(scope.iter().filter(|y| *y != x));
            }
        }
        let mut counts: Vec<usize> = Vec::new();
        for x in 0..n {
            let taken: FxHashSet<usize> =
                near[x].iter().filter(|y| **y < x).map(|y| self.colours[*y]).collect();
            let colour = (0..).find(|c| !taken.contains(c)).unwrap_or(taken.len());
            self.colours[x] = colour;
            counts.resize(counts.len().max(colour + 1), 1);
            counts[colour] = counts[colour].max(self.values[x].len());
        }
        counts
    }

    /// Returns the index of each choice's value in a state.
    fn indices(&self, counts: &[usize], mut state: usize) -> Vec<usize> {
        let by_colour: Vec<usize> = counts
            .iter()
            .map(|n| {
                let value = state % n;
                state /= n;
                value
            })
            .collect();
        self.colours.iter().zip(&self.values).map(|(c, v)| by_colour[*c] % v.len()).collect()
    }
}

/// Adds what factors depend on; true if any depends on more than was known.
fn widen(
    scopes: &mut BTreeMap<NodeId, Vec<usize>>,
    factors: &[(NodeId, u32)],
    sets: &Sets,
) -> bool {
    let mut wider = false;
    for (n, set) in factors {
        let scope = scopes.entry(*n).or_insert_with(|| {
            wider = true;
            Vec::new()
        });
        for x in sets.members(*set) {
            if let Err(place) = scope.binary_search(&(*x as usize)) {
                scope.insert(place, *x as usize);
                wider = true;
            }
        }
    }
    wider
}
