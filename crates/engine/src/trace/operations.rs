//! The operations of generative functions by name, for users of the library: reading and
//! changing choices and observed values by address, undoing changes, and the density of a
//! part of a trace.
//!
//! The terms are Gen's (Cusumano-Towner et al. 2019): [`Trace::update`] and
//! [`Trace::project`] are here; `simulate`, `generate`, `propose`, `regenerate` and
//! `score` are in the parent module. A fork of a trace is its clone. How an update runs
//! is in other modules.

use super::node::NodeId;
use super::{Address, Change, Constraint, Draws, Selector, Target, Trace, TraceResult, Weight};
use crate::lang::error::{FaultKind, RunError};
use crate::lang::value::Value;
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::num::ExactSum;
use rustc_hash::FxHashMap;

/// A value given to a choice or an observation.
#[derive(Clone, Debug)]
pub enum Given {
    /// As the program sees it.
    Value(Value),
    /// As the trace stores a choice (for a whitened gp, the underlying white noise): the
    /// form used by [`Update::discarded`], so that the way back is exact.
    Stored(Datum),
}

impl Given {
    fn value(&self) -> Value {
        match self {
            Given::Value(v) => v.clone(),
            Given::Stored(d) => Value::from_datum(d),
        }
    }
}

impl<V: Into<Value>> From<V> for Given {
    fn from(value: V) -> Self {
        Given::Value(value.into())
    }
}

/// The result of [`Trace::update`].
#[derive(Clone, Debug)]
pub struct Update {
    /// The change of the log joint density minus the log density of what was drawn from
    /// the prior: the importance weight of the new state relative to the old one.
    pub log_weight: f64,
    /// The same update as a proposal of an MCMC step.
    pub weight: Weight,
    /// The previous values of what was replaced and of the choices that vanished, by
    /// address: an update with these leads back.
    pub discarded: Vec<(Address, Given)>,
}

/// Given values, sorted by the kind of their addressee.
#[derive(Default)]
struct Sorted {
    changes: Vec<(Target, Change)>,
    constraints: Vec<(u64, Constraint)>,
    observed: Vec<(u64, Value)>,
    discarded: Vec<(Address, Given)>,
}

impl Trace {
    /// Returns the value of a choice, of an element of a choice, or an observed value, by
    /// its address, such as `@pose[arm_l]/bone`.
    ///
    /// # Errors
    /// If the trace has no such choice or observation; the message names the nearest
    /// address.
    pub fn get(&self, address: &str) -> TraceResult<Value> {
        let address: Address = address.parse().map_err(|e| wrong(format!("{e}")))?;
        if let Some(t) = self.find(&address) {
            return Ok(self.value(t));
        }
        self.observed_at(&address, &self.observation_nodes()).ok_or_else(|| self.unknown(&address))
    }

    /// Gives a value to a choice, an element of a choice, or an observation, and commits:
    /// [`Trace::update`] followed by [`Trace::commit`].
    ///
    /// # Errors
    /// As [`Trace::update`].
    pub fn set(
        &mut self,
        address: &str,
        value: impl Into<Value>,
        draws: Draws,
    ) -> TraceResult<Update> {
        let address = address.parse().map_err(|e| wrong(format!("{e}")))?;
        let update = self.update(&[(address, Given::Value(value.into()))], draws)?;
        self.commit();
        Ok(update)
    }

