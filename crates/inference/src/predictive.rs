//! Predictive checks: data replicated from the prior or the posterior are compared with
//! the observed data.
//!
//! In each state, every observation that has a sampler is redrawn ([`Trace::replicate`]);
//! the others are listed. Observations that differ only in the keys of their addresses
//! (those of a loop) are grouped as one observation with several numbers. The comparison
//! uses test statistics: Gelman, Meng & Stern, "Posterior predictive assessment of model
//! fitness" (1996). Judging the results is left to the caller.

use super::calibration::simulate::{replicating, state};
use super::callback::Callback;
use super::parallel::in_parallel;
use super::run::ChainError;
use indexmap::IndexMap;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, Draws, Limits, Trace};
use std::sync::{Arc, Mutex, PoisonError};

/// The test statistics.
pub const STATISTICS: [&str; 4] = ["mean", "sd", "min", "max"];

/// The numbers of one observation in one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Its address without keys.
    pub name: String,
    /// The numbers, in order of address and element.
    pub numbers: Vec<f64>,
}

/// Replicated observations, or the observed ones in the same form.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replication {
    /// The observations, by address.
    pub groups: Vec<Group>,
    /// Observations without a sampler or without numeric values, each with a description
    /// of what it is.
    pub silent: Vec<(String, String)>,
}

impl Replication {
    /// The numbers of an observation.
    pub fn get(&self, name: &str) -> Option<&Group> {
        self.groups.iter().find(|g| g.name == name)
    }
}

/// Mean, standard deviation (over n - 1), minimum and maximum of the finite numbers; NaN
/// if there are too few.
pub fn statistics(numbers: &[f64]) -> [f64; 4] {
    let (mut n, mut mean, mut squares) = (0.0, 0.0, 0.0);
    let (mut low, mut high) = (f64::NAN, f64::NAN);
    for x in numbers.iter().copied().filter(|x| x.is_finite()) {
        n += 1.0;
        let off = x - mean;
        mean += off / n;
        squares += off * (x - mean);
        low = x.min(low);
        high = x.max(high);
    }
    let sd = if n > 1.0 { (squares / (n - 1.0)).sqrt() } else { f64::NAN };
    [if n > 0.0 { mean } else { f64::NAN }, sd, low, high]
}

/// The fraction of replicated statistics above the observed one, with equal ones counting
/// half; NaN if there is nothing to compare.
pub fn tail(observed: f64, replicated: &[f64]) -> f64 {
    let known: Vec<f64> = replicated.iter().copied().filter(|x| !x.is_nan()).collect();
    if known.is_empty() || observed.is_nan() {
        return f64::NAN;
    }
    let above = known.iter().filter(|x| **x > observed).count() as f64;
    let same = known.iter().filter(|x| **x == observed).count() as f64;
    (above + 0.5 * same) / known.len() as f64
}

/// The observed data of a trace, in the same form as its replications.
pub fn observed(trace: &Trace) -> Replication {
    grouped(trace.observed().into_iter().map(|o| (o.address, o.value)).collect())
}

/// One replication of a state.
///
/// # Errors
/// If an observation cannot be drawn.
pub fn replication(trace: &Trace, draws: Draws) -> Result<Replication, Box<RunError>> {
    let drawn = trace.replicate(draws)?;
    let addresses: rustc_hash::FxHashMap<u64, Address> =
        trace.observed().into_iter().map(|o| (o.hash, o.address)).collect();
    let values = drawn
        .values
        .into_iter()
        .filter_map(|(hash, v)| Some((addresses.get(&hash)?.clone(), v)))
        .collect();
    let mut all = grouped(values);
    for (address, what) in drawn.silent {
        let name = keyless(&address);
        if !all.silent.iter().any(|(n, _)| *n == name) {
            all.silent.push((name, what));
        }
    }
    Ok(all)
}

fn grouped(values: Vec<(Address, Value)>) -> Replication {
    let mut groups: IndexMap<String, Vec<f64>> = IndexMap::new();
    let mut silent = Vec::new();
    for (address, value) in values {
        let (name, numbers) = (keyless(&address), value.numbers());
        if numbers.is_empty() {
            silent.push((name, format!("{}, which is not numeric", value.type_name())));
        } else {
            groups.entry(name).or_default().extend(numbers);
        }
    }
    Replication {
        groups: groups.into_iter().map(|(name, numbers)| Group { name, numbers }).collect(),
        silent,
    }
}

fn keyless(address: &Address) -> String {
    let mut a = address.clone();
    a.segments.iter_mut().for_each(|s| s.keys.clear());
    a.to_string()
}

