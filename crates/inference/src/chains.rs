//! Runs chains in parallel. Each has its own random streams, so the number of threads
//! affects only the run time.

use super::draws::Sink;
use super::init::draw_once;
use super::parallel::in_parallel;
use super::plan::{SharedStart, run_chain};
use super::run::{ChainError, ChainResult, Progress, RunOptions};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::trace::Limits;
use std::sync::Arc;
use std::time::{Duration, Instant};

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
