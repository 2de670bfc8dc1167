//! Chains side by side: each has its own streams, so the number of threads changes nothing but the time.

use super::draws::Sink;
use super::parallel::in_parallel;
use super::plan::{ChainError, ChainResult, Progress, RunOptions, run_chain};
use crate::lang::code::Code;
use crate::syntax::ast::KStmt;
use std::sync::Arc;

/// Runs chains `0 .. chains` of a plan; `sinks` has one sink a chain. All chains run to their end even if one fails. A limit
/// of time is for all of them together: with more chains than threads each gets its share.
pub fn run_chains(
    code: &Arc<Code>,
    plan: &[KStmt],
    options: &RunOptions,
    threads: usize,
    progress: &Progress,
    sinks: Vec<Box<dyn Sink>>,
) -> Vec<Result<ChainResult, ChainError>> {
    let rounds = sinks.len().div_ceil(threads.max(1)).max(1) as u32;
    let options = &RunOptions { time: options.time.map(|t| t / rounds), ..options.clone() };
    let run =
        |(chain, mut sink): (usize, Box<dyn Sink>)| run_chain(code, plan, options, progress, &mut *sink, chain as u32);
    let work: Vec<_> = sinks.into_iter().enumerate().collect();
    in_parallel(threads, work, run)
}
