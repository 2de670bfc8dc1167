//! Starts: traces of positive probability, and what to say when there is none.

use super::build::arguments;
use super::expr::{PlanEnv, evaluate};
use super::kernel::StepContext;
use super::kernels::ProgramKernel;
use super::kernels::program_kernel::proposes;
use super::plan::{ChainError, RunOptions, argument, call};
use super::selection::fail;
use crate::lang::address::Address;
use crate::lang::code::Code;
use crate::lang::error::RunError;
use crate::lang::value::Value;
use crate::platform::clock::Instant;
use crate::rng::{Purpose, StreamKey};
use crate::syntax::ast::{Expr, KStmt, KStmtKind};
use crate::syntax::span::Span;
use crate::trace::{Draws, Limits, Trace, TraceResult};
use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// How a chain starts: with the best of so many draws from the prior, by log joint
/// density.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// Draws of positive probability that are tried.
    pub draws: u64,
    /// How many of the best are kept: more than one begin a population that anneals in
    /// warm-up.
    pub keep: usize,
    /// No further draws are tried after this, if one was found.
    pub within: Option<Duration>,
}

impl Default for Start {
    fn default() -> Self {
        Start { draws: 1, keep: 1, within: None }
    }
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
    /// The first choices of that draw that are single numbers or truth values, with their
    /// values.
    pub drawn: Vec<(Address, Value)>,
}

/// A term of the joint density whose logarithm is -∞.
#[derive(Debug, Clone)]
pub struct ZeroTerm {
    /// Its address.
    pub address: Address,
    /// Its place in the program.
    pub span: Span,
    /// What is observed there that its distribution cannot give.
    pub outside: Option<String>,
}

impl fmt::Display for NoStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "all {RETRIES} draws from the prior have probability zero")
    }
}

/// The first of so many attempts at drawing from a prior that leads where the program has
/// a value.
///
/// # Errors
/// The last attempt's, or the first that is not a matter of the values drawn.
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

/// Draws from the prior and keeps nothing, for what is worked out once and kept by the
/// data: a failure is for the chains to tell.
pub(super) fn draw_once(code: &Arc<Code>, seed: u64, limits: Limits) {
    let draws = Draws { key: StreamKey::new(seed, 0, Purpose::START), step: 0, substream: 0 };
    let _ = Trace::simulate(Arc::clone(code), draws, limits);
}

/// The traces a chain starts with, the best first: as many as are to be kept, or fewer if
/// fewer draws succeed.
///
/// # Errors
/// If the program fails, or if no draw has positive probability within the bounded
/// retries.
pub fn starts(
    code: &Arc<Code>,
    seed: u64,
    chain: u32,
    how: Start,
    limits: Limits,
) -> Result<Vec<Trace>, StartError> {
    starts_from(code, (seed, chain), how, None, limits)
}

/// The same, each draw moved by what a kernel of the program proposes there.
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
        // Steps of the plan count from 0: this is apart from all of them.
        let at = StepContext::new(seed, chain, attempt).within(u64::MAX - 1);
        Ok(from.leap(&mut trace, &at)?.map(|()| trace))
    };
    let mut best: Vec<Trace> = Vec::new();
    let mut found = 0;
    let mut last = None;
    for attempt in 0..how.draws.saturating_add(RETRIES) {
        let draw = drawn(attempt);
        if attempt == 0 {
            // What is made ready once, such as a photograph that is looked at, is no
            // draw.
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
        // Failures cost attempts too, once there is something to start from.
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

/// Which terms of a trace have no probability.
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

/// What the `init` statement of a plan asks for. Where there is a limit of time, a
/// quarter of it: as much as is left to warm-up. And the kernel whose proposals it takes,
/// if it takes any.
pub(crate) fn start_of(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
) -> Result<(Start, Option<ProgramKernel>), ChainError> {
    let init = plan.iter().find_map(|s| match &s.kind {
        KStmtKind::Expr(e) => {
            call(e).filter(|(name, _)| *name == "init").map(|(_, args)| (e, args))
        }
        _ => None,
    });
    let Some((e, args)) = init else { return Ok((Start::default(), None)) };
    let wrong = || ChainError::Run(fail(e.span, "init takes prior() or best_of(n)".into()));
    let [how] = args else { return Err(wrong()) };
    let mut trace = Trace::prior(Arc::clone(code), options.limits.clone());
    let mut count = |e: &Expr| -> Result<u64, ChainError> {
        let (draws, started) = (Draws::default(), Instant::now());
        let mut env = PlanEnv {
            code,
            trace: &mut trace,
            variables: &[],
            draws,
            started,
            steps: 0,
            moved: None,
        };
        match evaluate(e, &mut env)? {
            Value::Num(x) if x >= 1.0 => Ok(x as u64),
            v => Err(ChainError::Run(fail(e.span, format!("expected a number of draws, got {v}")))),
        }
    };
    match call(&how.value) {
        Some(("prior", [])) => Ok((Start::default(), None)),
        Some(("best_of", args)) => {
            let draws = argument(args, 0, "n").map_or(Err(wrong()), &mut count)?;
            let keep = argument(args, 1, "keep").map_or(Ok(1), &mut count)?;
            let from = argument(args, 2, "from").map(|e| own(code, e, options)).transpose()?;
            Ok((
                Start {
                    draws,
                    keep: keep.min(draws) as usize,
                    within: options.time.map(|t| t / 4),
                },
                from,
            ))
        }
        _ => Err(wrong()),
    }
}

/// The kernel of the program that a start is proposed by.
fn own(code: &Arc<Code>, e: &Expr, options: &RunOptions) -> Result<ProgramKernel, ChainError> {
    let wrong = || {
        let mut wrong = fail(e.span, "`from` takes a kernel declared in the program".into());
        wrong.hint =
            Some("kernel near() { propose @x ~ normal(2, 0.1); } infer { init(best_of(20, from = near())); … }".into());
        ChainError::Run(wrong)
    };
    let (name, args) = call(e).ok_or_else(wrong)?;
    let declared = code
        .kernels
        .iter()
        .find(|k| &*k.name.node == name && proposes(&k.body))
        .ok_or_else(wrong)?;
    let mut trace = Trace::prior(Arc::clone(code), options.limits.clone());
    let started = Instant::now();
    let (draws, variables) = (Draws::default(), &[]);
    let mut env =
        PlanEnv { code, trace: &mut trace, variables, draws, started, steps: 0, moved: None };
    let arguments = arguments(declared, args, e.span, &mut env)?;
    Ok(ProgramKernel::new(Arc::clone(code), declared.clone(), arguments, started))
}
