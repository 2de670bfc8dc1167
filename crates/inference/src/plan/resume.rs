//! Interrupting a chain and resuming it: from a runner to a checkpoint, and back.

use super::checkpoint::{Checkpoint, SavedKernel};
use super::place::ResumePoint;
use super::runner::{Instance, Runner};
use crate::draws::Sink;
use crate::plain::Plain;
use crate::run::{ChainError, Progress, RunOptions};
use crate::state::StateError;
use crate::stats::KernelStats;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_numerics::platform::clock::Instant;
use std::sync::Arc;
use std::time::Duration;

impl<'a> Runner<'a> {
    /// The checkpoint of a chain now, inside a statement that has got as far as `point`;
    /// `None` if any of its variables is not plain data.
    pub fn checkpoint(&self, point: Option<ResumePoint>) -> Option<Checkpoint> {
        let variables = self.variables.iter().map(Plain::of).collect::<Option<_>>()?;
        let mut path = self.path.clone();
        if let (Some(last), Some(point)) = (path.last_mut(), point) {
            last.point = point;
        }
        if path.iter().any(|p| matches!(p.point, ResumePoint::Items { all: None, .. })) {
            return None;
        }
        let kernel = |i: &Instance| {
            let (state, log_evidence, step_size) = match &i.kernel {
                Some(k) => (k.save(&self.trace), k.log_evidence(), k.step_size()),
                None => (i.saved.clone(), i.stats.log_evidence, i.stats.step_size),
            };
            let stats = KernelStats { log_evidence, step_size, ..i.stats.clone() };
            SavedKernel { signature: i.signature.clone(), state, stats }
        };
        Some(Checkpoint {
            seed: self.options.seed,
            chain: self.chain,
            step: self.step,
            warmup_steps: self.warmup_steps,
            draws: self.draws,
            counted: self.counted,
            seconds: self.started.elapsed().as_secs_f64(),
            finished: self.finished,
            power: self.power,
            state: self.trace.constraints(),
            coarse: self.trace.coarse_state(),
            best: self.best.clone(),
            population: self.population.clone(),
            variables,
            path,
            kernels: self.instances.iter().map(kernel).collect(),
            sites: self.sites.list(),
            columns: self.recorder.columns().to_vec(),
            observed: self.recorder.observed().clone(),
            frozen: self.frozen.clone(),
            callback: self
                .options
                .callback
                .as_ref()
                .map(|w| w.save(self.chain))
                .unwrap_or_default(),
        })
    }

    /// A chain that resumes from a checkpoint.
    ///
    /// # Errors
    /// If the checkpoint belongs to another seed or chain, or the program fails with its
    /// choices.
    pub fn resume(
        code: &'a Arc<Code>,
        plan: &'a Plan,
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
        let (mut trace, _) =
            Trace::generate(Arc::clone(code), c.state, Draws::default(), options.limits.clone())?;
        trace.restore_coarse(&c.coarse);
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
        runner.variables = c.variables.iter().map(Plain::value).collect();
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
