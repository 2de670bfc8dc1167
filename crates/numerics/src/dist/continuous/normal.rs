//! The normal distribution.

use crate::dist::draw::standard;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, log_normal_cdf};

/// `normal(mean, sd)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    mean: f64,
    sd: f64,
    log_norm: f64,
}

impl Normal {
    pub(in crate::dist) fn of(mean: f64, sd: f64) -> Result<Normal, ParamError> {
        Ok(Normal { mean, sd, log_norm: log_norm(sd) })
    }

    pub(in crate::dist) fn location(&self) -> f64 {
        self.mean
    }

    pub(in crate::dist) fn scale(&self) -> f64 {
        self.sd
    }

    pub(in crate::dist) fn log_norm(&self) -> f64 {
        self.log_norm
    }

    /// Like [`Normal::new`], but reuses the normalising constant of `self` if the
    /// standard deviation is the same.
    #[inline]
    pub fn near(&self, mean: f64, sd: f64) -> Result<Normal, ParamError> {
        self.reused(&[mean, sd]).map_or_else(|| Normal::new(mean, sd), Ok)
    }
}

/// Returns the log density at the mean.
pub(in crate::dist) fn log_norm(sd: f64) -> f64 {
    -libm::log(sd) - LN_SQRT_2PI
}

impl Scalar for Normal {
    fn draw(&self, rng: &mut Stream) -> f64 {
        (self.mean + self.sd * rng.standard_normal()).clamp(f64::MIN, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        let z = standard(x, self.mean, self.sd);
        if z.is_nan() { f64::NEG_INFINITY } else { self.log_norm - 0.5 * z * z }
    }

    fn slope(&self, x: f64) -> Slope {
        let z = standard(x, self.mean, self.sd);
        Slope::new(-z / self.sd, [z / self.sd, (z * z - 1.0) / self.sd])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let z = standard(x, self.mean, self.sd);
        Some(Tails { below: log_normal_cdf(z), above: log_normal_cdf(-z) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-1.0, -standard(x, self.mean, self.sd)])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.mean)
    }

    fn number_sd(&self) -> Option<f64> {
        Some(self.sd)
    }

    #[inline]
    fn reused(&self, params: &[f64]) -> Option<Normal> {
        match params {
            [mean, sd] if sd.to_bits() == self.sd.to_bits() && mean.is_finite() => {
                Some(Normal { mean: *mean, ..*self })
            }
            _ => None,
        }
    }

    fn standardised(&self, x: f64) -> Option<f64> {
        Some(standard(x, self.mean, self.sd))
    }

    fn unstandardised(&self, z: f64) -> Option<f64> {
        Some(self.mean + self.sd * z)
    }
}
