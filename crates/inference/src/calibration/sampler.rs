//! The interface of samplers that are tested: they run a chain and report its states.

use crate::callback::Callback;
use crate::draws::Discard;
use crate::plan::{SharedStart, run_chain};
use crate::run::{ChainError, Progress, RunOptions};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::plan::Plan;
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
