//! The geometric distribution: failures before the first success.

use crate::dist::discrete::neg_binomial::success;
use crate::dist::tails::{CdfSlopes, Tails};
use crate::dist::{ParamError, Scalar, Slope, Support};
use crate::rng::Stream;
use smallvec::smallvec;

/// `geometric(p)`, which starts at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometric {
    p: f64,
}

impl Geometric {
    /// Creates the distribution with this probability of success in each trial; fails
    /// unless it is above 0 and at most 1.
    pub fn new(p: f64) -> Result<Geometric, ParamError> {
        Ok(Geometric { p: success(Self::NAME, p)? })
    }
}

impl Scalar for Geometric {
    const NAME: &'static str = "geometric";

    fn number_support(&self) -> Support {
        Support::Integers { lo: 0, hi: None }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        if self.p == 1.0 {
            return 0.0;
        }
        libm::floor(libm::log(rng.open_uniform()) / libm::log1p(-self.p)).min(f64::MAX)
    }

    fn log_density_num(&self, k: f64) -> f64 {
        if !(k >= 0.0 && k.is_finite() && k == libm::trunc(k)) {
            f64::NEG_INFINITY
        } else if k == 0.0 {
            libm::log(self.p)
        } else {
            libm::log(self.p) + k * libm::log1p(-self.p)
        }
    }

    fn slope(&self, k: f64) -> Slope {
        let down = if k > 0.0 { k / (1.0 - self.p) } else { 0.0 };
        Slope::discrete([1.0 / self.p - down])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x < 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let k = libm::floor(x);
        Some(Tails::from_above((k + 1.0) * libm::log1p(-self.p)))
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![(x + 1.0) / self.p])
    }

    fn number_mean(&self) -> Option<f64> {
        let mean = (1.0 - self.p) / self.p;
        mean.is_finite().then_some(mean)
    }

    fn number_sd(&self) -> Option<f64> {
        let sd = (1.0 - self.p).sqrt() / self.p;
        sd.is_finite().then_some(sd)
    }
}
