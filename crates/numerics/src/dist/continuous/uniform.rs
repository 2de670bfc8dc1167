//! The uniform distribution on an interval.

use crate::dist::param::finite;
use crate::dist::tails::{CdfSlopes, Tails};
use crate::dist::{ParamError, Scalar, Slope, Support};
use crate::rng::Stream;
use smallvec::smallvec;

/// `uniform(lo, hi)`, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uniform {
    lo: f64,
    hi: f64,
    log_density: f64,
}

impl Uniform {
    /// Creates the distribution between these bounds; fails unless both are finite, `lo`
    /// is below `hi`, and their difference is finite.
    pub fn new(lo: f64, hi: f64) -> Result<Uniform, ParamError> {
        let (lo, hi) = (finite(Self::NAME, "lo", lo)?, finite(Self::NAME, "hi", hi)?);
        if lo >= hi {
            return Err(ParamError::new(
                Self::NAME,
                "lo",
                format!("{lo} and {hi}"),
                "must be below hi",
            ));
        }
        let width = finite(Self::NAME, "hi - lo", hi - lo)?;
        Ok(Uniform { lo, hi, log_density: -libm::log(width) })
    }
}

impl Scalar for Uniform {
    const NAME: &'static str = "uniform";

    fn number_support(&self) -> Support {
        Support::Interval { lo: self.lo, hi: self.hi }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        (self.lo + (self.hi - self.lo) * rng.open_uniform()).clamp(self.lo, self.hi)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if (self.lo..=self.hi).contains(&x) { self.log_density } else { f64::NEG_INFINITY }
    }

    fn slope(&self, _x: f64) -> Slope {
        let inverse = 1.0 / (self.hi - self.lo);
        Slope::new(0.0, [inverse, -inverse])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let width = self.hi - self.lo;
        let part = |from: f64, to: f64| libm::log(((to - from) / width).clamp(0.0, 1.0));
        Some(Tails { below: part(self.lo, x), above: part(x, self.hi) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let width = self.hi - self.lo;
        Some(smallvec![-(self.hi - x) / width, -(x - self.lo) / width])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.lo + 0.5 * (self.hi - self.lo))
    }

    fn number_sd(&self) -> Option<f64> {
        Some((self.hi - self.lo) / 12f64.sqrt())
    }
}
