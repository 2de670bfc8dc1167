//! The shape of a posterior as a random walk adapts to it in warm-up: a covariance in the
//! unconstrained space (Haario, Saksman & Tamminen 2001), from windows of states that
//! double in length, so that states before convergence are forgotten.

use nalgebra::DMatrix;
use pcadlang_numerics::rng::Stream;
use serde::{Deserialize, Serialize};

/// The length of the first window, in states.
const WINDOW: u32 = 100;
/// The most coordinates whose covariance is worth estimating.
pub(super) const MOST: usize = 64;

/// The running covariance of a window, and the Cholesky factor of the previous window's.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Shape {
    mean: Vec<f64>,
    /// Sums of products of deviations: the lower triangle by rows.
    products: Vec<f64>,
    count: u32,
    window: u32,
    factor: Option<DMatrix<f64>>,
}

impl Shape {
    pub fn new(dimensions: usize) -> Self {
        let window = WINDOW.max(10 * dimensions as u32);
        let products = vec![0.0; dimensions * (dimensions + 1) / 2];
        Shape { mean: vec![0.0; dimensions], products, count: 0, window, factor: None }
    }

    /// True if the parts have consistent sizes; those read from a checkpoint may not.
    pub fn fits(&self) -> bool {
        let d = self.mean.len();
        let factor = self.factor.as_ref().is_none_or(|f| (f.nrows(), f.ncols()) == (d, d));
        d <= MOST && self.products.len() == d * (d + 1) / 2 && factor
    }

    /// Adds a state to the window.
    pub fn add(&mut self, y: &[f64]) {
        self.count = self.count.saturating_add(1);
        let n = f64::from(self.count);
        let before: Vec<f64> = y.iter().zip(&self.mean).map(|(y, m)| y - m).collect();
        self.mean.iter_mut().zip(&before).for_each(|(m, d)| *m += d / n);
        let mut entries = self.products.iter_mut();
        for (i, d) in before.iter().enumerate() {
            let after = y[..=i].iter().zip(&self.mean);
            after.zip(entries.by_ref()).for_each(|((y, m), p)| *p += d * (y - m));
        }
        if self.count == self.window {
            self.close();
        }
    }

    /// Ends a window: its covariance, shrunk slightly towards its diagonal, is used as
    /// the shape from now on.
    fn close(&mut self) {
        let (d, n) = (self.mean.len(), f64::from(self.count));
        let covariance = DMatrix::from_fn(d, d, |i, j| {
            let (i, j) = (i.max(j), i.min(j));
            let c = self.products[i * (i + 1) / 2 + j] / (n - 1.0);
            if i == j { c * (1.0 + 1e-3) + 1e-10 } else { c * (n / (n + 5.0)) }
        });
        if let Some(cholesky) = covariance.cholesky() {
            self.factor = Some(cholesky.unpack());
        }
        let longer = self.window.saturating_mul(2);
        *self = Shape { window: longer, factor: self.factor.take(), ..Shape::new(d) };
    }

    /// Draws a step of this shape, of unit scale; `None` before the end of the first
    /// window.
    pub fn step(&self, rng: &mut Stream) -> Option<Vec<f64>> {
        let factor = self.factor.as_ref()?;
        let z: Vec<f64> = (0..factor.nrows()).map(|_| rng.standard_normal()).collect();
        Some((0..z.len()).map(|i| (0..=i).map(|j| factor[(i, j)] * z[j]).sum()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    #[test]
    fn steps_have_the_covariance_of_the_states() {
        let mut rng = StreamKey::new(1, 0, Purpose::KERNEL).stream(0, 0, 0);
        let mut shape = Shape::new(2);
        assert!(shape.step(&mut rng).is_none());
        // Correlation 0.95, standard deviations 1 and 3, far from the origin; windows of
        // 100, 200, … 12,800 states.
        for _ in 0..25_500 {
            let (a, b) = (rng.standard_normal(), rng.standard_normal());
            shape.add(&[50.0 + a, 3.0 * (0.95 * a + (1.0 - 0.95f64 * 0.95).sqrt() * b)]);
        }
        let steps: Vec<Vec<f64>> = (0..40_000).filter_map(|_| shape.step(&mut rng)).collect();
        let moment = |i: usize, j: usize| {
            steps.iter().map(|s| s[i] * s[j]).sum::<f64>() / steps.len() as f64
        };
        assert!((moment(0, 0) - 1.0).abs() < 0.05, "{}", moment(0, 0));
        assert!((moment(1, 1) - 9.0).abs() < 0.45, "{}", moment(1, 1));
        assert!((moment(0, 1) - 2.85).abs() < 0.15, "{}", moment(0, 1));
    }

    /// The unshrunk covariance of few states in many dimensions would be nearly singular.
    #[test]
    fn the_first_shape_in_many_dimensions_is_near_that_of_the_states() {
        let mut rng = StreamKey::new(2, 0, Purpose::KERNEL).stream(0, 0, 0);
        let mut shape = Shape::new(MOST);
        while shape.factor.is_none() {
            let state: Vec<f64> = (0..MOST).map(|_| rng.standard_normal()).collect();
            shape.add(&state);
        }
        let factor = shape.factor.unwrap();
        let variances = (&factor * factor.transpose()).symmetric_eigenvalues();
        assert!(variances.min() > 0.3 && variances.max() < 2.3, "{variances}");
    }
}
