//! The multivariate normal distribution.

use super::{Datum, Distribution, Gradient, ParamError, Support};
use crate::num::LN_SQRT_2PI;
use crate::rng::Stream;
use nalgebra::{DMatrix, DVector};

/// mv_normal(mean, cov) or mv_normal(mean, chol)
#[derive(Clone, Debug, PartialEq)]
pub struct MvNormal {
    mean: DVector<f64>,
    chol: DMatrix<f64>,
    norm: f64,
}

impl MvNormal {
    /// A mean and a covariance matrix, of which the lower triangle is read.
    ///
    /// # Errors
    /// Unless all is finite and the matrix is symmetric and positive definite.
    pub fn from_cov(mean: &[f64], cov: &DMatrix<f64>) -> Result<Self, ParamError> {
        let scale = cov.amax();
        if cov.nrows() == cov.ncols() && (cov - cov.transpose()).amax() > 1e-9 * scale {
            return Err(ParamError::new("mv_normal", "cov", "symmetric", "a matrix that is not"));
        }
        match cov.clone().cholesky() {
            Some(c) => MvNormal::from_chol(mean, &c.l()),
            None => Err(ParamError::new("mv_normal", "cov", "positive definite", "a matrix that is not")),
        }
    }

    /// A mean and the lower triangular Cholesky factor of the covariance.
    ///
    /// # Errors
    /// Unless all is finite and the diagonal positive.
    pub fn from_chol(mean: &[f64], chol: &DMatrix<f64>) -> Result<Self, ParamError> {
        if let Some(m) = mean.iter().find(|m| !m.is_finite()) {
            return Err(ParamError::new("mv_normal", "mean", "finite", m));
        }
        if chol.nrows() != mean.len() || chol.ncols() != mean.len() {
            return Err(ParamError::new("mv_normal", "chol", "as large as the mean", format!("{} rows", chol.nrows())));
        }
        if let Some(x) = chol.iter().find(|x| !x.is_finite()) {
            return Err(ParamError::new("mv_normal", "chol", "finite", x));
        }
        if let Some(d) = chol.diagonal().iter().find(|d| **d <= 0.0) {
            return Err(ParamError::new("mv_normal", "chol", "positive on the diagonal", d));
        }
        let norm = -chol.diagonal().iter().map(|d| libm::log(*d)).sum::<f64>() - mean.len() as f64 * LN_SQRT_2PI;
        Ok(MvNormal { mean: DVector::from_column_slice(mean), chol: chol.lower_triangle(), norm })
    }

    /// The white noise behind a value.
    pub fn whiten_vec(&self, x: &[f64]) -> Option<Vec<f64>> {
        if x.len() != self.mean.len() {
            return None;
        }
        let d = DVector::from_column_slice(x) - &self.mean;
        self.chol.solve_lower_triangular(&d).map(|z| z.as_slice().to_vec())
    }

    /// The value of white noise.
    pub fn colour_vec(&self, z: &[f64]) -> Option<Vec<f64>> {
        if z.len() != self.mean.len() {
            return None;
        }
        Some((&self.mean + &self.chol * DVector::from_column_slice(z)).as_slice().to_vec())
    }
}

/// The log density of standard normal numbers.
pub(super) fn standard_log_density(z: &[f64]) -> f64 {
    let d = -0.5 * z.iter().map(|z| z * z).sum::<f64>() - z.len() as f64 * LN_SQRT_2PI;
    if d.is_nan() { f64::NEG_INFINITY } else { d }
}

impl Distribution for MvNormal {
    fn name(&self) -> &'static str {
        "mv_normal"
    }

    fn support(&self) -> Support {
        Support::Vector(self.mean.len())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let z: Vec<f64> = (0..self.mean.len()).map(|_| rng.standard_normal()).collect();
        Datum::Vec(self.colour_vec(&z).unwrap_or_default().into())
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let Datum::Vec(x) = x else { return f64::NEG_INFINITY };
        let Some(z) = self.whiten_vec(x) else { return f64::NEG_INFINITY };
        let d = self.norm - 0.5 * z.iter().map(|z| z * z).sum::<f64>();
        if d.is_nan() { f64::NEG_INFINITY } else { d }
    }

    /// By the value and by the mean; the factor's derivative is not given.
    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let Datum::Vec(x) = x else { return None };
        let z = DVector::from_vec(self.whiten_vec(x)?);
        let slope = self.chol.transpose().solve_upper_triangular(&z)?;
        Some(Gradient { x: slope.iter().map(|s| -s).collect(), params: slope.as_slice().to_vec() })
    }
}
