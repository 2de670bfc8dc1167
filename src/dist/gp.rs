//! A Gaussian process at given points.

use super::factor::Factor;
use super::mv_normal::{draw, score, slopes, standard_score, whiten};
use super::param::finite;
use super::{Covariance, Datum, Distribution, Gradient, ParamError, Support};
use crate::rng::Stream;

/// What is added to the diagonal of the covariance matrix, as a share of the variance: part of the model.
const JITTER: f64 = 1e-6;

/// `gp(mean, cov, at)`.
///
/// Its choice is stored as white noise z ~ N(0, I), with value = mean + chol(K + 1e-6 variance I) z, so that the values follow
/// when a parameter of the covariance moves; a centred one stores the values. Gradients are by the mean only.
#[derive(Clone, Debug, PartialEq)]
pub struct Gp {
    mean: Vec<f64>,
    factor: Factor,
    centred: bool,
}

impl Gp {
    /// With these means and this covariance function at these points; fails unless there are as many means as points, all
    /// finite, and the covariance matrix has a Cholesky factor.
    pub fn new(mean: Vec<f64>, cov: &Covariance, at: &[f64], centred: bool) -> Result<Gp, ParamError> {
        if mean.len() != at.len() {
            let value = format!("{} for {}", mean.len(), at.len());
            return Err(ParamError::new("gp", "mean", value, "must have a number for each point"));
        }
        for m in &mean {
            finite("gp", "mean", *m)?;
        }
        for x in at {
            finite("gp", "at", *x)?;
        }
        let packed = cov.packed(at, JITTER * cov.variance());
        let singular = || {
            let value = format!("{cov} at {} points", at.len());
            ParamError::new("gp", "cov", value, "must make a positive definite matrix")
        };
        let factor = Factor::new(at.len(), packed).ok_or_else(singular)?;
        Ok(Gp { mean, factor, centred })
    }

    /// The same process, storing values.
    pub fn to_centred(&self) -> Gp {
        Gp { centred: true, ..self.clone() }
    }
}

impl Distribution for Gp {
    fn name(&self) -> &'static str {
        "gp"
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

    fn is_stored_whitened(&self) -> bool {
        !self.centred
    }

    fn sample_stored(&self, rng: &mut Stream) -> Datum {
        if self.centred {
            return self.sample(rng);
        }
        self.mean.iter().map(|_| rng.standard_normal()).collect::<Vec<_>>().into()
    }

    fn log_density_stored(&self, s: &Datum) -> f64 {
        if self.centred {
            return self.log_density(s);
        }
        let score = s.with_numbers(self.mean.len(), standard_score);
        score.filter(|s| !s.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient_stored(&self, s: &Datum) -> Option<Gradient> {
        if self.centred {
            return self.gradient(s);
        }
        if !self.log_density_stored(s).is_finite() {
            return None;
        }
        let x = s.with_numbers(self.mean.len(), |z| z.iter().map(|z| -z).collect())?;
        Some(Gradient { x, params: vec![0.0; self.mean.len()] })
    }

    /// Noise of another length has no value: what there is of it is taken, the rest is 0.
    fn realise(&self, s: &Datum) -> Datum {
        if self.centred {
            return s.clone();
        }
        match s.with_numbers(self.mean.len(), |z| self.factor.colour(&self.mean, z)) {
            Some(x) => x.into(),
            None => {
                let number = |i| s.element(i).and_then(|x| x.num()).unwrap_or(0.0);
                let z: Vec<f64> = (0..self.mean.len()).map(number).collect();
                self.factor.colour(&self.mean, &z).into()
            }
        }
    }

    fn unrealise(&self, value: &Datum) -> Option<Datum> {
        if self.centred { Some(value.clone()) } else { self.whiten(value).map(Datum::from) }
    }
}
