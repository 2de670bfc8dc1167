//! Sorted values of one distribution: mixture components in an order, cut points.

use super::support::is_ascending;
use super::{Datum, Dist, Distribution, Gradient, ParamError, Support, product};
use crate::num::{accumulate, ln_gamma};
use crate::rng::Stream;

/// `ordered(d, n)`: n independent numbers of `d` in ascending order, one choice. The density is n! times the product of those of
/// `d`. Gradients by parameters are those of `d`, summed.
#[derive(Clone, Debug)]
pub struct Ordered {
    one: Dist,
    n: usize,
}

impl Ordered {
    /// So many numbers of a distribution; fails unless it is one of continuous numbers, and for more than 2^32 - 2.
    pub fn new(one: Dist, n: usize) -> Result<Ordered, ParamError> {
        let support = one.support();
        if !support.is_number() || support.is_discrete() {
            return Err(ParamError::new("ordered", "d", one.name(), "must be a distribution of continuous numbers"));
        }
        if n >= u32::MAX as usize {
            return Err(ParamError::new("ordered", "n", n, "must be below 2^32 - 1"));
        }
        Ok(Ordered { one, n })
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// The distribution of each before they are put in order.
    pub fn one(&self) -> &Dist {
        &self.one
    }

    fn parts(&self) -> impl Iterator<Item = &Dist> {
        std::iter::repeat_n(&self.one, self.n)
    }
}

impl Distribution for Ordered {
    fn name(&self) -> &'static str {
        "ordered"
    }

    fn support(&self) -> Support {
        Support::Ascending(Box::new(self.one.support()), self.n)
    }

    fn is_improper(&self) -> bool {
        self.one.is_improper()
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let mut xs: Vec<f64> = self.parts().filter_map(|p| p.sample(rng).num()).collect();
        xs.sort_by(f64::total_cmp);
        xs.into()
    }

    fn log_density(&self, x: &Datum) -> f64 {
        if !x.with_numbers(self.n, is_ascending).unwrap_or(false) {
            return f64::NEG_INFINITY;
        }
        let score = ln_gamma(self.n as f64 + 1.0) + product::score(self.parts(), self.n, x);
        if score.is_nan() { f64::NEG_INFINITY } else { score }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        product::slopes(self.parts(), self.n, x, |all, one| accumulate(all, &one))
    }
}
