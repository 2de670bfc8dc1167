//! The half-normal distribution: the absolute value of a normal number with mean 0.

use crate::dist::*;
use crate::num::{LN_SQRT_2PI, log_normal_cdf};

/// `half_normal(sd)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfNormal {
    sd: f64,
    log_norm: f64,
}

impl HalfNormal {
    pub(in crate::dist) fn of(sd: f64) -> Result<HalfNormal, ParamError> {
        Ok(HalfNormal { sd, log_norm: core::f64::consts::LN_2 - libm::log(sd) - LN_SQRT_2PI })
    }
}

impl Scalar for HalfNormal {
    const SUPPORT: Support = Support::AtLeast { lo: 0.0 };

    fn draw(&self, rng: &mut Stream) -> f64 {
        (self.sd * rng.standard_normal()).abs().min(f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x >= 0.0 {
            let z = x / self.sd;
            self.log_norm - 0.5 * z * z
        } else {
            f64::NEG_INFINITY
        }
    }

    fn slope(&self, x: f64) -> Slope {
        let z = x / self.sd;
        Slope::new(-z / self.sd, [(z * z - 1.0) / self.sd])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x <= 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let z = x / self.sd;
        let above = core::f64::consts::LN_2 + log_normal_cdf(-z);
        Some(Tails {
            below: libm::log(libm::erf(z * core::f64::consts::FRAC_1_SQRT_2)),
            above: above.min(0.0),
        })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-x / self.sd])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.sd * core::f64::consts::FRAC_2_PI.sqrt())
    }

    fn number_sd(&self) -> Option<f64> {
        Some(self.sd * (1.0 - core::f64::consts::FRAC_2_PI).sqrt())
    }
}
