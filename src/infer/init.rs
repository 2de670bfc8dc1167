//! Starts: traces of positive probability, and what to say when there is none.

use crate::lang::address::Address;
use crate::lang::code::Code;
use crate::lang::error::RunError;
use crate::rng::{Purpose, StreamKey};
use crate::syntax::span::Span;
use crate::trace::{Draws, Limits, Trace};
use std::fmt;
use std::sync::Arc;

/// How a chain starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// One draw from the prior.
    Prior,
    /// The best of so many, by log joint density.
    BestOf(u64),
}

/// How often a draw from the prior may have no probability before that is an error.
const RETRIES: u64 = 1000;

/// Why a chain cannot start.
#[derive(Debug, Clone)]
pub enum StartError {
    /// The program fails.
    Run(Box<RunError>),
    /// Every draw tried has probability zero.
    Impossible(NoStart),
}

/// What has no probability in the last draw that was tried.
#[derive(Debug, Clone, Default)]
pub struct NoStart {
    /// Observations and factors first, then choices.
    pub terms: Vec<ZeroTerm>,
}

/// A term of the joint density whose logarithm is -∞.
#[derive(Debug, Clone)]
pub struct ZeroTerm {
    /// Its address.
    pub address: Address,
    /// Its place in the program.
    pub span: Span,
}

impl fmt::Display for NoStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "every one of {RETRIES} draws from the prior has probability zero")
    }
}

/// Starts a chain.
///
/// # Errors
/// If the program fails, or if no draw has positive probability within the bounded retries.
pub fn start(code: &Arc<Code>, seed: u64, chain: u32, how: Start, limits: Limits) -> Result<Trace, StartError> {
    let wanted = match how {
        Start::Prior => 1,
        Start::BestOf(n) => n.max(1),
    };
    let key = StreamKey::new(seed, chain, Purpose::START);
    let mut best: Option<Trace> = None;
    let mut found = 0;
    let mut last = None;
    for attempt in 0..wanted + RETRIES {
        match Trace::simulate(Arc::clone(code), Draws { key, step: attempt, lane: 0 }, limits) {
            Ok(t) => {
                let log_joint = t.log_joint();
                if log_joint > f64::NEG_INFINITY {
                    found += 1;
                    if best.as_ref().is_none_or(|b| log_joint > b.log_joint()) {
                        best = Some(t);
                    }
                } else {
                    last = Some(Ok(t));
                }
            }
            Err(e) if e.is_recoverable() => last = Some(Err(e)),
            Err(e) => return Err(StartError::Run(e)),
        }
        // Failures cost attempts too, once there is something to start from.
        if found >= wanted || (found > 0 && attempt + 1 >= wanted) {
            break;
        }
    }
    match (best, last) {
        (Some(t), _) => Ok(t),
        (None, Some(Ok(t))) => Err(StartError::Impossible(explain(&t))),
        (None, Some(Err(e))) => Err(StartError::Run(e)),
        (None, None) => Err(StartError::Impossible(NoStart::default())),
    }
}

/// Which terms of a trace have no probability.
fn explain(t: &Trace) -> NoStart {
    let zero = t.impossible().into_iter().map(|(address, span)| ZeroTerm { address, span });
    NoStart { terms: zero.collect() }
}
