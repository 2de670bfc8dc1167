//! The uniform distribution on an interval.

use crate::dist::*;

/// `uniform(lo, hi)`, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uniform {
    lo: f64,
    hi: f64,
    log_density: f64,
}

impl Uniform {
    pub(in crate::dist) fn of(lo: f64, hi: f64) -> Result<Uniform, ParamError> {
        if lo >= hi {
            return Err(Self::bad("lo", format!("{lo} and {hi}"), "must be below hi"));
        }
        let width = param::finite(Self::NAME, "hi - lo", hi - lo)?;
        Ok(Uniform { lo, hi, log_density: -libm::log(width) })
    }
}

impl Scalar for Uniform {
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

    fn by_bounds(&self, lo: f64, hi: f64) -> Option<CdfSlopes> {
        Some(smallvec![lo, hi])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.lo + 0.5 * (self.hi - self.lo))
    }

    fn number_sd(&self) -> Option<f64> {
        Some((self.hi - self.lo) / 12f64.sqrt())
    }
}
