//! The beta distribution.

use super::param::positive;
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::{digamma, ln_beta};
use crate::rng::Stream;

/// beta(a, b)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beta {
    a: f64,
    b: f64,
    norm: f64,
}

impl Beta {
    /// Two shapes.
    ///
    /// # Errors
    /// Unless both are positive and finite.
    pub fn new(a: f64, b: f64) -> Result<Self, ParamError> {
        let (a, b) = (positive("beta", "a", a)?, positive("beta", "b", b)?);
        Ok(Beta { a, b, norm: -ln_beta(a, b) })
    }
}

/// (k - 1) ln x, with 0 ln 0 = 0.
pub(super) fn power_term(k: f64, ln_x: f64) -> f64 {
    if k == 1.0 { 0.0 } else { (k - 1.0) * ln_x }
}

impl Distribution for Beta {
    fn name(&self) -> &'static str {
        "beta"
    }

    fn support(&self) -> Support {
        Support::Interval { lo: 0.0, hi: 1.0 }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        // From two gammas in log space, so that small shapes do not end in 0/0; kept off the ends, where the density may
        // be infinite.
        let (x, y) = (super::gamma::ln_gamma_draw(self.a, rng), super::gamma::ln_gamma_draw(self.b, rng));
        let p = crate::num::expit(x - y);
        Datum::Num(p.clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON / 2.0))
    }

    /// At an end where the density grows without bound (a shape below 1) it is +inf.
    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if !(0.0..=1.0).contains(&x) {
            return f64::NEG_INFINITY;
        }
        let d = self.norm + power_term(self.a, libm::log(x)) + power_term(self.b, libm::log1p(-x));
        if d.is_nan() { f64::NEG_INFINITY } else { d }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let x = number(x);
        if !(x > 0.0 && x < 1.0) {
            return None;
        }
        let both = digamma(self.a + self.b);
        Some(Gradient {
            x: vec![(self.a - 1.0) / x - (self.b - 1.0) / (1.0 - x)],
            params: vec![libm::log(x) - digamma(self.a) + both, libm::log1p(-x) - digamma(self.b) + both],
        })
    }
}
