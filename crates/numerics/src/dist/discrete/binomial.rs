//! The binomial distribution. Probabilities use Loader's saddle-point form. Draws use
//! inversion for few expected successes, otherwise transformed rejection (Hörmann 1993,
//! "The generation of binomial random variates", BTRS).

use crate::dist::*;
use crate::num::{LN_SQRT_2PI, beta_tails, deviance, expit, ln_choose, log1p_exp, stirling_error};

/// `binomial(n, p)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binomial {
    n: f64,
    p: f64,
    /// The probability of failure.
    q: f64,
    error: f64,
}

impl Binomial {
    pub(in crate::dist) fn of(n: f64, p: f64) -> Result<Binomial, ParamError> {
        Binomial::with(n, p, 1.0 - p)
    }

    fn with(n: f64, p: f64, q: f64) -> Result<Binomial, ParamError> {
        if n < 0.0 {
            return Err(Self::bad("n", n, "must not be negative"));
        }
        Ok(Binomial { n, p, q, error: if n > 0.0 { stirling_error(n) } else { 0.0 } })
    }

    /// Returns the log probability of 0 < k < n, where neither probability underflows.
    fn within(&self, k: f64) -> f64 {
        let (n, l) = (self.n, self.n - k);
        let errors = self.error - stirling_error(k) - stirling_error(l);
        let deviances = deviance(k, n * self.p) + deviance(l, n * self.q);
        errors - deviances - LN_SQRT_2PI - 0.5 * (libm::log(k) + libm::log(l / n))
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
        let own = Binomial { p, q: 1.0 - p, ..*self };
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
        if self.p <= 0.5 { self.draw_few(self.p, rng) } else { self.n - self.draw_few(self.q, rng) }
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
        self.within(k)
    }

    fn slope(&self, k: f64) -> Slope {
        let up = if k > 0.0 { k / self.p } else { 0.0 };
        let down = if k < self.n { (self.n - k) / self.q } else { 0.0 };
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
        beta_tails(self.n - k, k + 1.0, self.q, self.p).map(Tails::from)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![0.0, -(self.n - x) / self.q])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.n * self.p)
    }

    fn number_sd(&self) -> Option<f64> {
        Some((self.n * self.p * self.q).sqrt())
    }
}

/// `binomial(n, logit = l)`: with the log odds `l` of success.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinomialLogit {
    by_p: Binomial,
    logit: f64,
}

impl BinomialLogit {
    pub(in crate::dist) fn of(n: f64, logit: f64) -> Result<BinomialLogit, ParamError> {
        Ok(BinomialLogit { by_p: Binomial::with(n, expit(logit), expit(-logit))?, logit })
    }
}

impl Scalar for BinomialLogit {
    fn number_support(&self) -> Support {
        self.by_p.number_support()
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        self.by_p.draw(rng)
    }

    fn log_density_num(&self, k: f64) -> f64 {
        let (n, logit) = (self.by_p.n, self.logit);
        if !((0.0..=n).contains(&k) && k == libm::trunc(k)) {
            return f64::NEG_INFINITY;
        }
        // Without the terms of outcomes that do not occur. Where a probability is far below
        // the precision of the other one, the binomial coefficient does not cancel.
        let some = |count: f64, logit: f64| match count {
            0.0 => 0.0,
            count => -count * log1p_exp(-logit),
        };
        match k > 0.0 && k < n && logit.abs() < 300.0 {
            true => self.by_p.within(k),
            false => ln_choose(n, k) + some(k, logit) + some(n - k, -logit),
        }
    }

    fn slope(&self, k: f64) -> Slope {
        let Binomial { n, p, q, .. } = self.by_p;
        Slope::discrete([0.0, k * q - (n - k) * p])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        Scalar::tails(&self.by_p, x)
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![0.0, -(self.by_p.n - x) * self.by_p.p])
    }

    fn number_mean(&self) -> Option<f64> {
        self.by_p.number_mean()
    }

    fn number_sd(&self) -> Option<f64> {
        self.by_p.number_sd()
    }
}
