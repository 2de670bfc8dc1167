//! Correlations of a posterior from the states and forces of a window of warm-up.
//!
//! For a normal posterior of covariance C, states vary by C and forces by the inverse of C.
//! Both are estimated, and the metric S with S F S = C, F the covariance of forces, is their
//! geometric mean: the one of least Fisher divergence between the posterior and a normal
//! (Seyboldt, Carlson & Carpenter 2026, "Preconditioning Hamiltonian Monte Carlo by
//! minimizing Fisher divergence"). For a normal posterior it is exact after as many states
//! as there are coordinates.

use super::metric::Mixing;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// The most coordinates whose correlations are learnt: a leapfrog step costs the square of
/// their number.
pub(super) const MOST: usize = 64;
/// Up to how many coordinates correlations count however weak they are: the map costs less
/// than the density.
const FEW: usize = 16;
/// With more of them, where a standard deviation differs from 1 by more than this factor.
const MATTERS: f64 = 1.4;
/// Weight of the unit matrix beside the covariances, in states.
const PRIOR: f64 = 1e-3;

/// Means and sums of products of the states and forces of a window.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Window {
    count: f64,
    states: Products,
    forces: Products,
}

/// A mean and sums of products about it, row by row (Welford 1962).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Products {
    mean: Vec<f64>,
    sums: Vec<f64>,
}

impl Products {
    fn add(&mut self, x: &[f64], count: f64) {
        let n = x.len();
        self.mean.resize(n, 0.0);
        self.sums.resize(n * n, 0.0);
        let share = (count - 1.0) / count;
        for (i, row) in self.sums.chunks_exact_mut(n.max(1)).enumerate() {
            let d = share * (x[i] - self.mean[i]);
            // Up to the diagonal; the rest is the same.
            for ((s, x), m) in row[..=i].iter_mut().zip(x).zip(&self.mean) {
                *s += d * (x - m);
            }
        }
        self.mean.iter_mut().zip(x).for_each(|(m, x)| *m += (x - *m) / count);
    }

    /// The covariance in scaled coordinates, with a little of the unit matrix.
    fn covariance(&self, scale: impl Fn(usize) -> f64, count: f64) -> DMatrix<f64> {
        let n = self.mean.len();
        DMatrix::from_fn(n, n, |i, j| {
            let sum = self.sums[i.max(j) * n + i.min(j)] * scale(i) * scale(j);
            (sum + if i == j { PRIOR } else { 0.0 }) / (count - 1.0 + PRIOR)
        })
    }
}

impl Window {
    /// Adds a state and the force there.
    pub fn add(&mut self, state: &[f64], force: &[f64]) {
        if state.len() != force.len() || state.len() != self.states.mean.len() {
            *self = Window::default();
        }
        if state.len() <= MOST && state.len() == force.len() {
            self.count += 1.0;
            self.states.add(state, self.count);
            self.forces.add(force, self.count);
        }
    }

    /// True if a checkpoint's sizes are consistent.
    pub fn is_whole(&self) -> bool {
        let n = self.states.mean.len();
        let square = |p: &Products| p.mean.len() == n && p.sums.len() == n * n;
        n <= MOST && square(&self.states) && square(&self.forces)
    }

    /// The map to make before coordinates are scaled; none if too little is known.
    pub fn mixing(&self, scales: &[f64]) -> Mixing {
        self.found(scales).unwrap_or_default()
    }

    fn found(&self, scales: &[f64]) -> Option<Mixing> {
        let n = self.states.mean.len();
        if n < 2 || n != scales.len() || self.count < 10.0 {
            return None;
        }
        let states = self.states.covariance(|i| scales[i].recip(), self.count);
        let forces = self.forces.covariance(|i| scales[i], self.count);
        let finite = |m: &DMatrix<f64>| m.iter().all(|x| x.is_finite());
        if !finite(&states) || !finite(&forces) {
            return None;
        }
        // With F = L L^T: S = L^-T (L^T C L)^(1/2) L^-1.
        let l = forces.cholesky()?.unpack();
        let middle = root(l.transpose() * states * &l)?.0;
        let half = l.transpose().solve_upper_triangular(&middle)?;
        let metric = l.transpose().solve_upper_triangular(&half.transpose())?;
        let (mixing, deviations) = root(metric)?;
        let usual = MATTERS.recip()..=MATTERS;
        let matters = n <= FEW || deviations.iter().any(|x| !usual.contains(x));
        let log_size: f64 = deviations.iter().map(|x| libm::log(*x)).sum();
        let known = matters && log_size.is_finite();
        known.then(|| Mixing { columns: mixing.iter().copied().collect(), log_size })
    }
}

/// The square root of a positive matrix, and its eigenvalues.
fn root(m: DMatrix<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let symmetric = (&m + m.transpose()) * 0.5;
    if symmetric.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::try_new(symmetric, f64::EPSILON, 10_000)?;
    let roots = eigen.eigenvalues.map(|x| x.max(0.0).sqrt());
    let v = eigen.eigenvectors;
    Some((&v * DMatrix::from_diagonal(&roots) * v.transpose(), roots))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The states of a normal distribution with this covariance: the metric is exact after few.
    #[test]
    fn the_covariance_of_a_normal_is_found_from_few_states() {
        let covariance =
            DMatrix::from_row_slice(3, 3, &[4.0, 1.9, 0.0, 1.9, 1.0, 0.1, 0.0, 0.1, 1.0]);
        let precision = covariance.clone().try_inverse().unwrap();
        let mut window = Window::default();
        for i in 0..12 {
            let y = DVector::from_fn(3, |j, _| libm::sin((i * (j + 2) * (j + 3)) as f64));
            window.add(y.as_slice(), (-&precision * &y).as_slice());
        }
        let scales = [2.0, 1.0, 1.0];
        let s = DMatrix::from_column_slice(3, 3, &window.mixing(&scales).columns);
        let t = DMatrix::from_diagonal(&DVector::from_row_slice(&scales)) * s;
        let found = &t * t.transpose();
        assert!((&found - &covariance).norm() < 0.01, "{found} {covariance}");
    }

    #[test]
    fn nothing_is_learnt_from_few_states_or_from_what_is_not_a_number() {
        let mut window = Window::default();
        (0..9).for_each(|i| window.add(&[f64::from(i), 1.0], &[0.0, 1.0]));
        assert_eq!(window.mixing(&[1.0, 1.0]), Mixing::default());
        (0..9).for_each(|_| window.add(&[f64::INFINITY, 1.0], &[0.0, 1.0]));
        assert_eq!(window.mixing(&[1.0, 1.0]), Mixing::default());
        assert_eq!(window.mixing(&[1.0]), Mixing::default());
    }

    #[test]
    fn coordinates_that_do_not_vary_stay_as_they_are() {
        let mut window = Window::default();
        (0..40).for_each(|i| {
            window.add(&[libm::sin(f64::from(i)), 1.0], &[-libm::sin(f64::from(i)), 0.0])
        });
        let columns = window.mixing(&[1.0, 1.0]).columns;
        let near = columns.iter().zip([1.0, 0.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near, "{columns:?}");
    }
}
