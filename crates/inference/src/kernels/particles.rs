//! The common part of particle kernels: states drawn from the prior, and acceptance of
//! complete states by estimates of the evidence (particle independent
//! Metropolis-Hastings: Andrieu, Doucet & Holenstein 2010, section 2.4.2). How particles
//! move from the prior to the target is left to each kernel.

use crate::calls::error::fail;
use crate::kernel::{Kernel, Outcome, StepContext, accepts};
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::lang::code::Observed;
use pcadlang_engine::trace::{Constraint, Selector, Trace, TraceResult};
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::Stream;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// How particles move from the prior to their target.
pub(super) trait ParticlePath {
    fn name(&self) -> &'static str;

    /// Forgets what was adapted to other data.
    fn forget(&mut self);

    /// See [`Kernel::save`].
    fn save(&self, trace: &Trace) -> Vec<u8>;

    /// See [`Kernel::load`].
    fn load(&mut self, state: &[u8]) -> Result<(), StateError>;

    /// Draws particles and moves them to the target. Returns them and the log of the
    /// evidence estimate.
    fn lead(
        &mut self,
        prior: &Prior,
        trace: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<(Vec<Trace>, f64)>;
}

/// No estimates so far.
const NO_ESTIMATES: (u64, f64) = (0, f64::NEG_INFINITY);

/// Draws particles.
pub(super) struct Prior {
    /// Choices that are not redrawn.
    frozen: Selector,
}

/// Proposes complete states, accepted with the ratio of the evidence estimates that they
/// come with.
pub struct Independent<W> {
    way: W,
    prior: Prior,
    span: Span,
    /// The last accepted state: its log joint density and the log of its evidence
    /// estimate.
    accepted: Option<(f64, f64)>,
    /// The data observed then.
    observed: Option<Arc<Observed>>,
    /// Whether the fields above come from a checkpoint; they then refer to the data that
    /// the trace observes at the next step.
    loaded: bool,
    /// The number of estimates, and the log of their sum.
    estimates: (u64, f64),
}

impl Prior {
    /// Draws particles; frozen choices keep their values.
    ///
    /// # Errors
    /// Errors of the program.
    pub fn draw(
        &self,
        trace: &mut Trace,
        particles: usize,
        at: &StepContext,
    ) -> TraceResult<Vec<Trace>> {
        let selection = trace.select(&self.frozen);
        let fixed: Vec<(u64, Constraint)> = trace
            .targets(selection)
            .iter()
            .filter_map(|t| Some((trace.address_hash(*t), Constraint::Stored(trace.stored(*t)?))))
            .collect();
        let one = |i: usize| trace.another(fixed.iter().cloned(), at.within(i as u64).draws(0));
        (0..particles).map(one).collect()
    }
}

#[allow(private_bounds)]
impl<W: ParticlePath> Independent<W> {
    /// For particles that move in this way; frozen choices are not redrawn. `span` is the
    /// position that errors refer to.
    pub(super) fn by(way: W, frozen: Selector, span: Span) -> Self {
        let (prior, estimates) = (Prior { frozen }, NO_ESTIMATES);
        Independent { way, prior, span, accepted: None, observed: None, loaded: false, estimates }
    }

    /// Begins a step. Returns true if it is the first of all, or the first with other
    /// data, for which the estimates start again.
    ///
    /// # Errors
    /// If the state is not the one that was last accepted.
    fn begin(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<bool> {
        trace.rollback();
        if std::mem::take(&mut self.loaded) {
            self.observed = Some(Arc::clone(trace.replacements()));
        }
        if !self.observed.as_ref().is_some_and(|o| Arc::ptr_eq(o, trace.replacements())) {
            self.observed = Some(Arc::clone(trace.replacements()));
            self.accepted = None;
            self.estimates = NO_ESTIMATES;
            return Ok(true);
        }
        if let Some((log_joint, _)) = self.accepted
            && log_joint.to_bits() != trace.log_joint().to_bits()
            && !at.adapting
        {
            let name = self.way.name();
            let mut e = fail(
                self.span,
                format!("another kernel changed the state between two steps of {name}"),
            );
            e.hint = Some(format!(
                "{name} draws complete states; its evidence estimate is valid only for the state it drew"
            ));
            return Err(e);
        }
        Ok(false)
    }

    /// Accepts one of the particles as the new state, or rejects.
    fn decide(
        &mut self,
        trace: &mut Trace,
        mut particles: Vec<Trace>,
        log_evidence: f64,
        rng: &mut Stream,
    ) -> Outcome {
        let one = rng.index(particles.len());
        let (count, log_sum) = self.estimates;
        self.estimates = (count.saturating_add(1), log_sum_exp(&[log_sum, log_evidence]));
        let ratio = match self.accepted {
            Some((_, old)) => log_evidence - old,
            // The first state is accepted, as an initial state.
            None if log_evidence > f64::NEG_INFINITY => 0.0,
            None => f64::NEG_INFINITY,
        };
        let accepted = accepts(ratio, rng);
        if accepted {
            *trace = particles.swap_remove(one);
            self.accepted = Some((trace.log_joint(), log_evidence));
            self.observed = Some(Arc::clone(trace.replacements()));
        }
        Outcome::one(accepted)
    }
}

impl<W: ParticlePath + Send> Kernel for Independent<W> {
    fn name(&self) -> String {
        self.way.name().into()
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        let begun = self.loaded || self.observed.is_some();
        pack(&(self.way.save(trace), self.accepted, begun, self.estimates))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let way: Vec<u8>;
        (way, self.accepted, self.loaded, self.estimates) = unpack(state)?;
        self.observed = None;
        self.way.load(&way)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        if self.begin(trace, at)? {
            self.way.forget();
        }
        let (particles, log_evidence) = self.way.lead(&self.prior, trace, at)?;
        Ok(self.decide(trace, particles, log_evidence, &mut at.stream()))
    }

    /// The log of the mean of all estimates.
    fn log_evidence(&self) -> Option<f64> {
        let (n, log_sum) = self.estimates;
        (n > 0).then(|| log_sum - libm::log(n as f64))
    }
}
