//! The negative binomial distribution. Probabilities use Loader's saddle-point form;
//! draws are Poisson with a gamma-distributed rate.

use crate::dist::draw::ln_gamma_draw;
use crate::dist::param::MAX_INTEGER;
use crate::dist::tails::speed_by_differences;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, beta_tails, deviance, digamma, ln_gamma, stirling_error};

/// `neg_binomial(r, p)`: the number of failures before the `r`-th success, as in scipy's
/// `nbinom(r, p)`; `r` may be any positive number. Stan's `neg_binomial(alpha, beta)` has
/// r = alpha, p = beta / (1 + beta).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NegBinomial {
    r: f64,
    p: f64,
    error: f64,
}

impl NegBinomial {
    pub(in crate::dist) fn of(r: f64, p: f64) -> Result<NegBinomial, ParamError> {
        Ok(NegBinomial { r, p, error: stirling_error(r) })
    }
}

impl Scalar for NegBinomial {
    const SUPPORT: Support = Support::Integers { lo: 0, hi: None };

    /// Draws a number of failures of at most about 2^53.
    fn draw(&self, rng: &mut Stream) -> f64 {
        let log_rate = ln_gamma_draw(self.r, rng) + libm::log1p(-self.p) - libm::log(self.p);
        let rate = libm::exp(log_rate).min(MAX_INTEGER);
        Poisson::new(rate).map_or(0.0, |d| d.draw(rng))
    }

    fn log_density_num(&self, k: f64) -> f64 {
        let (r, p) = (self.r, self.p);
        if !(k >= 0.0 && k.is_finite() && k == libm::trunc(k)) {
            return f64::NEG_INFINITY;
        }
        if k == 0.0 {
            return r * libm::log(p);
        }
        if p == 1.0 {
            return f64::NEG_INFINITY;
        }
        let n = r + k;
        if n == k && r < 1.0 {
            // `r` is lost in the sum n, and Gamma(k + r) / Gamma(k + 1) is k^(r - 1).
            return (r - 1.0) * libm::log(k) - ln_gamma(r) + r * libm::log(p) + k * libm::log1p(-p);
        }
        let errors = stirling_error(n) - self.error - stirling_error(k);
        let deviances = deviance(r, n * p) + deviance(k, n * (1.0 - p));
        let score = errors - deviances - LN_SQRT_2PI + 0.5 * (libm::log(r / n) - libm::log(k));
        if score.is_nan() { f64::NEG_INFINITY } else { score }
    }

    fn slope(&self, k: f64) -> Slope {
        let (r, p) = (self.r, self.p);
        let by_r = if k > 0.0 { digamma(k + r) - digamma(r) + libm::log(p) } else { libm::log(p) };
        let down = if k > 0.0 { k / (1.0 - p) } else { 0.0 };
        Slope::discrete([by_r, r / p - down])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x < 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let k = libm::floor(x);
        beta_tails(self.r, k + 1.0, self.p, 1.0 - self.p).map(Tails::from)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let tails = |r| beta_tails(r, x + 1.0, self.p, 1.0 - self.p).map(Tails::from);
        let by_r = speed_by_differences(self.r, self.log_density_num(x), tails);
        Some(smallvec![by_r, (self.r + x) / self.p])
    }

    fn number_mean(&self) -> Option<f64> {
        let mean = self.r * ((1.0 - self.p) / self.p);
        mean.is_finite().then_some(mean)
    }

    fn number_sd(&self) -> Option<f64> {
        let sd = (self.r * (1.0 - self.p)).sqrt() / self.p;
        sd.is_finite().then_some(sd)
    }
}
