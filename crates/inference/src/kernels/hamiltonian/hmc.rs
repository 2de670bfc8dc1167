//! `hmc(sel, steps)` and `mala(sel)`: trajectories of a fixed number of leapfrog steps
//! (Neal 2011).

use super::kernel::{DIVERGENT, End, Hamiltonian, Path, Trajectory};
use crate::kernel::{SiteSelection, accepts};
use crate::kernels::row::{KernelRow, MARGINAL, SEL, int, number};
use pcadlang_engine::trace::TraceResult;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "hmc",
    &[SEL, int("steps", 10, [1, 10_000], "The number of leapfrog steps per proposal."), MARGINAL],
    "Hamiltonian Monte Carlo; step size and metric are adapted in warm-up (Neal 2011).",
    number!(
        "infer { warmup 200 { hmc(@x, steps = 5); } repeat 100 { hmc(@x, steps = 5); collect x; } }"
    ),
    |call| {
        call.moving(|scope, call| {
            let steps = call.whole("steps")?;
            Ok(Hmc::new(scope, steps, None).summing_out(call.marginal()?))
        })
    },
);

/// Hamiltonian Monte Carlo; with one step it is the Metropolis-adjusted Langevin
/// algorithm.
pub type Hmc = Hamiltonian<FixedSteps>;

/// A fixed number of leapfrog steps, accepted or rejected as a whole.
#[derive(Clone, Debug)]
pub struct FixedSteps(u32);

impl Hmc {
    /// A kernel for these choices with `steps` leapfrog steps. The step size is adapted
    /// if it is `None`.
    pub fn new(scope: SiteSelection, steps: u32, step: Option<f64>) -> Self {
        // The optimal acceptance rates of Langevin steps and of long trajectories
        // (Roberts & Rosenthal 1998, Beskos et al. 2013).
        let target = if steps == 1 { 0.574 } else { 0.8 };
        Hamiltonian::along(FixedSteps(steps.max(1)), scope, target, step)
    }
}

impl Trajectory for FixedSteps {
    fn name(&self) -> &'static str {
        if self.0 == 1 { "mala" } else { "hmc" }
    }

    fn walk(&self, path: &mut Path) -> TraceResult<End> {
        let Path { system, here, step, metric, rng } = path;
        // A random length, so that trajectories do not keep returning to their starting
        // point.
        let step = *step * (0.9 + 0.2 * rng.uniform());
        let mut point = system.launch(here, metric, rng);
        let energy = point.kinetic();
        let mut there = true;
        for _ in 0..self.0 {
            match system.leapfrog(&point, step, metric)? {
                Some(to) => point = to,
                None => {
                    there = false;
                    break;
                }
            }
        }
        let ratio = if there {
            point.log_density - here.log_density + energy - point.kinetic()
        } else {
            f64::NEG_INFINITY
        };
        let accepted = there && accepts(ratio, rng);
        let divergent = ratio.is_nan() || ratio <= -DIVERGENT;
        Ok(End {
            to: accepted.then_some(point),
            acceptance: libm::exp(ratio.min(0.0)),
            failed: !there,
            divergent,
        })
    }
}
