//! A Gaussian process at given points.

use crate::dist::joint::factor::Factor;
use crate::dist::joint::gaussian::{Gaussian, gaussian_family};
use crate::dist::param::{finite, not_negative};
use crate::dist::*;

/// The largest number of points: the time to factor their covariance grows with its cube.
const MOST_POINTS: usize = 4000;

/// The default jitter, which is added to the diagonal of the covariance matrix as a
/// fraction of the variance. It is part of the model.
pub const JITTER: f64 = 1e-6;

/// `gp(mean, cov, at)`, with a jitter of [`JITTER`] by default.
///
/// Its choice is stored as white noise z ~ N(0, I), with value = mean + chol(K + jitter
/// variance I) z, so the values follow when a parameter of the covariance changes. A
/// centred process stores the values. Gradients are with respect to the mean only.
#[derive(Clone, Debug, PartialEq)]
pub struct Gp(Gaussian, f64);

impl Gp {
    /// Creates the process with these means and this covariance function at these points;
    /// fails unless there are as many means as points, all finite, and the covariance
    /// matrix has a Cholesky factor.
    pub fn new(
        mean: Vec<f64>,
        cov: &Covariance,
        at: &[f64],
        centred: bool,
    ) -> Result<Gp, ParamError> {
        Gp::with_jitter(mean, cov, at, centred, JITTER)
    }

    /// Like [`Gp::new`], with another fraction of the variance added to the diagonal;
    /// fails also if it is negative or not finite.
    pub fn with_jitter(
        mean: Vec<f64>,
        cov: &Covariance,
        at: &[f64],
        centred: bool,
        jitter: f64,
    ) -> Result<Gp, ParamError> {
        not_negative(Self::NAME, "jitter", jitter)?;
        if mean.len() != at.len() {
            let value = format!("{} for {}", mean.len(), at.len());
            return Err(Self::bad("mean", value, "must have one number per point"));
        }
        if at.len() > MOST_POINTS {
            let rule = "must have at most 4000 points";
            return Err(Self::bad("at", at.len(), rule));
        }
        for m in &mean {
            finite(Self::NAME, "mean", *m)?;
        }
        for x in at {
            finite(Self::NAME, "at", *x)?;
        }
        let packed = cov.packed(at, jitter * cov.variance());
        let singular = || {
            let value = format!("{cov} at {} points", at.len());
            Self::bad("cov", value, "must make a positive definite matrix")
        };
        let factor = Factor::new(at.len(), packed).map_err(|_| singular())?;
        Ok(Gp(Gaussian { mean: mean.into(), factor, whitened: !centred }, jitter))
    }

    /// Returns the same process in centred form, which stores values.
    pub fn to_centred(&self) -> Gp {
        Gp(self.0.centred(), self.1)
    }

    /// Converts derivatives with respect to the factor to those with respect to the
    /// parameters of the covariance function `cov` at these points.
    pub fn vjp_covariance(
        &self,
        cov: &Covariance,
        at: &[f64],
        by_factor: &[f64],
    ) -> Option<Vec<f64>> {
        let by = self.0.factor.vjp_cholesky(by_factor);
        let n = at.len();
        (by.len() == n * (n + 1) / 2).then_some(())?;
        let mut out = vec![0.0; cov.param_count()];
        let (mut distances, mut off_diagonal) = (Vec::new(), Vec::new());
        let mut diagonal = 0.0;
        for (i, x) in at.iter().enumerate() {
            let row = &by[i * (i + 1) / 2..(i + 1) * (i + 2) / 2];
            distances.extend(at[..i].iter().map(|y| (x - y).abs()));
            off_diagonal.extend(&row[..i]);
            diagonal += row[i];
        }
        cov.vjp_each(&distances, &off_diagonal, &mut out);
        cov.vjp(None, diagonal * (1.0 + self.1), &mut out);
        Some(out)
    }
}

gaussian_family!(Gp);
