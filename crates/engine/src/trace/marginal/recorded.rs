//! Recording the log density with finite choices summed out, as a function of continuous
//! choices, on a tape.
//!
//! The scores of each entry of a factor are recorded in the first of the states in which it
//! occurs ([`super::states`]). What depends on none of the choices is recorded once. The
//! tape then eliminates the choices one by one ([`crate::lang::tape`]).

use super::states::{Halt, Sites, Visited};
use crate::lang::tape::{Entry, Factor};
use crate::trace::gradient::{Given, Recorded, Recorder, Recording, SummedChoices};
use crate::trace::node::*;
use crate::trace::{Change, Draws, Target, Trace, TraceResult};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// The maximum number of states in which scores are recorded.
const MOST_STATES: usize = 512;

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
        let (Some(start), Ok(mut sites)) = (start, self.sites(targets, sites)) else {
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
        let in_place = recorded.in_place.map(|in_place| in_place.on(&tape, &self.graph));
        Ok(Some(Recording::new(self, (tape, in_place), targets, summed)))
    }

    /// Records everything, and counts the scores in the sum and in a sweep; `None` if that
    /// is not possible.
    fn record_states(
        &mut self,
        targets: &[Target],
        sites: &mut Sites,
        draws: Draws,
    ) -> Option<(Recorded, usize, usize)> {
        let mut recorded = None;
        let mut table = Table { factors: Vec::new(), places: FxHashMap::default() };
        let visit = |trace: &mut Trace, sites: &Sites, state: Visited| {
            if state.first {
                recorded = Some(Recorded::new(trace.graph.incremental));
                table = Table { factors: Vec::new(), places: FxHashMap::default() };
            }
            let scores = trace.scores_by_factor(&sites.scopes, state.choices);
            let record = RecordState {
                given: state.given,
                table: &mut table,
                scopes: &sites.scopes,
                counts: &sites.values.iter().map(Vec::len).collect::<Vec<_>>(),
                indices: state.indices,
                first: state.first,
            };
            let before = recorded.take();
            let now = before.and_then(|b| trace.record_state(targets, b, scores, record));
            let mut now = now.ok_or(Halt::Cannot("it cannot be recorded"))?;
            let is_free = |n: &NodeId| {
                state.given.get(n).is_some_and(|g| g.as_ref().is_some_and(|g| g.is_empty()))
            };
            now.forms.retain(|n, _| is_free(n));
            recorded = Some(now);
            Ok(())
        };
        self.visit_states(sites, (MOST_STATES, true), draws, visit).ok()?;
        let mut recorded = recorded?;
        if table.places.values().any(|(_, seen)| !seen.iter().all(|s| *s)) {
            return None;
        }
        let counts: Vec<usize> = sites.values.iter().map(Vec::len).collect();
        let of_scope = |f: &Factor| f.scope.iter().map(|x| counts[*x]).sum::<usize>();
        let sweep = table.factors.iter().map(of_scope).sum();
        let recordings: usize = table.factors.iter().map(|f| f.entries.len()).sum();
        let sums = recorded.tape.sum_out(&counts, table.factors)?;
        Some((recorded, recordings + sums, sweep))
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
                        self.graph.put_scored(n, &mut prior, &mut likelihood);
                        (n, [prior.value(), likelihood.value()])
                    })
                    .collect();
                open.push((place, scores));
            }
        }
        let (first, table) = (record.first, &mut *record.table);
        self.record_scores(targets, before, record.given, |r: &mut Recorder| {
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
