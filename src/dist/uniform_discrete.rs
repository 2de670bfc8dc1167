//! The uniform distribution on a range of whole numbers.

use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::rng::Stream;

/// uniform_discrete(lo, hi), both ends included
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformDiscrete {
    lo: i64,
    hi: i64,
}

impl UniformDiscrete {
    /// The least and the greatest value.
    ///
    /// # Errors
    /// Unless both are whole numbers below 2^53 in size and `lo <= hi`.
    pub fn new(lo: f64, hi: f64) -> Result<Self, ParamError> {
        let whole = |name, x: f64| {
            if x == libm::trunc(x) && x.abs() < 9_007_199_254_740_992.0 {
                Ok(x as i64)
            } else {
                Err(ParamError::new("uniform_discrete", name, "a whole number", x))
            }
        };
        let (lo, hi) = (whole("lo", lo)?, whole("hi", hi)?);
        if lo > hi {
            return Err(ParamError::new("uniform_discrete", "hi", "at least lo", format!("{hi} with lo = {lo}")));
        }
        Ok(UniformDiscrete { lo, hi })
    }
}

impl Distribution for UniformDiscrete {
    fn name(&self) -> &'static str {
        "uniform_discrete"
    }

    fn support(&self) -> Support {
        Support::Integers { lo: self.lo, hi: Some(self.hi) }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Num((self.lo + rng.index((self.hi - self.lo) as usize + 1) as i64) as f64)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if x == libm::trunc(x) && self.lo as f64 <= x && x <= self.hi as f64 {
            -libm::log((self.hi - self.lo) as f64 + 1.0)
        } else {
            f64::NEG_INFINITY
        }
    }

    /// Whole parameters have no derivative.
    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        self.support().contains(x).then(|| Gradient { x: Vec::new(), params: Vec::new() })
    }
}
