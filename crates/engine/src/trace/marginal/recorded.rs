//! Recording the log density with finite choices summed out, as a function of continuous
//! choices, on a tape.
//!
//! Scores that depend on the same summed-out choices are a factor, with an entry for each
//! joint value of these. If no factor depends on two choices of one colour, all entries
//! occur among the assignments that give all choices of a colour their values together:
//! as many as joint values of the colours, however many choices there are. The trace is
//! brought into each of these states, and the scores of each entry are recorded in the
//! first state in which it occurs. What depends on none of the choices is recorded once.
//! The tape then eliminates the choices one by one ([`crate::lang::tape`]).
//!
//! As in [`super::explore`], what a factor depends on is what its evaluation reads, in
//! any of the states; if a state shows that it reads more, the states are made again.

use super::Partition;
use super::reads::{Label, Reader, Sets};
use crate::lang::code::Op;
use crate::lang::tape::{Entry, Factor};
use crate::trace::gradient::{Given, Recorded, Recorder, Recording, SummedChoices};
use crate::trace::node::*;
use crate::trace::{Change, Draws, Target, Trace, TraceResult};
use pcadlang_numerics::dist::{Datum, Support};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;

/// The maximum number of states in which scores are recorded.
const MOST_STATES: usize = 512;

/// The choices to sum out, and what was found about them.
struct Sites {
    targets: Vec<Target>,
    values: Vec<Vec<Datum>>,
    supports: Vec<Support>,
    /// The labels of these choices, and of those that move.
    own: FxHashMap<NodeId, Label>,
    colours: Vec<usize>,
    /// By factor: the choices that it depends on, in ascending order.
    scopes: BTreeMap<NodeId, Vec<usize>>,
}

/// Factors under construction.
struct Table {
    factors: Vec<Factor>,
    /// By factor: its place in the list, and which entries have been recorded.
    places: FxHashMap<NodeId, (usize, Vec<bool>)>,
}

impl Trace {
    /// Like [`Trace::record`], with the choices of `sites` summed out. `None` also if they
    /// are not finite, if the structure of the program depends on continuous choices, if
    /// other choices appear or vanish with them, if the program fails at some of their
    /// values, or if too many depend on each other. The state stays the same.
    ///
    /// # Errors
    /// If the state cannot be restored.
    pub fn record_summed(
        &mut self,
        targets: &[Target],
        sites: &[Target],
        draws: Draws,
    ) -> TraceResult<Option<Recording>> {
        self.rollback();
        let now = |t: &Target| Some((*t, Change::Set(self.stored(*t)?)));
        let start: Option<Vec<(Target, Change)>> = sites.iter().map(now).collect();
        let (Some(start), Some(mut sites)) = (start, self.sites(targets, sites)) else {
            return Ok(None);
        };
        // Some of the states may not need all of the choices.
        let Ok(held) = self.hold_choices() else { return Ok(None) };
        let tape = self.record_states(targets, &mut sites, draws);
        self.rollback();
        self.propose(&start, draws)?;
        self.commit();
        self.release_held(held)?;
        let Some((recorded, entries, sweep)) = tape else { return Ok(None) };
        let summed = SummedChoices { sites: sites.targets, values: sites.values, entries, sweep };
        let tape = recorded.tape.finish();
        let in_place = recorded.in_place.map(|in_place| in_place.on(&tape));
        Ok(Some(Recording::new(self, (tape, in_place), targets, summed)))
    }

    fn sites(&self, targets: &[Target], sites: &[Target]) -> Option<Sites> {
        let mut own: FxHashMap<NodeId, Label> = FxHashMap::default();
        own.extend(targets.iter().map(|t| (t.node, Label { site: NONE, moves: true, set: 0 })));
        let (mut values, mut supports) = (Vec::new(), Vec::new());
        for (i, t) in sites.iter().enumerate() {
            let support = self.dist(*t)?.stored_support();
            let all: Vec<Datum> = support.is_finite().then(|| support.finite_values())??;
            let label = Label { site: i as u32, moves: false, set: i as u32 + 1 };
            if t.element != NONE || all.is_empty() || own.insert(t.node, label).is_some() {
                return None;
            }
            values.push(all);
            supports.push(support);
        }
        let (colours, scopes) = (vec![0; sites.len()], BTreeMap::new());
        Some(Sites { targets: sites.to_vec(), values, supports, own, colours, scopes })
    }

