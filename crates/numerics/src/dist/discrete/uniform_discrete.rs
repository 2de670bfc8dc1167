//! The uniform distribution on a range of integers.

use crate::dist::*;

/// `uniform_discrete(lo, hi)`, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformDiscrete {
    lo: f64,
    hi: f64,
    log_probability: f64,
}

impl UniformDiscrete {
    pub(in crate::dist) fn of(lo: f64, hi: f64) -> Result<UniformDiscrete, ParamError> {
        if lo > hi {
            return Err(Self::bad("lo", format!("{lo} and {hi}"), "must not be above hi"));
        }
        Ok(UniformDiscrete { lo, hi, log_probability: -libm::log(hi - lo + 1.0) })
    }
}

impl Scalar for UniformDiscrete {
    fn number_support(&self) -> Support {
        Support::Integers { lo: self.lo as i64, hi: Some(self.hi as i64) }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        let count = self.hi as i64 - self.lo as i64 + 1;
        (self.lo as i64 + rng.index(count as usize) as i64) as f64
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if (self.lo..=self.hi).contains(&x) && x == libm::trunc(x) {
            self.log_probability
        } else {
            f64::NEG_INFINITY
        }
    }

    fn slope(&self, _x: f64) -> Slope {
        Slope::discrete([0.0, 0.0])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let width = self.hi - self.lo + 1.0;
        let part = |count: f64| libm::log((count / width).clamp(0.0, 1.0));
        let k = libm::floor(x);
        Some(Tails { below: part(k - self.lo + 1.0), above: part(self.hi - k) })
    }

    fn cdf_slopes(&self, _x: f64) -> Option<CdfSlopes> {
        Some(smallvec![0.0, 0.0])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(0.5 * (self.lo + self.hi))
    }

    fn number_sd(&self) -> Option<f64> {
        let n = self.hi - self.lo + 1.0;
        Some(((n - 1.0) * (n + 1.0) / 12.0).sqrt())
    }
}
