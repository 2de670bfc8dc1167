//! Correlations of a posterior from the states and forces of a window of warm-up.
//!
//! For a normal posterior of covariance C, states vary by C and forces by the inverse of C.
//! Both are estimated, and the metric S with S F S = C, F the covariance of forces, is their
//! geometric mean: the one of least Fisher divergence between the posterior and a normal
//! (Seyboldt, Carlson & Carpenter 2026, "Preconditioning Hamiltonian Monte Carlo by
//! minimizing Fisher divergence"). For a normal posterior it is exact after as many states
//! as there are coordinates.

use super::metric::Directions;
use nalgebra::{DMatrix, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// The most coordinates whose correlations are learnt: a leapfrog step costs up to the
/// square of their number.
pub(super) const MOST: usize = 64;
/// Weight of the unit matrix beside the covariances, in states.
const PRIOR: f64 = 1e-3;
/// Directions are stretched where a standard deviation differs from 1 by more than this
/// factor.
const MATTERS: f64 = 1.4;

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

    /// The directions to stretch after these scales; none if too little is known.
    pub fn directions(&self, scales: &[f64]) -> Directions {
        self.found(scales).unwrap_or_default()
    }

    fn found(&self, scales: &[f64]) -> Option<Directions> {
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
        let root = root(l.transpose() * states * &l)?;
        let half = l.transpose().solve_upper_triangular(&root)?;
        let metric = l.transpose().solve_upper_triangular(&half.transpose())?;
        let metric = (&metric + metric.transpose()) * 0.5;
        if !finite(&metric) {
            return None;
        }
        let eigen = SymmetricEigen::try_new(metric, f64::EPSILON, 10_000)?;
        let mut found = Directions::default();
        for (variance, along) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let by = variance.sqrt();
            if by.is_finite() && by > 0.0 && !(MATTERS.recip()..=MATTERS).contains(&by) {
                found.along.extend(along.iter());
                found.more.push(by - 1.0);
            }
        }
        Some(found)
    }
}

/// The square root of a positive matrix.
fn root(m: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let symmetric = (&m + m.transpose()) * 0.5;
    let eigen = SymmetricEigen::try_new(symmetric, f64::EPSILON, 10_000)?;
    let roots = eigen.eigenvalues.map(|x| x.max(0.0).sqrt());
    let v = eigen.eigenvectors;
    Some(&v * DMatrix::from_diagonal(&roots) * v.transpose())
}
