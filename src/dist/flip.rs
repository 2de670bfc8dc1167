//! A truth value.

use super::param::probability;
use super::{Datum, Distribution, Gradient, ParamError, Support};
use crate::rng::Stream;

/// `flip(p)`: true with probability `p`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flip {
    p: f64,
}

impl Flip {
    /// With this probability of true; fails unless it is in [0, 1].
    pub fn new(p: f64) -> Result<Flip, ParamError> {
        Ok(Flip { p: probability("flip", "p", p)? })
    }

    /// The log probability of a truth value.
    #[inline]
    pub fn log_probability(&self, x: bool) -> f64 {
        if x { libm::log(self.p) } else { libm::log1p(-self.p) }
    }

    /// Its derivative by the probability, where it is finite.
    #[inline]
    pub(super) fn slope(&self, x: bool) -> f64 {
        if x { 1.0 / self.p } else { -1.0 / (1.0 - self.p) }
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

    #[inline]
    fn log_density(&self, x: &Datum) -> f64 {
        match x {
            Datum::Bool(x) => self.log_probability(*x),
            _ => f64::NEG_INFINITY,
        }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        match x {
            Datum::Bool(x) if self.log_probability(*x).is_finite() => {
                Some(Gradient { x: Vec::new(), params: vec![self.slope(*x)] })
            }
            _ => None,
        }
    }

    fn mean(&self) -> Option<f64> {
        Some(self.p)
    }

    fn sd(&self) -> Option<f64> {
        Some((self.p * (1.0 - self.p)).sqrt())
    }
}
