//! Observed values as part of a trace: reading them, replacing them, and sampling them
//! from their distributions given the choices. This is the basis of simulation-based
//! calibration and posterior predictive checks.
//!
//! A value that replaces the program's is kept under the observation's address and scored
//! from then on, also when the observation vanishes and reappears. Replacing it is a
//! proposal like any other: pending until it is committed, undone by a roll-back. Scoring
//! is in [`super::eval`].

use super::graph::Graph;
use super::journal::Entry;
use super::node::*;
use super::{Address, Draws, Trace, TraceResult, Weight};
use crate::lang::code::{DistSpec, Observed, Op};
use crate::lang::density::pointwise;
use crate::lang::value::Value;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// An observation of a trace.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Its address.
    pub address: Address,
    /// A hash of the address, stable between runs, by which [`Trace::set_observed`]
    /// identifies it.
    pub hash: u64,
    /// The observed value.
    pub value: Value,
}

/// New data for the observations of a trace, sampled given its choices.
#[derive(Clone, Debug, Default)]
pub struct Replicate {
    /// The address hash and new value of each observation that can be sampled, by
    /// address.
    pub values: Vec<(u64, Value)>,
    /// Those that cannot be sampled: factors, and observations under a likelihood without
    /// a sampler. The address, and a description.
    pub silent: Vec<(Address, String)>,
}

impl Trace {
    /// Returns the observations with their values, by address; factors are not included.
    pub fn observed(&self) -> Vec<Observation> {
        let g = &self.graph;
        let one = |n: NodeId| {
            let (hash, value) = (g.observation_hash(n)?, g.observed_value(n).clone());
            Some(Observation { address: g.address(n), hash, value })
        };
        let mut all: Vec<_> = self.scored_nodes().filter_map(one).collect();
        all.sort_by(|a, b| a.address.cmp(&b.address));
        all
    }

