//! `smc(move, particles)`: a proposal by annealed sequential Monte Carlo, as in Del
//! Moral, Doucet & Jasra (2006).
//!
//! Particles drawn from the prior are weighted and resampled as the power of the
//! likelihood rises from 0 to 1, and moved by the inner kernel in between. The product of
//! the mean weights is an unbiased estimate of the evidence. Accepting one of the final
//! particles with the ratio of the new estimate to the old one (particle independent
//! Metropolis-Hastings: Andrieu, Doucet & Holenstein 2010, section 2.4.2) leaves the
//! posterior exactly invariant for any number of particles. The powers are chosen in the
//! first run, such that the effective sample size is half the number of particles at
//! each, and are fixed from then on.

use super::row::{Built, INNER, KernelRow, int, number};
use crate::calls::error::fail;
use crate::kernel::{Kernel, Outcome, StepContext, accepts, inner_step};
use crate::resampling::systematic;
use crate::state::{StateError, holds, pack, unpack};
use pcadlang_engine::lang::code::Observed;
use pcadlang_engine::trace::{Constraint, Selector, Trace, TraceResult};
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::Stream;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "smc",
    &[INNER, int("particles", 100, [2, 1_000_000], "The number of particles.")],
    "Proposes complete states by annealed sequential Monte Carlo with the inner kernel, \
     accepted by their evidence estimates (particle independent Metropolis-Hastings, Andrieu \
     et al. 2010). No other kernel may change the state in between.",
    number!("infer { repeat 20 { smc(drift(@x), particles = 20); collect x; } }"),
    |call| {
        let inner = call.inner()?;
        let particles = call.whole("particles")?;
        let signature = format!("smc({}, {particles})", inner.signature);
        let smc = Smc::new(inner.kernel, particles as usize, call.frozen(), call.span());
        Ok(Built::new(smc, signature))
    },
)
.irreversible();

/// The most powers: a likelihood that needs more has practically no overlap with the
/// prior.
const MOST_POWERS: usize = 1000;

/// If the largest log weight exceeds this in absolute value, weights are computed
/// relative to it.
const LARGE: f64 = 1e9;

/// No estimates so far.
const NO_ESTIMATES: (u64, f64) = (0, f64::NEG_INFINITY);

/// Proposes complete states, accepted with the ratio of the evidence estimates that they
/// come with.
pub struct Smc {
    kernel: Box<dyn Kernel>,
    particles: usize,
    /// Choices that are not redrawn.
    frozen: Selector,
    span: Span,
    /// The powers of the likelihood, of which the last is 1; chosen in the first run.
    powers: Vec<f64>,
    /// The last accepted state: its log joint density and the log of its evidence
    /// estimate.
    accepted: Option<(f64, f64)>,
    /// The data observed then.
    observed: Option<Arc<Observed>>,
    /// True if the state comes from a checkpoint; it then refers to the data that the
    /// trace observes at the next step.
    loaded: bool,
    /// The number of estimates, and the log of their sum.
    estimates: (u64, f64),
}

impl Smc {
    /// `particles` particles, moved by a kernel; frozen choices are not redrawn. `span`
    /// is the position that errors refer to.
    pub fn new(kernel: Box<dyn Kernel>, particles: usize, frozen: Selector, span: Span) -> Self {
        Smc {
            kernel,
            particles,
            frozen,
            span,
            powers: Vec::new(),
            accepted: None,
            observed: None,
            loaded: false,
            estimates: NO_ESTIMATES,
        }
    }

