//! The inverse gamma distribution: the reciprocal of a gamma number.

use crate::dist::draw::{ln_gamma_draw, representable};
use crate::dist::tails::speed_by_differences;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, deviance, digamma, gamma_tails, ln_gamma, stirling_error};

/// The shape from which the saddle-point form is used.
const LARGE: f64 = 64.0;

/// `inv_gamma(shape, scale)`: 1 / x is gamma(shape, rate = scale).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvGamma {
    shape: f64,
    scale: f64,
    log_norm: f64,
}

impl InvGamma {
    pub(in crate::dist) fn of(shape: f64, scale: f64) -> Result<InvGamma, ParamError> {
        let log_norm = if shape < LARGE {
            -ln_gamma(shape)
        } else {
            let k = shape - 1.0;
            -LN_SQRT_2PI - 0.5 * libm::log(k) - stirling_error(k)
        };
        Ok(InvGamma { shape, scale, log_norm })
    }

    /// Returns ln(scale / x), also where the ratio underflows.
    fn log_ratio(&self, x: f64) -> f64 {
        let t = self.scale / x;
        if t >= f64::MIN_POSITIVE { libm::log(t) } else { libm::log(self.scale) - libm::log(x) }
    }
}

impl Scalar for InvGamma {
    const SUPPORT: Support = Support::Positive;

    fn draw(&self, rng: &mut Stream) -> f64 {
        representable(libm::exp(libm::log(self.scale) - ln_gamma_draw(self.shape, rng)))
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !(x > 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let t = self.scale / x;
        if t == f64::INFINITY {
            return f64::NEG_INFINITY;
        }
        let log_t = self.log_ratio(x);
        if self.shape >= LARGE && t >= f64::MIN_POSITIVE {
            return self.log_norm - deviance(self.shape - 1.0, t) + log_t - libm::log(x);
        }
        let log_norm = if self.shape < LARGE { self.log_norm } else { -ln_gamma(self.shape) };
        log_norm + self.shape * log_t - t - libm::log(x)
    }

    fn slope(&self, x: f64) -> Slope {
        let t = self.scale / x;
        let by_shape = self.log_ratio(x) - digamma(self.shape);
        Slope::new((t - self.shape - 1.0) / x, [by_shape, (self.shape - t) / self.scale])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x <= 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        gamma_tails(self.shape, self.scale / x).map(|t| Tails::from(t).swapped())
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let own = self.log_density_num(x);
        let tails = |a| gamma_tails(a, self.scale / x).map(|t| Tails::from(t).swapped());
        Some(smallvec![speed_by_differences(self.shape, own, tails), -x / self.scale])
    }

    fn number_mean(&self) -> Option<f64> {
        (self.shape > 1.0).then(|| self.scale / (self.shape - 1.0))
    }

    fn number_sd(&self) -> Option<f64> {
        (self.shape > 2.0).then(|| self.scale / ((self.shape - 1.0) * (self.shape - 2.0).sqrt()))
    }
}