    /// Samples every observation given the choices, in the shape of the observed value.
    /// The trace is unchanged; [`Trace::set_observed`] takes the values.
    ///
    /// # Errors
    /// If a likelihood fails while it samples.
    pub fn replicate(&self, draws: Draws) -> TraceResult<Replicate> {
        let g = &self.graph;
        let mut all = Vec::new();
        let mut silent = Vec::new();
        for n in self.scored_nodes() {
            let address = g.address(n);
            let Some(hash) = g.observation_hash(n) else {
                silent.push((address, "a factor".to_owned()));
                continue;
            };
            match g.draw_observed(n, &mut draws.stream(hash))? {
                Ok(value) => all.push((address, hash, value)),
                Err(what) => silent.push((address, what)),
            }
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        silent.sort();
        Ok(Replicate {
            values: all.into_iter().map(|(_, hash, value)| (hash, value)).collect(),
            silent,
        })
    }

    /// Proposes replacements of observed values, given by the hashes of the observations'
    /// addresses. The update is pending until [`Trace::commit`] or [`Trace::rollback`]. A
    /// value for an observation that does not exist yet is kept until it does.
    ///
    /// # Errors
    /// If a value cannot be scored; the trace is then unchanged.
    pub fn set_observed(&mut self, values: &[(u64, Value)]) -> TraceResult<Weight> {
        self.propose_observed(&[], &[], values, Draws::default())
    }

    /// Returns the log density of each observed value: for each observation, the hash of
    /// its address and the log densities of its elements (a single one if it has no
    /// elements). Sorted by hash, so that the same observations come in the same order.
    /// `None` if there are more than `most` values.
    pub fn pointwise(&self, most: usize) -> Option<Vec<(u64, Vec<f64>)>> {
        let g = &self.graph;
        let (mut all, mut count) = (Vec::new(), 0);
        for n in self.scored_nodes() {
            let Op::Observe { dist: spec, site, .. } = g.op(n) else { continue };
            let frame = g.store[n].frame;
            let observed = g.observed_value(n);
            let likelihood =
                matches!(spec, DistSpec::Value(o) if !matches!(g.value(frame, *o), Value::Dist(_)));
            let scores = match likelihood {
                true => vec![self.score_at(n)],
                false => match g.make_dist(n, spec) {
                    Ok(dist) => pointwise(&dist, observed),
                    Err(_) => vec![f64::NAN],
                },
            };
            count += scores.len();
            if count > most {
                return None;
            }
            all.push((g.site_hash(frame, *site), scores));
        }
        all.sort_by_key(|(hash, _)| *hash);
        Some(all)
    }

    /// Returns the observed values in the order of [`Trace::pointwise`]: the name (the
    /// observation's address and the index of the element) and the value as a number, or
    /// NaN if it is not a number.
    pub fn points(&self, most: usize) -> Vec<(String, f64)> {
        let Some(scores) = self.pointwise(most) else { return Vec::new() };
        let mut observed: FxHashMap<u64, Observation> =
            self.observed().into_iter().map(|o| (o.hash, o)).collect();
        let mut all = Vec::new();
        for (hash, scores) in scores {
            let Some(o) = observed.remove(&hash) else { continue };
            let name = o.address.to_string();
            let name = name.trim_start_matches('@');
            let number = |v: Value| match v {
                Value::Num(x) => x,
                Value::Bool(b) => f64::from(u8::from(b)),
                _ => f64::NAN,
            };
            match (o.value.len(), scores.len()) {
                (Some(n), count) if n == count => all.extend((0..n).map(|i| {
                    (format!("{name}[{i}]"), o.value.element(i).map_or(f64::NAN, number))
                })),
                (_, count) => {
                    all.extend((0..count).map(|_| (name.to_owned(), number(o.value.clone()))))
                }
            }
        }
        all
    }

    /// Returns the observations by the hashes of their addresses.
    pub(super) fn observation_nodes(&self) -> FxHashMap<u64, NodeId> {
        let hashed = |n| Some((self.graph.observation_hash(n)?, n));
        self.scored_nodes().filter_map(hashed).collect()
    }

    /// Replaces observed values, within an update.
    pub(super) fn put_observed(&mut self, values: &[(u64, Value)]) {
        if values.is_empty() {
            return;
        }
        let nodes = self.observation_nodes();
        for (hash, value) in values {
            let Graph { store, update, .. } = &mut self.graph;
            let old = Arc::make_mut(&mut store.observed).insert(*hash, value.clone());
            update.note(Entry::Observed(*hash, old));
            if let Some(n) = nodes.get(hash) {
                update.save(store, *n);
                store[*n].flags |= TARGET;
                update.invalidate_target(store, &self.code, *n);
            }
        }
    }

    /// Returns the values that replace the program's observed values. The allocation
    /// changes whenever they do, so that holders can detect a change by pointer.
    #[doc(hidden)]
    pub fn replacements(&self) -> &Arc<Observed> {
        &self.graph.store.observed
    }

    /// Observes the same values as another trace of the same program.
    ///
    /// # Errors
    /// As [`Trace::set_observed`].
    #[doc(hidden)]
    pub fn observe_as(&mut self, other: &Trace) -> TraceResult<()> {
        if Arc::ptr_eq(&self.graph.store.observed, &other.graph.store.observed) {
            return Ok(());
        }
        let mut values: Vec<_> =
            other.graph.store.observed.iter().map(|(hash, v)| (*hash, v.clone())).collect();
        values.sort_by_key(|(hash, _)| *hash);
        self.set_observed(&values)?;
        self.commit();
        self.graph.store.observed = Arc::clone(&other.graph.store.observed);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Change;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    fn draws(step: u64) -> Draws {
        Draws { key: StreamKey::new(3, 0, Purpose::REPLICATE), step, substream: 0 }
    }

    fn trace(text: &str) -> Trace {
        crate::testing::trace(text, 1)
    }

    const TEXT: &str = "assume x ~ normal(0, 1); assume c ~ flip(0.5);
         observe normal(x, 0.5) = 2 as a;
         observe normal(x, 1) = [1, 2, 3] as b;
         for i in 0 .. 3 { observe poisson(1 + x * x) = i as n; }
         if c { observe flip(0.3) = true as f; }";

    #[test]
    fn what_is_put_in_place_is_scored_read_back_and_undone() {
        let mut t = trace(TEXT);
        let before = (t.log_joint(), t.observed());
        assert!(before.1.len() >= 5);
        let new = t.replicate(draws(0)).unwrap();
        assert!(new.silent.is_empty());
        let w = t.set_observed(&new.values).unwrap();
        assert!(
            (t.log_joint() - before.0 - w.log_joint).abs() < 1e-12
                && w.log_joint == w.log_likelihood
        );
        t.rollback();
        assert_eq!(t.log_joint().to_bits(), before.0.to_bits());
        assert!(t.observed().iter().zip(&before.1).all(|(a, b)| a.value.same(&b.value)));
        t.set_observed(&new.values).unwrap();
        t.commit();
        let (score, read) = (t.log_joint(), t.observed());
        for o in &read {
            let v = new.values.iter().find(|(h, _)| *h == o.hash).unwrap();
            assert!(o.value.same(&v.1), "{}", o.address);
        }
        assert_eq!(score.to_bits(), t.rerun().unwrap().log_joint().to_bits());
        assert!(matches!(&read[0].value, Value::Num(_)) && read[1].value.len() == Some(3));
    }

    #[test]
    fn updates_go_on_with_what_was_put_in_place() {
        let mut t = trace(TEXT);
        let new = t.replicate(draws(1)).unwrap();
        t.set_observed(&new.values).unwrap();
        t.commit();
        for step in 0..50 {
            let all = t.select(&crate::trace::Selector::All);
            let targets = t.targets(all).to_vec();
            let target = targets[step as usize % targets.len()];
            t.propose(&[(target, Change::Resample)], draws(2 + step)).unwrap();
            if step % 3 == 0 {
                t.rollback()
            } else {
                t.commit()
            }
            assert_eq!(t.log_joint().to_bits(), t.rerun().unwrap().log_joint().to_bits());
        }
        let mut whole = t.clone();
        whole.set_incremental(false);
        let other = t.replicate(draws(99)).unwrap().values;
        assert_eq!(t.set_observed(&other).unwrap(), whole.set_observed(&other).unwrap());
    }

    #[test]
    fn what_cannot_be_drawn_is_named() {
        let t = trace(
            "assume x ~ normal(0, 1); factor(-x * x); observe flat() = x; observe normal(x, 1) = 0;",
        );
        let r = t.replicate(draws(0)).unwrap();
        let named: Vec<String> = r.silent.iter().map(|(a, w)| format!("{a}: {w}")).collect();
        assert_eq!(r.values.len(), 1);
        assert!(named.contains(&"@factor#1: a factor".to_owned()), "{named:?}");
        assert!(named.iter().any(|n| n.contains("improper distribution `flat`")), "{named:?}");
    }

    #[test]
    fn draws_have_the_moments_of_the_distribution() {
        let t = trace(
            "assume x ~ normal(0, 1); observe normal(x, 2) = [0, 0]; observe mv_normal([x, 0], [[1, 0.5], [0.5, 2]]) = [0, 0];",
        );
        let Some(Value::Num(x)) = t.choices().first().map(|(_, v, _)| v.clone()) else {
            panic!("no choice")
        };
        let (mut sum, mut cross, n) = (0.0, 0.0, 20_000);
        for step in 0..n {
            let r = t.replicate(draws(step)).unwrap().values;
            let number = |k: usize, i: usize| match r[k].1.element(i) {
                Some(Value::Num(v)) => v,
                v => panic!("{v:?}"),
            };
            sum += number(0, 1);
            cross += (number(1, 0) - x) * number(1, 1);
        }
        // The standard errors are 0.014 and 0.011.
        assert!((sum / n as f64 - x).abs() < 0.07 && (cross / n as f64 - 0.5).abs() < 0.06);
    }
}
