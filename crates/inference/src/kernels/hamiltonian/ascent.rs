//! Ascent to a mode by L-BFGS (Nocedal & Wright 2006, algorithm 7.4) with a backtracking
//! line search. The mode is that of the density in the unconstrained space, in which the
//! kernels of this family move.
//!
//! Climbs of the same choices share how far coordinates move ([`Scales`]): L-BFGS alone has to
//! find that in each, in more steps than it has.

use super::memory::Memory;
use super::point::Point;
use super::system::System;
use crate::kernel::StepContext;
use pcadlang_engine::trace::{ChoiceKind, Selector, Trace, TraceResult};
use std::collections::VecDeque;
use std::sync::Arc;

/// The number of previous steps from which the curvature is estimated.
const MEMORY: usize = 8;

/// A step and the change of the gradient over it.
#[derive(Clone, Debug)]
pub(super) struct Pair {
    step: Vec<f64>,
    change: Vec<f64>,
}

/// The last steps of a climb, which remain valid if it is interrupted.
pub(super) type Past = VecDeque<Pair>;

/// How far each coordinate moves for a change of the gradient, in the climbs of some choices so far:
/// the geometric mean of the diagonals of an inverse curvature and of a curvature, as a metric of
/// states and forces has it.
#[derive(Clone, Debug, Default)]
pub(super) struct Scales {
    pairs: u32,
    /// Sums of the squares of steps and of changes, each by the product of both.
    steps: Vec<f64>,
    changes: Vec<f64>,
    /// Empty until enough is known.
    ratios: Vec<f64>,
}

/// The number of steps from which scales are known.
const KNOWN: u32 = 20;

impl Scales {
    fn learn(&mut self, Pair { step, change }: &Pair) {
        let n = step.len();
        if self.steps.len() != n {
            *self = Scales { steps: vec![0.0; n], changes: vec![0.0; n], ..Scales::default() };
        }
        self.pairs += 1;
        let by = 1.0 / dot(step, change);
        let add = |sums: &mut [f64], xs: &[f64]| {
            sums.iter_mut().zip(xs).for_each(|(sum, x)| *sum += x * x * by);
        };
        add(&mut self.steps, step);
        add(&mut self.changes, change);
        if self.pairs >= KNOWN {
            self.ratios.clear();
            // No coordinate is infinitely stiff or soft.
            let [least, most] = [&self.steps, &self.changes]
                .map(|sums| 1e-12 * sums.iter().sum::<f64>() + f64::MIN_POSITIVE);
            let ratio = |(s, c): (&f64, &f64)| ((s + least) / (c + most)).sqrt();
            self.ratios.extend(self.steps.iter().zip(&self.changes).map(ratio));
            if !self.ratios.iter().all(|r| r.is_finite()) {
                *self = Scales::default();
            }
        }
    }

