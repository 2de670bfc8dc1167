//! The binomial distribution.

use super::param::probability;
use super::{Datum, Distribution, Gradient, ParamError, Support, number};
use crate::num::ln_choose;
use crate::rng::Stream;

/// binomial(n, p): the number of successes in n trials
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binomial {
    n: f64,
    p: f64,
}

/// The largest count of trials: counts stay exact in a double.
const MOST: f64 = 9_007_199_254_740_992.0;

impl Binomial {
    /// A number of trials and the probability of success.
    ///
    /// # Errors
    /// Unless `n` is a whole number from 0 to 2^53 and `p` lies between 0 and 1.
    pub fn new(n: f64, p: f64) -> Result<Self, ParamError> {
        if !(n >= 0.0 && n <= MOST && n == libm::trunc(n)) {
            return Err(ParamError::new("binomial", "n", "a whole number, at least 0", n));
        }
        Ok(Binomial { n, p: probability("binomial", "p", p)? })
    }
}

impl Distribution for Binomial {
    fn name(&self) -> &'static str {
        "binomial"
    }

    fn support(&self) -> Support {
        Support::Integers { lo: 0, hi: Some(self.n as i64) }
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        match rand_distr::Binomial::new(self.n as u64, self.p) {
            Ok(b) => Datum::Num(rng.sample::<u64>(b) as f64),
            Err(_) => Datum::Num(0.0),
        }
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let k = number(x);
        if !(k >= 0.0 && k <= self.n && k == libm::trunc(k)) {
            return f64::NEG_INFINITY;
        }
        let yes = if k == 0.0 { 0.0 } else { k * libm::log(self.p) };
        let no = if k == self.n { 0.0 } else { (self.n - k) * libm::log1p(-self.p) };
        ln_choose(self.n, k) + yes + no
    }

    /// By `p` only: whole parameters have no derivative.
    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let k = number(x);
        let by_p = k / self.p - (self.n - k) / (1.0 - self.p);
        (self.support().contains(x) && by_p.is_finite()).then(|| Gradient { x: Vec::new(), params: vec![by_p] })
    }
}
