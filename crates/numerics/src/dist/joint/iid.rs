//! Independent elements of one distribution.

use crate::dist::joint::product;
use crate::dist::*;
use crate::num::accumulate;

/// `iid(d, n)`. In the language, its elements are choices with their own addresses.
///
/// Elements are stored as values: a Gaussian process becomes a centred one. Parameter
/// gradients are summed over the elements.
#[derive(Clone, Debug)]
pub struct Iid {
    one: Dist,
    n: usize,
}

impl Iid {
    /// Creates the distribution of `n` elements; fails if `n` is above 2^32 - 2, because
    /// further elements have no addresses.
    pub fn new(one: Dist, n: usize) -> Result<Iid, ParamError> {
        if n >= u32::MAX as usize {
            return Err(Self::bad("n", n, "must be below 2^32 - 1"));
        }
        Ok(Iid { one: one.centred(), n })
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Returns whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Returns the distribution of an element.
    pub fn one(&self) -> &Dist {
        &self.one
    }

    fn parts(&self) -> impl Iterator<Item = &Dist> {
        std::iter::repeat_n(&self.one, self.n)
    }
}

impl Distribution for Iid {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        Support::Product(Box::new(self.one.support()), self.n)
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::from_elements(self.parts().map(|p| p.sample(rng)).collect())
    }

    fn log_density(&self, x: &Datum) -> f64 {
        product::score(self.parts(), self.n, x)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        product::slopes(self.parts(), self.n, x, |all, one| accumulate(all, &one))
    }

    fn is_gaussian(&self) -> bool {
        self.one.is_gaussian()
    }

    fn whiten(&self, x: &Datum) -> Option<Vec<f64>> {
        product::whiten(self.parts(), self.n, x)
    }

    fn colour(&self, z: &[f64]) -> Option<Datum> {
        product::colour(self.parts(), self.n, z)
    }

    fn is_scalar(&self) -> bool {
        false
    }

    fn is_improper(&self) -> bool {
        self.one.is_improper()
    }

    fn param_count(&self) -> usize {
        self.one.param_count()
    }

    fn has_moving_support(&self) -> bool {
        self.one.has_moving_support()
    }

    fn made_of(&self) -> Option<(&[Dist], usize)> {
        Some((std::slice::from_ref(&self.one), self.n))
    }
}
