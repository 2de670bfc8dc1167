//! `nuts(sel, max_depth)`: the No-U-Turn sampler (Hoffman & Gelman 2014) with multinomial
//! sampling over the trajectory and the generalised stopping rule, checked across
//! subtrees as well (Betancourt 2017; as in Stan).

use super::kernel::{DIVERGENT, End, Hamiltonian, Path, Trajectory};
use super::metric::Metric;
use super::point::Point;
use super::system::System;
use crate::kernel::SiteSelection;
use crate::kernels::row::{KernelRow, MARGINAL, SEL, int, number};
use pcadlang_engine::trace::TraceResult;
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
    /// The sum of the momenta; that of one point is its own.
    sum: Option<Arc<Vec<f64>>>,
    proposal: Arc<Point>,
    weight: Weight,
    /// True if it makes a U-turn or diverges.
    stop: bool,
}

impl Tree {
    /// A segment of one point.
    fn leaf(point: Arc<Point>, weight: Weight) -> Tree {
        let (first, last) = (Arc::clone(&point), Arc::clone(&point));
        Tree { first, last, sum: None, proposal: point, weight, stop: false }
    }

    fn sum(&self) -> &[f64] {
        self.sum.as_ref().map_or(&self.first.momentum, |sum| sum)
    }

    /// The same segment in reverse order.
    fn reversed(mut self) -> Tree {
        std::mem::swap(&mut self.first, &mut self.last);
        self
    }
}

/// A sum of probabilities relative to that of the start: `share` times the exponential of
/// `log`, which is 0 unless they are beyond the range of numbers.
#[derive(Clone, Copy)]
struct Weight {
    log: f64,
    share: f64,
}

/// The log weights whose exponentials, and sums and ratios of them, are normal numbers.
const USUAL: std::ops::RangeInclusive<f64> = -300.0..=300.0;

impl Weight {
    fn new(log: f64) -> Weight {
        if USUAL.contains(&log) {
            Weight { log: 0.0, share: libm::exp(log) }
        } else {
            Weight { log, share: 1.0 }
        }
    }

    /// The probability of a single point, at most 1.
    fn acceptance(self) -> f64 {
        if self.log == 0.0 { self.share.min(1.0) } else { f64::from(self.log > 0.0) }
    }

    fn plus(self, other: Weight) -> Weight {
        let log = self.log.max(other.log);
        Weight { log, share: self.share_at(log) + other.share_at(log) }
    }

    /// This weight over another, which is not smaller beyond the range of numbers.
    fn over(self, other: Weight) -> f64 {
        if self.log == other.log {
            self.share / other.share
        } else {
            libm::exp(self.log - other.log) * (self.share / other.share)
        }
    }

    fn share_at(self, log: f64) -> f64 {
        if self.log == log { self.share } else { self.share * libm::exp(self.log - log) }
    }
}

/// The state of a transition beside the tree.
struct Walk<'s, 'a> {
    system: &'s mut System<'a>,
    metric: &'s Metric,
    step: f64,
    /// The energy at the start.
    energy: f64,
    acceptance: f64,
    leaps: f64,
    divergent: bool,
    rng: &'s mut Stream,
}

impl Walk<'_, '_> {
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
        let weight = inner.weight.plus(outer.weight);
        let take = self.rng.uniform() < outer.weight.over(weight);
        let proposal = Arc::clone(if take { &outer.proposal } else { &inner.proposal });
        Ok(Some(self.join(inner, outer, proposal, weight)))
    }

    fn leap(&mut self, from: &Point) -> TraceResult<Option<Tree>> {
        self.leaps += 1.0;
        let Some(point) = self.system.leapfrog(from, self.step, self.metric)? else {
            self.divergent = true;
            return Ok(None);
        };
        let log_weight = self.energy - (point.kinetic() - point.log_density);
        if log_weight.is_nan() || log_weight <= -DIVERGENT {
            self.divergent = true;
            return Ok(None);
        }
        let weight = Weight::new(log_weight);
        self.acceptance += weight.acceptance();
        Ok(Some(Tree::leaf(point, weight)))
    }

    /// Joins two segments, the second computed after the first in the same direction of
    /// time.
    fn join(&mut self, inner: Tree, outer: Tree, proposal: Arc<Point>, weight: Weight) -> Tree {
        let turns = turning(&inner.first, &outer.last, inner.sum(), outer.sum())
            || (inner.sum.is_some() || outer.sum.is_some())
                && (turning(&inner.first, &outer.first, inner.sum(), &outer.first.momentum)
                    || turning(&inner.last, &outer.last, outer.sum(), &inner.last.momentum));
        let stop = inner.stop || outer.stop || turns;
        let sums = inner.sum().iter().zip(outer.sum());
        let sum = Some(self.system.numbers(sums.map(|(a, b)| a + b)));
        Tree { stop, first: inner.first, last: outer.last, sum, proposal, weight }
    }
}

/// True if the velocity at one of the ends no longer points along the sum of the momenta,
/// which is given as two partial sums.
fn turning(a: &Point, b: &Point, some: &[f64], more: &[f64]) -> bool {
    let (mut first, mut last) = (0.0, 0.0);
    for (((s, t), v), w) in some.iter().zip(more).zip(&a.momentum).zip(&b.momentum) {
        let sum = s + t;
        first += v * sum;
        last += w * sum;
    }
    // Also true for NaN.
    !(first > 0.0 && last > 0.0)
}

impl Trajectory for Doubling {
    fn name(&self) -> &'static str {
        "nuts"
    }

    fn walk(&self, path: &mut Path) -> TraceResult<End> {
        let Path { system, here, step, metric, rng } = path;
        let step = *step;
        let start = system.launch(here, metric, rng);
        let energy = start.kinetic() - here.log_density;
        let (acceptance, leaps, divergent) = (0.0, 0.0, false);
        let mut walk = Walk { system, metric, step, energy, acceptance, leaps, divergent, rng };
        // In order of time: `first` is the earliest point.
        let mut tree = Tree::leaf(start, Weight::new(0.0));
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
            let take = walk.rng.uniform() < new.weight.over(tree.weight);
            let weight = tree.weight.plus(new.weight);
            let proposal = Arc::clone(if take { &new.proposal } else { &tree.proposal });
            moved |= take;
            tree = if forward {
                walk.join(tree, new, proposal, weight)
            } else {
                // Joined in reverse order of time, and reversed again.
                walk.join(tree.reversed(), new, proposal, weight).reversed()
            };
            if tree.stop {
                break;
            }
        }
        let (acceptance, divergent) = (walk.acceptance / walk.leaps.max(1.0), walk.divergent);
        Ok(End { to: moved.then_some(tree.proposal), acceptance, failed: false, divergent })
    }
}
