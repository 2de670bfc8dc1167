//! The multivariate normal distribution.

use super::factor::{Factor, lower};
use super::param::finite;
use super::{Datum, Distribution, Gradient, ParamError, Support};
use crate::num::LN_SQRT_2PI;
use crate::rng::Stream;
use nalgebra::DMatrix;

/// `mv_normal(mean, cov)` or `mv_normal(mean, chol)`. Gradients are by the mean only.
#[derive(Clone, Debug, PartialEq)]
pub struct MvNormal {
    mean: Box<[f64]>,
    factor: Factor,
}

impl MvNormal {
    /// With this mean and covariance; fails unless the mean is finite and the covariance as large, symmetric (to 1e-9 of its
    /// largest entry) and positive definite.
    pub fn from_cov(mean: &[f64], cov: &DMatrix<f64>) -> Result<MvNormal, ParamError> {
        let size = || ParamError::new("mv_normal", "cov", shape(cov), "must be square, as large as the mean");
        let packed = lower(cov).filter(|_| cov.nrows() == mean.len()).ok_or_else(size)?;
        if let Some(x) = cov.iter().find(|x| !x.is_finite()) {
            return Err(ParamError::new("mv_normal", "cov", x, "must be finite"));
        }
        let scale = cov.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let n = mean.len();
        let symmetric = (0..n).all(|i| (0..i).all(|j| (cov[(i, j)] - cov[(j, i)]).abs() <= 1e-9 * scale));
        if !symmetric {
            return Err(ParamError::new("mv_normal", "cov", "one that is not", "must be symmetric"));
        }
        let definite = || ParamError::new("mv_normal", "cov", "one that is not", "must be positive definite");
        Self::make(mean, Factor::new(n, packed).ok_or_else(definite)?)
    }

    /// With this mean and the lower triangular Cholesky factor of the covariance; fails unless the mean is finite and the factor
    /// as large and finite, with a positive diagonal and zeros above it.
    pub fn from_chol(mean: &[f64], chol: &DMatrix<f64>) -> Result<MvNormal, ParamError> {
        if chol.nrows() != mean.len() || chol.ncols() != mean.len() {
            return Err(ParamError::new("mv_normal", "chol", shape(chol), "must be square, as large as the mean"));
        }
        let n = mean.len();
        if (0..n).any(|j| (0..j).any(|i| chol[(i, j)] != 0.0)) {
            return Err(ParamError::new("mv_normal", "chol", "one that is not", "must be lower triangular"));
        }
        let bad = || ParamError::new("mv_normal", "chol", "one without", "must be finite with a positive diagonal");
        Self::make(mean, Factor::from_lower(chol).ok_or_else(bad)?)
    }

    fn make(mean: &[f64], factor: Factor) -> Result<MvNormal, ParamError> {
        for m in mean {
            finite("mv_normal", "mean", *m)?;
        }
        Ok(MvNormal { mean: mean.into(), factor })
    }
}

fn shape(m: &DMatrix<f64>) -> String {
    format!("{} x {}", m.nrows(), m.ncols())
}

/// The log density of x = mean + L z.
pub(super) fn score(factor: &Factor, mean: &[f64], x: &Datum) -> f64 {
    let score = x.with_numbers(factor.size(), |x| {
        if x.iter().any(|x| !x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        standard_score(&factor.whiten(mean, x)) - factor.log_det()
    });
    score.filter(|s| !s.is_nan()).unwrap_or(f64::NEG_INFINITY)
}

/// The log density of standard normal noise.
pub(super) fn standard_score(z: &[f64]) -> f64 {
    let square: f64 = z.iter().map(|z| z * z).sum();
    -0.5 * square - LN_SQRT_2PI * z.len() as f64
}

/// The derivatives of [`score`] by the value and by the mean.
pub(super) fn slopes(factor: &Factor, mean: &[f64], x: &Datum) -> Option<Gradient> {
    if !score(factor, mean, x).is_finite() {
        return None;
    }
    let by_mean = x.with_numbers(factor.size(), |x| factor.solve_transposed(factor.whiten(mean, x)))?;
    Some(Gradient { x: by_mean.iter().map(|g| -g).collect(), params: by_mean })
}

/// mean + L z for fresh noise.
pub(super) fn draw(factor: &Factor, mean: &[f64], rng: &mut Stream) -> Datum {
    let z: Vec<f64> = mean.iter().map(|_| rng.standard_normal()).collect();
    factor.colour(mean, &z).into()
}

/// The noise behind a finite vector.
pub(super) fn whiten(factor: &Factor, mean: &[f64], x: &Datum) -> Option<Vec<f64>> {
    x.with_numbers(factor.size(), |x| factor.whiten(mean, x)).filter(|z| z.iter().all(|z| z.is_finite()))
}

impl Distribution for MvNormal {
    fn name(&self) -> &'static str {
        "mv_normal"
    }

    fn support(&self) -> Support {
        Support::Vector(self.mean.len())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        draw(&self.factor, &self.mean, rng)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        score(&self.factor, &self.mean, x)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        slopes(&self.factor, &self.mean, x)
    }

    fn is_gaussian(&self) -> bool {
        true
    }

    fn whiten(&self, x: &Datum) -> Option<Vec<f64>> {
        whiten(&self.factor, &self.mean, x)
    }

    fn colour(&self, z: &[f64]) -> Option<Datum> {
        (z.len() == self.mean.len()).then(|| self.factor.colour(&self.mean, z).into())
    }
}
