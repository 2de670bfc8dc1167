//! A run of chains: its settings, progress, results and errors. Chains run in parallel; each
//! has its own random streams, so the number of threads affects only the run time.

use super::callback::Callback;
use super::draws::Sink;
use super::init::{NoStart, StartError, draw_once};
use super::neighbours::Banks;
use super::parallel::in_parallel;
use super::pause::Pause;
use super::plan::{SharedStart, run_chain};
use super::state::StateError;
use super::stats::{KernelStats, SiteStats};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::trace::{Constraint, Limits, Trace};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};
use std::time::{Duration, Instant};

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
    /// goes to the start and the warm-up, unless the steps of the warm-up are given, which are
    /// made in any case, or `search` says more. Each phase makes at least one step.
    pub time: Option<Duration>,
    /// What the start and the warm-up make however little time there is.
    pub search: Search,
    /// If false, every update re-runs the whole program.
    pub incremental: bool,
    /// Limits on what the program may build.
    pub limits: Limits,
    /// Called at steps and draws.
    pub callback: Option<Arc<dyn Callback>>,
    /// Finds the neighbours that `knn` proposes from.
    pub banks: Option<Arc<dyn Banks>>,
    /// True to count the proposals of single-site kernels by address; this costs a few
    /// percent of a fast step.
    pub sites: bool,
    /// True to record the log density of each observed value with every draw, as the
    /// column `log_lik`, if there are at most 1000 of them.
    pub pointwise: bool,
    /// The number of the first chain. Chains with the same seed and number have the same
    /// draws, so that the chains of a run can be spread over several calls or machines.
    pub first_chain: u32,
}

impl Default for RunOptions {
    fn default() -> Self {
        RunOptions {
            seed: 0,
            steps: None,
            warmup: None,
            time: None,
            search: Search::default(),
            incremental: true,
            limits: Limits::default(),
            callback: None,
            banks: None,
            sites: false,
            pointwise: false,
            first_chain: 0,
        }
    }
}

/// The least that a chain makes of a search for where the posterior is, under a time limit: on a
/// busy machine it takes longer, and time limits what follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Search {
    /// Draws of the start, of those that the plan says.
    pub draws: u64,
    /// Steps of the warm-up, of those that the plan says.
    pub warmup: u64,
}

/// State shared between the chains and the code that monitors them.
#[derive(Debug, Default)]
pub struct Progress {
    /// Set it to end the run at the next step, or after a while in the middle of one.
    pub cancelled: Arc<AtomicBool>,
    /// Increment it to make every chain pass a [`Checkpoint`](super::Checkpoint) to its sink at the next
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
    /// Holds the chains between two kernel applications.
    pub pause: Pause,
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
    /// The observations whose log densities are recorded: a hash of each one's address, and its
    /// number of values.
    pub observed: Option<Vec<(u64, usize)>>,
    /// Counts of what the kernels did.
    pub kernels: Vec<KernelStats>,
    /// Counts of single-site kernels, by address, if [`RunOptions::sites`] is set.
    pub sites: Vec<SiteStats>,
    /// Wall time.
    pub seconds: f64,
    /// The terms with probability zero in all states with the values that `force` sets, so that the
    /// chain started without them.
    pub contradicted: Option<NoStart>,
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

impl ChainError {
    /// True if the chain found no state to start from. Another chain may find one, so that this
    /// must not lose the draws of the others.
    #[doc(hidden)]
    pub fn is_of_the_start(&self) -> bool {
        match self {
            ChainError::Start(StartError::Run(e)) => e.is_recoverable(),
            ChainError::Start(StartError::Impossible(_)) => true,
            _ => false,
        }
    }
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

/// Runs chains of a plan, numbered from [`RunOptions::first_chain`]; `sinks` has one sink per
/// chain. All chains run to
/// their end even if one fails. A time limit applies to all of them together: with more
/// chains than threads, each gets its part of what is left once the data are ready.
pub fn run_chains(
    code: &Arc<Code>,
    plan: &Plan,
    options: &RunOptions,
    threads: usize,
    progress: &Progress,
    sinks: Vec<Box<dyn Sink>>,
) -> Vec<Result<ChainResult, ChainError>> {
    let rounds = sinks.len().div_ceil(threads.max(1)).max(1) as u32;
    let shared = SharedStart::default();
    let prepare = || shared.prepare(code, plan, options);
    let time = options.time.map(|t| share(code, options, t, rounds, prepare));
    let options = &RunOptions { time, ..options.clone() };
    let run = |(chain, mut sink): (u32, Box<dyn Sink>)| {
        run_chain(code, plan, options, progress, &mut *sink, chain, &shared)
    };
    let work: Vec<_> = (options.first_chain..).zip(sinks).collect();
    in_parallel(threads, work, run)
}

/// The time limit of a chain, when chains run in `rounds` rounds. Values that are
/// computed once, such as the people in a photograph or what chains start from, are computed
/// before the chains begin; otherwise the first chain of each thread would pay for them and
/// have less time than later ones.
fn share(
    code: &Arc<Code>,
    options: &RunOptions,
    time: Duration,
    rounds: u32,
    prepare: impl FnOnce(),
) -> Duration {
    if rounds == 1 {
        return time;
    }
    let begun = Instant::now();
    let limits = options.limits.clone();
    draw_once(
        code,
        options.seed,
        Limits { stop: limits.stop.clone().or_within(Some(time)), ..limits },
    );
    prepare();
    time.saturating_sub(begun.elapsed()) / rounds
}
