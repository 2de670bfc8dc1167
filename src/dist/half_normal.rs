//! The half-normal distribution.

use super::param::positive;
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::LN_SQRT_2PI;
use crate::rng::Stream;

/// half_normal(sd): the size of normal(0, sd)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfNormal {
    sd: f64,
}

impl HalfNormal {
    /// The standard deviation of the whole normal distribution.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn new(sd: f64) -> Result<Self, ParamError> {
        Ok(HalfNormal { sd: positive("half_normal", "sd", sd)? })
    }
}

impl Distribution for HalfNormal {
    fn name(&self) -> &'static str {
        "half_normal"
    }

    fn support(&self) -> Support {
        Support::NonNegative
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Num((self.sd * rng.standard_normal()).abs().min(f64::MAX))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if !(x >= 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let z = x / self.sd;
        core::f64::consts::LN_2 - 0.5 * z * z - libm::log(self.sd) - LN_SQRT_2PI
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let z = number(x) / self.sd;
        let inside = self.support().contains(x);
        inside.then(|| Gradient { x: vec![-z / self.sd], params: vec![(z * z - 1.0) / self.sd] })
    }
}