    /// Changes choices and observed values by address, leaving the rest unchanged. A
    /// value for something that does not exist yet is used when it appears; choices that
    /// appear without a given value are drawn from their prior. Gaussian processes keep
    /// their underlying white noise when their parameters change. The update is pending
    /// until [`Trace::commit`] or [`Trace::rollback`]; it can also be undone after that
    /// ([`Update::discarded`]), bit for bit.
    ///
    /// # Errors
    /// If an address is not in the updated trace (the message names the nearest one that
    /// is), if a value does not fit its choice, or if the program fails; the trace is
    /// then unchanged.
    pub fn update(&mut self, given: &[(Address, Given)], draws: Draws) -> TraceResult<Update> {
        self.rollback();
        let mut sorted = self.sort_given(given)?;
        let proposed =
            self.propose_observed(&sorted.changes, &sorted.constraints, &sorted.observed, draws);
        let mut weight = proposed.map_err(|e| self.misfit_behind(given, e))?;
        let late = self.appeared_observations(given, &sorted);
        let removed = self.graph.update.removed.clone();
        if !removed.is_empty() || !late.is_empty() {
            // Addresses may contain values that have changed, so they are spelt in the
            // previous state.
            self.rollback();
            for (n, _, stored) in removed {
                let address = self.graph.address(n);
                if !sorted.discarded.iter().any(|(a, _)| *a == address) {
                    sorted.discarded.push((address, Given::Stored(stored)));
                }
            }
            sorted.observed.extend(late);
            weight = self.propose_observed(
                &sorted.changes,
                &sorted.constraints,
                &sorted.observed,
                draws,
            )?;
        }
        if let Err(e) = self.check_given(given) {
            self.rollback();
            return Err(e);
        }
        sorted.discarded.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(Update { log_weight: self.importance(), weight, discarded: sorted.discarded })
    }

    /// Returns the log density of the choices, observations and factors that a selector
    /// selects, in the current state (including a pending update). For [`Selector::All`]
    /// it equals the log joint bit for bit. Observations have addresses and tags but no
    /// kinds.
    pub fn project(&self, selector: &Selector) -> f64 {
        let g = &self.graph;
        let mut sum = ExactSum::default();
        for t in self.all_targets().iter().filter(|t| g.selects(selector, t)) {
            sum.add(self.score_of(*t));
        }
        for n in self.scored_nodes() {
            if selector.selects(&g.facts(n, selector.needs_address(), None)) {
                g.put_score(n, &mut sum);
            }
        }
        sum.value()
    }

    /// The change of the log joint in the pending update minus the log density of what it
    /// drew from the prior.
    fn importance(&self) -> f64 {
        let (g, none) = (&self.graph, ExactSum::default());
        let Some(before) = &self.update else { return 0.0 };
        ExactSum::difference_of_sums(
            [&g.score.prior, &g.score.likelihood, &g.score.drawn],
            [&before.prior, &before.likelihood, &none],
        )
    }

    /// Sorts what is given into values of choices, values of observations, and values of
    /// what does not exist yet.
    fn sort_given(&self, given: &[(Address, Given)]) -> TraceResult<Sorted> {
        let mut sorted = Sorted::default();
        let nodes = self.nodes_for(given);
        for (address, given) in given {
            let (hash, target) = (address.hash64(), self.find(address));
            let datum = match given {
                Given::Value(v) => v.to_datum(),
                Given::Stored(d) => Some(d.clone()),
            };
            if datum.as_ref().is_some_and(has_nan) {
                return Err(wrong(format!("the value given for `{address}` is not a number")));
            }
            if target.is_none()
                && let Some(old) = self.observed_at(address, &nodes)
            {
                sorted.observed.push((hash, given.value()));
                sorted.discarded.push((address.clone(), Given::Value(old)));
                continue;
            }
            let Some(datum) = datum else {
                match target {
                    Some(_) => return Err(self.misfit(address, given)),
                    None => continue,
                }
            };
            let (change, constraint) = match given {
                Given::Value(_) => (Change::Value(datum.clone()), Constraint::Value(datum)),
                Given::Stored(_) => (Change::Set(datum.clone()), Constraint::Stored(datum)),
            };
            sorted.constraints.push((hash, constraint));
            if let Some(t) = target {
                sorted.changes.push((t, change));
                let old = self.stored(t).map(|d| (address.clone(), Given::Stored(d)));
                sorted.discarded.extend(old);
            }
        }
        Ok(sorted)
    }

