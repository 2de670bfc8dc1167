//! The joint density of finite choices given the rest, as tables.
//!
//! The entries of each factor are evaluated in the first of the states in which they occur
//! ([`super::states`]). A finite choice that only other values need is one of the choices
//! too, from whichever state the tables are made: where nothing needs it, it has its prior,
//! and is not kept.

use super::states::{Halt, Sites, Visited};
use crate::lang::error::RunError;
use crate::trace::node::{NONE, NodeId};
use crate::trace::{Change, Constraint, Draws, Selection, Target, Trace, TraceResult};
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::elimination::Factor;
use pcadlang_numerics::num::ExactSum;
use rustc_hash::{FxHashMap, FxHashSet};

/// The maximum number of states in which scores are evaluated, and of entries of a factor.
const MOST: usize = 1 << 14;
/// The same for states times nodes of the trace: a second or two.
const MOST_WORK: usize = 1 << 24;

/// Tables of the joint density of finite choices.
#[derive(Clone, Debug, Default)]
pub struct Tabulated {
    /// The hashes of the addresses of the choices, and the values of each.
    choices: Vec<(u64, Vec<Datum>)>,
    /// The scores that depend on the choices, which are numbered from 0.
    pub factors: Vec<Factor>,
    /// The log density of what depends on none of them.
    pub rest: f64,
}

/// The result of [`Trace::tabulate`].
#[derive(Debug)]
pub enum Tabulation {
    /// The tables.
    Tables(Tabulated),
    /// The program fails at some values of the choices.
    Fails,
    /// The choices have no such tables; why, with the address of one of them.
    Refused(Box<RunError>),
}

impl Tabulated {
    /// The number of values of each choice.
    pub fn counts(&self) -> Vec<usize> {
        self.choices.iter().map(|(_, values)| values.len()).collect()
    }
}

/// Tables under construction.
#[derive(Default)]
struct Tables {
    factors: Vec<Factor>,
    /// By factor and choice of its scope: how far apart its entries are.
    strides: Vec<Vec<usize>>,
    /// The nodes with scores, each with its factor.
    scores: Vec<(Option<usize>, NodeId)>,
    rest: f64,
}

impl Trace {
    /// Tabulates the log prior plus `power` times the log likelihood as a function of the
    /// selected choices, given all others. The state stays the same.
    ///
    /// # Errors
    /// If the state cannot be restored.
    pub fn tabulate(
        &mut self,
        selection: Selection,
        power: f64,
        draws: Draws,
    ) -> TraceResult<Tabulation> {
        self.rollback();
        let before = self.constraints();
        let others = self.beside(selection);
        let mut held = Vec::new();
        let done = loop {
            match self.hold_choices() {
                Ok(more) => held.push(more),
                Err(e) => break Tabulation::Refused(e),
            }
            let targets = self.targets(selection).to_vec();
            let Some(first) = targets.first().copied() else {
                break Tabulation::Tables(Tabulated::default());
            };
            let refused = |trace: &Trace, why| Tabulation::Refused(trace.cannot_sum(first, why));
            let mut sites = match self.sites(&[], &targets) {
                Ok(sites) => sites,
                Err(why) => break refused(self, why),
            };
            let mut tables = Tables::default();
            let visit = |trace: &mut Trace, sites: &Sites, state: Visited| {
                trace.asks_for_all(sites, &state)?;
                tables.enter(trace, sites, state, power)
            };
            let most = (MOST_WORK / self.graph.store.len().max(1)).clamp(1, MOST);
            match self.visit_states(&mut sites, (most, false), draws, visit) {
                Ok(()) => break self.tabulated(&sites, tables),
                Err(Halt::Fails) => break Tabulation::Fails,
                Err(Halt::Cannot(why)) => break refused(self, why),
                // Selected choices that appear are among those of the next round.
                Err(Halt::Structure(changes)) => {
                    let why = "other choices are created or removed with it";
                    let update = self.propose(&changes, draws)?;
                    if update.appeared == 0 || update.vanished > 0 {
                        self.rollback();
                        break refused(self, why);
                    }
                    self.commit();
                    if self.beside(selection) != others {
                        break refused(self, why);
                    }
                }
            }
        };
        self.rollback();
        for h in held {
            self.release_held(h)?;
        }
        self.restore(&before, draws)?;
        Ok(done)
    }

    /// Checks that observations and factors depend on all choices that are not of `sites`:
    /// one that they do not would vanish.
    fn asks_for_all(&self, sites: &Sites, state: &Visited) -> Result<(), Halt> {
        let own = sites.targets.iter().map(|t| t.node);
        let known: FxHashSet<NodeId> = state.asked.iter().copied().chain(own).collect();
        match state.choices.iter().all(|n| known.contains(n)) {
            true => Ok(()),
            false => Err(Halt::Cannot("other choices are created or removed with it")),
        }
    }

