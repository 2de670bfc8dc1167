//! Starts: traces of positive probability, and what to say when there is none.

use super::build::arguments;
use super::expr::{Scope, evaluate};
use super::kernel::At;
use super::kernels::Own;
use super::kernels::own::proposes;
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
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// How a chain starts: with the best of so many draws from the prior, by log joint density.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Draws of positive probability that are tried.
    pub draws: u64,
    /// How many of the best are kept: more than one begin a population that anneals in warm-up.
    pub keep: usize,
    /// What tells kinds of draws apart, by its value: those that are kept are the best of each kind, then the second best, and so on.
    pub kinds: Option<Expr>,
    /// No further draws are tried after this, if one was found.
    pub within: Option<Duration>,
}

impl Default for Start {
    fn default() -> Self {
        Start { draws: 1, keep: 1, kinds: None, within: None }
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
    /// The first choices of that draw that are single numbers or truth values, with their values.
    pub drawn: Vec<(Address, Value)>,
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

/// The first of so many attempts at drawing from a prior that leads where the program has a value.
///
/// # Errors
/// The last attempt's, or the first that is not a matter of the values drawn.
pub(crate) fn attempts<T>(most: u64, mut draw: impl FnMut(u64) -> TraceResult<T>) -> TraceResult<T> {
    let mut attempt = 0;
    loop {
        match draw(attempt) {
            Err(e) if e.is_recoverable() && attempt + 1 < most => attempt += 1,
            done => return done,
        }
    }
}

/// The traces a chain starts with, the best first: as many as are to be kept, or fewer if fewer draws succeed.
///
/// # Errors
/// If the program fails, or if no draw has positive probability within the bounded retries.
pub fn starts(code: &Arc<Code>, seed: u64, chain: u32, how: Start, limits: Limits) -> Result<Vec<Trace>, StartError> {
    starts_from(code, (seed, chain), how, None, limits)
}

/// The same, each draw moved by what a kernel of the program proposes there.
pub(crate) fn starts_from(
    code: &Arc<Code>,
    (seed, chain): (u64, u32),
    how: Start,
    from: Option<&Own>,
    limits: Limits,
) -> Result<Vec<Trace>, StartError> {
    let (key, mut begun) = (StreamKey::new(seed, chain, Purpose::START), Instant::now());
    let drawn = |attempt: u64| -> TraceResult<Option<Trace>> {
        let draws = Draws { key, step: attempt, lane: 0 };
        let mut trace = Trace::simulate(Arc::clone(code), draws, limits.clone())?;
        let Some(from) = from else { return Ok(Some(trace)) };
        // Steps of the plan count from 0: this is apart from all of them.
        let at = At::new(seed, chain, attempt).within(u64::MAX - 1);
        Ok(from.leap(&mut trace, &at)?.map(|()| trace))
    };
    let mut best = Best { keep: how.keep.max(1), kinds: Vec::new() };
    let mut found = 0;
    let mut last = None;
    for attempt in 0..how.draws.saturating_add(RETRIES) {
        let draw = drawn(attempt);
        if attempt == 0 {
            // What is made ready once, such as a photograph that is looked at, is no draw.
            begun = Instant::now();
        }
        match draw {
            Ok(None) => {}
            Ok(Some(t)) if t.log_joint() > f64::NEG_INFINITY => {
                found += 1;
                let mut t = t;
                let kind = how.kinds.as_ref().map(|e| {
                    let (draws, started) = (Draws { key, step: attempt, lane: 1 }, begun);
                    let mut env = Scope { code, trace: &mut t, variables: &[], draws, started, steps: 0, moved: None };
                    evaluate(e, &mut env)
                });
                let kind = kind.transpose().map_err(StartError::Run)?.unwrap_or_default();
                best.add(kind, t);
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
        _ if found > 0 => Ok(best.in_turn()),
        Some(Ok(t)) => Err(StartError::Impossible(explain(&t))),
        Some(Err(e)) => Err(StartError::Run(e)),
        None => Err(StartError::Impossible(NoStart::default())),
    }
}

/// The best draws of each kind, and the kinds by their best: as many of both as are kept.
struct Best {
    keep: usize,
    kinds: Vec<(Value, Vec<Trace>)>,
}

impl Best {
    fn add(&mut self, kind: Value, t: Trace) {
        let mut own = match self.kinds.iter().position(|(k, _)| k.same(&kind)) {
            Some(i) => self.kinds.remove(i).1,
            None => Vec::new(),
        };
        let place = own.partition_point(|b| b.log_joint() >= t.log_joint());
        own.insert(place, t);
        own.truncate(self.keep);
        let first = |own: &[Trace]| own.first().map_or(f64::NEG_INFINITY, Trace::log_joint);
        let place = self.kinds.partition_point(|(_, other)| first(other) >= first(&own));
        self.kinds.insert(place, (kind, own));
        self.kinds.truncate(self.keep);
    }

    /// The best of each kind, then the second best of each, as many as are kept; the best of all comes first.
    fn in_turn(self) -> Vec<Trace> {
        let mut kinds: Vec<_> = self.kinds.into_iter().map(|(_, own)| own.into_iter()).collect();
        let mut all = Vec::new();
        while all.len() < self.keep {
            let before = all.len();
            all.extend(kinds.iter_mut().filter_map(Iterator::next).take(self.keep - before));
            if all.len() == before {
                break;
            }
        }
        all
    }
}

/// Which terms of a trace have no probability.
fn explain(t: &Trace) -> NoStart {
    let zero = t.impossible().into_iter().map(|(address, span)| ZeroTerm { address, span });
    let single = |(address, value, _): (Address, Value, _)| match value {
        Value::Num(_) | Value::Bool(_) => Some((address, value)),
        _ => None,
    };
    NoStart { terms: zero.collect(), drawn: t.choices().into_iter().filter_map(single).take(6).collect() }
}

/// What the `init` statement of a plan asks for. Where there is a limit of time, a quarter of it: as much as is left to warm-up.
/// And the kernel whose proposals it takes, if it takes any.
pub(crate) fn start_of(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
) -> Result<(Start, Option<Own>), ChainError> {
    let init = plan.iter().find_map(|s| match &s.kind {
        KStmtKind::Expr(e) => call(e).filter(|(name, _)| *name == "init").map(|(_, args)| (e, args)),
        _ => None,
    });
    let Some((e, args)) = init else { return Ok((Start::default(), None)) };
    let wrong = || ChainError::Run(fail(e.span, "init takes prior() or best_of(n)".into()));
    let [how] = args else { return Err(wrong()) };
    let mut trace = Trace::prior(Arc::clone(code), options.limits.clone());
    let mut count = |e: &Expr| -> Result<u64, ChainError> {
        let (draws, started) = (Draws::default(), Instant::now());
        let mut env = Scope { code, trace: &mut trace, variables: &[], draws, started, steps: 0, moved: None };
        match evaluate(e, &mut env)? {
            Value::Num(x) if x >= 1.0 => Ok(x as u64),
            v => Err(ChainError::Run(fail(e.span, format!("a number of draws was expected, got {v}")))),
        }
    };
    match call(&how.value) {
        Some(("prior", [])) => Ok((Start::default(), None)),
        Some(("best_of", args)) => {
            let draws = argument(args, 0, "n").map_or(Err(wrong()), &mut count)?;
            let keep = argument(args, 1, "keep").map_or(Ok(1), &mut count)?;
            let from = argument(args, 2, "from").map(|e| own(code, e, options)).transpose()?;
            let (keep, within) = (keep.min(draws) as usize, options.time.map(|t| t / 4));
            Ok((Start { draws, keep, kinds: argument(args, 3, "kinds").cloned(), within }, from))
        }
        _ => Err(wrong()),
    }
}

/// The kernel of the program that a start is proposed by.
fn own(code: &Arc<Code>, e: &Expr, options: &RunOptions) -> Result<Own, ChainError> {
    let wrong = || {
        let mut wrong = fail(e.span, "a start is proposed by a kernel of the program".into());
        wrong.hint =
            Some("kernel near() { propose @x ~ normal(2, 0.1); } infer { init(best_of(20, from = near())); … }".into());
        ChainError::Run(wrong)
    };
    let (name, args) = call(e).ok_or_else(wrong)?;
    let declared = code.kernels.iter().find(|k| &*k.name.node == name && proposes(&k.body)).ok_or_else(wrong)?;
    let mut trace = Trace::prior(Arc::clone(code), options.limits.clone());
    let started = Instant::now();
    let (draws, variables) = (Draws::default(), &[]);
    let mut env = Scope { code, trace: &mut trace, variables, draws, started, steps: 0, moved: None };
    let arguments = arguments(declared, args, e.span, &mut env)?;
    Ok(Own::new(Arc::clone(code), declared.clone(), arguments, started))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    fn begun(keep: usize, kinds: Option<&str>) -> Vec<f64> {
        let kinds = kinds.map_or(String::new(), |k| format!(", kinds = {k}"));
        let model = Model::from_text(&format!(
            "assume x ~ uniform(-1, 1); observe normal(x, 0.1) = 0.9;
             infer {{ init(best_of(200, keep = {keep}{kinds})); repeat 1 {{ collect x; }} }}"
        ))
        .unwrap();
        let options = RunOptions::default();
        let (how, from) = start_of(model.code(), &model.plan().unwrap().0, &options).unwrap();
        let traces = starts_from(model.code(), (1, 0), how, from.as_ref(), Limits::default()).unwrap();
        let x = |t: &Trace| match t.value(t.all_targets()[0]) {
            Value::Num(x) => x,
            v => panic!("{v}"),
        };
        traces.iter().map(x).collect()
    }

    /// Without kinds the best are all near the datum; with kinds they take turns, the best of all first.
    #[test]
    fn the_best_of_each_kind_are_kept_in_turn() {
        let all = begun(4, None);
        assert!(all.len() == 4 && all.iter().all(|x| *x > 0.8), "{all:?}");
        let two = begun(4, Some("x > 0"));
        assert_eq!(two.iter().map(|x| *x > 0.0).collect::<Vec<_>>(), [true, false, true, false], "{two:?}");
        assert!(two[0] == all[0] && two[2] == all[1] && two[1] > two[3] && two[1] < 0.0, "{two:?}");
        // More kinds than are kept: the best of the best kinds.
        let many = begun(3, Some("[x > 0.5, x > 0, x > -0.5]"));
        assert!(many[0] == all[0] && many[1] < 0.5 && many[1] > 0.4 && many[2] < 0.0 && many[2] > -0.1, "{many:?}");
        // Fewer draws than are kept.
        assert_eq!(begun(300, Some("x > 0")).len(), 200);
    }
}
