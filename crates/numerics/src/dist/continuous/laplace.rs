//! The Laplace distribution: exponential on both sides of its location.

use crate::dist::draw::standard;
use crate::dist::*;

/// `laplace(location, scale)`. At the location, where the density has a kink, the
/// derivative is taken as 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laplace {
    location: f64,
    scale: f64,
    log_norm: f64,
}

impl Laplace {
    pub(in crate::dist) fn of(location: f64, scale: f64) -> Result<Laplace, ParamError> {
        Ok(Laplace { location, scale, log_norm: -core::f64::consts::LN_2 - libm::log(scale) })
    }
}

impl Scalar for Laplace {
    fn draw(&self, rng: &mut Stream) -> f64 {
        let size = -self.scale * libm::log(rng.open_uniform());
        let x = if rng.next_u64() & 1 == 0 { self.location + size } else { self.location - size };
        x.clamp(f64::MIN, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x.is_finite() {
            self.log_norm - standard(x, self.location, self.scale).abs()
        } else {
            f64::NEG_INFINITY
        }
    }

    fn slope(&self, x: f64) -> Slope {
        let z = standard(x, self.location, self.scale);
        let sign = if z == 0.0 { 0.0 } else { z.signum() };
        Slope::new(-sign / self.scale, [sign / self.scale, (z.abs() - 1.0) / self.scale])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let z = standard(x, self.location, self.scale);
        let tails = Tails::from_below(-z.abs() - core::f64::consts::LN_2);
        Some(if z < 0.0 { tails } else { tails.swapped() })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-1.0, -standard(x, self.location, self.scale)])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.location)
    }

    fn number_sd(&self) -> Option<f64> {
        Some(core::f64::consts::SQRT_2 * self.scale)
    }
}
