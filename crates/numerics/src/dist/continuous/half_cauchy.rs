//! The upper half of a Cauchy distribution.

use crate::dist::continuous::cauchy::cauchy_slope;
use crate::dist::draw::log1p_square;
use crate::dist::*;

/// `half_cauchy(location, scale)`, on [location, inf).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfCauchy {
    location: f64,
    scale: f64,
    log_norm: f64,
}

impl HalfCauchy {
    pub(in crate::dist) fn of(location: f64, scale: f64) -> Result<HalfCauchy, ParamError> {
        Ok(HalfCauchy {
            location,
            scale,
            log_norm: libm::log(core::f64::consts::FRAC_2_PI) - libm::log(scale),
        })
    }
}

impl Scalar for HalfCauchy {
    fn number_support(&self) -> Support {
        Support::AtLeast { lo: self.location }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        let x = self.location
            + self.scale * libm::tan(core::f64::consts::FRAC_PI_2 * rng.open_uniform());
        x.clamp(self.location, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x >= self.location && x.is_finite() {
            self.log_norm - log1p_square(x, self.location, self.scale)
        } else {
            f64::NEG_INFINITY
        }
    }

    fn slope(&self, x: f64) -> Slope {
        cauchy_slope(x, self.location, self.scale)
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let z = ((x - self.location) / self.scale).max(0.0);
        let part = |y: f64, x: f64| libm::log(libm::atan2(y, x) * core::f64::consts::FRAC_2_PI);
        Some(Tails { below: part(z, 1.0), above: part(1.0, z) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-1.0, -(x - self.location) / self.scale])
    }

    fn by_bounds(&self, lo: f64, _hi: f64) -> Option<CdfSlopes> {
        Some(smallvec![lo, 0.0])
    }
}
