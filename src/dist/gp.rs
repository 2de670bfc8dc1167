//! A Gaussian process at some points, kept as the white noise behind it: value = mean + L z with L L^T = K.
//!
//! Whitened, the noise keeps its meaning when length or spread change; the values follow. `centred` keeps the values
//! instead, which suits data that say much about each of them (Papaspiliopoulos et al. 2007).

use super::mv_normal::standard_log_density;
use super::{Covariance, Datum, Distribution, Gradient, MvNormal, ParamError, Support};
use crate::rng::Stream;

/// gp(mean, cov, at)
#[derive(Clone, Debug, PartialEq)]
pub struct Gp {
    normal: MvNormal,
    n: usize,
    centred: bool,
}

/// What is added to the diagonal of the covariance matrix, as a fraction of the variance.
const JITTER: f64 = 1e-6;
/// At most this many points: the factor costs their cube.
const MOST: usize = 4000;

impl Gp {
    /// The values of a process with this mean and covariance function at some points.
    ///
    /// # Errors
    /// If mean and points differ in number, are not finite, there are more than 4000, or the covariance matrix cannot be
    /// factored.
    pub fn new(mean: Vec<f64>, cov: &Covariance, at: &[f64], centred: bool) -> Result<Self, ParamError> {
        if mean.len() != at.len() {
            return Err(ParamError::new("gp", "mean", "as long as the points", mean.len()));
        }
        if at.len() > MOST {
            return Err(ParamError::new("gp", "at", "at most 4000 points", at.len()));
        }
        if let Some(x) = at.iter().find(|x| !x.is_finite()) {
            return Err(ParamError::new("gp", "at", "finite", x));
        }
        if let Some(x) = mean.iter().find(|x| !x.is_finite()) {
            return Err(ParamError::new("gp", "mean", "finite", x));
        }
        let mut k = cov.matrix(at);
        let jitter = JITTER * cov.variance();
        for i in 0..at.len() {
            k[(i, i)] += jitter;
        }
        let singular = || ParamError::new("gp", "cov", "such that its matrix can be factored", cov);
        let chol = k.cholesky().ok_or_else(singular)?.l();
        Ok(Gp { normal: MvNormal::from_chol(&mean, &chol).map_err(|_| singular())?, n: at.len(), centred })
    }

    /// Whether values are kept instead of the noise behind them.
    pub fn is_centred(&self) -> bool {
        self.centred
    }

    /// White noise.
    pub fn sample_noise(&self, rng: &mut Stream) -> Datum {
        Datum::Vec((0..self.n).map(|_| rng.standard_normal()).collect())
    }

    /// The log density of white noise.
    pub fn log_density_noise(&self, z: &Datum) -> f64 {
        match z {
            Datum::Vec(z) if z.len() == self.n => standard_log_density(z),
            _ => f64::NEG_INFINITY,
        }
    }

    /// The values of white noise.
    pub fn colour_vec(&self, z: &[f64]) -> Option<Vec<f64>> {
        self.normal.colour_vec(z)
    }

    /// The noise behind values.
    pub fn whiten_vec(&self, x: &[f64]) -> Option<Vec<f64>> {
        self.normal.whiten_vec(x)
    }
}

impl Distribution for Gp {
    fn name(&self) -> &'static str {
        "gp"
    }

    fn support(&self) -> Support {
        Support::Vector(self.n)
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        self.normal.sample(rng)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        self.normal.log_density(x)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        self.normal.gradient(x)
    }
}
