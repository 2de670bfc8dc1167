//! The multivariate normal distribution.

use crate::dist::joint::factor::{Factor, lower};
use crate::dist::joint::gaussian::{Gaussian, gaussian_family};
use crate::dist::param::finite;
use crate::dist::*;
use nalgebra::DMatrix;

/// `mv_normal(mean, cov)` or `mv_normal(mean, chol)`. Gradients are with respect to the
/// mean only.
///
/// Its choice is stored as its value. A whitened one stores the white noise z of mean +
/// chol z, so the value follows when the mean and the covariance change.
#[derive(Clone, Debug, PartialEq)]
pub struct MvNormal(Gaussian);

impl MvNormal {
    /// Creates the distribution with this mean and covariance; fails unless the mean is
    /// finite and the covariance is of matching size, finite, symmetric (to 1e-9 of its
    /// largest entry) and positive definite.
    pub fn from_cov(mean: &[f64], cov: &DMatrix<f64>) -> Result<MvNormal, ParamError> {
        let size =
            || Self::bad("cov", shape(cov), "must be square and match the length of the mean");
        let packed = lower(cov).filter(|_| cov.nrows() == mean.len()).ok_or_else(size)?;
        if let Some(x) = cov.iter().find(|x| !x.is_finite()) {
            return Err(Self::bad("cov", x, "must be finite"));
        }
        let scale = cov.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let n = mean.len();
        let symmetric =
            (0..n).all(|i| (0..i).all(|j| (cov[(i, j)] - cov[(j, i)]).abs() <= 1e-9 * scale));
        if !symmetric {
            return Err(Self::bad("cov", "one that is not", "must be symmetric"));
        }
        let definite = || Self::bad("cov", "one that is not", "must be positive definite");
        Self::make(mean, Factor::new(n, packed).map_err(|_| definite())?)
    }

    /// Creates the distribution with this mean and lower triangular Cholesky factor of
    /// the covariance; fails unless the mean is finite and the factor is of matching size
    /// and finite, with a positive diagonal and zeros above it.
    pub fn from_chol(mean: &[f64], chol: &DMatrix<f64>) -> Result<MvNormal, ParamError> {
        if chol.nrows() != mean.len() || chol.ncols() != mean.len() {
            return Err(Self::bad(
                "chol",
                shape(chol),
                "must be square and match the length of the mean",
            ));
        }
        let n = mean.len();
        if (0..n).any(|j| (0..j).any(|i| chol[(i, j)] != 0.0)) {
            return Err(Self::bad("chol", "one that is not", "must be lower triangular"));
        }
        let bad = || Self::bad("chol", "one without", "must be finite with a positive diagonal");
        Self::make(mean, Factor::from_lower(chol).ok_or_else(bad)?)
    }

    fn make(mean: &[f64], factor: Factor) -> Result<MvNormal, ParamError> {
        for m in mean {
            finite(Self::NAME, "mean", *m)?;
        }
        Ok(MvNormal(Gaussian { mean: mean.into(), factor, whitened: false }))
    }

    /// Returns the same distribution in whitened form, which stores white noise.
    pub fn to_whitened(&self) -> MvNormal {
        MvNormal(Gaussian { whitened: true, ..self.0.clone() })
    }

    /// Returns the same distribution in centred form, which stores values.
    pub fn to_centred(&self) -> MvNormal {
        MvNormal(self.0.centred())
    }

    /// Converts derivatives with respect to the factor to those with respect to the
    /// entries of the covariance, its lower triangle by rows. An entry off the diagonal
    /// stands for both of its positions.
    pub fn vjp_covariance(&self, by_factor: &[f64]) -> Vec<f64> {
        self.0.factor.vjp_cholesky(by_factor)
    }
}

fn shape(m: &DMatrix<f64>) -> String {
    format!("{} x {}", m.nrows(), m.ncols())
}

gaussian_family!(MvNormal);
