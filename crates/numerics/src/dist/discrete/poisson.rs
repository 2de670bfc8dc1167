//! The Poisson distribution. Probabilities use Loader's saddle-point form. Draws use
//! inversion for small rates, otherwise transformed rejection (Hörmann 1993, "The
//! transformed rejection method for generating Poisson random variables", PTRS).

use crate::dist::param::MAX_INTEGER;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, deviance, gamma_tails, ln_factorial, stirling_error};

/// `poisson(rate)`; always 0 if the rate is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Poisson {
    rate: f64,
}

impl Poisson {
    pub(in crate::dist) fn of(rate: f64) -> Result<Poisson, ParamError> {
        Ok(Poisson { rate })
    }
}

impl Scalar for Poisson {
    const SUPPORT: Support = Support::Integers { lo: 0, hi: None };

    fn draw(&self, rng: &mut Stream) -> f64 {
        let rate = self.rate;
        if rate < 10.0 {
            let mut mass = libm::exp(-rate);
            let mut u = rng.uniform();
            let mut k = 0.0;
            while u >= mass && mass > 0.0 {
                u -= mass;
                k += 1.0;
                mass *= rate / k;
            }
            return k;
        }
        let spread = rate.sqrt();
        let b = 0.931 + 2.53 * spread;
        let a = -0.059 + 0.02483 * b;
        let log_inverse = libm::log(1.1239 + 1.1328 / (b - 3.4));
        let squeeze = 0.9277 - 3.6224 / (b - 2.0);
        loop {
            let u = rng.open_uniform() - 0.5;
            let v = rng.open_uniform();
            let us = 0.5 - u.abs();
            let k = libm::floor((2.0 * a / us + b) * u + rate + 0.43);
            if us >= 0.07 && v <= squeeze {
                return k.max(0.0);
            }
            if k < 0.0 || (us < 0.013 && v > us) {
                continue;
            }
            if libm::log(v) + log_inverse - libm::log(a / (us * us) + b) <= self.log_density_num(k)
            {
                return k;
            }
        }
    }

    fn log_density_num(&self, k: f64) -> f64 {
        if !(k >= 0.0 && k.is_finite() && k == libm::trunc(k)) {
            f64::NEG_INFINITY
        } else if k == 0.0 {
            -self.rate
        } else if self.rate == 0.0 {
            f64::NEG_INFINITY
        } else {
            -LN_SQRT_2PI - 0.5 * libm::log(k) - stirling_error(k) - deviance(k, self.rate)
        }
    }

    fn slope(&self, k: f64) -> Slope {
        Slope::discrete([if k > 0.0 { k / self.rate - 1.0 } else { -1.0 }])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        if x < 0.0 {
            return Some(Tails::NONE_BELOW);
        }
        let k = libm::floor(x);
        gamma_tails(k + 1.0, self.rate).map(|t| Tails::from(t).swapped())
    }

    fn cdf_slopes(&self, _x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-1.0])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.rate)
    }

    fn number_sd(&self) -> Option<f64> {
        Some(self.rate.sqrt())
    }
}

/// `poisson(log = l)`: with the rate exp(l).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoissonLog {
    log: f64,
    by_rate: Poisson,
}

impl PoissonLog {
    pub(in crate::dist) fn of(log: f64) -> Result<PoissonLog, ParamError> {
        match libm::exp(log) {
            rate if rate <= MAX_INTEGER => Ok(PoissonLog { log, by_rate: Poisson { rate } }),
            _ => Err(Self::bad("log", log, "must be at most log(2^53)")),
        }
    }
}

impl Scalar for PoissonLog {
    const SUPPORT: Support = Poisson::SUPPORT;

    fn draw(&self, rng: &mut Stream) -> f64 {
        self.by_rate.draw(rng)
    }

    fn log_density_num(&self, k: f64) -> f64 {
        let here = k > 0.0 && k.is_finite() && k == libm::trunc(k);
        match here && self.log < -300.0 {
            // The rate underflows, or nearly, and nothing cancels.
            true => k * self.log - ln_factorial(k),
            false => self.by_rate.log_density_num(k),
        }
    }

    fn slope(&self, k: f64) -> Slope {
        Slope::discrete([k - self.by_rate.rate])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        Scalar::tails(&self.by_rate, x)
    }

    fn cdf_slopes(&self, _x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-self.by_rate.rate])
    }

    fn number_mean(&self) -> Option<f64> {
        self.by_rate.number_mean()
    }

    fn number_sd(&self) -> Option<f64> {
        self.by_rate.number_sd()
    }
}
