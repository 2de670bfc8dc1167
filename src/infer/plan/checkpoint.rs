//! Checkpoints: all the state that a chain needs to resume, with the same draws as
//! without the interruption.
//!
//! Everything else is a function of that state and of the program: a trace is re-run from
//! its choices, with bit-for-bit equal scores and lists of choices in the same order;
//! random streams are determined by step and address; caches are rebuilt.

use super::place::{Doing, PlanPosition};
use super::runner::{Instance, Runner};
use super::{ChainError, Progress, RunOptions};
use crate::infer::draws::{Column, KernelStats, Sink, SiteStats};
use crate::infer::plain::Plain;
use crate::infer::population::Population;
use crate::infer::state::{StateError, holds, pack, unpack};
use crate::lang::code::Code;
use crate::platform::clock::Instant;
use crate::syntax::ast::KStmt;
use crate::trace::{Constraint, Draws, Selector, Trace};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;

type State = Vec<(u64, Constraint)>;

/// A bound on counts: no chain gets this far.
const MOST: u64 = 1 << 60;
/// The most numbers that are recorded with a draw.
const MOST_NUMBERS: usize = 10_000_000;

/// The state of a chain at a step, with all it needs to resume. Valid only with the same
/// program, plan, data and seed; the code that stores it must check that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    seed: u64,
    chain: u32,
    step: u64,
    warmup_steps: u64,
    draws: u64,
    counted: [u64; 3],
    seconds: f64,
    finished: bool,
    power: f64,
    /// The choices.
    state: State,
    best: Option<(f64, State)>,
    population: Population,
    variables: Vec<(Arc<str>, Plain)>,
    path: Vec<PlanPosition>,
    kernels: Vec<SavedKernel>,
    sites: Vec<(u64, SiteStats)>,
    columns: Vec<Column>,
    observed: Option<Vec<(u64, usize)>>,
    frozen: Selector,
    #[serde(rename = "watch")]
    callback: Vec<u8>,
}

/// A kernel of a chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SavedKernel {
    signature: String,
    state: Vec<u8>,
    stats: KernelStats,
}

impl Checkpoint {
    /// The checkpoint of a chain now, inside a statement that has got as far as `doing`;
    /// `None` if any of its variables is not plain data.
    pub(super) fn of(r: &Runner, doing: Option<Doing>) -> Option<Checkpoint> {
        let plain = |(name, v): &(Arc<str>, _)| Some((Arc::clone(name), Plain::of(v)?));
        let variables = r.variables.iter().map(plain).collect::<Option<_>>()?;
        let mut path = r.path.clone();
        if let (Some(last), Some(doing)) = (path.last_mut(), doing) {
            last.doing = doing;
        }
        if path.iter().any(|p| matches!(p.doing, Doing::Items { all: None, .. })) {
            return None;
        }
        let kernel = |i: &Instance| {
            let (state, log_evidence, step_size) = match &i.kernel {
                Some(k) => (k.save(&r.trace), k.log_evidence(), k.step_size()),
                None => (i.saved.clone(), i.stats.log_evidence, i.stats.step_size),
            };
            let stats = KernelStats { log_evidence, step_size, ..i.stats.clone() };
            SavedKernel { signature: i.signature.clone(), state, stats }
        };
        Some(Checkpoint {
            seed: r.options.seed,
            chain: r.chain,
            step: r.step,
            warmup_steps: r.warmup_steps,
            draws: r.draws,
            counted: r.counted,
            seconds: r.started.elapsed().as_secs_f64(),
            finished: r.finished,
            power: r.power,
            state: r.trace.constraints(),
            best: r.best.clone(),
            population: r.population.clone(),
            variables,
            path,
            kernels: r.instances.iter().map(kernel).collect(),
            sites: r.sites.list(),
            columns: r.recorder.columns().to_vec(),
            observed: r.recorder.observed().clone(),
            frozen: r.frozen.clone(),
            callback: r.options.callback.as_ref().map(|w| w.save(r.chain)).unwrap_or_default(),
        })
    }

    /// Serialises the checkpoint.
    pub fn to_bytes(&self) -> Vec<u8> {
        pack(self)
    }

    /// Reads the bytes of [`Checkpoint::to_bytes`].
    ///
    /// # Errors
    /// If the bytes are not a valid checkpoint.
    pub fn from_bytes(bytes: &[u8]) -> Result<Checkpoint, StateError> {
        let c: Checkpoint = unpack(bytes)?;
        let sizes =
            c.columns.iter().try_fold(0usize, |sum, column| sum.checked_add(column.shape.len()));
        let counts = [c.step, c.draws].into_iter().chain(c.path.iter().map(PlanPosition::most));
        let fits = c.warmup_steps <= c.step
            && c.population.fits()
            && sizes.is_some_and(|n| n <= MOST_NUMBERS);
        holds(fits && counts.into_iter().all(|n| n < MOST), "a chain")?;
        Ok(c)
    }

    /// The chain, from 0.
    pub fn chain(&self) -> u32 {
        self.chain
    }

    /// The number of draws so far.
    pub fn draws(&self) -> u64 {
        self.draws
    }

    /// The columns of a draw; empty before the first one.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The number of steps, including warm-up.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Whether the plan is finished.
    pub fn is_finished(&self) -> bool {
        self.finished
    }
}

impl<'a> Runner<'a> {
    /// A chain that resumes from a checkpoint.
    ///
    /// # Errors
    /// If the checkpoint belongs to another seed or chain, or the program fails with its
    /// choices.
    pub fn resume(
        code: &'a Arc<Code>,
        plan: &[KStmt],
        options: &'a RunOptions,
        progress: &'a Progress,
        sink: &'a mut dyn Sink,
        chain: u32,
        c: Checkpoint,
    ) -> Result<Self, ChainError> {
        if (c.seed, c.chain) != (options.seed, chain) {
            let message = format!(
                "the checkpoint belongs to chain {} with seed {}",
                u64::from(c.chain) + 1,
                c.seed
            );
            return Err(StateError::new(message).into());
        }
        let count = c.state.len();
        let (trace, _) =
            Trace::generate(Arc::clone(code), c.state, Draws::default(), options.limits.clone())?;
        if trace.choice_count() != count {
            return Err(
                StateError::new("the checkpoint's choices are not those of the program").into()
            );
        }
        if let Some(callback) = &options.callback {
            callback.load(chain, &c.callback)?;
        }
        let past = Duration::try_from_secs_f64(c.seconds).unwrap_or_default();
        let now = Instant::now();
        let started = now.checked_sub(past).unwrap_or(now);
        let mut runner = Runner::new(
            code,
            plan,
            options,
            progress,
            sink,
            (chain, started),
            (trace, c.population),
        );
        runner.variables = c.variables.into_iter().map(|(name, v)| (name, v.value())).collect();
        runner.resume_path = c.path.into();
        let saved = |k: SavedKernel| Instance {
            signature: k.signature,
            kernel: None,
            saved: k.state,
            stats: k.stats,
        };
        runner.instances = c.kernels.into_iter().map(saved).collect();
        runner.sites.load(c.sites);
        runner.recorder.set_columns(c.columns);
        runner.recorder.set_observed(c.observed);
        runner.frozen = c.frozen;
        runner.counted = c.counted;
        (runner.step, runner.warmup_steps, runner.draws) = (c.step, c.warmup_steps, c.draws);
        (runner.power, runner.best, runner.finished) = (c.power, c.best, c.finished);
        Ok(runner)
    }
}