/// Replications of `count` states drawn from the prior.
///
/// # Errors
/// If no state can be drawn, or its observations cannot.
pub fn prior(
    code: &Arc<Code>,
    seed: u64,
    count: u32,
    threads: usize,
    limits: Limits,
) -> Result<Vec<Replication>, ChainError> {
    let one = |i: u32| -> Result<Replication, ChainError> {
        let trace = state(code, limits.clone(), seed, i)?;
        Ok(replication(&trace, replicating(seed, i, 0))?)
    };
    in_parallel(threads.max(1), (0..count).collect(), one).into_iter().collect()
}

/// Gathers a replication of every recorded draw, as a run's callback. Clones share the
/// replications.
#[derive(Clone, Debug)]
pub struct Predictive {
    seed: u64,
    chains: Arc<[Mutex<Chain>]>,
}

#[derive(Debug, Default)]
struct Chain {
    draws: Vec<Replication>,
    failed: Option<Box<RunError>>,
}

impl Predictive {
    /// For `chains` chains of a run with this seed.
    pub fn new(chains: u32, seed: u64) -> Predictive {
        Predictive { seed, chains: (0..chains).map(|_| Mutex::default()).collect() }
    }

    /// The replications so far, by chain.
    ///
    /// # Errors
    /// The first error in drawing observations.
    pub fn draws(&self) -> Result<Vec<Vec<Replication>>, Box<RunError>> {
        let take = |c: &Mutex<Chain>| {
            let c = c.lock().unwrap_or_else(PoisonError::into_inner);
            c.failed.clone().map_or_else(|| Ok(c.draws.clone()), Err)
        };
        self.chains.iter().map(take).collect()
    }
}

impl Callback for Predictive {
    fn draw(&self, chain: u32, trace: &mut Trace, _: Draws) {
        let Some(at) = self.chains.get(chain as usize) else { return };
        let mut at = at.lock().unwrap_or_else(PoisonError::into_inner);
        let turn = at.draws.len() as u64;
        match replication(trace, replicating(self.seed, chain, turn)) {
            Ok(r) => at.draws.push(r),
            Err(e) => at.failed = at.failed.take().or(Some(e)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{compiled, trace};
    use crate::{Progress, RunOptions, draws::Discard, run_chains};

    const TEXT: &str = "assume m ~ normal(0, 2);
         for i in 0 .. 4 { observe normal(m, 1) = i as x; }
         observe normal(m, 1) = [1, 2] as y; factor(0) as soft;
         infer { warmup 1000 { nuts(@m); } repeat 1000 { nuts(@m); } }";

    #[test]
    fn statistics_and_tails() {
        assert_eq!(statistics(&[1.0, f64::INFINITY, 3.0, f64::NAN, 2.0]), [2.0, 1.0, 1.0, 3.0]);
        assert!(statistics(&[]).iter().all(|x| x.is_nan()) && statistics(&[5.0])[1].is_nan());
        assert_eq!(tail(1.0, &[0.0, 1.0, 2.0, 3.0]), 0.625);
        assert!(tail(f64::NAN, &[1.0]).is_nan() && tail(1.0, &[]).is_nan());
    }

    /// The posterior of m given six observations of unit variance, mean 1.5 and prior
    /// variance 4: mean 1.44, variance 0.16.
    #[test]
    fn predictive_draws_have_the_exact_moments() {
        let compiled = compiled(TEXT);
        let now = observed(&trace(TEXT, 0));
        let names: Vec<&str> = now.groups.iter().map(|g| &*g.name).collect();
        assert_eq!(
            (names, now.groups[0].numbers.clone()),
            (vec!["@x", "@y"], vec![0.0, 1.0, 2.0, 3.0])
        );
        let moments = |draws: &[Replication]| {
            let xs: Vec<f64> = draws.iter().map(|r| r.get("@x").unwrap().numbers[0]).collect();
            let [mean, sd, ..] = statistics(&xs);
            (mean, sd * sd)
        };
        let from_prior = prior(&compiled.code, 3, 4000, 2, Limits::default()).unwrap();
        assert_eq!(from_prior, prior(&compiled.code, 3, 4000, 1, Limits::default()).unwrap());
        assert_eq!(from_prior[0].silent, [("@soft".to_owned(), "a factor".to_owned())]);
        let (mean, variance) = moments(&from_prior);
        assert!(mean.abs() < 0.2 && (variance - 5.0).abs() < 0.6, "{mean} {variance}");
        let callback = Predictive::new(1, 3);
        let options = RunOptions {
            seed: 3,
            callback: Some(Arc::new(callback.clone())),
            ..RunOptions::default()
        };
        let done = run_chains(
            &compiled.code,
            &compiled.plans[0],
            &options,
            1,
            &Progress::default(),
            vec![Box::new(Discard)],
        );
        assert!(done[0].is_ok());
        let draws = callback.draws().unwrap().concat();
        let (mean, variance) = moments(&draws);
        assert!(
            draws.len() == 1000 && (mean - 1.44).abs() < 0.2 && (variance - 1.16).abs() < 0.3,
            "{mean} {variance}"
        );
    }
}
