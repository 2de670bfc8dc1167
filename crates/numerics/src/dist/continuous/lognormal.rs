//! The log-normal distribution: the exponential of a normal number.

use crate::dist::draw::representable;
use crate::dist::param::{finite, positive};
use crate::dist::tails::{CdfSlopes, Tails};
use crate::dist::{ParamError, Scalar, Slope, Support};
use crate::num::{LN_SQRT_2PI, log_normal_cdf};
use crate::rng::Stream;
use smallvec::smallvec;

/// `lognormal(mu, sigma)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogNormal {
    mu: f64,
    sigma: f64,
    log_norm: f64,
}

impl LogNormal {
    /// Creates the distribution with this mean and standard deviation of the logarithm;
    /// fails unless mu is finite and sigma positive and finite.
    pub fn new(mu: f64, sigma: f64) -> Result<LogNormal, ParamError> {
        let (mu, sigma) = (finite(Self::NAME, "mu", mu)?, positive(Self::NAME, "sigma", sigma)?);
        Ok(LogNormal { mu, sigma, log_norm: -libm::log(sigma) - LN_SQRT_2PI })
    }
}

impl Scalar for LogNormal {
    const NAME: &'static str = "lognormal";

    fn number_support(&self) -> Support {
        Support::Positive
    }

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