    /// The choices that are not selected.
    fn beside(&self, selection: Selection) -> FxHashSet<u64> {
        let hash = |t: &Target| self.address_hash(*t);
        let selected: FxHashSet<u64> = self.targets(selection).iter().map(hash).collect();
        self.all_targets().iter().map(hash).filter(|h| !selected.contains(h)).collect()
    }

    fn tabulated(&self, sites: &Sites, tables: Tables) -> Tabulation {
        let hash = |t: &Target| self.address_hash(*t);
        let choices = sites.targets.iter().map(hash).zip(sites.values.iter().cloned()).collect();
        let Tables { factors, rest, .. } = tables;
        if factors.iter().any(|f| f.table.iter().any(|x| x.is_nan())) {
            let why = "not all of its values occur together with those of the others";
            return Tabulation::Refused(self.cannot_sum(sites.targets[0], why));
        }
        Tabulation::Tables(Tabulated { choices, factors, rest })
    }

    /// Gives the choices of tables the values with these indices. False, with the state as it
    /// was, if another choice would appear or vanish, or the program fails.
    ///
    /// # Errors
    /// If the program fails in a way that does not depend on the values.
    pub fn assign(
        &mut self,
        tables: &Tabulated,
        indices: &[usize],
        selection: Selection,
        draws: Draws,
    ) -> TraceResult<bool> {
        self.rollback();
        let (mut changes, mut constraints) = (Vec::new(), Vec::new());
        for ((hash, values), i) in tables.choices.iter().zip(indices) {
            let value = values[*i].clone();
            match self.graph.choices.find(*hash) {
                Some(node) => {
                    let target = Target { node, element: NONE };
                    if self.stored(target).as_ref() != Some(&value) {
                        changes.push((target, Change::Set(value)));
                    }
                }
                None => constraints.push((*hash, Constraint::Stored(value))),
            }
        }
        let count = |trace: &Trace| trace.choice_count() - trace.targets(selection).len();
        let others = count(self);
        match self.propose_constrained(&changes, &constraints, draws) {
            Ok(_) if count(self) == others => {
                self.commit();
                Ok(true)
            }
            Ok(_) => {
                self.rollback();
                Ok(false)
            }
            Err(e) if e.is_recoverable() => Ok(false),
            Err(e) => Err(e),
        }
    }
}

impl Tables {
    /// Tables without entries.
    fn new(sites: &Sites) -> Result<Tables, Halt> {
        let mut tables = Tables::default();
        for scope in sites.scopes.values() {
            let (mut strides, mut size) = (Vec::with_capacity(scope.len()), 1usize);
            for x in scope {
                strides.push(size);
                size = size.saturating_mul(sites.values[*x].len());
            }
            if size > MOST {
                return Err(Halt::Cannot("too many choices depend on each other"));
            }
            // NaN until an entry has been evaluated.
            tables.factors.push(Factor { scope: scope.clone(), table: vec![f64::NAN; size] });
            tables.strides.push(strides);
        }
        Ok(tables)
    }

    /// Enters the entries that occur in a state for the first time.
    fn enter(
        &mut self,
        trace: &Trace,
        sites: &Sites,
        state: Visited,
        power: f64,
    ) -> Result<(), Halt> {
        if state.first {
            *self = Tables::new(sites)?;
        }
        if !state.choices.is_empty() {
            let places: FxHashMap<NodeId, usize> = sites.scopes.keys().copied().zip(0..).collect();
            let scores = trace.scores_by_factor(&sites.scopes, state.choices);
            let place = |f: Option<NodeId>| f.and_then(|f| places.get(&f).copied());
            self.scores = scores.into_iter().map(|(f, n)| (place(f), n)).collect();
        }
        // The entry of each factor that this state shows first.
        let entry = |(f, strides): (&Factor, &Vec<usize>)| {
            let at: usize = f.scope.iter().zip(strides).map(|(x, s)| s * state.indices[*x]).sum();
            f.table[at].is_nan().then_some(at)
        };
        let open: Vec<Option<usize>> = self.factors.iter().zip(&self.strides).map(entry).collect();
        let mut sums: Vec<[ExactSum; 2]> = vec![Default::default(); self.factors.len()];
        let mut base: [ExactSum; 2] = Default::default();
        for (factor, n) in &self.scores {
            let [prior, likelihood] = match factor {
                None if state.first => &mut base,
                Some(f) if open[*f].is_some() => &mut sums[*f],
                _ => continue,
            };
            trace.graph.put_scored(*n, prior, likelihood);
        }
        let tempered = |[prior, likelihood]: &[ExactSum; 2]| {
            let likelihood = likelihood.value();
            // An impossible state is impossible at every power.
            let scaled =
                if likelihood == f64::NEG_INFINITY { likelihood } else { power * likelihood };
            prior.value() + scaled
        };
        if state.first {
            self.rest = tempered(&base);
        }
        // Observations of a factor may be absent in a state: nothing is added for them.
        for ((f, at), sum) in self.factors.iter_mut().zip(open).zip(&sums) {
            if let Some(at) = at {
                f.table[at] = tempered(sum);
            }
        }
        Ok(())
    }
}
