//! The half-Cauchy distribution.

use super::param::{finite, positive};
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::rng::Stream;
use core::f64::consts::FRAC_PI_2;

/// half_cauchy(location, scale): the upper half of a Cauchy distribution
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfCauchy {
    location: f64,
    scale: f64,
}

impl HalfCauchy {
    /// Where it begins, and its median's distance from there.
    ///
    /// # Errors
    /// Unless `location` is finite and `scale` positive and finite.
    pub fn new(location: f64, scale: f64) -> Result<Self, ParamError> {
        Ok(HalfCauchy {
            location: finite("half_cauchy", "location", location)?,
            scale: positive("half_cauchy", "scale", scale)?,
        })
    }
}

impl Distribution for HalfCauchy {
    fn name(&self) -> &'static str {
        "half_cauchy"
    }

    fn support(&self) -> Support {
        Support::Interval { lo: self.location, hi: f64::INFINITY }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let x = self.location + self.scale * libm::tan(FRAC_PI_2 * rng.open_uniform());
        Datum::Num(x.clamp(self.location, f64::MAX))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if !(x >= self.location && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        // hypot keeps 1 + z^2 from overflowing far out.
        let z = (x - self.location) / self.scale;
        -libm::log(FRAC_PI_2) - libm::log(self.scale) - 2.0 * libm::log(libm::hypot(1.0, z))
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let z = (number(x) - self.location) / self.scale;
        let slope = -2.0 * z / (1.0 + z * z) / self.scale;
        let inside = self.support().contains(x) && slope.is_finite();
        inside.then(|| Gradient { x: vec![slope], params: vec![-slope, -1.0 / self.scale - slope * z] })
    }
}