    /// Records everything, and counts the scores in the sum and in a sweep; `None` if that
    /// is not possible.
    fn record_states(
        &mut self,
        targets: &[Target],
        sites: &mut Sites,
        draws: Draws,
    ) -> Option<(Recorded, usize, usize)> {
        loop {
            let counts = sites.colour()?;
            let states = counts.iter().try_fold(1, |n: usize, c| n.checked_mul(*c))?;
            if states > MOST_STATES {
                return None;
            }
            let mut recorded = Some(Recorded::new(self.graph.incremental));
            let mut table = Table { factors: Vec::new(), places: FxHashMap::default() };
            for state in 0..states {
                let indices = sites.indices(&counts, state);
                self.go_to(sites, &indices, draws)?;
                let mut partition = Partition::default();
                partition.grow(sites.targets.len());
                let choices: Vec<NodeId> = self.all_targets().iter().map(|t| t.node).collect();
                let mut reader = Reader::new(&self.graph, &self.code, &sites.own, &mut partition);
                reader.sets = Some(Sets::singletons(sites.targets.len()));
                reader.read_all(choices.iter().copied());
                let found = &reader.found;
                let sets = reader.sets.as_ref().filter(|s| !s.overflow)?;
                if found.structure_moves || found.anywhere || found.unclear {
                    return None;
                }
                if widen(&mut sites.scopes, &found.factors, sets) {
                    recorded = None;
                }
                let Some(before) = recorded.take() else { continue };
                let given = reader.given(&indices);
                let scores = self.scores_by_factor(&sites.scopes, &choices);
                let record = RecordState {
                    given: &given,
                    table: &mut table,
                    scopes: &sites.scopes,
                    counts: &sites.values.iter().map(Vec::len).collect::<Vec<_>>(),
                    indices: &indices,
                    first: state == 0,
                };
                let mut now = self.record_state(targets, before, scores, record)?;
                let is_free = |n: &NodeId| {
                    given.get(n).is_some_and(|g| g.as_ref().is_some_and(|g| g.is_empty()))
                };
                now.forms.retain(|n, _| is_free(n));
                recorded = Some(now);
            }
            if let Some(mut recorded) = recorded {
                if table.places.values().any(|(_, seen)| !seen.iter().all(|s| *s)) {
                    return None;
                }
                let counts: Vec<usize> = sites.values.iter().map(Vec::len).collect();
                let of_scope = |f: &Factor| f.scope.iter().map(|x| counts[*x]).sum::<usize>();
                let sweep = table.factors.iter().map(of_scope).sum();
                let recordings: usize = table.factors.iter().map(|f| f.entries.len()).sum();
                let sums = recorded.tape.sum_out(&counts, table.factors)?;
                return Some((recorded, recordings + sums, sweep));
            }
        }
    }

    /// Gives the choices their values in a state; `None` if that is not possible without
    /// other changes.
    fn go_to(&mut self, sites: &Sites, indices: &[usize], draws: Draws) -> Option<()> {
        let values = sites.values.iter().zip(indices).map(|(v, i)| Change::Set(v[*i].clone()));
        let changes: Vec<_> = sites.targets.iter().copied().zip(values).collect();
        let weight = self.propose(&changes, draws).ok()?;
        let same =
            |(t, s): (&Target, &Support)| self.dist(*t).is_some_and(|d| d.stored_support() == *s);
        if weight.appeared + weight.vanished > 0
            || self.detaches_held()
            || !sites.targets.iter().zip(&sites.supports).all(same)
        {
            self.rollback();
            return None;
        }
        self.commit();
        Some(())
    }

    /// Returns all nodes with scores, each with the factor that it is part of.
    fn scores_by_factor(
        &self,
        scopes: &BTreeMap<NodeId, Vec<usize>>,
        choices: &[NodeId],
    ) -> Vec<(Option<NodeId>, NodeId)> {
        let is_score = |n: &NodeId| {
            self.graph.nodes[*n as usize].state == State::Clean
                && matches!(self.graph.op(&self.code, *n), Op::Observe { .. } | Op::Factor { .. })
        };
        let mut all: Vec<NodeId> = (0..self.graph.nodes.len() as NodeId).filter(is_score).collect();
        all.extend(choices);
        all.sort_unstable();
        all.dedup();
        let factor = |n: NodeId| {
            if matches!(self.graph.op(&self.code, n), Op::Draw { .. }) {
                return scopes.contains_key(&n).then_some(n);
            }
            let (mut at, mut outermost) = (n, None);
            while at != NONE {
                outermost = Some(at).filter(|at| scopes.contains_key(at)).or(outermost);
                at = self.graph.frames[self.graph.nodes[at as usize].frame as usize].owner;
            }
            outermost
        };
        all.into_iter().map(|n| (factor(n), n)).collect()
    }

