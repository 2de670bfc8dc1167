//! Running a compiled inference block on a chain, step by step.

mod apply;
pub(super) mod checkpoint;
mod place;
mod resume;
mod runner;
mod start;
mod warmup;

use super::draws::Sink;
use super::force::Forced;
use super::init::{Start, StartError, starts_from};
use super::population::Population;
use super::run::{ChainError, ChainResult, Progress, RunOptions};
use crate::calls::build::KernelMaker;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::{Callee, Plan, Step};
use pcadlang_engine::trace::{Limits, Trace};
use pcadlang_numerics::platform::clock::Instant;
use runner::Runner;
pub(crate) use start::SharedStart;
use start::start_of;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Runs one chain of a plan, or resumes it from the checkpoint of its sink. Chains share
/// how they start.
///
/// # Errors
/// If the chain cannot start, the program or the sink fails, or the checkpoint belongs to
/// another plan.
pub(crate) fn run_chain(
    code: &Arc<Code>,
    plan: &Plan,
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    chain: u32,
    shared: &SharedStart,
) -> Result<ChainResult, ChainError> {
    let started = Instant::now();
    let options = &stoppable(options, progress);
    if let Some(checkpoint) = sink.resume().map_err(ChainError::Sink)? {
        check(code, &plan.steps, options)?;
        return Runner::resume(code, plan, options, progress, sink, chain, checkpoint)?.run();
    }
    let (how, from, forced) = shared.get(|| start_of(code, plan, options))?;
    // Under a time limit a quarter of it is for the start, as much as that leaves to warm-up.
    let within = options.time.filter(|_| options.warmup.is_none()).map(|t| t / 4);
    let how = Start { within, least: options.search.draws, ..how };
    check(code, &plan.steps, options)?;
    let (seeded, limits) = ((options.seed, chain), &options.limits);
    let start = |forced| starts_from(code, seeded, how, (from.as_ref(), forced), limits.clone());
    // What is forced may contradict the observations; the chain then starts without it.
    let (begun, contradicted) = match start(&forced) {
        Err(StartError::Impossible(by)) if !forced.is_empty() => {
            (start(&Forced::default()), Some(by))
        }
        begun => (begun, None),
    };
    let begun = begun.map_err(ChainError::Start)?;
    let done = run_among(code, plan, options, progress, sink, (chain, started), begun)?;
    Ok(ChainResult { contradicted, ..done })
}

/// Runs a plan from a given state, in place of a start from the prior; `force` statements
/// of the program are not applied again. Streams of random numbers are determined by
/// seed, chain and step: two runs from one state need different chain numbers.
///
/// # Errors
/// If the program or the sink fails.
pub fn run_from(
    code: &Arc<Code>,
    plan: &Plan,
    options: &RunOptions,
    progress: &Progress,
    sink: &mut dyn Sink,
    chain: u32,
    mut trace: Trace,
) -> Result<ChainResult, ChainError> {
    let started = Instant::now();
    let options = &stoppable(options, progress);
    check(code, &plan.steps, options)?;
    trace.rollback();
    trace.set_limits(options.limits.clone());
    run_among(code, plan, options, progress, sink, (chain, started), vec![trace])
}

/// Checks the calls of kernels, as far as these can before a chain begins.
fn check(code: &Code, steps: &[Step], options: &RunOptions) -> Result<(), Box<RunError>> {
    for step in steps {
        for call in step.calls() {
            if let Callee::Builtin(i) = call.kernel
                && let Some(check) = KernelMaker::of(code.builtins.get(i)).and_then(|m| m.check)
            {
                check(call, options)?;
            }
        }
        check(code, step.body(), options)?;
    }
    Ok(())
}

/// The time limit in which evaluations must end from the beginning of a chain on. If the start
/// and the warm-up are made whatever time they take, only what follows is limited.
fn search_time(options: &RunOptions) -> Option<Duration> {
    options.time.filter(|_| options.warmup.is_none() && options.search.warmup == 0)
}

/// The options of a chain, with limits by which it can also be stopped in the middle of
/// an evaluation.
fn stoppable(options: &RunOptions, progress: &Progress) -> RunOptions {
    let stop = options.limits.stop.clone().or(Arc::clone(&progress.cancelled));
    let stop = stop.or_within(search_time(options));
    RunOptions { limits: Limits { stop, ..options.limits.clone() }, ..options.clone() }
}

/// Runs a plan from the best of several states.
fn run_among(
    code: &Arc<Code>,
    plan: &Plan,
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
    let done = runner.freeze().and_then(|()| runner.run());
    progress.ended.fetch_add(1, Ordering::Relaxed);
    done
}
