//! Draws states and data from the joint distribution of a program: choices from the
//! prior, then every observation from its own distribution given the choices.
//!
//! A program that does not define such a distribution is refused, with the reason: a
//! factor, a likelihood without a sampler, an improper prior, frozen choices,
//! observations whose existence is random, or observed values that depend on choices.

use super::{CalibrationError, Settings};
use crate::run::ChainError;
use crate::{StartError, attempts};
use pcadlang_engine::lang::code::{Code, Observed};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Limits, Observation, Selector, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::sync::Arc;

/// How many draws from the prior may be undefined before that is an error.
const RETRIES: u64 = 1000;

/// A state with data drawn from it.
pub(super) struct Simulated {
    /// The state, with its observations replaced by the data.
    pub trace: Trace,
    /// The data, by the hash of the observation's address.
    pub data: Arc<Observed>,
    /// The program's own observations.
    given: Vec<Observation>,
}

/// The randomness of redrawing observations for the `step`-th time.
pub(crate) fn replicating(seed: u64, index: u32, step: u64) -> Draws {
    Draws { key: StreamKey::new(seed, index, Purpose::REPLICATE), step, substream: 0 }
}

/// Draws a state and its data.
pub(super) fn simulate(
    code: &Arc<Code>,
    settings: &Settings,
    index: u32,
) -> Result<Simulated, CalibrationError> {
    let trace = state(code, settings.limits.clone(), settings.seed, index)?;
    with_data(trace, settings, index)
}

/// Draws a state from the prior. The prior has no mass where the program is undefined (a
/// scale that is not positive): kernels reject such states, so they are redrawn here.
pub(crate) fn state(
    code: &Arc<Code>,
    limits: Limits,
    seed: u64,
    index: u32,
) -> Result<Trace, ChainError> {
    let key = StreamKey::new(seed, index, Purpose::TRUTH);
    let draw =
        |step| Trace::simulate(Arc::clone(code), Draws { key, step, substream: 0 }, limits.clone());
    attempts(RETRIES, draw).map_err(|e| match e.is_recoverable() {
        true => ChainError::Start(StartError::Run(e)),
        false => ChainError::Run(e),
    })
}

fn with_data(
    mut trace: Trace,
    settings: &Settings,
    index: u32,
) -> Result<Simulated, CalibrationError> {
    let refuse = |reason: String| Err(CalibrationError::NotSimulable(reason));
    if trace.code().has_freezes {
        return refuse(
            "`freeze` fixes choices at the start of each chain, so their posterior cannot be checked".into(),
        );
    }
    let drawn = trace.replicate(replicating(settings.seed, index, 0))?;
    if let Some((address, what)) = drawn.silent.first() {
        let more = match drawn.silent.len() {
            1 => String::new(),
            n => format!(" (and {} more)", n - 1),
        };
        return refuse(format!(
            "data cannot be simulated from the program: {address} is {what}, which has no sampler{more}"
        ));
    }
    let all = trace.select(&Selector::All);
    let targets = trace.targets(all).to_vec();
    if let Some(t) = targets.iter().find(|t| trace.dist(**t).is_some_and(|d| d.is_improper())) {
        let address = trace.address(*t);
        return refuse(format!(
            "the prior of {address} is improper, so true values cannot be drawn from it"
        ));
    }
    let given = trace.observed();
    if given.is_empty() {
        return refuse("the program has no observations".into());
    }
    trace.set_observed(&drawn.values)?;
    trace.commit();
    Ok(Simulated { trace, data: Arc::new(drawn.values.into_iter().collect()), given })
}

/// Refuses programs whose set of observations or observed values is random: `a` and `b`
/// are two draws.
pub(super) fn same_data(a: &Simulated, b: &Simulated) -> Result<(), CalibrationError> {
    let refuse = |reason: String| Err(CalibrationError::NotSimulable(reason));
    for (x, y) in [(a, b), (b, a)] {
        for o in &x.given {
            match y.given.iter().find(|p| p.hash == o.hash) {
                None => {
                    return refuse(format!(
                        "whether the observation {} exists depends on random choices: this check \
                         needs a fixed set of observations",
                        o.address
                    ));
                }
                // Objects are equal only if they are identical.
                Some(p) if !p.value.same(&o.value) && !matches!(p.value, Value::Object(_)) => {
                    return refuse(format!(
                        "the value observed by {} depends on random choices, so it is not data",
                        o.address
                    ));
                }
                Some(_) => {}
            }
        }
    }
    Ok(())
}
