//! The categorical distribution.

use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::log_sum_exp;
use crate::rng::Stream;

/// categorical(weights): one of 0, 1, … with probability in proportion to its weight
#[derive(Clone, Debug, PartialEq)]
pub struct Categorical {
    weights: Vec<f64>,
    log_total: f64,
}

impl Categorical {
    /// One weight for each value; they need not sum to 1.
    ///
    /// # Errors
    /// Unless all are finite and at least 0, and one is positive.
    pub fn new(weights: &[f64]) -> Result<Self, ParamError> {
        if let Some(w) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
            return Err(ParamError::new("categorical", "weights", "finite and at least 0", w));
        }
        let logs: Vec<f64> = weights.iter().map(|w| libm::log(*w)).collect();
        let log_total = log_sum_exp(&logs);
        if log_total == f64::NEG_INFINITY {
            return Err(ParamError::new("categorical", "weights", "not all 0", format!("{weights:?}")));
        }
        Ok(Categorical { weights: weights.to_vec(), log_total })
    }
}

impl Distribution for Categorical {
    fn name(&self) -> &'static str {
        "categorical"
    }

    fn support(&self) -> Support {
        Support::Integers { lo: 0, hi: Some(self.weights.len() as i64 - 1) }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let largest = self.weights.iter().copied().fold(0.0, f64::max);
        let total: f64 = self.weights.iter().map(|w| w / largest).sum();
        let mut u = rng.uniform() * total;
        let mut last = 0;
        for (i, w) in self.weights.iter().enumerate() {
            if *w == 0.0 {
                continue;
            }
            last = i;
            u -= w / largest;
            if u < 0.0 {
                break;
            }
        }
        Datum::Num(last as f64)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let k = number(x);
        if k >= 0.0 && k == libm::trunc(k) && k < self.weights.len() as f64 {
            libm::log(self.weights[k as usize]) - self.log_total
        } else {
            f64::NEG_INFINITY
        }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let k = self.support().contains(x).then(|| number(x) as usize)?;
        let total = libm::exp(self.log_total);
        let by_weight = |i: usize| if i == k { 1.0 / self.weights[i] } else { 0.0 } - 1.0 / total;
        let params: Vec<f64> = (0..self.weights.len()).map(by_weight).collect();
        params.iter().all(|p| p.is_finite()).then_some(Gradient { x: Vec::new(), params })
    }
}
