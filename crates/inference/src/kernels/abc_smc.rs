//! `abc(move, eps, particles)`: approximate Bayesian computation by sequential Monte
//! Carlo with decreasing tolerances (Del Moral, Doucet & Jasra 2012), as a proposal.
//!
//! Particles drawn from the prior, each with simulated data, are kept if those data are
//! within the tolerance; copies of them replace the others, and all are moved by the
//! inner kernel as in `abc`. The product of the fractions kept is an unbiased estimate of
//! the probability that simulated data come within `eps`. Accepting one of the final
//! particles with the ratio of these estimates therefore leaves the prior given such data
//! invariant for any number of particles (see `particles.rs`). The tolerances are chosen
//! in the first run, such that half of the particles are kept at each, and are fixed from
//! then on.

use super::abc::{simulate, step_within};
use super::particles::{Independent, ParticlePath, Prior};
use crate::kernel::{Kernel, StepContext};
use crate::resampling::systematic;
use crate::state::{StateError, holds, pack, unpack};
use pcadlang_engine::trace::{Selector, Trace, TraceResult};
use pcadlang_syntax::span::Span;

/// The most tolerances.
const MOST: usize = 1000;

/// Particle independent Metropolis-Hastings without likelihoods.
pub type AbcSmc = Independent<Tolerances>;

/// Lowers the largest distance of simulated data to `eps`.
pub struct Tolerances {
    kernel: Box<dyn Kernel>,
    eps: f64,
    particles: usize,
    /// The number of moves of each particle at each tolerance.
    moves: u32,
    span: Span,
    /// Decreasing tolerances, of which the last is `eps`; chosen in the first run.
    tolerances: Vec<f64>,
}

impl AbcSmc {
    /// The inner kernel, the largest distance, and the numbers of particles and of their
    /// moves at each tolerance; frozen choices are not redrawn. `span` is the position
    /// that errors refer to.
    pub fn new(
        kernel: Box<dyn Kernel>,
        eps: f64,
        (particles, moves): (usize, u32),
        frozen: Selector,
        span: Span,
    ) -> Self {
        let way = Tolerances { kernel, eps, particles, moves, span, tolerances: Vec::new() };
        Independent::by(way, frozen, span)
    }
}

impl ParticlePath for Tolerances {
    fn name(&self) -> &'static str {
        "abc"
    }

    fn forget(&mut self) {
        self.tolerances.clear();
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        pack(&(self.kernel.save(trace), &self.tolerances))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let (inner, tolerances): (Vec<u8>, Vec<f64>) = unpack(state)?;
        holds(tolerances.last().is_none_or(|t| *t == self.eps), self.name())?;
        self.tolerances = tolerances;
        self.kernel.load(&inner)
    }

    fn lead(
        &mut self,
        prior: &Prior,
        trace: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<(Vec<Trace>, f64)> {
        let mut particles = prior.draw(trace, self.particles, at)?;
        let mut distances = Vec::with_capacity(particles.len());
        for (i, p) in particles.iter().enumerate() {
            distances.push(simulate(p, at.within(i as u64).draws(1), self.span)?);
        }
        let find = self.tolerances.is_empty();
        let (mut tolerance, mut log_kept, mut rung) = (f64::INFINITY, 0.0, 0);
        while tolerance > self.eps {
            if find {
                let next =
                    if rung + 1 < MOST { next_tolerance(&distances, tolerance) } else { self.eps };
                self.tolerances.push(next.max(self.eps));
            }
            tolerance = self.tolerances[rung];
            rung += 1;
            let kept: Vec<f64> =
                distances.iter().map(|d| f64::from(u8::from(*d <= tolerance))).collect();
            let count: f64 = kept.iter().sum();
            if count == 0.0 {
                if find {
                    self.tolerances.clear();
                }
                return Ok((particles, f64::NEG_INFINITY));
            }
            log_kept += libm::log(count / self.particles as f64);
            let within = at.within((1 << 32) + rung as u64);
            let chosen = systematic(&kept, self.particles, &mut within.stream());
            particles = chosen.iter().map(|i| particles[*i].clone()).collect();
            distances = chosen.iter().map(|i| distances[*i]).collect();
            for (i, (p, d)) in particles.iter_mut().zip(&mut distances).enumerate() {
                for step in 0..self.moves {
                    let at = within.within(i as u64).within(step.into());
                    step_within(&mut *self.kernel, p, &at, (d, tolerance), self.span)?;
                }
            }
        }
        Ok((particles, log_kept))
    }
}

/// The tolerance that keeps half of the particles, or else the largest one below the
/// present tolerance among that half.
fn next_tolerance(distances: &[f64], present: f64) -> f64 {
    let mut sorted = distances.to_vec();
    sorted.sort_by(f64::total_cmp);
    let half = &sorted[..sorted.len().div_ceil(2)];
    half.iter().rev().find(|d| **d < present).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_keep_half_and_fall() {
        assert_eq!(next_tolerance(&[3.0, 1.0, 4.0, 2.0], f64::INFINITY), 2.0);
        assert_eq!(next_tolerance(&[2.0, 1.0, 2.0, 2.0], 2.0), 1.0);
        // If no particle is closer, or none is comparable, only the final tolerance
        // remains.
        assert_eq!(next_tolerance(&[2.0; 4], 2.0), 0.0);
        assert_eq!(next_tolerance(&[f64::INFINITY; 4], f64::INFINITY), 0.0);
    }
}
