//! Nonlinear least squares by damped Gauss-Newton steps (Levenberg 1944; Marquardt 1963), with
//! derivatives by forward differences.

use nalgebra::{DMatrix, DVector};

/// The step of the differences.
const DIFFERENCE: f64 = 1e-6;
/// The first and least damping, relative to the diagonal of the normal equations.
const DAMPING: f64 = 1e-3;
/// The damping is raised by this factor after a step that gains less than `POOR` of what the
/// linear model promises, and lowered by it after one that gains more than `GOOD`.
const FACTOR: f64 = 10.0;
const POOR: f64 = 0.25;
const GOOD: f64 = 0.75;
/// How often the damping of one step is raised before the search ends.
const TRIES: usize = 8;
/// The search ends when a step lowers the sum by less than this part of it.
const ENOUGH: f64 = 1e-4;

/// Lowers the sum of the squares of `residuals` from `start`, in at most `steps` steps, and
/// returns the lowest point found. The variables should be scaled so that each matters over
/// about a unit. `residuals` returns equally many numbers each time, or `None` where they are
/// undefined: no step leads there. `None` if they are undefined at `start`.
pub fn damped_least_squares(
    mut residuals: impl FnMut(&[f64]) -> Option<Vec<f64>>,
    start: &[f64],
    steps: usize,
) -> Option<Vec<f64>> {
    let square = |r: &[f64]| r.iter().map(|r| r * r).sum::<f64>();
    let mut x = start.to_vec();
    let mut here = residuals(&x)?;
    let mut sum = square(&here);
    let mut damping = DAMPING;
    for _ in 0..steps {
        let columns: Vec<Vec<f64>> = (0..x.len())
            .map(|i| {
                let mut beside = x.clone();
                beside[i] += DIFFERENCE;
                // A variable that cannot be moved this way stays.
                let there = residuals(&beside).unwrap_or_else(|| here.clone());
                there.iter().zip(&here).map(|(a, b)| (a - b) / DIFFERENCE).collect()
            })
            .collect();
        // Plain sums: the same bits on any machine.
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let normal = DMatrix::from_fn(x.len(), x.len(), |i, j| dot(&columns[i], &columns[j]));
        let slope = DVector::from_fn(x.len(), |i, _| -dot(&columns[i], &here));
        let diagonal = normal.diagonal();
        let better = (0..TRIES).find_map(|_| {
            let mut damped = normal.clone();
            let added = diagonal.map(|d| damping * d + f64::EPSILON);
            (0..x.len()).for_each(|i| damped[(i, i)] += added[i]);
            let step = damped.cholesky()?.solve(&slope);
            let to: Vec<f64> = x.iter().zip(step.iter()).map(|(x, d)| x + d).collect();
            let promised: f64 =
                (0..x.len()).map(|i| step[i] * (slope[i] + added[i] * step[i])).sum();
            let there = residuals(&to).map(|r| (square(&r), r));
            let gained = there.as_ref().map_or(f64::NEG_INFINITY, |(lower, _)| sum - lower);
            if gained < POOR * promised {
                damping *= FACTOR;
            } else if gained > GOOD * promised {
                damping = DAMPING.max(damping / FACTOR);
            }
            there.filter(|_| gained > 0.0).map(|(lower, r)| (to, lower, r))
        });
        let Some((to, lower, there)) = better else { break };
        let gained = sum - lower;
        (x, here) = (to, there);
        if gained < ENOUGH * std::mem::replace(&mut sum, lower) {
            break;
        }
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curved_valley_is_followed_to_its_lowest_point() {
        // Rosenbrock's function: its minimum is at (1, 1).
        let valley = |x: &[f64]| Some(vec![1.0 - x[0], 10.0 * (x[1] - x[0] * x[0])]);
        let found = damped_least_squares(valley, &[-1.2, 1.0], 50).unwrap();
        assert!(found.iter().all(|x| (x - 1.0).abs() < 1e-6), "{found:?}");
    }

    #[test]
    fn an_arm_of_two_links_reaches_its_target_or_stretches_towards_it() {
        let hand = |x: &[f64]| {
            let (a, b) = (x[0], x[0] + x[1]);
            [libm::cos(a) + libm::cos(b), libm::sin(a) + libm::sin(b)]
        };
        let to = |target: [f64; 2]| {
            let reach = move |x: &[f64]| {
                Some(hand(x).iter().zip(target).map(|(h, t)| h - t).collect::<Vec<f64>>())
            };
            hand(&damped_least_squares(reach, &[0.3, 0.4], 50).unwrap())
        };
        let [x, y] = to([0.5, 1.2]);
        assert!((x - 0.5).abs() < 1e-5 && (y - 1.2).abs() < 1e-5, "{x} {y}");
        let [x, y] = to([0.0, 3.0]);
        assert!(x.abs() < 1e-2 && (y - 2.0).abs() < 1e-2, "{x} {y}");
    }

    #[test]
    fn no_step_leads_where_the_residuals_are_undefined() {
        // The lowest point, -1, is outside of the domain.
        let root = |x: &[f64]| (x[0] >= 0.0).then(|| vec![x[0] + 1.0]);
        let found = damped_least_squares(root, &[2.0], 50).unwrap();
        assert!((0.0..0.1).contains(&found[0]), "{found:?}");
        assert_eq!(damped_least_squares(root, &[-1.0], 50), None);
    }
}
