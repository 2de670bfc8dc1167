//! `slice(sel, width, doubling)`: slice sampling of one number at a time (Neal 2003,
//! section 4): an interval around the present point by stepping out (figure 3) or
//! doubling (figures 4 and 6), followed by shrinkage (figure 5).
//!
//! Each coordinate of the unconstrained space is moved in turn. A point at which the
//! program is undefined, or choices appear or vanish, counts as outside the slice, so the
//! kernel moves within the present structure.

use super::row::{KernelRow, SEL, Type, flag, number, opt};
use crate::kernel::{Kernel, Outcome, Registered, SiteSelection, StepContext, recoverable};
use crate::state::{StateError, in_order, pack, unpack};
use pcadlang_engine::trace::{Change, Target, Trace, TraceResult};
use pcadlang_numerics::rng::Stream;
use rustc_hash::FxHashMap;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "slice",
    &[
        SEL,
        opt(
            "width",
            Type::Num,
            "learnt",
            "The width of the initial interval, in the unconstrained space; by default 1, \
             adapted in warm-up.",
        ),
        flag(
            "doubling",
            "Expands the interval by doubling instead of stepping out: for slices much wider \
             than `width`.",
        ),
    ],
    "Slice sampling of one number at a time with stepping out or doubling (Neal 2003).",
    number!("infer { repeat 100 { slice(@x, width = 2); collect x; } }"),
    |call| {
        call.moving(|scope, call| {
            Ok(Slice::new(scope, call.positive_if_given("width")?, call.truth("doubling")?))
        })
    },
);

/// The most widths of stepping out, divided at random between both sides, which keeps the
/// kernel reversible.
const STEPS_OUT: u32 = 32;

/// The most doublings of an interval.
const DOUBLINGS: u32 = 16;

/// After this many shrinkage steps an interval contains only the present point.
const SHRINKS: u32 = 200;

/// Univariate slice sampling.
#[derive(Clone, Debug)]
pub struct Slice {
    scope: Registered,
    width: Option<f64>,
    doubling: bool,
    /// By address and coordinate: widths adapted in warm-up, with the number of moves
    /// they are based on.
    learnt: FxHashMap<(u64, usize), (f64, f64)>,
}

impl Slice {
    /// A kernel for these choices, with a width in the unconstrained space, or adapted
    /// widths if it is `None`. The interval doubles or steps out.
    pub fn new(scope: SiteSelection, width: Option<f64>, doubling: bool) -> Self {
        Slice { scope: Registered::new(scope), width, doubling, learnt: FxHashMap::default() }
    }

    fn width(&self, key: (u64, usize)) -> f64 {
        self.width.unwrap_or_else(|| self.learnt.get(&key).map_or(1.0, |(w, _)| *w))
    }

    /// Adapts a width towards three times the mean distance moved: two random points of
    /// an interval are on average a third of its length apart.
    fn learn(&mut self, key: (u64, usize), moved: f64) {
        let (width, count) = self.learnt.entry(key).or_insert((1.0, 0.0));
        *count += 1.0;
        *width += ((3.0 * moved).clamp(1e-150, 1e150) - *width) / count.min(50.0);
    }
}

/// One coordinate of a choice.
struct Line<'a> {
    trace: &'a mut Trace,
    at: &'a StepContext,
    target: Target,
    y: Vec<f64>,
    coordinate: usize,
    /// The log Jacobian at the present point.
    jacobian: f64,
}

