//! Ascent to a mode by L-BFGS (Nocedal & Wright 2006, algorithm 7.4) with a backtracking
//! line search. The mode is that of the density in the unconstrained space, in which the
//! kernels of this family move.

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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The direction of ascent: the gradient times the inverse curvature from the last steps.
fn direction(gradient: &[f64], past: &Past) -> Vec<f64> {
    let mut q = gradient.to_vec();
    let mut shares = Vec::with_capacity(past.len());
    for p in past.iter().rev() {
        let share = dot(&p.step, &q) / dot(&p.step, &p.change);
        q.iter_mut().zip(&p.change).for_each(|(q, y)| *q -= share * y);
        shares.push(share);
    }
    if let Some(p) = past.back() {
        let scale = dot(&p.step, &p.change) / dot(&p.change, &p.change);
        q.iter_mut().for_each(|q| *q *= scale);
    } else {
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

/// Returns the point reached by at most `steps` steps uphill; `past` has the steps
/// before.
pub(super) fn ascend(
    system: &mut System,
    begun: &Arc<Point>,
    steps: u32,
    past: &mut Past,
) -> TraceResult<Arc<Point>> {
    let mut here = Arc::clone(begun);
    for _ in 0..steps {
        let mut along = direction(&here.gradient, past);
        let slope = dot(&along, &here.gradient);
        if slope.is_nan() || slope <= 0.0 {
            past.clear();
            along = direction(&here.gradient, past);
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
            past.push_back(Pair { step, change });
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
        let Ok(next) = ascend(&mut system, &here, 1, &mut past) else { break };
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
        assert_eq!(direction(&[8.0, 4.0], &past), [2.0, 1.0]);
    }

    /// Makes at most that many steps with all choices from a state.
    fn climb_all(trace: &mut Trace, steps: u32) {
        let (at, mut memory) = (StepContext::new(1, 0, 0), Memory::default());
        let targets = trace.all_targets().to_vec();
        let (mut system, begun) =
            System::begin(trace, &at, &targets, None, &mut memory).unwrap().unwrap();
        let top = ascend(&mut system, &begun, steps, &mut Past::new()).unwrap();
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
}
