//! The geometric distribution: failures before the first success.

use crate::dist::*;

/// `geometric(p)`, which starts at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometric {
    p: f64,
}

impl Geometric {
    pub(in crate::dist) fn of(p: f64) -> Result<Geometric, ParamError> {
        Ok(Geometric { p })
    }
}

impl Scalar for Geometric {
    const SUPPORT: Support = Support::Integers { lo: 0, hi: None };

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