    /// Records the scores that belong to a state.
    fn record_state(
        &mut self,
        targets: &[Target],
        before: Recorded,
        scores: Vec<(Option<NodeId>, NodeId)>,
        mut record: RecordState,
    ) -> Option<Recorded> {
        let mut by_factor: FxHashMap<NodeId, Vec<NodeId>> = FxHashMap::default();
        let mut order = Vec::new();
        let mut base = Vec::new();
        for (factor, n) in scores {
            match factor {
                None => base.push(n),
                Some(f) => by_factor
                    .entry(f)
                    .or_insert_with(|| {
                        order.push(f);
                        Vec::new()
                    })
                    .push(n),
            }
        }
        // Observations of a factor may be absent in a state.
        let absent = record.scopes.keys().filter(|f| !by_factor.contains_key(f)).copied();
        let absent: Vec<NodeId> = absent.collect();
        order.extend(absent);
        let mut open = Vec::new();
        for f in order {
            if let Some(place) = record.entry(f)? {
                let own = by_factor.remove(&f).unwrap_or_default();
                let scores: Vec<(NodeId, [f64; 2])> = own
                    .into_iter()
                    .map(|n| {
                        let (mut prior, mut likelihood) = Default::default();
                        self.graph.put_scored(&self.code, n, &mut prior, &mut likelihood);
                        (n, [prior.value(), likelihood.value()])
                    })
                    .collect();
                open.push((place, scores));
            }
        }
        let (first, table) = (record.first, &mut *record.table);
        self.graph.record_scores(&self.code, targets, before, record.given, |r: &mut Recorder| {
            if first {
                for n in base {
                    r.score(n)?;
                }
                r.put_scores(&Given::new());
            }
            for ((factor, entry), scores) in open {
                r.recorded.tape.begin_terms();
                let scope = table.factors[factor].scope.iter();
                let given = scope.map(|x| (*x as u32, record.indices[*x] as u32)).collect();
                let mut fixed = [0.0; 2];
                for (n, now) in scores {
                    if !r.score(n)? {
                        fixed[0] += now[0];
                        fixed[1] += now[1];
                    }
                }
                r.put_scores(&given);
                table.factors[factor].entries[entry] = r.recorded.tape.entry(fixed);
            }
            Some(())
        })
    }
}

/// Where the scores of a state are recorded.
struct RecordState<'a> {
    table: &'a mut Table,
    scopes: &'a BTreeMap<NodeId, Vec<usize>>,
    given: &'a FxHashMap<NodeId, Option<Given>>,
    /// The numbers of values of the choices, and the indices of their values.
    counts: &'a [usize],
    indices: &'a [usize],
    first: bool,
}

impl RecordState<'_> {
    /// Returns the place of a factor and of its entry in this state, if the entry has not
    /// been recorded yet; `None` if it is not a known factor.
    fn entry(&mut self, factor: NodeId) -> Option<Option<(usize, usize)>> {
        let scope = self.scopes.get(&factor)?;
        let size = scope.iter().try_fold(1, |n: usize, x| n.checked_mul(self.counts[*x]))?;
        if size > MOST_STATES {
            return None;
        }
        let factors = &mut self.table.factors;
        let (place, seen) = self.table.places.entry(factor).or_insert_with(|| {
            let entries = vec![Entry::default(); size];
            factors.push(Factor { scope: scope.clone(), entries });
            (factors.len() - 1, vec![false; size])
        });
        let entry = scope.iter().rev().fold(0, |p, x| p * self.counts[*x] + self.indices[*x]);
        Some((!std::mem::replace(&mut seen[entry], true)).then_some((*place, entry)))
    }
}

impl Sites {
    /// Colours the choices so that no factor depends on two of one colour. Returns the
    /// number of values by colour.
    fn colour(&mut self) -> Option<Vec<usize>> {
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
            let colour = (0..=taken.len()).find(|c| !taken.contains(c))?;
            self.colours[x] = colour;
            counts.resize(counts.len().max(colour + 1), 1);
            counts[colour] = counts[colour].max(self.values[x].len());
        }
        Some(counts)
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
