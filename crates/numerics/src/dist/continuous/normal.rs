//! The normal distribution.

use crate::dist::draw::standard;
use crate::dist::param::{finite, positive};
use crate::dist::tails::{CdfSlopes, Tails};
use crate::dist::{ParamError, Scalar, Slope, Support};
use crate::num::{LN_SQRT_2PI, log_normal_cdf};
use crate::rng::Stream;
use smallvec::smallvec;

/// `normal(mean, sd)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    mean: f64,
    sd: f64,
    log_norm: f64,
}

impl Normal {
    /// Creates the distribution with this mean and standard deviation; fails unless the
    /// mean is finite and the standard deviation positive and finite.
    pub fn new(mean: f64, sd: f64) -> Result<Normal, ParamError> {
        let (mean, sd) = (finite(Self::NAME, "mean", mean)?, positive(Self::NAME, "sd", sd)?);
        Ok(Normal { mean, sd, log_norm: -libm::log(sd) - LN_SQRT_2PI })
    }

    /// Like [`Normal::new`], but reuses the normalising constant of `self` if the
    /// standard deviation is the same.
    #[inline]
    pub fn near(&self, mean: f64, sd: f64) -> Result<Normal, ParamError> {
        if sd.to_bits() != self.sd.to_bits() {
            return Normal::new(mean, sd);
        }
        Ok(Normal { mean: finite(Self::NAME, "mean", mean)?, ..*self })
    }
}

impl Scalar for Normal {
    const NAME: &'static str = "normal";

    fn number_support(&self) -> Support {
        Support::Real
    }

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

    fn standardised(&self, x: f64) -> Option<f64> {
        Some(standard(x, self.mean, self.sd))
    }

    fn unstandardised(&self, z: f64) -> Option<f64> {
        Some(self.mean + self.sd * z)
    }
}
