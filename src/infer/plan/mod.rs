//! Running an inference block: one chain, statement by statement.

mod apply;
pub(super) mod banks;
mod checkpoint;
mod place;
mod runner;
mod warmup;

pub use checkpoint::Checkpoint;

use super::callback::Callback;
use super::draws::{KernelStats, Sink, SiteStats};
use super::init::{StartError, start_of, starts_from};
use super::neighbours::Banks;
use super::population::Population;
use super::state::StateError;
use crate::lang::code::Code;
use crate::lang::error::RunError;
use crate::platform::clock::Instant;
use crate::syntax::ast::{Expr, ExprKind, KStmt};
use crate::trace::{Constraint, Limits, Trace};
use runner::Runner;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// Bounds and settings of a run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The seed; the same seed gives the same draws.
    pub seed: u64,
    /// Kernel applications per chain after warm-up, in place of the outermost `repeat`'s
    /// count.
    pub steps: Option<u64>,
    /// Kernel applications per chain in warm-up, in place of the program's count.
    pub warmup: Option<u64>,
    /// The time limit of the whole run, which ends at the next step. At most half of it
    /// goes to warm-up.
    pub time: Option<Duration>,
    /// If false, every update re-runs the whole program.
    pub incremental: bool,
    /// Limits on what the program may build.
    pub limits: Limits,
    /// Called at steps and draws.
    pub callback: Option<Arc<dyn Callback>>,
    /// Finds the neighbours that `knn` proposes from.
    pub banks: Option<Arc<dyn Banks>>,
    /// Whether to count the proposals of single-site kernels by address; this costs a few
    /// percent of a fast step.
    pub sites: bool,
    /// Whether to record the log density of each observed value with every draw, as the
    /// column `log_lik`, if there are at most 1000 of them.
    pub pointwise: bool,
}

impl Default for RunOptions {
    fn default() -> Self {
        RunOptions {
            seed: 0,
            steps: None,
            warmup: None,
            time: None,
            incremental: true,
            limits: Limits::default(),
            callback: None,
            banks: None,
            sites: false,
            pointwise: false,
        }
    }
}

/// State shared between the chains and the code that monitors them.
#[derive(Debug, Default)]
pub struct Progress {
    /// Set it to end the run at the next step, or after a while in the middle of one.
    pub cancelled: Arc<AtomicBool>,
    /// Increment it to make every chain pass a [`Checkpoint`] to its sink at the next
    /// step. A chain that ends before its plan does passes one in any case.
    pub checkpoints: AtomicU64,
    /// Steps of all chains.
    pub steps: AtomicU64,
    /// The best log joint density of any chain, as bits of an `f64`.
    pub best: AtomicU64,
    /// Chains that have an initial state.
    pub started: AtomicU32,
    /// Chains that are in warm-up.
    pub warming: AtomicU32,
    /// Chains that have ended.
    pub ended: AtomicU32,
    /// The pass of an outermost loop that a chain began last, and the number of passes of
    /// that loop.
    pub pass: AtomicU64,
    /// See `pass`.
    pub passes: AtomicU64,
}

/// The result of a chain.
#[derive(Debug)]
pub struct ChainResult {
    /// The last state.
    pub last: Trace,
    /// The choices of the best recorded draw, with its log joint density.
    pub best: Option<(f64, Vec<(u64, Constraint)>)>,
    /// Kernel applications after warm-up, and in it.
    pub steps: u64,
    /// See `steps`.
    pub warmup: u64,
    /// The number of draws recorded.
    pub draws: u64,
    /// What the kernels did.
    pub kernels: Vec<KernelStats>,
    /// What single-site kernels did, by address, if [`RunOptions::sites`] is set.
    pub sites: Vec<SiteStats>,
    /// Wall time.
    pub seconds: f64,
}

