//! Single-site Metropolis-Hastings from the prior: q_single of Kulkarni et al. 2014,
//! section 3.

use super::row::{KernelRow, SEL, number};
use crate::kernel::{
    Kernel, Outcome, Registered, SiteSelection, StepContext, accept_or_reject, recoverable,
};
use pcadlang_engine::trace::{Change, Trace, TraceResult};

pub(crate) const ROW: KernelRow = KernelRow::new(
    "mh",
    &[SEL],
    "Metropolis-Hastings that proposes a single selected choice from its prior.",
    number!("infer { repeat 100 { mh(@x); collect x; } }"),
    |call| call.moving(|scope, _| Ok(Mh::new(scope))),
);

/// `mh(sel)`: proposes one choice from its prior, given the rest.
#[derive(Clone, Debug)]
pub struct Mh {
    scope: Registered,
}

impl Mh {
    /// A kernel for one of these choices at a time.
    pub fn new(scope: SiteSelection) -> Self {
        Mh { scope: Registered::new(scope.single()) }
    }
}

impl Kernel for Mh {
    fn name(&self) -> String {
        "mh".into()
    }

    fn decides_in_stages(&mut self, _: &Trace) -> bool {
        true
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let Some((target, n)) = self.scope.pick(trace, &mut rng) else {
            return Ok(Outcome::default());
        };
        let proposed = trace.propose(&[(target, Change::Resample)], at.draws(0));
        let Some(weight) = recoverable(proposed)? else { return Ok(Outcome::failed().at(target)) };
        let ratio =
            at.tempered(&weight) + libm::log(n as f64) - self.scope.reverse_selection(trace);
        Ok(accept_or_reject(trace, at, ratio, &mut rng)?.at(target))
    }
}