impl Line<'_> {
    /// The log density at a point relative to that of the present one; the point is
    /// pending afterwards.
    fn log_density(&mut self, x: f64) -> TraceResult<f64> {
        let mut y = self.y.clone();
        y[self.coordinate] = x;
        let proposed = self.trace.propose(&[(self.target, Change::Free(y))], self.at.draws(0));
        Ok(match recoverable(proposed)? {
            Some(w) if w.appeared + w.vanished == 0 => {
                self.at.tempered(&w) + w.log_jacobian - self.jacobian
            }
            _ => f64::NEG_INFINITY,
        })
    }

    fn here(&self) -> f64 {
        self.y[self.coordinate]
    }

    /// Moves along the line; returns the distance.
    fn step(&mut self, width: f64, doubling: bool, rng: &mut Stream) -> TraceResult<f64> {
        let here = self.here();
        let level = libm::log(rng.open_uniform());
        let left = here - width * rng.uniform();
        let first = (left, left + width);
        let interval = if doubling {
            self.double(first, level, rng)?
        } else {
            self.step_out(first, level, width, rng)?
        };
        let (mut left, mut right) = interval;
        for _ in 0..SHRINKS {
            let x = left + (right - left) * rng.uniform();
            if self.log_density(x)? > level
                && (!doubling || self.leads_back(x, interval, width, level)?)
            {
                self.trace.commit();
                return Ok((x - here).abs());
            }
            if x < here { left = x } else { right = x }
        }
        self.trace.rollback();
        Ok(0.0)
    }

    /// Widens an interval at each end until the end is outside the slice (figure 3).
    fn step_out(
        &mut self,
        (mut left, mut right): (f64, f64),
        level: f64,
        width: f64,
        rng: &mut Stream,
    ) -> TraceResult<(f64, f64)> {
        let mut to_left = rng.index(STEPS_OUT as usize);
        let mut to_right = STEPS_OUT as usize - 1 - to_left;
        while to_left > 0 && self.log_density(left)? > level {
            left -= width;
            to_left -= 1;
        }
        while to_right > 0 && self.log_density(right)? > level {
            right += width;
            to_right -= 1;
        }
        Ok((left, right))
    }

    /// Doubles an interval to either side at random until both ends are outside the slice
    /// (figure 4).
    fn double(
        &mut self,
        (mut left, mut right): (f64, f64),
        level: f64,
        rng: &mut Stream,
    ) -> TraceResult<(f64, f64)> {
        let (mut out_left, mut out_right) =
            (self.log_density(left)? <= level, self.log_density(right)? <= level);
        for _ in 0..DOUBLINGS {
            if out_left && out_right {
                break;
            }
            if rng.uniform() < 0.5 {
                left -= right - left;
                out_left = self.log_density(left)? <= level;
            } else {
                right += right - left;
                out_right = self.log_density(right)? <= level;
            }
        }
        Ok((left, right))
    }

    /// True if doubling from `x` could have led to this interval: it must not have
    /// stopped at any of the intervals that halving towards `x` passes through (figure
    /// 6). If so, `x` is pending.
    fn leads_back(
        &mut self,
        x: f64,
        (mut left, mut right): (f64, f64),
        width: f64,
        level: f64,
    ) -> TraceResult<bool> {
        let here = self.here();
        let mut differs = false;
        while right - left > 1.1 * width {
            let middle = left + 0.5 * (right - left);
            differs |= (here < middle) != (x < middle);
            if x < middle {
                right = middle
            } else {
                left = middle
            }
            if differs && self.log_density(left)? <= level && self.log_density(right)? <= level {
                return Ok(false);
            }
        }
        if differs {
            self.log_density(x)?;
        }
        Ok(true)
    }
}

impl Kernel for Slice {
    fn name(&self) -> String {
        "slice".into()
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn save(&self, _: &Trace) -> Vec<u8> {
        pack(&in_order(&self.learnt).into_iter().collect::<Vec<_>>())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let learnt: Vec<_> = unpack(state)?;
        self.learnt = learnt.into_iter().collect();
        Ok(())
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, _) = self.scope.members(trace, &mut rng);
        let site = if let [one] = targets[..] { Some(one) } else { None };
        let mut outcome = Outcome { site, ..Default::default() };
        for target in targets {
            let mut coordinate = 0;
            // Read again for each coordinate, as the previous one has moved.
            while let Some((y, jacobian)) =
                trace.free_to_move(target).filter(|(y, _)| coordinate < y.len())
            {
                let key = (trace.address_hash(target), coordinate);
                let width = self.width(key);
                let mut line = Line { trace, at, target, y, coordinate, jacobian };
                let moved = line.step(width, self.doubling, &mut rng)?;
                if at.adapting && self.width.is_none() {
                    self.learn(key, moved);
                }
                outcome.proposals += 1;
                outcome.accepted += 1;
                coordinate += 1;
            }
        }
        Ok(outcome)
    }
}
