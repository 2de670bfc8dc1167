//! `delayed(move, at, then)`: delayed acceptance (Christen & Fox 2005) in the form of surrogate
//! transitions (Liu 2001, section 9.4.3).
//!
//! Beside the chain's trace there is a second one, in which the coarse surrogates of the
//! observations at `at` replace them. The inner kernel moves the surrogate trace, with
//! its own acceptance test; only moves that it accepts are proposed to the chain's trace,
//! where the ratio (fine change / coarse change) decides. With any inner kernel that is
//! reversible under the surrogate this leaves the posterior invariant, however poor the
//! surrogate is, as long as it has positive density wherever the observation has. The
//! observation itself is evaluated only for moves that pass the first stage.
//!
//! Where the surrogates are `flat()` and the inner kernel makes one proposal, there is no second
//! trace: the observations wait until everything else has been tested. A first stage cannot tell
//! whether the structure will change, so such moves are rejected while something waits; one step
//! of [`STRUCTURAL`], chosen at random, waits for nothing.

use super::row::{Built, INNER, KernelRow, Type, arg, opt};
use crate::calls::error::fail;
use crate::kernel::{Kernel, Outcome, StepContext, accept_or_reject, recoverable};
use crate::state::StateError;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::ids::OpId;
use pcadlang_engine::trace::{Selector, Trace, TraceResult};
use pcadlang_syntax::span::Span;
use std::sync::Arc;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "delayed",
    &[
        INNER,
        arg("at", Type::Selection, "The observation with a coarse surrogate."),
        opt("then", Type::Selection, "none", "Others, which are compared after those."),
    ],
    "Delayed acceptance: proposals are screened by the surrogate of `observe … with coarse = \
     …`; only those that pass are evaluated under the observation itself (Christen and Fox \
     2005). Exact for any surrogate that is positive wherever the likelihood is. Under `flat()` the \
     observation waits until everything else has been tested; moves that change which choices \
     there are pass in one step of sixteen, in which nothing waits.",
    "\
assume x ~ normal(0, 1);
observe normal(x, 1) = 2 with coarse = normal(x, 1.5) as y;
infer { repeat 100 { delayed(mh(@x), at = @y); collect x; } }",
    |call| {
        let inner = call.inner()?;
        let (at, then) = (call.selector("at")?, call.selector("then")?);
        let (mut kernel, mut signature) = (inner.kernel, inner.signature);
        for stage in [at, then].into_iter().filter(|stage| *stage != Selector::Nothing) {
            signature = format!("delayed({signature}, {stage:?})");
            kernel = Box::new(Delayed::new(kernel, stage, call.span()));
        }
        Ok(Built { kernel, signature })
    },
)
.of_reversible("delayed(drift(@x), @obs)");

/// Of this many steps one may change which choices and observations there are.
const STRUCTURAL: u64 = 16;

/// Two-stage acceptance with a reversible inner kernel.
pub struct Delayed {
    kernel: Box<dyn Kernel>,
    /// The observations whose surrogates are used in the first stage.
    observations: Selector,
    span: Span,
    /// The trace under the surrogates.
    surrogate: Option<Trace>,
    /// The observations that wait, where there is no second trace; `None` if not known yet.
    waiting: Option<Option<Arc<[OpId]>>>,
}

impl Delayed {
    /// `observations` are those that have surrogates; `span` is the position that errors
    /// refer to.
    pub fn new(kernel: Box<dyn Kernel>, observations: Selector, span: Span) -> Self {
        Delayed { kernel, observations, span, surrogate: None, waiting: None }
    }

    /// Moves the surrogate trace to the present state.
    fn follow(&mut self, trace: &mut Trace) -> TraceResult<&mut Trace> {
        trace.rollback();
        let mut surrogate = match self.surrogate.take() {
            Some(surrogate) => surrogate,
            None => {
                trace.under_surrogates(&self.observations)?.ok_or_else(|| self.nothing_coarse())?
            }
        };
        surrogate.observe_as(trace)?;
        surrogate.propose_choices_of(trace)?;
        surrogate.commit();
        if let Some(extra) = trace.lacks(&surrogate) {
            let address = surrogate.address(extra);
            return Err(fail(
                self.span,
                format!("delayed: only the surrogate depends on the choice {address}"),
            ));
        }
        Ok(self.surrogate.insert(surrogate))
    }