/// Why a chain ended early.
#[derive(Debug)]
pub enum ChainError {
    /// The chain could not start.
    Start(StartError),
    /// The program failed.
    Run(Box<RunError>),
    /// The draws could not be written.
    Sink(std::io::Error),
    /// The chain cannot resume from the checkpoint.
    Checkpoint(StateError),
}

impl From<StateError> for ChainError {
    fn from(e: StateError) -> Self {
        ChainError::Checkpoint(e)
    }
}

impl From<Box<RunError>> for ChainError {
    fn from(e: Box<RunError>) -> Self {
        ChainError::Run(e)
    }
}

/// Runs one chain of a plan, or resumes it from the checkpoint of its sink.
///
/// # Errors
/// If the chain cannot start, the program or the sink fails, or the checkpoint belongs to
/// another plan.
pub(crate) fn run_chain(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    chain: u32,
) -> Result<ChainResult, ChainError> {
    let started = Instant::now();
    let options = &stoppable(options, progress);
    if let Some(checkpoint) = sink.resume().map_err(ChainError::Sink)? {
        banks::check(plan, options)?;
        return Runner::resume(code, plan, options, progress, sink, chain, checkpoint)?.run(plan);
    }
    let (how, from) = start_of(code, plan, options)?;
    banks::check(plan, options)?;
    let mut begun =
        starts_from(code, (options.seed, chain), how, from.as_ref(), options.limits.clone())
            .map_err(ChainError::Start)?;
    for trace in &mut begun {
        super::force::apply(code, trace, options, chain)?;
    }
    run_among(code, plan, options, progress, sink, (chain, started), begun)
}

/// Runs a plan from a given state, in place of a start from the prior; `force` statements
/// of the program are not applied again. Streams of random numbers are determined by
/// seed, chain and step: two runs from one state need different chain numbers.
///
/// # Errors
/// If the program or the sink fails.
pub fn run_from(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    chain: u32,
    mut trace: Trace,
) -> Result<ChainResult, ChainError> {
    let started = Instant::now();
    let options = &stoppable(options, progress);
    banks::check(plan, options)?;
    trace.rollback();
    trace.set_limits(options.limits.clone());
    run_among(code, plan, options, progress, sink, (chain, started), vec![trace])
}

/// The options of a chain, with limits by which it can also be stopped in the middle of
/// an evaluation.
fn stoppable(options: &RunOptions, progress: &Progress) -> RunOptions {
    let stop =
        options.limits.stop.clone().or(Arc::clone(&progress.cancelled)).or_within(options.time);
    RunOptions { limits: Limits { stop, ..options.limits.clone() }, ..options.clone() }
}

/// Runs a plan from the best of several states.
fn run_among(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    (chain, started): (u32, Instant),
    mut begun: Vec<Trace>,
) -> Result<ChainResult, ChainError> {
    let population = Population::new(&begun);
    let trace = begun.swap_remove(0);
    let mut runner =
        Runner::new(code, plan, options, progress, sink, (chain, started), (trace, population));
    progress.started.fetch_add(1, Ordering::Relaxed);
    let done = runner.freeze().and_then(|()| runner.run(plan));
    progress.ended.fetch_add(1, Ordering::Relaxed);
    done
}

/// The name and arguments of a call of a named function.
pub(super) fn call(e: &Expr) -> Option<(&str, &[crate::syntax::ast::Arg])> {
    match &e.kind {
        ExprKind::Call { callee, args } => match &callee.kind {
            ExprKind::Var(name) => Some((name, args)),
            _ => None,
        },
        _ => None,
    }
}

/// Finds an argument by name or position.
pub(super) fn argument<'a>(
    args: &'a [crate::syntax::ast::Arg],
    place: usize,
    name: &str,
) -> Option<&'a Expr> {
    let named = args.iter().find(|a| a.name.as_ref().is_some_and(|n| &*n.node == name));
    named.or_else(|| args.get(place).filter(|a| a.name.is_none())).map(|a| &a.value)
}
