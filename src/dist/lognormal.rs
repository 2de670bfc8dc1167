//! The log-normal distribution.

use super::param::{finite, positive};
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::LN_SQRT_2PI;
use crate::rng::Stream;

/// lognormal(mu, sigma): e to the power of normal(mu, sigma)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogNormal {
    mu: f64,
    sigma: f64,
}

impl LogNormal {
    /// Mean and standard deviation of the logarithm.
    ///
    /// # Errors
    /// Unless `mu` is finite and `sigma` positive and finite.
    pub fn new(mu: f64, sigma: f64) -> Result<Self, ParamError> {
        Ok(LogNormal { mu: finite("lognormal", "mu", mu)?, sigma: positive("lognormal", "sigma", sigma)? })
    }
}

impl Distribution for LogNormal {
    fn name(&self) -> &'static str {
        "lognormal"
    }

    fn support(&self) -> Support {
        Support::Positive
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        // Kept off 0 and infinity, where the density is zero.
        let y = self.mu + self.sigma * rng.standard_normal();
        Datum::Num(libm::exp(y).clamp(f64::MIN_POSITIVE, f64::MAX))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if !(x > 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let y = libm::log(x);
        let z = (y - self.mu) / self.sigma;
        -0.5 * z * z - y - libm::log(self.sigma) - LN_SQRT_2PI
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let x = number(x);
        if !(x > 0.0 && x.is_finite()) {
            return None;
        }
        let z = (libm::log(x) - self.mu) / self.sigma;
        Some(Gradient {
            x: vec![-(z / self.sigma + 1.0) / x],
            params: vec![z / self.sigma, (z * z - 1.0) / self.sigma],
        })
    }
}
