//! Independent draws from one distribution.

use super::{Datum, Dist, Distribution, Gradient, ParamError, Support};
use crate::rng::Stream;

/// iid(d, n)
#[derive(Clone, Debug)]
pub struct Iid {
    element: Dist,
    n: usize,
}

/// At most this many draws.
const MOST: usize = 100_000_000;

impl Iid {
    /// A distribution and how many.
    ///
    /// # Errors
    /// If there are more than a hundred million.
    pub fn new(element: Dist, n: usize) -> Result<Self, ParamError> {
        if n > MOST {
            return Err(ParamError::new("iid", "n", "at most 100000000", n));
        }
        Ok(Iid { element, n })
    }

    /// The distribution of one.
    pub fn element(&self) -> &Dist {
        &self.element
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.n
    }
}

impl Distribution for Iid {
    fn name(&self) -> &'static str {
        "iid"
    }

    fn support(&self) -> Support {
        Support::Repeat(Box::new(self.element.support()), self.n)
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::from_elements((0..self.n).map(|_| self.element.sample(rng)).collect())
    }

    fn log_density(&self, x: &Datum) -> f64 {
        if x.len() != Some(self.n) {
            return f64::NEG_INFINITY;
        }
        (0..self.n).map(|i| x.element(i).map_or(f64::NEG_INFINITY, |e| self.element.log_density(&e))).sum()
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let mut all = Gradient { x: Vec::new(), params: Vec::new() };
        for i in 0..self.n {
            let g = self.element.gradient(&x.element(i)?)?;
            all.x.extend(g.x);
            if all.params.is_empty() {
                all.params = g.params;
            } else {
                all.params.iter_mut().zip(g.params).for_each(|(a, b)| *a += b);
            }
        }
        Some(all)
    }
}
