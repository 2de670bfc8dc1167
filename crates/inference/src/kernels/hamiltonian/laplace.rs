//! A Gaussian about a mode of a density: Laplace's approximation (MacKay 2003, chapter
//! 27).

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pcadlang_numerics::rng::Stream;
use serde::{Deserialize, Serialize};

/// Curvatures are clamped to this range: flat and inverted directions, which a mode does
/// not have, get a standard deviation of 4.
const CURVATURES: (f64, f64) = (1.0 / 16.0, 1e12);

/// A multivariate normal distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Laplace {
    pub mean: Vec<f64>,
    /// The principal axes, concatenated.
    axes: Vec<f64>,
    /// The standard deviations along them.
    spreads: Vec<f64>,
}

impl Laplace {
    /// The approximation at a mode; `curvature` is minus the Hessian of the log density
    /// there, row by row.
    pub fn new(mean: Vec<f64>, curvature: &[f64]) -> Option<Laplace> {
        let n = mean.len();
        if curvature.len() != n * n || curvature.iter().any(|c| !c.is_finite()) {
            return None;
        }
        if n == 0 {
            return Some(Laplace { mean, axes: Vec::new(), spreads: Vec::new() });
        }
        let m = DMatrix::from_row_slice(n, n, curvature);
        let eigen = SymmetricEigen::try_new((&m + m.transpose()) * 0.5, 1e-12, 10_000)?;
        let spread = |c: &f64| 1.0 / c.clamp(CURVATURES.0, CURVATURES.1).sqrt();
        let spreads = eigen.eigenvalues.iter().map(spread).collect();
        Some(Laplace { mean, axes: eigen.eigenvectors.as_slice().to_vec(), spreads })
    }

    /// The log of the integral of exp(-x' C x / 2), C being the curvature.
    pub fn log_volume(&self) -> f64 {
        let half_log = 0.5 * libm::log(2.0 * std::f64::consts::PI);
        self.spreads.iter().map(|s| libm::log(*s) + half_log).sum()
    }

    fn axis(&self, i: usize) -> &[f64] {
        let n = self.mean.len();
        &self.axes[i * n..(i + 1) * n]
    }

    /// The squared Mahalanobis distance of a point from the mean.
    pub fn distance(&self, y: &[f64]) -> f64 {
        let off = DVector::from_iterator(y.len(), y.iter().zip(&self.mean).map(|(y, m)| y - m));
        let along = |i: usize| {
            self.axis(i).iter().zip(off.iter()).map(|(a, o)| a * o).sum::<f64>() / self.spreads[i]
        };
        (0..self.spreads.len()).map(|i| along(i) * along(i)).sum()
    }

    /// The log density at a point.
    pub fn log_density(&self, y: &[f64]) -> f64 {
        -0.5 * self.distance(y) - self.log_volume()
    }

    /// Draws a sample.
    pub fn sample(&self, rng: &mut Stream) -> Vec<f64> {
        let mut y = self.mean.clone();
        for (i, spread) in self.spreads.iter().enumerate() {
            let z = spread * rng.standard_normal();
            y.iter_mut().zip(self.axis(i)).for_each(|(y, a)| *y += z * a);
        }
        y
    }

    /// True if the parts are consistent; those read from a checkpoint may not be.
    pub fn is_sound(&self) -> bool {
        let n = self.mean.len();
        let finite = self.mean.iter().chain(&self.axes).all(|x| x.is_finite());
        finite
            && self.axes.len() == n * n
            && self.spreads.len() == n
            && self.spreads.iter().all(|s| *s > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    fn rng() -> Stream {
        StreamKey::new(5, 0, Purpose::KERNEL).stream(0, 0, 0)
    }

    /// The curvature [[2, 1], [1, 3]] has the determinant 5 and the inverse [[3, -1],
    /// [-1, 2]] / 5.
    #[test]
    fn density_and_draws_are_those_of_the_curvature() {
        let l = Laplace::new(vec![1.0, -2.0], &[2.0, 1.0, 1.0, 3.0]).unwrap();
        let tau = 2.0 * std::f64::consts::PI;
        let by_hand = |x: f64, y: f64| {
            -0.5 * (2.0 * x * x + 2.0 * x * y + 3.0 * y * y) - libm::log(tau / 5f64.sqrt())
        };
        for (x, y) in [(0.0, 0.0), (0.3, -1.0), (-2.0, 5.0)] {
            assert!((l.log_density(&[1.0 + x, -2.0 + y]) - by_hand(x, y)).abs() < 1e-9);
        }
        let (mut rng, n) = (rng(), 40_000);
        let mut moments = [0.0; 3];
        for _ in 0..n {
            let y = l.sample(&mut rng);
            let (a, b) = (y[0] - 1.0, y[1] + 2.0);
            moments = [moments[0] + a * a, moments[1] + a * b, moments[2] + b * b];
        }
        for (m, expected) in moments.map(|m| m / f64::from(n)).into_iter().zip([0.6, -0.2, 0.4]) {
            assert!((m - expected).abs() < 0.015, "{m} {expected}");
        }
    }

    #[test]
    fn what_is_flat_or_no_number_does_no_harm() {
        let l = Laplace::new(vec![0.0, 0.0], &[-3.0, 0.0, 0.0, 0.0]).unwrap();
        assert!(
            l.is_sound()
                && (l.log_density(&[4.0, 0.0]) - l.log_density(&[0.0, 0.0]) + 0.5).abs() < 1e-12
        );
        assert!(
            Laplace::new(vec![0.0], &[f64::NAN]).is_none()
                && Laplace::new(vec![0.0], &[]).is_none()
        );
        let point = Laplace::new(Vec::new(), &[]).unwrap();
        assert!(
            point.is_sound() && point.log_density(&point.sample(&mut rng())) == 0.0,
            "of no dimensions"
        );
        let mut broken = l;
        broken.axes.pop();
        assert!(!broken.is_sound());
    }
}