    /// Begins a step. The first of all, and the first with other data, start estimates and
    /// powers again.
    ///
    /// # Errors
    /// If the state is not the one that was last accepted.
    fn begin(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<()> {
        trace.rollback();
        if std::mem::take(&mut self.loaded) {
            self.observed = Some(Arc::clone(trace.replacements()));
        }
        if !self.observed.as_ref().is_some_and(|o| Arc::ptr_eq(o, trace.replacements())) {
            self.observed = Some(Arc::clone(trace.replacements()));
            self.accepted = None;
            self.estimates = NO_ESTIMATES;
            self.powers.clear();
            return Ok(());
        }
        if let Some((log_joint, _)) = self.accepted
            && log_joint.to_bits() != trace.log_joint().to_bits()
            && !at.adapting
        {
            let message = "another kernel changed the state between two steps of smc";
            let mut e = fail(self.span, message.into());
            let hint = "smc draws complete states; its evidence estimate is valid only for the state it drew";
            e.hint = Some(hint.into());
            return Err(e);
        }
        Ok(())
    }

    /// Draws particles from the prior; frozen choices keep their values.
    fn draw_from_prior(&self, trace: &mut Trace, at: &StepContext) -> TraceResult<Vec<Trace>> {
        let selection = trace.select(&self.frozen);
        let fixed: Vec<(u64, Constraint)> = trace
            .targets(selection)
            .iter()
            .filter_map(|t| Some((trace.address_hash(*t), Constraint::Stored(trace.stored(*t)?))))
            .collect();
        let one = |i: usize| trace.another(fixed.iter().cloned(), at.within(i as u64).draws(0));
        (0..self.particles).map(one).collect()
    }

    /// Draws particles and moves them to the posterior. Returns them and the log of the
    /// evidence estimate.
    fn anneal(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<(Vec<Trace>, f64)> {
        let mut particles = self.draw_from_prior(trace, at)?;
        let find = self.powers.is_empty();
        let (mut power, mut log_evidence, mut rung) = (0.0, 0.0, 0);
        while power < 1.0 {
            let likelihoods: Vec<f64> = particles.iter().map(Trace::log_likelihood).collect();
            if find {
                let next =
                    if rung + 1 < MOST_POWERS { next_power(&likelihoods, power) } else { 1.0 };
                self.powers.push(next);
            }
            let step = self.powers[rung] - power;
            power = self.powers[rung];
            rung += 1;
            // A state of zero likelihood has zero weight at any power.
            let gain = |l: &f64| {
                if *l == f64::NEG_INFINITY || l.is_nan() { f64::NEG_INFINITY } else { step * l }
            };
            let weights: Vec<f64> = likelihoods.iter().map(gain).collect();
            let total = log_sum_exp(&weights);
            log_evidence += total - libm::log(self.particles as f64);
            if total == f64::NEG_INFINITY {
                return Ok((particles, total));
            }
            let within = at.within((1 << 32) + rung as u64);
            let most = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let whole = if most.abs() > LARGE { most } else { total };
            let shares: Vec<f64> = weights.iter().map(|w| libm::exp(w - whole)).collect();
            let chosen = systematic(&shares, self.particles, &mut within.stream());
            particles = chosen.into_iter().map(|i| particles[i].clone()).collect();
            for (i, p) in particles.iter_mut().enumerate() {
                inner_step(
                    &mut *self.kernel,
                    p,
                    &StepContext { power: at.power * power, ..within.within(i as u64) },
                )?;
            }
        }
        Ok((particles, log_evidence))
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

impl Kernel for Smc {
    fn name(&self) -> String {
        "smc".into()
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        let begun = self.loaded || self.observed.is_some();
        pack(&(
            pack(&(self.kernel.save(trace), &self.powers)),
            self.accepted,
            begun,
            self.estimates,
        ))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let annealed: Vec<u8>;
        (annealed, self.accepted, self.loaded, self.estimates) = unpack(state)?;
        self.observed = None;
        let (inner, powers): (Vec<u8>, Vec<f64>) = unpack(&annealed)?;
        let possible = powers.iter().all(|p| *p > 0.0) && powers.last().is_none_or(|p| *p == 1.0);
        holds(possible, "smc")?;
        self.powers = powers;
        self.kernel.load(&inner)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        self.begin(trace, at)?;
        let (particles, log_evidence) = self.anneal(trace, at)?;
        Ok(self.decide(trace, particles, log_evidence, &mut at.stream()))
    }

    /// The log of the mean of all estimates.
    fn log_evidence(&self) -> Option<f64> {
        let (n, log_sum) = self.estimates;
        (n > 0).then(|| log_sum - libm::log(n as f64))
    }
}

/// The power at which the effective sample size is half the number of particles, by
/// bisection.
fn next_power(likelihoods: &[f64], power: f64) -> f64 {
    // Next to large values the logarithm of their number would be lost to rounding, so
    // they are taken relative to the largest.
    let most =
        likelihoods.iter().copied().filter(|l| l.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    let from = if most.abs() > LARGE { most } else { 0.0 };
    let enough = |to: f64| {
        let relative = |l: &f64| (to - power) * (l - from);
        let weights: Vec<f64> =
            likelihoods.iter().filter(|l| l.is_finite()).map(relative).collect();
        let twice: Vec<f64> = weights.iter().map(|w| 2.0 * w).collect();
        2.0 * log_sum_exp(&weights) - log_sum_exp(&twice)
            >= libm::log(0.5 * weights.len().max(1) as f64)
    };
    if enough(1.0) {
        return 1.0;
    }
    let (mut low, mut high) = (power, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if enough(middle) { low = middle } else { high = middle }
    }
    if low > power { low } else { high }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The likelihoods are so far apart that no power gives an effective sample size of
    /// half: the next power must rise nevertheless.
    #[test]
    fn powers_rise_whatever_the_likelihoods_are() {
        for power in [0.0, 1e-3, 0.5, 1.0 - 1e-10] {
            let next = next_power(&[0.0, -1e30, -1e30], power);
            assert!(next > power && next < 1.0, "{power}: {next}");
        }
        assert_eq!(next_power(&[-3.0; 4], 0.2), 1.0);
    }
}
