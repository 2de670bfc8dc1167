//! The metric of Hamiltonian kernels: a linear map T from a space in which the posterior is
//! about round, and momenta are standard normal, to the unconstrained coordinates. The
//! inverse mass is T T^T.
//!
//! T scales each coordinate, and before that stretches some directions, at right angles to
//! each other. Without directions it is a diagonal metric.

use crate::state::{StateError, holds};
use serde::{Deserialize, Serialize};

/// Scales by coordinate, and stretched directions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Metric {
    pub scales: Vec<f64>,
    pub stretched: Directions,
}

/// Directions among scaled coordinates, and by how much each is stretched.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Directions {
    /// Unit vectors, one after the other.
    pub along: Vec<f64>,
    /// The factors, less 1.
    pub more: Vec<f64>,
}

impl Metric {
    /// The metric that leaves coordinates as they are.
    #[cfg(test)]
    pub fn plain(n: usize) -> Metric {
        Metric { scales: vec![1.0; n], stretched: Directions::default() }
    }

    pub fn dimensions(&self) -> usize {
        self.scales.len()
    }

    /// The gradient in the round space: `out` = T^T `gradient`.
    #[inline]
    pub fn pull(&self, gradient: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(gradient.iter().zip(&self.scales).map(|(g, s)| g * s));
        self.stretched.apply(out);
    }

    /// Moves coordinates by a vector of the round space: `to` = `from` + `step` T `by`.
    #[inline]
    pub fn push(&self, from: &[f64], step: f64, by: &[f64], to: &mut Vec<f64>) {
        to.clear();
        if self.stretched.more.is_empty() {
            let moved = from.iter().zip(by).zip(&self.scales);
            to.extend(moved.map(|((y, p), s)| y + step * s * p));
            return;
        }
        to.extend_from_slice(by);
        self.stretched.apply(to);
        let moved = to.iter_mut().zip(from).zip(&self.scales);
        moved.for_each(|((p, y), s)| *p = y + step * s * *p);
    }

    /// The log of the determinant of T.
    pub fn log_size(&self) -> f64 {
        let all = self.scales.iter().copied().chain(self.stretched.more.iter().map(|m| 1.0 + m));
        all.map(libm::log).sum()
    }
}

impl Directions {
    /// Stretches a vector along all directions.
    #[inline]
    fn apply(&self, x: &mut [f64]) {
        for (along, more) in self.along.chunks_exact(x.len().max(1)).zip(&self.more) {
            let share: f64 = along.iter().zip(&*x).map(|(u, x)| u * x).sum();
            let by = more * share;
            x.iter_mut().zip(along).for_each(|(x, u)| *x += by * u);
        }
    }

    /// Checks what a checkpoint has for `n` coordinates.
    ///
    /// # Errors
    /// If the sizes are inconsistent.
    pub fn check(&self, n: usize) -> Result<(), StateError> {
        holds(n.checked_mul(self.more.len()) == Some(self.along.len()), "a metric")
    }
}
