//! The gamma distribution.

use crate::dist::draw::{gamma_draw, ln_gamma_draw, representable, x_log_y};
use crate::dist::tails::speed_by_differences;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, deviance, digamma, gamma_tails, ln_gamma, stirling_error};

/// The shape from which the saddle-point form is used.
const LARGE: f64 = 64.0;

/// `gamma(shape, rate)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gamma {
    shape: f64,
    rate: f64,
    log_norm: f64,
}

impl Gamma {
    pub(in crate::dist) fn of(shape: f64, rate: f64) -> Result<Gamma, ParamError> {
        let log_norm = if shape < LARGE {
            libm::log(rate) - ln_gamma(shape)
        } else {
            let k = shape - 1.0;
            libm::log(rate) - LN_SQRT_2PI - 0.5 * libm::log(k) - stirling_error(k)
        };
        Ok(Gamma { shape, rate, log_norm })
    }
}

impl Scalar for Gamma {
    const SUPPORT: Support = Support::Positive;

    fn draw(&self, rng: &mut Stream) -> f64 {
        if self.shape < 1.0 {
            representable(libm::exp(ln_gamma_draw(self.shape, rng) - libm::log(self.rate)))
        } else {
            representable(gamma_draw(self.shape, rng) / self.rate)
        }
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !(x > 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let t = x * self.rate;
        if t == f64::INFINITY {
            return f64::NEG_INFINITY;
        }
        if self.shape >= LARGE && t > 0.0 {
            return self.log_norm - deviance(self.shape - 1.0, t);
        }
        let power = if t > 0.0 {
            x_log_y(self.shape - 1.0, t)
        } else {
            (self.shape - 1.0) * (libm::log(x) + libm::log(self.rate))
        };
        self.log_norm + power - t
    }

    fn slope(&self, x: f64) -> Slope {
        let by_x = (self.shape - 1.0) / x - self.rate;
        let by_shape = libm::log(self.rate) + libm::log(x) - digamma(self.shape);
        Slope::new(by_x, [by_shape, self.shape / self.rate - x])
    }

    #[inline]
    fn slope_without_shape(&self, x: f64) -> Slope {
        Slope::new((self.shape - 1.0) / x - self.rate, [0.0, self.shape / self.rate - x])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        gamma_tails(self.shape, self.rate * x).map(Tails::from)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let own = self.log_density_num(x);
        let tails = |a| gamma_tails(a, self.rate * x).map(Tails::from);
        Some(smallvec![speed_by_differences(self.shape, own, tails), x / self.rate])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.shape / self.rate)
    }

    fn number_sd(&self) -> Option<f64> {
        Some(self.shape.sqrt() / self.rate)
    }
}
