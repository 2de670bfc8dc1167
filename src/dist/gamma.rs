//! The gamma distribution.

use super::beta::power_term;
use super::param::positive;
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::{digamma, ln_gamma};
use crate::rng::Stream;

/// gamma(shape, rate)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gamma {
    shape: f64,
    rate: f64,
    norm: f64,
}

impl Gamma {
    /// Shape and rate: the mean is shape / rate.
    ///
    /// # Errors
    /// Unless both are positive and finite.
    pub fn new(shape: f64, rate: f64) -> Result<Self, ParamError> {
        let (shape, rate) = (positive("gamma", "shape", shape)?, positive("gamma", "rate", rate)?);
        Ok(Gamma { shape, rate, norm: shape * libm::log(rate) - ln_gamma(shape) })
    }
}

/// The log of a draw from gamma(shape, 1): for shapes below 1 by the boost of Marsaglia and Tsang (2000) in log space,
/// where the draw itself would underflow.
pub(super) fn ln_gamma_draw(shape: f64, rng: &mut Stream) -> f64 {
    let boosted = if shape < 1.0 { shape + 1.0 } else { shape };
    let x = match rand_distr::Gamma::new(boosted, 1.0) {
        Ok(g) => rng.sample::<f64>(g),
        Err(_) => boosted,
    };
    let y = libm::log(x.max(f64::MIN_POSITIVE));
    if shape < 1.0 { y + libm::log(rng.open_uniform()) / shape } else { y }
}

impl Distribution for Gamma {
    fn name(&self) -> &'static str {
        "gamma"
    }

    fn support(&self) -> Support {
        Support::Positive
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let y = ln_gamma_draw(self.shape, rng) - libm::log(self.rate);
        Datum::Num(libm::exp(y).clamp(f64::MIN_POSITIVE, f64::MAX))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let x = number(x);
        if !(x > 0.0 && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        self.norm + power_term(self.shape, libm::log(x)) - self.rate * x
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let x = number(x);
        if !(x > 0.0 && x.is_finite()) {
            return None;
        }
        Some(Gradient {
            x: vec![(self.shape - 1.0) / x - self.rate],
            params: vec![libm::log(self.rate) - digamma(self.shape) + libm::log(x), self.shape / self.rate - x],
        })
    }
}
