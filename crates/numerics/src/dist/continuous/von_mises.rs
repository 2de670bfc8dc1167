//! The von Mises distribution: an angle around a mean direction.

use crate::dist::support::wrap_angle;
use crate::dist::*;
use crate::num::{log_scaled_i0, one_minus_i1_over_i0};
use core::f64::consts::{PI, TAU};

/// `von_mises(mean, concentration)`: an angle in radians in (-pi, pi]; uniform if the
/// concentration is 0.
///
/// Draws follow Best & Fisher 1979, "Efficient simulation of the von Mises distribution",
/// rearranged so that nothing cancels if the concentration is large. The mean as a number
/// is undefined for a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VonMises {
    mean: f64,
    concentration: f64,
    log_norm: f64,
}

impl VonMises {
    pub(in crate::dist) fn of(mean: f64, concentration: f64) -> Result<VonMises, ParamError> {
        let mean = wrap_angle(mean);
        let log_norm = -libm::log(TAU) - log_scaled_i0(concentration);
        Ok(VonMises { mean, concentration, log_norm })
    }

    /// 1 - cos(x - mean).
    #[inline]
    fn fall(&self, x: f64) -> f64 {
        let half = libm::sin(0.5 * (x - self.mean));
        2.0 * half * half
    }
}

impl Scalar for VonMises {
    const SUPPORT: Support = Support::Circle;

    fn draw(&self, rng: &mut Stream) -> f64 {
        let k = self.concentration;
        if k < 1e-16 {
            return wrap_angle(PI * (2.0 * rng.uniform() - 1.0));
        }
        // r - 1 of the wrapped Cauchy envelope, r = (1 + sqrt(1 + 4 k^2)) / (2 k).
        let h = 0.5 / k;
        let beyond = h + h * h / (1.0 + (1.0 + h * h).sqrt());
        loop {
            let (u, v, sign) = (rng.open_uniform(), rng.open_uniform(), rng.next_u64() & 1);
            let s = libm::sin(0.5 * PI * u);
            let fall = 2.0 * s * s;
            // 1 - f, with f = (1 + r z) / (r + z) and z = cos(pi u).
            let less = beyond * fall / (beyond + 2.0 - fall);
            let c = k * beyond + k * less;
            if c * (2.0 - c) > v || libm::log(c / v) + 1.0 - c >= 0.0 {
                let turn = 2.0 * libm::asin((0.5 * less).sqrt().min(1.0));
                return wrap_angle(self.mean + if sign == 0 { turn } else { -turn });
            }
        }
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if Support::Circle.contains_num(x) {
            self.log_norm - self.concentration * self.fall(x)
        } else {
            f64::NEG_INFINITY
        }
    }

    fn slope(&self, x: f64) -> Slope {
        let pull = self.concentration * libm::sin(x - self.mean);
        Slope::new(-pull, [pull, one_minus_i1_over_i0(self.concentration) - self.fall(x)])
    }
}
