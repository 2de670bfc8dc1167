//! The uniform distribution on an interval.

use super::param::finite;
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::rng::Stream;

/// uniform(lo, hi), both ends included
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uniform {
    lo: f64,
    hi: f64,
}

impl Uniform {
    /// Two ends.
    ///
    /// # Errors
    /// Unless both are finite, their distance too, and `lo < hi`.
    pub fn new(lo: f64, hi: f64) -> Result<Self, ParamError> {
        let (lo, hi) = (finite("uniform", "lo", lo)?, finite("uniform", "hi", hi)?);
        if lo >= hi {
            return Err(ParamError::new("uniform", "hi", "greater than lo", format!("{hi} with lo = {lo}")));
        }
        finite("uniform", "hi - lo", hi - lo)?;
        Ok(Uniform { lo, hi })
    }
}

impl Distribution for Uniform {
    fn name(&self) -> &'static str {
        "uniform"
    }

    fn support(&self) -> Support {
        Support::Interval { lo: self.lo, hi: self.hi }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Num((self.lo + (self.hi - self.lo) * rng.open_uniform()).clamp(self.lo, self.hi))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if self.lo <= x && x <= self.hi { -libm::log(self.hi - self.lo) } else { f64::NEG_INFINITY }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let w = self.hi - self.lo;
        self.support().contains(x).then(|| Gradient { x: vec![0.0], params: vec![1.0 / w, -1.0 / w] })
    }
}
