//! The exponential distribution.

use crate::dist::*;

/// `exponential(rate)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponential {
    rate: f64,
    log_rate: f64,
}

impl Exponential {
    pub(in crate::dist) fn of(rate: f64) -> Result<Exponential, ParamError> {
        Ok(Exponential { rate, log_rate: libm::log(rate) })
    }
}

impl Scalar for Exponential {
    const SUPPORT: Support = Support::AtLeast { lo: 0.0 };

    fn draw(&self, rng: &mut Stream) -> f64 {
        (-libm::log(rng.open_uniform()) / self.rate).min(f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x >= 0.0 { self.log_rate - self.rate * x } else { f64::NEG_INFINITY }
    }

    fn slope(&self, x: f64) -> Slope {
        Slope::new(-self.rate, [1.0 / self.rate - x])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        Some(Tails::from_above(-self.rate * x.max(0.0)))
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![x / self.rate])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(1.0 / self.rate)
    }

    fn number_sd(&self) -> Option<f64> {
        Some(1.0 / self.rate)
    }
}
