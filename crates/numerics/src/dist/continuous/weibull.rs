//! The Weibull distribution.

use crate::dist::draw::representable;
use crate::dist::*;
use crate::num::ln_gamma;

/// `weibull(shape, scale)`: (x / scale)^shape is exponential with rate 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weibull {
    shape: f64,
    scale: f64,
    log_norm: f64,
}

impl Weibull {
    pub(in crate::dist) fn of(shape: f64, scale: f64) -> Result<Weibull, ParamError> {
        Ok(Weibull { shape, scale, log_norm: libm::log(shape) })
    }

    /// Returns ln(x / scale), also where the ratio overflows or underflows.
    fn log_ratio(&self, x: f64) -> f64 {
        let t = x / self.scale;
        if t >= f64::MIN_POSITIVE && t.is_finite() {
            libm::log(t)
        } else {
            libm::log(x) - libm::log(self.scale)
        }
    }
}

impl Scalar for Weibull {
    const SUPPORT: Support = Support::Positive;

    fn draw(&self, rng: &mut Stream) -> f64 {
        let power = libm::log(-libm::log(rng.open_uniform())) / self.shape;
        // For a large shape the factor is near 1, where going through the logarithm of
        // the scale would lose more precision than the standard deviation.
        let far = power.abs() > 700.0;
        representable(if far {
            libm::exp(libm::log(self.scale) + power)
        } else {
            self.scale * libm::exp(power)
        })
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !(x > 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let power = self.shape * self.log_ratio(x);
        let fall = libm::exp(power);
        if fall == f64::INFINITY {
            f64::NEG_INFINITY
        } else {
            self.log_norm + power - libm::log(x) - fall
        }
    }

    fn slope(&self, x: f64) -> Slope {
        let log_ratio = self.log_ratio(x);
        let excess = libm::expm1(self.shape * log_ratio);
        let by_x = -(1.0 + self.shape * excess) / x;
        Slope::new(
            by_x,
            [1.0 / self.shape - log_ratio * excess, self.shape * (excess / self.scale)],
        )
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x <= 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let power = self.shape * self.log_ratio(x);
        let fall = libm::exp(power);
        // ln(1 - e^-fall) where the probability below may be less than the smallest double.
        match fall < 1e-8 {
            true => Some(Tails { below: power - 0.5 * fall, above: -fall }),
            false => Some(Tails::from_above(-fall)),
        }
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![x / self.shape * self.log_ratio(x), -x / self.scale])
    }

    fn number_mean(&self) -> Option<f64> {
        let mean = self.scale * libm::exp(ln_gamma(1.0 + 1.0 / self.shape));
        mean.is_finite().then_some(mean)
    }

    fn number_sd(&self) -> Option<f64> {
        let e = 1.0 / self.shape;
        // ln(1 + var / mean^2), by a series in zeta values where the plain difference
        // would cancel.
        let log_ratio = if e < 1e-3 {
            let (two, three, four) =
                (1.644_934_066_848_226_4, 1.202_056_903_159_594, 1.082_323_233_711_138);
            e * e * (two - e * (2.0 * three - e * 3.5 * four))
        } else {
            ln_gamma(1.0 + 2.0 * e) - 2.0 * ln_gamma(1.0 + e)
        };
        let sd = self.number_mean()? * libm::expm1(log_ratio).sqrt();
        sd.is_finite().then_some(sd)
    }
}