    /// Returns the values given to observations that appeared in this update.
    fn appeared_observations(
        &self,
        given: &[(Address, Given)],
        sorted: &Sorted,
    ) -> Vec<(u64, Value)> {
        let new = |(a, _): &&(Address, Given)| {
            let hash = a.hash64();
            self.find(a).is_none() && !sorted.observed.iter().any(|(h, _)| *h == hash)
        };
        let nodes = self.nodes_for(given);
        let hashed = given.iter().filter(new).map(|(a, given)| (a.hash64(), given.value()));
        hashed.filter(|(h, _)| nodes.contains_key(h)).collect()
    }

    /// Fails unless everything given now exists and fits its distribution.
    fn check_given(&self, given: &[(Address, Given)]) -> TraceResult<()> {
        let nodes = self.nodes_for(given);
        for (address, given) in given {
            match self.find(address) {
                None if nodes.contains_key(&address.hash64()) => {}
                None => return Err(self.unknown(address)),
                Some(t) => {
                    let fits = self
                        .dist(t)
                        .zip(self.stored(t))
                        .is_some_and(|(d, x)| d.stored_support().fits(&x));
                    if !fits {
                        return Err(self.misfit(address, given));
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the observations, unless all addresses are those of choices: finding
    /// observations takes a pass over all nodes.
    fn nodes_for(&self, given: &[(Address, Given)]) -> FxHashMap<u64, NodeId> {
        match given.iter().all(|(a, _)| self.find(a).is_some()) {
            true => FxHashMap::default(),
            false => self.observation_nodes(),
        }
    }

    /// Returns the observed value at an address.
    fn observed_at(&self, address: &Address, nodes: &FxHashMap<u64, NodeId>) -> Option<Value> {
        Some(self.graph.observed_value(*nodes.get(&address.hash64())?).clone())
    }

    fn unknown(&self, address: &Address) -> Box<RunError> {
        let g = &self.graph;
        let mut known: Vec<String> =
            self.all_targets().iter().map(|t| self.address(*t).to_string()).collect();
        known.extend(self.observation_nodes().values().map(|n| g.address(*n).to_string()));
        known.sort();
        let text = address.to_string();
        let near = pcadlang_syntax::diag::nearest(&text, known.iter().map(String::as_str));
        let near = near.map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
        wrong(format!("the trace has no choice or observation `{text}`{near}"))
    }

    /// Replaces a failure of the program by a misfit error, if a given value does not fit
    /// the current form of its choice.
    fn misfit_behind(&self, given: &[(Address, Given)], e: Box<RunError>) -> Box<RunError> {
        let misfits = |(address, given): &&(Address, Given)| {
            let dist = self.find(address).and_then(|t| self.dist(t));
            dist.is_some_and(|d| match given {
                Given::Value(v) => !v.to_datum().is_some_and(|x| d.support().fits(&x)),
                Given::Stored(x) => !d.stored_support().fits(x),
            })
        };
        match given.iter().find(misfits) {
            Some((address, given)) if !e.is_recoverable() => self.misfit(address, given),
            _ => e,
        }
    }

    fn misfit(&self, address: &Address, given: &Given) -> Box<RunError> {
        let value = given.value();
        let dist = self.find(address).and_then(|t| self.dist(t));
        let dist =
            dist.map(|d| format!(", which is drawn from `{}`", d.name())).unwrap_or_default();
        wrong(format!("{value} does not fit `{address}`{dist}"))
    }
}

fn wrong(message: String) -> Box<RunError> {
    Box::new(RunError {
        kind: FaultKind::Index,
        message,
        span: Default::default(),
        address: Address::default(),
        calls: Vec::new(),
        hint: None,
    })
}

fn has_nan(d: &Datum) -> bool {
    match d {
        Datum::Num(x) => x.is_nan(),
        Datum::Bool(_) => false,
        Datum::Vec(xs) => xs.iter().any(|x| x.is_nan()),
        Datum::List(xs) => xs.iter().any(has_nan),
    }
}
