//! The Cauchy distribution: Student's t with one degree of freedom.

use crate::dist::draw::{log1p_square, standard};
use crate::dist::*;

/// `cauchy(location, scale)`. Its mean is undefined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cauchy {
    location: f64,
    scale: f64,
    log_norm: f64,
}

impl Cauchy {
    pub(in crate::dist) fn of(location: f64, scale: f64) -> Result<Cauchy, ParamError> {
        Ok(Cauchy {
            location,
            scale,
            log_norm: libm::log(core::f64::consts::FRAC_1_PI) - libm::log(scale),
        })
    }
}

/// Returns the derivatives at `x`, which are the same for the half-Cauchy distribution.
pub(in crate::dist) fn cauchy_slope(x: f64, location: f64, scale: f64) -> Slope {
    let z = standard(x, location, scale);
    // 2 z / (1 + z^2), and z times that, without overflow.
    let (once, twice) = if z.abs() < 1.0 {
        (2.0 * z / (1.0 + z * z), 2.0 * z * z / (1.0 + z * z))
    } else {
        (2.0 / (z + 1.0 / z), 2.0 / (1.0 + 1.0 / z / z))
    };
    let by_x = if z.is_finite() { once / scale } else { 2.0 / (x - location) };
    Slope::new(-by_x, [by_x, (twice - 1.0) / scale])
}

impl Scalar for Cauchy {
    fn draw(&self, rng: &mut Stream) -> f64 {
        // Small angles keep full relative precision, so draws in the tails take many
        // different values.
        let size = 1.0 / libm::tan(core::f64::consts::FRAC_PI_2 * rng.open_uniform());
        let sign = if rng.next_u64() & 1 == 0 { 1.0 } else { -1.0 };
        (self.location + self.scale * (sign * size)).clamp(f64::MIN, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x.is_finite() {
            self.log_norm - log1p_square(x, self.location, self.scale)
        } else {
            f64::NEG_INFINITY
        }
    }

    fn slope(&self, x: f64) -> Slope {
        cauchy_slope(x, self.location, self.scale)
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let z = standard(x, self.location, self.scale);
        let part = |x: f64| libm::log(libm::atan2(1.0, x) * core::f64::consts::FRAC_1_PI);
        Some(Tails { below: part(-z), above: part(z) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-1.0, -standard(x, self.location, self.scale)])
    }
}
