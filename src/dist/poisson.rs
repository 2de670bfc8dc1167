//! The Poisson distribution.

use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::ln_factorial;
use crate::rng::Stream;

/// poisson(rate)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Poisson {
    rate: f64,
}

impl Poisson {
    /// The mean; 0 always gives 0.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1e15.
    pub fn new(rate: f64) -> Result<Self, ParamError> {
        if (0.0..=1e15).contains(&rate) {
            Ok(Poisson { rate })
        } else {
            Err(ParamError::new("poisson", "rate", "between 0 and 1e15", rate))
        }
    }
}

impl Distribution for Poisson {
    fn name(&self) -> &'static str {
        "poisson"
    }

    fn support(&self) -> Support {
        Support::Integers { lo: 0, hi: None }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        match rand_distr::Poisson::new(self.rate) {
            Ok(p) => Datum::Num(rng.sample::<f64>(p)),
            Err(_) => Datum::Num(0.0),
        }
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let k = number(x);
        if !(k >= 0.0 && k == libm::trunc(k) && k.is_finite()) {
            return f64::NEG_INFINITY;
        }
        if k == 0.0 {
            return -self.rate;
        }
        k * libm::log(self.rate) - self.rate - ln_factorial(k)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let by_rate = number(x) / self.rate - 1.0;
        let inside = self.support().contains(x) && by_rate.is_finite();
        inside.then(|| Gradient { x: Vec::new(), params: vec![by_rate] })
    }
}
