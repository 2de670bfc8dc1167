//! The binomial distribution. Probabilities use Loader's saddle-point form. Draws use
//! inversion for few expected successes, otherwise transformed rejection (Hörmann 1993,
//! "The generation of binomial random variates", BTRS).

use crate::dist::*;
use crate::num::{LN_SQRT_2PI, beta_tails, deviance, stirling_error};

/// `binomial(n, p)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binomial {
    n: f64,
    p: f64,
    error: f64,
}

impl Binomial {
    pub(in crate::dist) fn of(n: f64, p: f64) -> Result<Binomial, ParamError> {
        if n < 0.0 {
            return Err(Self::bad("n", n, "must not be negative"));
        }
        Ok(Binomial { n, p, error: if n > 0.0 { stirling_error(n) } else { 0.0 } })
    }

    /// Draws a number of successes, for p <= 1/2.
    fn draw_few(&self, p: f64, rng: &mut Stream) -> f64 {
        let n = self.n;
        if n * p < 10.0 {
            let odds = p / (1.0 - p);
            let mut mass = libm::exp(n * libm::log1p(-p));
            let mut u = rng.uniform();
            let mut k = 0.0;
            while u >= mass && k < n {
                u -= mass;
                k += 1.0;
                mass *= odds * (n - k + 1.0) / k;
                if mass == 0.0 {
                    break;
                }
            }
            return k;
        }
        let spread = (n * p * (1.0 - p)).sqrt();
        let b = 1.15 + 2.53 * spread;
        let a = -0.0873 + 0.0248 * b + 0.01 * p;
        let squeeze = 0.92 - 4.2 / b;
        let alpha = (2.83 + 5.1 / b) * spread;
        let own = Binomial { p, ..*self };
        let at_mode = own.log_density_num(libm::floor((n + 1.0) * p));
        loop {
            let u = rng.open_uniform() - 0.5;
            let v = rng.open_uniform();
            let us = 0.5 - u.abs();
            let k = libm::floor((2.0 * a / us + b) * u + n * p + 0.5);
            if us >= 0.07 && v <= squeeze {
                return k.clamp(0.0, n);
            }
            if k < 0.0 || k > n {
                continue;
            }
            if libm::log(v * alpha / (a / (us * us) + b)) <= own.log_density_num(k) - at_mode {
                return k;
            }
        }
    }
}

impl Scalar for Binomial {
    fn number_support(&self) -> Support {
        Support::Integers { lo: 0, hi: Some(self.n as i64) }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        if self.p <= 0.5 {
            self.draw_few(self.p, rng)
        } else {
            self.n - self.draw_few(1.0 - self.p, rng)
        }
    }

    fn log_density_num(&self, k: f64) -> f64 {
        let (n, p) = (self.n, self.p);
        if !((0.0..=n).contains(&k) && k == libm::trunc(k)) {
            return f64::NEG_INFINITY;
        }
        // The number of successes is certain: p = 0 or 1, or no trials.
        if p == 0.0 || n == 0.0 {
            return if k == 0.0 { 0.0 } else { f64::NEG_INFINITY };
        }
        if p == 1.0 {
            return if k == n { 0.0 } else { f64::NEG_INFINITY };
        }
        if k == 0.0 {
            return n * libm::log1p(-p);
        }
        if k == n {
            return n * if p > 0.5 { libm::log1p(p - 1.0) } else { libm::log(p) };
        }
        let l = n - k;
        let errors = self.error - stirling_error(k) - stirling_error(l);
        let deviances = deviance(k, n * p) + deviance(l, n * (1.0 - p));
        errors - deviances - LN_SQRT_2PI - 0.5 * (libm::log(k) + libm::log(l / n))
    }

    fn slope(&self, k: f64) -> Slope {
        let up = if k > 0.0 { k / self.p } else { 0.0 };
        let down = if k < self.n { (self.n - k) / (1.0 - self.p) } else { 0.0 };
        Slope::discrete([0.0, up - down])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x < 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let k = libm::floor(x);
        if k >= self.n {
            return Some(Tails::ALL_BELOW);
        }
        beta_tails(self.n - k, k + 1.0, 1.0 - self.p, self.p).map(Tails::from)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![0.0, -(self.n - x) / (1.0 - self.p)])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.n * self.p)
    }

    fn number_sd(&self) -> Option<f64> {
        Some((self.n * self.p * (1.0 - self.p)).sqrt())
    }
}
