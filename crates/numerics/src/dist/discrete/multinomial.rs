//! The multinomial distribution. Probabilities use Loader's saddle-point form; counts are
//! drawn one category after the other.

use crate::dist::support::are_counts;
use crate::dist::*;
use crate::num::{LN_SQRT_2PI, deviance, stirling_error};

/// `multinomial(n, weights)`: how many of n draws fall into each category. The weights
/// need not sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Multinomial {
    n: f64,
    weights: Box<[f64]>,
    total: f64,
}

impl Multinomial {
    /// Creates the distribution of `n` draws with these weights; fails unless `n` is an
    /// integer between 0 and 2^53, and all weights are finite and not negative with a
    /// positive, finite sum.
    pub fn new(n: f64, weights: &[f64]) -> Result<Multinomial, ParamError> {
        let n = param::integer(Self::NAME, "n", n)?;
        if n < 0.0 {
            return Err(Self::bad("n", n, "must not be negative"));
        }
        let one = |e| ParamError { distribution: Self::NAME, ..e };
        Categorical::new(weights).map_err(one)?;
        Ok(Multinomial { n, weights: weights.into(), total: weights.iter().sum() })
    }

    fn score(&self, xs: &[f64]) -> f64 {
        if !are_counts(xs, self.n as i64) {
            return f64::NEG_INFINITY;
        }
        if self.n == 0.0 {
            return 0.0;
        }
        // ln k! minus the terms k ln k - k of Stirling's formula, which the deviances
        // contain.
        let rest = |k: f64| 0.5 * libm::log(k) + LN_SQRT_2PI + stirling_error(k);
        let mut sum = rest(self.n);
        for (k, w) in xs.iter().zip(&self.weights) {
            let expected = self.n * (w / self.total);
            if *k > 0.0 {
                sum -= rest(*k);
            }
            // If the expected count underflows, its logarithm is still finite unless the
            // weight is 0.
            sum -= if *k > 0.0 && expected < f64::MIN_POSITIVE {
                *k * (libm::log(*k) - libm::log(self.n) - libm::log(*w) + libm::log(self.total)
                    - 1.0)
            } else {
                deviance(*k, expected)
            };
        }
        sum
    }
}

impl Distribution for Multinomial {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        Support::Counts { total: self.n as i64, kinds: self.weights.len() }
    }

    /// Draws each category's count, which is binomial given those before it.
    fn sample(&self, rng: &mut Stream) -> Datum {
        let mut after: Vec<f64> = Vec::with_capacity(self.weights.len());
        let mut sum = 0.0;
        for w in self.weights.iter().rev() {
            after.push(sum);
            sum += w;
        }
        let mut left = self.n;
        let count = |(w, after): (&f64, f64)| {
            let share = if after > 0.0 { w / (w + after) } else { f64::from(u8::from(*w > 0.0)) };
            let k = Binomial::new(left, share).map_or(0.0, |d| d.draw(rng));
            left -= k;
            k
        };
        let counts: Vec<f64> =
            self.weights.iter().zip(after.into_iter().rev()).map(count).collect();
        counts.into()
    }

    fn log_density(&self, x: &Datum) -> f64 {
        x.with_numbers(self.weights.len(), |xs| self.score(xs)).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        x.with_numbers(self.weights.len(), |xs| {
            let by_weight =
                |(k, w): (&f64, &f64)| if *k > 0.0 { k / w } else { 0.0 } - self.n / self.total;
            let params =
                std::iter::once(0.0).chain(xs.iter().zip(&self.weights).map(by_weight)).collect();
            Gradient { x: Vec::new(), params }
        })
    }
}
