//! `hmc(sel, steps)` and `mala(sel)`: trajectories of a fixed number of leapfrog steps (Neal 2011).

use super::summed::with_alternatives;
use super::{Adaptation, DIVERGENT, Memory, System, system};
use crate::infer::kernel::{At, Kernel, Outcome, Pick, Registered, Scope, accepts};
use crate::trace::{Selector, Target, Trace, TraceResult};

/// Hamiltonian Monte Carlo; with one step it is the Metropolis-adjusted Langevin algorithm.
#[derive(Clone, Debug)]
pub struct Hmc {
    scope: Registered,
    /// Finite choices that are summed out.
    summed: Registered,
    steps: u32,
    adaptation: Adaptation,
    memory: Memory,
}

impl Hmc {
    /// The kernel for these choices, with so many leapfrog steps and a step size, or else one that is learnt.
    pub fn new(scope: Scope, steps: u32, step: Option<f64>) -> Self {
        // The best acceptance of long trajectories, and of Langevin steps (Roberts & Rosenthal 1998, Beskos et al. 2013).
        let target = if steps == 1 { 0.574 } else { 0.8 };
        let adaptation = Adaptation::new(target, step);
        let (scope, summed) = (Registered::new(scope), Registered::nothing());
        Hmc { scope, summed, steps: steps.max(1), adaptation, memory: Memory::default() }
    }

    /// The same with these finite choices summed out of the density that it sees.
    #[must_use]
    pub fn summing_out(self, choices: Selector) -> Self {
        Hmc { summed: Registered::new(Scope { selector: choices, pick: Pick::All }), ..self }
    }
}

impl Kernel for Hmc {
    fn name(&self) -> String {
        if self.steps == 1 { "mala".into() } else { "hmc".into() }
    }

    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome> {
        let mut summed = self.summed.clone();
        let outcome = with_alternatives(&mut summed, trace, at, |trace, sites| self.go(trace, at, sites));
        self.summed = summed;
        outcome
    }
}

impl Hmc {
    fn go(&mut self, trace: &mut Trace, at: &At, sites: &[Target]) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, _) = self.scope.members(trace, at, &mut rng);
        let Some((mut system, here)) = System::begin(trace, at, &targets, sites, &mut self.memory)? else {
            return Ok(Outcome::default());
        };
        let step = self.adaptation.step(&mut system, &here, at.adapting, &mut rng)?;
        // Of uneven length, so that no trajectory comes back to where it began again and again.
        let step = step * (0.9 + 0.2 * rng.uniform());
        let mass = &self.adaptation.inverse_mass;
        let mut point = system.launch(&here, mass, &mut rng);
        let energy = system::kinetic(&point, mass);
        let mut there = true;
        for _ in 0..self.steps {
            match system.leapfrog(&point, step, mass)? {
                Some(to) => point = to,
                None => {
                    there = false;
                    break;
                }
            }
        }
        let ratio = if there {
            point.log_density - here.log_density + energy - system::kinetic(&point, mass)
        } else {
            f64::NEG_INFINITY
        };
        let accepted = there && accepts(ratio, &mut rng);
        let accepted = system.settle(accepted.then_some(&*point))?;
        if at.adapting {
            self.adaptation.learn(libm::exp(ratio.min(0.0)), if accepted { &point.y } else { &here.y });
        }
        let divergent = ratio.is_nan() || ratio <= -DIVERGENT;
        Ok(Outcome { failed: u32::from(!there), divergent: u32::from(divergent), ..Outcome::one(accepted) })
    }
}
