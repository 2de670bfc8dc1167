//! Initial states: traces of positive probability, and an explanation when none is found.

use super::kernel::StepContext;
use super::kernels::ProgramKernel;
use crate::lang::address::Address;
use crate::lang::code::Code;
use crate::lang::error::RunError;
use crate::lang::value::Value;
use crate::platform::clock::Instant;
use crate::rng::{Purpose, StreamKey};
use crate::syntax::span::Span;
use crate::trace::{Draws, Limits, Trace, TraceResult};
use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// How a chain starts: from the best of a number of draws from the prior, by log joint
/// density.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// The number of draws of positive probability.
    pub draws: u64,
    /// How many of the best are kept: with more than one, warm-up begins with a
    /// population that anneals.
    pub keep: usize,
    /// A time limit: once a draw has succeeded, no further ones are made after it.
    pub within: Option<Duration>,
}

impl Default for Start {
    fn default() -> Self {
        Start { draws: 1, keep: 1, within: None }
    }
}

/// How many draws from the prior may have zero probability before that is an error.
const RETRIES: u64 = 1000;

/// Why a chain cannot start.
#[derive(Debug, Clone)]
pub enum StartError {
    /// The program failed.
    Run(Box<RunError>),
    /// Every draw had probability zero.
    Impossible(NoStart),
}

/// What has zero probability in the last draw.
#[derive(Debug, Clone, Default)]
pub struct NoStart {
    /// Observations and factors first, then choices.
    pub terms: Vec<ZeroTerm>,
    /// The first choices of that draw that are single numbers or truth values, with their
    /// values.
    pub drawn: Vec<(Address, Value)>,
}

/// A term of the joint density whose logarithm is -∞.
#[derive(Debug, Clone)]
pub struct ZeroTerm {
    /// Its address.
    pub address: Address,
    /// Its position in the program.
    pub span: Span,
    /// An observed value outside of the support of its distribution.
    pub outside: Option<String>,
}

impl fmt::Display for NoStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "all {RETRIES} draws from the prior have probability zero")
    }
}

/// Returns the first of at most `most` draws that does not fail with a recoverable error.
///
/// # Errors
/// The last attempt's error, or the first one that is not recoverable.
pub(crate) fn attempts<T>(
    most: u64,
    mut draw: impl FnMut(u64) -> TraceResult<T>,
) -> TraceResult<T> {
    let mut attempt = 0;
    loop {
        match draw(attempt) {
            Err(e) if e.is_recoverable() && attempt + 1 < most => attempt += 1,
            done => return done,
        }
    }
}

/// Draws from the prior and discards the draw, so that values which are computed once and
/// cached with the data are ready. An error is ignored: the chains will report it.
pub(super) fn draw_once(code: &Arc<Code>, seed: u64, limits: Limits) {
    let draws = Draws { key: StreamKey::new(seed, 0, Purpose::START), step: 0, substream: 0 };
    let _ = Trace::simulate(Arc::clone(code), draws, limits);
}

/// The traces a chain starts with, the best first: `how.keep` of them, or fewer if fewer
/// draws succeed.
///
/// # Errors
/// If the program fails, or if no draw has positive probability within a bounded number
/// of attempts.
pub fn starts(
    code: &Arc<Code>,
    seed: u64,
    chain: u32,
    how: Start,
    limits: Limits,
) -> Result<Vec<Trace>, StartError> {
    starts_from(code, (seed, chain), how, None, limits)
}

/// As [`starts`], but each draw is moved to what a kernel of the program proposes from
/// it.
pub(crate) fn starts_from(
    code: &Arc<Code>,
    (seed, chain): (u64, u32),
    how: Start,
    from: Option<&ProgramKernel>,
    limits: Limits,
) -> Result<Vec<Trace>, StartError> {
    let (key, mut begun) = (StreamKey::new(seed, chain, Purpose::START), Instant::now());
    let drawn = |attempt: u64| -> TraceResult<Option<Trace>> {
        let draws = Draws { key, step: attempt, substream: 0 };
        let mut trace = Trace::simulate(Arc::clone(code), draws, limits.clone())?;
        let Some(from) = from else { return Ok(Some(trace)) };
        // Steps of the plan count from 0: this part is distinct from all of them.
        let at = StepContext::new(seed, chain, attempt).within(u64::MAX - 1);
        Ok(from.leap(&mut trace, &at)?.map(|()| trace))
    };
    let mut best: Vec<Trace> = Vec::new();
    let mut found = 0;
    let mut last = None;
    for attempt in 0..how.draws.saturating_add(RETRIES) {
        let draw = drawn(attempt);
        if attempt == 0 {
            // One-time preparation, such as the analysis of a photograph, does not count
            // against the time limit.
            begun = Instant::now();
        }
        match draw {
            Ok(None) => {}
            Ok(Some(t)) if t.log_joint() > f64::NEG_INFINITY => {
                found += 1;
                let place = best.partition_point(|b| b.log_joint() >= t.log_joint());
                if place < how.keep.max(1) {
                    best.insert(place, t);
                    best.truncate(how.keep.max(1));
                }
            }
            Ok(Some(t)) => last = Some(Ok(t)),
            Err(e) if e.is_recoverable() => last = Some(Err(e)),
            Err(e) => return Err(StartError::Run(e)),
        }
        let late = || how.within.is_some_and(|t| begun.elapsed() >= t);
        if found > 0 && (limits.stop.is_asked() || late()) || found == 0 && attempt + 1 >= RETRIES {
            break;
        }
        // Once there is a state to start from, failed attempts count as draws too.
        if found >= how.draws || (found > 0 && attempt + 1 >= how.draws) {
            break;
        }
    }
    match last {
        _ if !best.is_empty() => Ok(best),
        Some(Ok(t)) => Err(StartError::Impossible(explain(&t))),
        Some(Err(e)) => Err(StartError::Run(e)),
        None => Err(StartError::Impossible(NoStart::default())),
    }
}

/// The terms of a trace that have zero probability.
fn explain(t: &Trace) -> NoStart {
    let mut outside: HashMap<Address, String> = t.outside_support().into_iter().collect();
    let zero = t.impossible().into_iter();
    let zero =
        zero.map(|(address, span)| ZeroTerm { outside: outside.remove(&address), address, span });
    let single = |(address, value, _): (Address, Value, _)| match value {
        Value::Num(_) | Value::Bool(_) => Some((address, value)),
        _ => None,
    };
    NoStart {
        terms: zero.collect(),
        drawn: t.choices().into_iter().filter_map(single).take(6).collect(),
    }
}
