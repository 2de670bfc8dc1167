//! The log-normal distribution: the exponential of a normal number.

use crate::dist::draw::representable;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, log_normal_cdf};

/// `lognormal(mu, sigma)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogNormal {
    mu: f64,
    sigma: f64,
    log_norm: f64,
}

impl LogNormal {
    pub(in crate::dist) fn of(mu: f64, sigma: f64) -> Result<LogNormal, ParamError> {
        Ok(LogNormal { mu, sigma, log_norm: -libm::log(sigma) - LN_SQRT_2PI })
    }
}

impl Scalar for LogNormal {
    const SUPPORT: Support = Support::Positive;

    fn draw(&self, rng: &mut Stream) -> f64 {
        representable(libm::exp(self.mu + self.sigma * rng.standard_normal()))
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !(x > 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let log_x = libm::log(x);
        let z = (log_x - self.mu) / self.sigma;
        self.log_norm - log_x - 0.5 * z * z
    }

    fn slope(&self, x: f64) -> Slope {
        let z = (libm::log(x) - self.mu) / self.sigma;
        Slope::new(-(1.0 + z / self.sigma) / x, [z / self.sigma, (z * z - 1.0) / self.sigma])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x <= 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let z = (libm::log(x) - self.mu) / self.sigma;
        Some(Tails { below: log_normal_cdf(z), above: log_normal_cdf(-z) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-x, -x * (libm::log(x) - self.mu) / self.sigma])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(libm::exp(self.mu + 0.5 * self.sigma * self.sigma)).filter(|m| m.is_finite())
    }

    fn number_sd(&self) -> Option<f64> {
        let variance = self.sigma * self.sigma;
        Some(libm::exp(self.mu + 0.5 * variance) * libm::expm1(variance).sqrt())
            .filter(|s| s.is_finite())
    }
}