    /// The observations that wait, if there is no second trace.
    fn waiting(&mut self, trace: &Trace) -> Option<Arc<[OpId]>> {
        if self.waiting.is_none() {
            let flat = trace.flat_surrogates(&self.observations);
            self.waiting = Some(flat.filter(|_| self.kernel.decides_in_stages(trace)));
        }
        self.waiting.clone().flatten()
    }

    fn nothing_coarse(&self) -> Box<RunError> {
        let mut e =
            fail(self.span, "delayed: no selected observation has a coarse surrogate".into());
        e.hint = Some(
            "observe normal(x, 1) = 2 with coarse = normal(x, 2) as y; … delayed(…, @y)".into(),
        );
        e
    }
}

/// The log prior plus the log likelihood raised to a power.
fn tempered(trace: &Trace, power: f64) -> f64 {
    let likelihood = if power == 0.0 { 0.0 } else { power * trace.log_likelihood() };
    trace.log_prior() + likelihood
}

impl Kernel for Delayed {
    fn name(&self) -> String {
        format!("delayed {}", self.kernel.name())
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        self.kernel.save(self.surrogate.as_ref().unwrap_or(trace))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        self.kernel.load(state)
    }

    fn decides_in_stages(&mut self, trace: &Trace) -> bool {
        self.waiting(trace).is_some()
    }

    fn sweep(&mut self, trace: &mut Trace, after: Option<u64>) -> Option<usize> {
        if self.waiting(trace).is_some() {
            return self.kernel.sweep(trace, after);
        }
        // Errors are reported by the step.
        self.follow(trace).ok()?;
        self.kernel.sweep(self.surrogate.as_mut()?, after)
    }

    fn remaining(&mut self, trace: &mut Trace) -> usize {
        if self.waiting(trace).is_some() {
            return self.kernel.remaining(trace);
        }
        self.surrogate.as_mut().map_or(0, |surrogate| self.kernel.remaining(surrogate))
    }

    fn visited(&mut self, trace: &Trace) -> Option<u64> {
        if self.waiting(trace).is_some() {
            return self.kernel.visited(trace);
        }
        self.kernel.visited(self.surrogate.as_ref()?)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        if let Some(waiting) = self.waiting(trace) {
            let waits = at.within(STRUCTURAL).stream().open_uniform() > 1.0 / STRUCTURAL as f64;
            if !waits {
                return self.kernel.step(trace, at);
            }
            trace.let_wait(waiting);
            let done = self.kernel.step(trace, at);
            trace.end_wait();
            return done;
        }
        self.follow(trace)?;
        let Some(surrogate) = &mut self.surrogate else { return Ok(Outcome::default()) };
        let before = tempered(surrogate, at.power);
        let beyond = trace.beyond(surrogate);
        let inner = self.kernel.step(surrogate, &at.within(0))?;
        surrogate.rollback();
        if inner.accepted == 0 {
            return Ok(Outcome { site: None, ..inner });
        }
        let coarse = tempered(surrogate, at.power) - before;
        let mut outcome = match recoverable(trace.propose_choices_of(surrogate))? {
            None => Outcome { accepted: 0, failed: 1, ..inner },
            Some(w) => {
                let fine = if at.power == 1.0 {
                    w.log_joint
                } else {
                    w.log_joint - (1.0 - at.power) * w.log_likelihood
                };
                // Choices that only the observation depends on must not change: the ratio
                // does not account for new ones.
                let same = trace.lacks(surrogate).is_none()
                    && trace.beyond(surrogate) == beyond
                    && !trace.takes_away(&beyond);
                let ratio = if same { fine - coarse } else { f64::NEG_INFINITY };
                let decided = accept_or_reject(trace, at, ratio, &mut at.stream())?;
                Outcome { accepted: decided.accepted.min(inner.accepted), ..inner }
            }
        };
        if outcome.accepted == 0 {
            surrogate.propose_choices_of(trace)?;
            surrogate.commit();
        }
        outcome.site = None;
        Ok(outcome)
    }
}
