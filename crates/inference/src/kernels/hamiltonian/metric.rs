//! The metric of Hamiltonian kernels: a linear map T from a space in which the posterior is
//! about round, and momenta are standard normal, to the unconstrained coordinates. The
//! inverse mass is T T^T.

use crate::state::{StateError, holds};
use serde::{Deserialize, Serialize};

/// A scale for each coordinate, and before that a map of all of them if their correlations
/// are known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Metric {
    pub scales: Vec<f64>,
    /// T, column by column, and row by row; empty if coordinates are scaled only.
    columns: Vec<f64>,
    rows: Vec<f64>,
    /// The log of the determinant of T.
    pub log_size: f64,
}

/// The symmetric map of scaled coordinates that makes up for their correlations, column by
/// column, and the log of its determinant; empty if there is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Mixing {
    pub columns: Vec<f64>,
    pub log_size: f64,
}

impl Metric {
    /// The metric of these scales, after a map of as many coordinates or none.
    pub fn new(scales: Vec<f64>, mixing: &Mixing) -> Metric {
        let n = scales.len();
        let log_size = scales.iter().map(|s| libm::log(*s)).sum::<f64>() + mixing.log_size;
        let (mut columns, mut rows) = (mixing.columns.clone(), mixing.columns.clone());
        for column in columns.chunks_exact_mut(n.max(1)) {
            column.iter_mut().zip(&scales).for_each(|(x, s)| *x *= s);
        }
        for (row, s) in rows.chunks_exact_mut(n.max(1)).zip(&scales) {
            row.iter_mut().for_each(|x| *x *= s);
        }
        Metric { scales, columns, rows, log_size }
    }

    pub fn dimensions(&self) -> usize {
        self.scales.len()
    }

    /// The gradient in the round space: `out` = T^T `gradient`.
    #[inline]
    pub fn pull(&self, gradient: &[f64], out: &mut Vec<f64>) {
        out.clear();
        if self.rows.is_empty() {
            out.extend(gradient.iter().zip(&self.scales).map(|(g, s)| g * s));
        } else {
            out.resize(gradient.len(), 0.0);
            add_columns(&self.rows, gradient, out);
        }
    }

    /// Moves coordinates by a vector of the round space: `to` = `from` + `step` T `by`.
    #[inline]
    pub fn push(&self, from: &[f64], step: f64, by: &[f64], to: &mut Vec<f64>) {
        to.clear();
        if self.columns.is_empty() {
            let moved = from.iter().zip(by).zip(&self.scales);
            to.extend(moved.map(|((y, p), s)| y + step * s * p));
        } else {
            to.resize(from.len(), 0.0);
            add_columns(&self.columns, by, to);
            to.iter_mut().zip(from).for_each(|(d, y)| *d = y + step * *d);
        }
    }

    /// Checks what a checkpoint has.
    ///
    /// # Errors
    /// If the sizes are inconsistent.
    pub fn check(&self) -> Result<(), StateError> {
        let n = self.scales.len();
        let whole = self.columns.is_empty() || Some(self.columns.len()) == n.checked_mul(n);
        holds(whole && self.rows.len() == self.columns.len(), "a metric")
    }
}

/// Adds columns, each times its share, to a vector of their length.
#[inline]
fn add_columns(columns: &[f64], shares: &[f64], out: &mut [f64]) {
    let n = out.len();
    let (fours, four_shares) = (columns.chunks_exact(4 * n), shares.chunks_exact(4));
    let (rest, rest_shares) = (fours.remainder(), four_shares.remainder());
    for (four, by) in fours.zip(four_shares) {
        let ((a, b), (c, d)) = {
            let (first, second) = four.split_at(2 * n);
            (first.split_at(n), second.split_at(n))
        };
        for ((((o, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *o += (a * by[0] + b * by[1]) + (c * by[2] + d * by[3]);
        }
    }
    for (column, by) in rest.chunks_exact(n).zip(rest_shares) {
        out.iter_mut().zip(column).for_each(|(o, x)| *o += x * by);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_and_moves_are_adjoint() {
        for n in [1usize, 3, 4, 5, 9] {
            let entry = |i: usize, j: usize| libm::cos((i * j + i + j) as f64);
            let columns: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
            let scales: Vec<f64> = (0..n).map(|i| 0.5 + i as f64).collect();
            for mixing in [Mixing { columns, log_size: 0.0 }, Mixing::default()] {
                let metric = Metric::new(scales.clone(), &mixing);
                let p: Vec<f64> = (0..n).map(|i| libm::sin(i as f64)).collect();
                let g: Vec<f64> = (0..n).map(|i| 1.0 / (1.0 + i as f64)).collect();
                let (mut force, mut to) = (Vec::new(), Vec::new());
                metric.pull(&g, &mut force);
                metric.push(&vec![0.0; n], 2.0, &p, &mut to);
                let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                assert!((dot(&to, &g) - 2.0 * dot(&p, &force)).abs() < 1e-12, "{n}");
                for i in 0..n {
                    let mixed = if mixing.columns.is_empty() {
                        p[i]
                    } else {
                        (0..n).map(|j| entry(j, i) * p[j]).sum()
                    };
                    assert!((to[i] - 2.0 * scales[i] * mixed).abs() < 1e-12, "{n} {i}");
                }
            }
        }
    }
}
