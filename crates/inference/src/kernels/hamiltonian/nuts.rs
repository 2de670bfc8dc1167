//! `nuts(sel, max_depth)`: the No-U-Turn sampler (Hoffman & Gelman 2014) with multinomial
//! sampling over the trajectory and the generalised stopping rule, checked across
//! subtrees as well (Betancourt 2017; as in Stan).

use super::kernel::{DIVERGENT, End, Hamiltonian, Path, Trajectory};
use super::point::Point;
use super::system::System;
use crate::kernel::SiteSelection;
use crate::kernels::row::{KernelRow, MARGINAL, SEL, int, number};
use pcadlang_engine::trace::TraceResult;
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::Stream;
use std::sync::Arc;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "nuts",
    &[
        SEL,
        int(
            "max_depth",
            10,
            [1, 20],
            "The maximum tree depth: at most 2^max_depth leapfrog steps.",
        ),
        MARGINAL,
    ],
    "The No-U-Turn sampler (Hoffman and Gelman 2014).",
    number!("infer { warmup 200 { nuts(@x); } repeat 100 { nuts(@x); collect x; } }"),
    |call| {
        call.moving(|scope, call| {
            let depth = call.whole("max_depth")?;
            Ok(Nuts::new(scope, depth).summing_out(call.marginal()?))
        })
    },
);

/// The No-U-Turn sampler.
pub type Nuts = Hamiltonian<Doubling>;

/// A trajectory that doubles until it turns, at most this many times.
#[derive(Clone, Debug)]
pub struct Doubling(u32);

impl Nuts {
    /// A kernel for these choices; a trajectory doubles at most `max_depth` times.
    pub fn new(scope: SiteSelection, max_depth: u32) -> Self {
        Hamiltonian::along(Doubling(max_depth), scope, 0.8, None)
    }
}

/// A segment of a trajectory, in the order in which it was computed.
struct Tree {
    first: Arc<Point>,
    last: Arc<Point>,
    /// The sum of the momenta.
    sum: Arc<Vec<f64>>,
    proposal: Arc<Point>,
    log_weight: f64,
    /// True if it makes a U-turn or diverges.
    stop: bool,
}

/// The state of a transition beside the tree.
struct Walk<'s, 'a> {
    system: &'s mut System<'a>,
    mass: &'s [f64],
    step: f64,
    /// The energy at the start.
    energy: f64,
    acceptance: f64,
    leaps: f64,
    divergent: bool,
    rng: &'s mut Stream,
}

impl Walk<'_, '_> {
    /// A tree of one point.
    fn leaf(&mut self, point: Arc<Point>, log_weight: f64) -> Tree {
        let sum = self.system.numbers(point.momentum.iter().copied());
        Tree {
            first: Arc::clone(&point),
            last: Arc::clone(&point),
            sum,
            proposal: point,
            log_weight,
            stop: false,
        }
    }

    /// A tree of 2^depth leapfrog steps from an end; `None` if one of them diverges.
    fn grow(&mut self, depth: u32, from: &Point) -> TraceResult<Option<Tree>> {
        if depth == 0 {
            return self.leap(from);
        }
        let Some(inner) = self.grow(depth - 1, from)? else { return Ok(None) };
        if inner.stop {
            return Ok(Some(inner));
        }
        let Some(outer) = self.grow(depth - 1, &inner.last)? else { return Ok(None) };
        let log_weight = log_sum_exp(&[inner.log_weight, outer.log_weight]);
        let take = self.rng.uniform() < libm::exp(outer.log_weight - log_weight);
        let proposal = Arc::clone(if take { &outer.proposal } else { &inner.proposal });
        Ok(Some(self.join(inner, outer, proposal, log_weight)))
    }

    fn leap(&mut self, from: &Point) -> TraceResult<Option<Tree>> {
        self.leaps += 1.0;
        let Some(point) = self.system.leapfrog(from, self.step, self.mass)? else {
            self.divergent = true;
            return Ok(None);
        };
        let log_weight = self.energy - (point.kinetic(self.mass) - point.log_density);
        self.acceptance += libm::exp(log_weight.min(0.0));
        if log_weight.is_nan() || log_weight <= -DIVERGENT {
            self.divergent = true;
            return Ok(None);
        }
        Ok(Some(self.leaf(point, log_weight)))
    }

    /// Joins two segments, the second computed after the first in the same direction of
    /// time.
    fn join(&mut self, inner: Tree, outer: Tree, proposal: Arc<Point>, log_weight: f64) -> Tree {
        let turns = turning(&inner.first, &outer.last, &inner.sum, &outer.sum)
            || turning(&inner.first, &outer.first, &inner.sum, &outer.first.momentum)
            || turning(&inner.last, &outer.last, &outer.sum, &inner.last.momentum);
        let sum = self.system.numbers(inner.sum.iter().zip(outer.sum.iter()).map(|(a, b)| a + b));
        let stop = inner.stop || outer.stop || turns;
        Tree { stop, first: inner.first, last: outer.last, sum, proposal, log_weight }
    }
}

/// True if the velocity at one of the ends no longer points along the sum of the momenta,
/// which is given as two partial sums.
fn turning(a: &Point, b: &Point, some: &[f64], more: &[f64]) -> bool {
    let (mut first, mut last) = (0.0, 0.0);
    for (((s, t), v), w) in some.iter().zip(more).zip(&a.velocity).zip(&b.velocity) {
        let sum = s + t;
        first += v * sum;
        last += w * sum;
    }
    // Also true for NaN.
    !(first > 0.0 && last > 0.0)
}

/// The same segment in reverse order.
fn reversed(mut t: Tree) -> Tree {
    std::mem::swap(&mut t.first, &mut t.last);
    t
}

impl Trajectory for Doubling {
    fn name(&self) -> &'static str {
        "nuts"
    }

    fn walk(&self, path: &mut Path) -> TraceResult<End> {
        let Path { system, here, step, inverse_mass: mass, rng } = path;
        let step = *step;
        let start = system.launch(here, mass, rng);
        let energy = start.kinetic(mass) - here.log_density;
        let mut walk =
            Walk { system, mass, step, energy, acceptance: 0.0, leaps: 0.0, divergent: false, rng };
        // In order of time: `first` is the earliest point.
        let mut tree = walk.leaf(start, 0.0);
        let mut moved = false;
        for depth in 0..self.0 {
            let forward = walk.rng.uniform() < 0.5;
            walk.step = if forward { step } else { -step };
            let from = Arc::clone(if forward { &tree.last } else { &tree.first });
            let Some(new) = walk.grow(depth, &from)? else { break };
            if new.stop {
                break;
            }
            // Biased towards the new half, which leaves the target invariant (Betancourt
            // 2017, A.3.2).
            let take = walk.rng.uniform() < libm::exp(new.log_weight - tree.log_weight);
            let log_weight = log_sum_exp(&[tree.log_weight, new.log_weight]);
            let proposal = Arc::clone(if take { &new.proposal } else { &tree.proposal });
            moved |= take;
            tree = if forward {
                walk.join(tree, new, proposal, log_weight)
            } else {
                // Joined in reverse order of time, and reversed again.
                reversed(walk.join(reversed(tree), new, proposal, log_weight))
            };
            if tree.stop {
                break;
            }
        }
        let (acceptance, divergent) = (walk.acceptance / walk.leaps.max(1.0), walk.divergent);
        Ok(End { to: moved.then_some(tree.proposal), acceptance, failed: false, divergent })
    }
}