    /// The scales, if they are known and of this number of coordinates.
    fn of(&self, n: usize) -> Option<&[f64]> {
        Some(&self.ratios[..]).filter(|ratios| n > 0 && ratios.len() == n)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The direction of ascent: the gradient times the inverse curvature from the last steps.
fn direction(gradient: &[f64], past: &Past, scales: &Scales) -> Vec<f64> {
    let mut q = gradient.to_vec();
    let mut shares = Vec::with_capacity(past.len());
    for p in past.iter().rev() {
        let share = dot(&p.step, &q) / dot(&p.step, &p.change);
        q.iter_mut().zip(&p.change).for_each(|(q, y)| *q -= share * y);
        shares.push(share);
    }
    let scales = scales.of(q.len());
    if let Some(scales) = scales {
        q.iter_mut().zip(scales).for_each(|(q, s)| *q *= s);
    }
    if let Some(Pair { step, change }) = past.back() {
        let square = |(c, s): (&f64, &f64)| c * c * s;
        let length = match scales {
            Some(scales) => change.iter().zip(scales).map(square).sum(),
            None => dot(change, change),
        };
        let scale = dot(step, change) / length;
        q.iter_mut().for_each(|q| *q *= scale);
    } else if scales.is_none() {
        let length = dot(gradient, gradient).sqrt().max(1.0);
        q.iter_mut().for_each(|q| *q /= length);
    }
    for (p, share) in past.iter().zip(shares.iter().rev()) {
        let back = dot(&p.change, &q) / dot(&p.step, &p.change);
        q.iter_mut().zip(&p.step).for_each(|(q, s)| *q += (share - back) * s);
    }
    q
}

/// Finds a point along a direction that gains enough (Armijo's rule), with ever shorter
/// steps.
fn climb(system: &mut System, from: &Point, along: &[f64]) -> TraceResult<Option<Arc<Point>>> {
    let slope = dot(along, &from.gradient);
    let mut step = 1.0;
    for _ in 0..40 {
        if let Some(to) = system.go(from.y.iter().zip(along).map(|(y, d)| y + step * d))?
            && to.log_density >= from.log_density + 1e-4 * step * slope
        {
            return Ok(Some(to));
        }
        step *= 0.5;
    }
    Ok(None)
}

/// Returns the point reached by at most `steps` steps uphill; `past` has the steps before, and
/// `scales` learns from them.
pub(super) fn ascend(
    system: &mut System,
    begun: &Arc<Point>,
    steps: u32,
    past: &mut Past,
    scales: &mut Scales,
) -> TraceResult<Arc<Point>> {
    let mut here = Arc::clone(begun);
    for _ in 0..steps {
        let mut along = direction(&here.gradient, past, scales);
        let slope = dot(&along, &here.gradient);
        if slope.is_nan() || slope <= 0.0 {
            past.clear();
            along = direction(&here.gradient, past, scales);
        }
        let Some(next) = climb(system, &here, &along)? else {
            if past.is_empty() {
                break;
            }
            past.clear();
            continue;
        };
        let step: Vec<f64> = next.y.iter().zip(&here.y).map(|(a, b)| a - b).collect();
        let change: Vec<f64> =
            here.gradient.iter().zip(&next.gradient).map(|(a, b)| a - b).collect();
        let gain = next.log_density - here.log_density;
        if dot(&step, &change) > 1e-12 * dot(&change, &change) {
            let pair = Pair { step, change };
            scales.learn(&pair);
            past.push_back(pair);
            if past.len() > MEMORY {
                past.pop_front();
            }
        }
        here = next;
        let flat = here.gradient.iter().all(|g| g.abs() < 1e-7);
        if flat || gain.abs() <= 1e-13 * (1.0 + here.log_density.abs()) {
            break;
        }
    }
    Ok(here)
}

/// The most steps of a short ascent.
const FEW: u32 = 50;

/// Climbs a few steps with all continuous choices, while each gains much more than the
/// density varies within the typical set; a mode may be far from that.
pub(crate) fn approach(trace: &mut Trace, at: &StepContext) -> TraceResult<()> {
    let selection = trace.select(&Selector::Kind(ChoiceKind::Continuous));
    let targets = trace.targets(selection).to_vec();
    let mut memory = Memory::default();
    // Where there is no gradient the state stays as it is.
    let Ok(Some((mut system, begun))) = System::begin(trace, at, &targets, None, &mut memory)
    else {
        return Ok(());
    };
    let (mut here, mut past) = (Arc::clone(&begun), Past::new());
    for _ in 0..FEW {
        let alone = &mut Scales::default();
        let Ok(next) = ascend(&mut system, &here, 1, &mut past, alone) else { break };
        let gain = next.log_density - here.log_density;
        here = next;
        if gain < 10.0 + here.y.len() as f64 {
            break;
        }
    }
    let moved = here.log_density > begun.log_density && system.finish_at(Some(&here))?;
    if !moved {
        trace.rollback();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_engine::trace::Draws;

    /// -2 |y|^2 has the gradient -4 y: one step along an axis determines the curvature in
    /// all directions.
    #[test]
    fn the_direction_leads_to_the_top_of_a_round_hill() {
        let past = VecDeque::from([Pair { step: vec![1.0, 0.0], change: vec![4.0, 0.0] }]);
        assert_eq!(direction(&[8.0, 4.0], &past, &Scales::default()), [2.0, 1.0]);
    }

    /// Makes at most that many steps with all choices from a state.
    fn climb_all(trace: &mut Trace, steps: u32) {
        let (at, mut memory) = (StepContext::new(1, 0, 0), Memory::default());
        let targets = trace.all_targets().to_vec();
        let (mut system, begun) =
            System::begin(trace, &at, &targets, None, &mut memory).unwrap().unwrap();
        let top =
            ascend(&mut system, &begun, steps, &mut Past::new(), &mut Scales::default()).unwrap();
        assert!(system.finish_at(Some(&top)).unwrap());
    }

    /// The gradient points across a ridge, while the last steps point along it.
    #[test]
    fn a_narrow_ridge_takes_few_steps() {
        let text =
            "assume a ~ normal(0, 1); assume b ~ normal(0, 1); observe normal(a + b, 0.1) = 1;";
        let mut trace = crate::testing::trace(text, 1);
        for (address, x) in [("@a", 2.0), ("@b", -1.0)] {
            trace.set(address, x, Draws::default()).unwrap();
        }
        climb_all(&mut trace, 40);
        for t in trace.all_targets() {
            let x = trace.stored(*t).and_then(|x| x.num()).unwrap();
            // Where a = b and a + 100 (a + b - 1) = 0.
            assert!((x - 100.0 / 201.0).abs() < 1e-6, "{x}");
        }
    }

    /// The curvature is so small that no fraction of the proposed step leads uphill: the
    /// gradient alone does.
    #[test]
    fn a_slope_that_is_almost_straight_is_climbed_by_its_gradient() {
        // Symmetric about 50, and straight on both sides.
        let text = "assume x ~ flat(); factor(x - 2 * log1p(exp(x - 50)));";
        let mut trace = crate::testing::trace(text, 1);
        trace.set("@x", 15.0, Draws::default()).unwrap();
        climb_all(&mut trace, 60);
        let x = trace.stored(trace.all_targets()[0]).and_then(|x| x.num()).unwrap();
        assert!((x - 50.0).abs() < 1e-3, "{x}");
    }

    /// Twelve choices whose deviations differ by a factor of 560, all one deviation off: a climb
    /// has to find each curvature, one after it knows them.
    #[test]
    fn scales_of_one_climb_serve_the_next() {
        let deviation = |i: usize| 10f64.powf(i as f64 / 4.0);
        let seen = |i| {
            let d = deviation(i);
            format!("assume x{i} ~ normal(0, {d}); observe normal(x{i}, {d}) = 0;")
        };
        let text: String = (0..12).map(seen).collect();
        let gain = |steps: u32, scales: &mut Scales| {
            let mut trace = crate::testing::trace(&text, 1);
            for i in 0..12 {
                trace.set(&format!("@x{i}"), deviation(i), Draws::default()).unwrap();
            }
            let (at, mut memory) = (StepContext::new(1, 0, 0), Memory::default());
            let targets = trace.all_targets().to_vec();
            let (mut system, begun) =
                System::begin(&mut trace, &at, &targets, None, &mut memory).unwrap().unwrap();
            let top = ascend(&mut system, &begun, steps, &mut Past::new(), scales).unwrap();
            top.log_density - begun.log_density
        };
        let mut known = Scales::default();
        assert!((gain(200, &mut known) - 12.0).abs() < 1e-6);
        assert!(gain(3, &mut Scales::default()) < 11.0);
        assert!(gain(3, &mut known) > 11.98);
    }
}
