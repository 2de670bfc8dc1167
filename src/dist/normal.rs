//! The normal distribution.

use super::param::{finite, positive};
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::LN_SQRT_2PI;
use crate::rng::Stream;

/// normal(mean, sd)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    mean: f64,
    sd: f64,
    norm: f64,
}

impl Normal {
    /// A mean and a standard deviation.
    ///
    /// # Errors
    /// Unless the mean is finite and `sd` positive and finite.
    pub fn new(mean: f64, sd: f64) -> Result<Self, ParamError> {
        let (mean, sd) = (finite("normal", "mean", mean)?, positive("normal", "sd", sd)?);
        Ok(Normal { mean, sd, norm: -libm::log(sd) - LN_SQRT_2PI })
    }

    /// The log density of a number.
    #[inline]
    pub fn log_density_num(&self, x: f64) -> f64 {
        let z = (x - self.mean) / self.sd;
        if z.is_nan() { f64::NEG_INFINITY } else { self.norm - 0.5 * z * z }
    }

    /// Standardises a number.
    pub fn whiten_num(&self, x: f64) -> f64 {
        (x - self.mean) / self.sd
    }

    /// The inverse of [`Normal::whiten_num`].
    pub fn colour_num(&self, z: f64) -> f64 {
        self.mean + self.sd * z
    }
}

impl Distribution for Normal {
    fn name(&self) -> &'static str {
        "normal"
    }

    fn support(&self) -> Support {
        Support::Real
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Num(self.colour_num(rng.standard_normal()))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        self.log_density_num(number(x))
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let z = self.whiten_num(number(x));
        z.is_finite().then(|| Gradient { x: vec![-z / self.sd], params: vec![z / self.sd, (z * z - 1.0) / self.sd] })
    }
}
