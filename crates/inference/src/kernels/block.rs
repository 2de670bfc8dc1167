//! Blocked Metropolis-Hastings from the prior: q_block (Kulkarni et al. 2014, section 3).

use super::row::{KernelRow, SEL};
use crate::kernel::{
    Kernel, Outcome, Registered, SiteSelection, StepContext, accept_or_reject, recoverable,
};
use pcadlang_engine::trace::{Trace, TraceResult};

pub(crate) const ROW: KernelRow = KernelRow::new(
    "block",
    &[SEL],
    "Metropolis-Hastings that proposes all selected choices jointly from their prior.",
    "\
assume x ~ normal(0, 1) #pair;
assume y ~ normal(0, 1) #pair;
observe normal(x + y, 1) = 2 as sum;
infer { repeat 100 { block($pair); collect x, y; } }",
    |call| call.moving(|scope, _| Ok(Block::new(scope))),
);

/// `block(sel)`: proposes all selected choices jointly from their priors. Choices that
/// appear or vanish as a result are accounted for in the acceptance ratio, so the
/// selection may change with the state.
#[derive(Clone, Debug)]
pub struct Block {
    scope: Registered,
}

impl Block {
    /// A kernel for these choices.
    pub fn new(scope: SiteSelection) -> Self {
        Block { scope: Registered::new(scope) }
    }
}

impl Kernel for Block {
    fn name(&self) -> String {
        "block".into()
    }

    fn decides_in_stages(&mut self, _: &Trace) -> bool {
        true
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, ways) = self.scope.members(trace, &mut rng);
        if targets.is_empty() {
            return Ok(Outcome::default());
        }
        let proposed = trace.regenerate(&targets, at.draws(0));
        let Some(weight) = recoverable(proposed)? else { return Ok(Outcome::failed()) };
        let ratio = at.tempered(&weight) + ways - self.scope.reverse_selection(trace);
        accept_or_reject(trace, at, ratio, &mut rng)
    }
}
