//! The interface of samplers that are tested: they run a chain and report its states.

use crate::callback::Callback;
use crate::draws::Discard;
use crate::kernel::{Kernel, StepContext};
use crate::plan::{SharedStart, run_chain};
use crate::run::{ChainError, Progress, RunOptions};
use crate::{Start, starts};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::trace::{Draws, Limits};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::sync::Arc;

/// A sampler of the posterior of a program.
pub trait Sampler: Sync {
    /// Runs a chain and passes its states, draw by draw, to `callback`, which may replace
    /// the state of the chain. `steps` is the number of kernel applications after
    /// warm-up, in place of the sampler's own. Returns the number made.
    ///
    /// # Errors
    /// If the chain cannot start or fails.
    fn run(
        &self,
        code: &Arc<Code>,
        chain: u32,
        steps: Option<u64>,
        callback: Arc<dyn Callback>,
    ) -> Result<u64, ChainError>;
}

/// A sampler that runs the plan of a program.
pub struct PlanSampler<'a> {
    /// Its `infer` block.
    pub plan: &'a Plan,
    /// Seed, warm-up and limits; steps and callback are set by the check.
    pub options: RunOptions,
    /// Counts steps, and ends chains early when cancelled.
    pub progress: &'a Progress,
}

impl Sampler for PlanSampler<'_> {
    fn run(
        &self,
        code: &Arc<Code>,
        chain: u32,
        steps: Option<u64>,
        callback: Arc<dyn Callback>,
    ) -> Result<u64, ChainError> {
        let options = RunOptions {
            steps: steps.or(self.options.steps),
            callback: Some(callback),
            ..self.options.clone()
        };
        let shared = SharedStart::default();
        let done =
            run_chain(code, self.plan, &options, self.progress, &mut Discard, chain, &shared)?;
        Ok(done.steps)
    }
}

/// A sampler that applies one kernel in a loop from a draw from the prior, for custom
/// kernels.
pub struct KernelSampler<F> {
    /// Constructs the kernel of a chain.
    pub kernel: F,
    /// The seed.
    pub seed: u64,
    /// Applications before the first draw, in which the kernel may adapt.
    pub warmup: u64,
    /// Applications between draws; at least 1.
    pub every: u64,
    /// The number of draws, if the check does not set the number of steps.
    pub draws: u64,
}

impl<F: Fn() -> Box<dyn Kernel> + Sync> Sampler for KernelSampler<F> {
    fn run(
        &self,
        code: &Arc<Code>,
        chain: u32,
        steps: Option<u64>,
        callback: Arc<dyn Callback>,
    ) -> Result<u64, ChainError> {
        let begun = starts(code, self.seed, chain, Start::default(), Limits::default())
            .map_err(ChainError::Start)?;
        let Some(mut trace) = begun.into_iter().next() else { return Ok(0) };
        let mut kernel = (self.kernel)();
        let every = self.every.max(1);
        let steps = steps.unwrap_or(self.draws * every);
        let predict = StreamKey::new(self.seed, chain, Purpose::PREDICT);
        for step in 0..self.warmup + steps {
            let adapting = step < self.warmup;
            kernel.step(
                &mut trace,
                &StepContext { adapting, ..StepContext::new(self.seed, chain, step) },
            )?;
            if !adapting && (step - self.warmup + 1).is_multiple_of(every) {
                callback.draw(chain, &mut trace, Draws { key: predict, step, substream: 0 });
            }
        }
        Ok(steps)
    }
}
