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
    /// The seed: same seed, same draws.
    pub seed: u64,
    /// Kernel applications per chain after warm-up, in place of the outermost `repeat`'s
    /// count.
    pub steps: Option<u64>,
    /// Kernel applications per chain in warm-up, in place of what the program says.
    pub warmup: Option<u64>,
    /// Time in all; the run ends at the next step. At most half of it goes to warm-up.
    pub time: Option<Duration>,
    /// False: every update re-runs the whole program.
    pub incremental: bool,
    /// Bounds on what the program may build.
    pub limits: Limits,
    /// What is called at steps and draws.
    pub callback: Option<Arc<dyn Callback>>,
    /// Who finds the neighbours that `knn` proposes from.
    pub banks: Option<Arc<dyn Banks>>,
    /// Whether to count what single-site kernels do by address; it costs a few percent of
    /// a fast step.
    pub sites: bool,
    /// Whether to record the log density of each observed value with every draw, as the
    /// column `log_lik`, where there are at most 1000.
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

/// What is shared between the chains and whoever watches them.
#[derive(Debug, Default)]
pub struct Progress {
    /// Set to end the run at the next step, or after a while in the middle of one.
    pub cancelled: Arc<AtomicBool>,
    /// Counted up to have every chain hand a [`Checkpoint`] to its sink at the next step.
    /// One that ends before its plan does hands one over in any case.
    pub checkpoints: AtomicU64,
    /// Steps of all chains.
    pub steps: AtomicU64,
    /// The best log joint density of any chain, as bits.
    pub best: AtomicU64,
    /// Chains that have found where to start.
    pub started: AtomicU32,
    /// Chains that are in warm-up.
    pub warming: AtomicU32,
    /// Chains that have ended.
    pub ended: AtomicU32,
    /// Passes of the outermost loop that a chain began last, and how many it is to make.
    pub pass: AtomicU64,
    /// See `pass`.
    pub passes: AtomicU64,
}

/// What a chain leaves.
#[derive(Debug)]
pub struct ChainResult {
    /// Its last state.
    pub last: Trace,
    /// The choices of its best recorded draw, and its log joint density.
    pub best: Option<(f64, Vec<(u64, Constraint)>)>,
    /// Kernel applications after and in warm-up.
    pub steps: u64,
    /// See `steps`.
    pub warmup: u64,
    /// Draws recorded.
    pub draws: u64,
    /// What the kernels did.
    pub kernels: Vec<KernelStats>,
    /// What single-site kernels did, by address, if that was asked for.
    pub sites: Vec<SiteStats>,
    /// Wall time.
    pub seconds: f64,
}

/// Why a chain ended early.
#[derive(Debug)]
pub enum ChainError {
    /// It could not start.
    Start(StartError),
    /// The program failed.
    Run(Box<RunError>),
    /// The draws could not be written.
    Sink(std::io::Error),
    /// A checkpoint cannot be gone on from.
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

/// Runs one chain of a plan, or goes on with it from the checkpoint that its sink has.
///
/// # Errors
/// If it cannot start, the program fails, the sink does, or the checkpoint is of another
/// plan.
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

/// Runs a plan from a state there is, in place of a start of its own; what the program
/// forces is not forced again. Streams of random numbers belong to seed, chain and step:
/// two runs from one state need different chains.
///
/// # Errors
/// If the program fails, or the sink does.
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

/// The options of a chain that hears in the middle of an evaluation, too, that it should
/// end.
fn stoppable(options: &RunOptions, progress: &Progress) -> RunOptions {
    let stop =
        options.limits.stop.clone().or(Arc::clone(&progress.cancelled)).or_within(options.time);
    RunOptions { limits: Limits { stop, ..options.limits.clone() }, ..options.clone() }
}

/// Runs a plan from the best of some states.
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

/// The name and arguments of a call.
pub(super) fn call(e: &Expr) -> Option<(&str, &[crate::syntax::ast::Arg])> {
    match &e.kind {
        ExprKind::Call { callee, args } => match &callee.kind {
            ExprKind::Var(name) => Some((name, args)),
            _ => None,
        },
        _ => None,
    }
}

/// An argument by its name or place.
pub(super) fn argument<'a>(
    args: &'a [crate::syntax::ast::Arg],
    place: usize,
    name: &str,
) -> Option<&'a Expr> {
    let named = args.iter().find(|a| a.name.as_ref().is_some_and(|n| &*n.node == name));
    named.or_else(|| args.get(place).filter(|a| a.name.is_none())).map(|a| &a.value)
}
