//! The exponential distribution.

use super::param::positive;
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::rng::Stream;

/// exponential(rate)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponential {
    rate: f64,
}

impl Exponential {
    /// A rate: the mean is 1 / rate.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn new(rate: f64) -> Result<Self, ParamError> {
        Ok(Exponential { rate: positive("exponential", "rate", rate)? })
    }
}

impl Distribution for Exponential {
    fn name(&self) -> &'static str {
        "exponential"
    }

    fn support(&self) -> Support {
        Support::NonNegative
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Num((-libm::log(rng.open_uniform()) / self.rate).min(f64::MAX))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if x >= 0.0 && x.is_finite() { libm::log(self.rate) - self.rate * x } else { f64::NEG_INFINITY }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let inside = self.support().contains(x);
        inside.then(|| Gradient { x: vec![-self.rate], params: vec![1.0 / self.rate - number(x)] })
    }
}
