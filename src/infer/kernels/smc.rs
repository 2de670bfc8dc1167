//! `smc(move, particles)`: annealed sequential Monte Carlo (Del Moral, Doucet & Jasra 2006) as a proposal.
//!
//! Particles drawn from the prior are weighed and resampled as the power of the likelihood rises from 0 to 1, and move by the
//! kernel inside in between. The product of the mean weights estimates the evidence without bias; accepting one of the last
//! particles with the ratio of the new estimate to the old (particle independent Metropolis-Hastings: Andrieu, Doucet &
//! Holenstein 2010, section 2.4.2) leaves the posterior exactly invariant for any number of particles. The powers are
//! found in the first run, so that half of the weights count at each, and stay as they are.

use crate::infer::kernel::{At, Kernel, Outcome, accepts, inner_step};
use crate::infer::resampling::systematic;
use crate::infer::selection::fail;
use crate::num::log_sum_exp;
use crate::syntax::span::Span;
use crate::trace::{Constraint, Selector, Trace, TraceResult};

/// The most powers: a likelihood that needs more has no support where the prior has.
const MOST_POWERS: usize = 1000;

/// Particle independent Metropolis-Hastings around a kernel.
pub struct Smc {
    kernel: Box<dyn Kernel>,
    particles: usize,
    /// Choices that are not drawn anew.
    frozen: Selector,
    span: Span,
    /// The powers of the likelihood, the last one 1; found in the first run.
    powers: Vec<f64>,
    /// The state that was accepted last: its log joint density and the log of the evidence's estimate.
    accepted: Option<(f64, f64)>,
    /// The logs of all estimates.
    estimates: Vec<f64>,
}

impl Smc {
    /// So many particles, moved by a kernel. `span` is where errors point.
    pub fn new(kernel: Box<dyn Kernel>, particles: usize, frozen: Selector, span: Span) -> Self {
        Smc { kernel, particles, frozen, span, powers: Vec::new(), accepted: None, estimates: Vec::new() }
    }

    /// Particles from the prior; what is frozen stays.
    fn draw(&self, trace: &mut Trace, at: &At) -> TraceResult<Vec<Trace>> {
        let selection = trace.select(&self.frozen);
        let fixed: Vec<(u64, Constraint)> = trace
            .targets(selection)
            .iter()
            .filter_map(|t| Some((trace.address_hash(*t), Constraint::Stored(trace.stored(*t)?))))
            .collect();
        let one = |i: usize| trace.another(fixed.iter().cloned(), at.within(i as u64).draws(0));
        (0..self.particles).map(one).collect()
    }

    /// Raises the power from 0 to 1; gives the particles and the log of the evidence's estimate.
    fn run(&mut self, trace: &mut Trace, at: &At) -> TraceResult<(Vec<Trace>, f64)> {
        let mut particles = self.draw(trace, at)?;
        let find = self.powers.is_empty();
        let (mut power, mut log_evidence, mut rung) = (0.0, 0.0, 0);
        while power < 1.0 {
            let likelihoods: Vec<f64> = particles.iter().map(Trace::log_likelihood).collect();
            if find {
                let next = if rung + 1 < MOST_POWERS { next_power(&likelihoods, power) } else { 1.0 };
                self.powers.push(next);
            }
            let step = self.powers[rung] - power;
            power = self.powers[rung];
            rung += 1;
            // What is impossible has no weight at any power.
            let gain = |l: &f64| if *l == f64::NEG_INFINITY || l.is_nan() { f64::NEG_INFINITY } else { step * l };
            let weights: Vec<f64> = likelihoods.iter().map(gain).collect();
            let total = log_sum_exp(&weights);
            log_evidence += total - libm::log(self.particles as f64);
            if total == f64::NEG_INFINITY {
                return Ok((particles, total));
            }
            let within = at.within((1 << 32) + rung as u64);
            let shares: Vec<f64> = weights.iter().map(|w| libm::exp(w - total)).collect();
            let chosen = systematic(&shares, self.particles, &mut within.stream());
            particles = chosen.into_iter().map(|i| particles[i].clone()).collect();
            for (i, p) in particles.iter_mut().enumerate() {
                inner_step(&mut *self.kernel, p, &At { power: at.power * power, ..within.within(i as u64) })?;
            }
        }
        Ok((particles, log_evidence))
    }
}

/// The power at which half of the particles would count (by the effective number of equal weights), by bisection.
fn next_power(likelihoods: &[f64], power: f64) -> f64 {
    let enough = |to: f64| {
        let weights: Vec<f64> = likelihoods.iter().filter(|l| l.is_finite()).map(|l| (to - power) * l).collect();
        let twice: Vec<f64> = weights.iter().map(|w| 2.0 * w).collect();
        2.0 * log_sum_exp(&weights) - log_sum_exp(&twice) >= libm::log(0.5 * weights.len().max(1) as f64)
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

impl Kernel for Smc {
    fn name(&self) -> String {
        "smc".into()
    }

    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome> {
        trace.rollback();
        if let Some((log_joint, _)) = self.accepted
            && log_joint.to_bits() != trace.log_joint().to_bits()
            && !at.adapting
        {
            let mut e = fail(self.span, "another kernel moved the state between two steps of smc".into());
            e.hint = Some(
                "smc draws whole states by itself; its estimate of the evidence belongs to the state it drew".into(),
            );
            return Err(e);
        }
        let (mut particles, log_evidence) = self.run(trace, at)?;
        let mut rng = at.stream();
        let one = rng.index(particles.len());
        self.estimates.push(log_evidence);
        let ratio = match self.accepted {
            // The first state is a start like any other.
            None => {
                if log_evidence > f64::NEG_INFINITY {
                    0.0
                } else {
                    f64::NEG_INFINITY
                }
            }
            Some((_, old)) => log_evidence - old,
        };
        let accepted = accepts(ratio, &mut rng);
        if accepted {
            *trace = particles.swap_remove(one);
            self.accepted = Some((trace.log_joint(), log_evidence));
        }
        Ok(Outcome::one(accepted))
    }

    fn log_evidence(&self) -> Option<f64> {
        let n = self.estimates.len();
        (n > 0).then(|| log_sum_exp(&self.estimates) - libm::log(n as f64))
    }
}
