//! The Bernoulli distribution.

use super::param::probability;
use super::{Datum, Distribution, Gradient, ParamError, Support};
use crate::rng::Stream;

/// flip(p): true with probability p
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flip {
    p: f64,
}

impl Flip {
    /// The probability of `true`.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn new(p: f64) -> Result<Self, ParamError> {
        Ok(Flip { p: probability("flip", "p", p)? })
    }
}

impl Distribution for Flip {
    fn name(&self) -> &'static str {
        "flip"
    }

    fn support(&self) -> Support {
        Support::Boolean
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Bool(rng.uniform() < self.p)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        match x {
            Datum::Bool(true) => libm::log(self.p),
            Datum::Bool(false) => libm::log1p(-self.p),
            _ => f64::NEG_INFINITY,
        }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let by_p = match x {
            Datum::Bool(true) => 1.0 / self.p,
            Datum::Bool(false) => -1.0 / (1.0 - self.p),
            _ => return None,
        };
        by_p.is_finite().then(|| Gradient { x: Vec::new(), params: vec![by_p] })
    }
}
