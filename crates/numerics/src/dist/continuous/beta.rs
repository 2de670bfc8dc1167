//! The beta distribution.

use crate::dist::draw::{ln_gamma_draw, x_log_y, x_log1p_y};
use crate::dist::tails::speed_by_differences;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, beta_tails, deviance, digamma, expit, ln_beta, stirling_error};

/// The value of both parameters from which the saddle-point form is used.
const LARGE: f64 = 64.0;

/// `beta(a, b)`. At 0 and 1 the density is its limit: a pole (+inf) if the parameter is
/// below 1, and 0 if it is above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beta {
    a: f64,
    b: f64,
    log_norm: f64,
}

impl Beta {
    pub(in crate::dist) fn of(a: f64, b: f64) -> Result<Beta, ParamError> {
        let log_norm = if a.min(b) < LARGE {
            -ln_beta(a, b)
        } else {
            let (k, l) = (a - 1.0, b - 1.0);
            let n = k + l;
            let errors = stirling_error(n) - stirling_error(k) - stirling_error(l);
            errors + libm::log(n + 1.0) - LN_SQRT_2PI - 0.5 * (libm::log(k) + libm::log(l / n))
        };
        Ok(Beta { a, b, log_norm })
    }
}

impl Scalar for Beta {
    const SUPPORT: Support = Support::Interval { lo: 0.0, hi: 1.0 };

    fn draw(&self, rng: &mut Stream) -> f64 {
        let (x, y) = (ln_gamma_draw(self.a, rng), ln_gamma_draw(self.b, rng));
        expit(x - y).clamp(f64::MIN_POSITIVE, 1f64.next_down())
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !(0.0..=1.0).contains(&x) {
            return f64::NEG_INFINITY;
        }
        let (k, l) = (self.a - 1.0, self.b - 1.0);
        if self.a.min(self.b) < LARGE {
            self.log_norm + x_log_y(k, x) + x_log1p_y(l, -x)
        } else if x == 0.0 || x == 1.0 {
            f64::NEG_INFINITY
        } else {
            let n = k + l;
            self.log_norm - deviance(k, n * x) - deviance(l, n * (1.0 - x))
        }
    }

    fn slope(&self, x: f64) -> Slope {
        let (a, b) = (self.a, self.b);
        let all = digamma(a + b);
        let left = if a == 1.0 { 0.0 } else { (a - 1.0) / x };
        let right = if b == 1.0 { 0.0 } else { (b - 1.0) / (1.0 - x) };
        // Where the derivative has a pole, its value at the smallest positive double is
        // used.
        let floor = f64::from_bits(1);
        let by_a = libm::log(x.max(floor)) + all - digamma(a);
        Slope::new(left - right, [by_a, libm::log1p(-x).max(f64::MIN) + all - digamma(b)])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        beta_tails(self.a, self.b, x, 1.0 - x).map(Tails::from)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let own = self.log_density_num(x);
        let tails = |a, b| beta_tails(a, b, x, 1.0 - x).map(Tails::from);
        let by_a = speed_by_differences(self.a, own, |a| tails(a, self.b));
        Some(smallvec![by_a, speed_by_differences(self.b, own, |b| tails(self.a, b))])
    }

    #[inline]
    fn upper_pole(&self) -> Option<f64> {
        (self.b < 1.0).then_some(self.b)
    }

    fn number_mean(&self) -> Option<f64> {
        Some(1.0 / (1.0 + self.b / self.a))
    }

    fn number_sd(&self) -> Option<f64> {
        let m = 1.0 / (1.0 + self.b / self.a);
        Some((m * (1.0 - m) / (self.a + self.b + 1.0)).sqrt())
    }
}
