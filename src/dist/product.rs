//! Independent elements, each with parameters of its own: what `normal([1, 2, 3], 1)` means.

use super::{Datum, Dist, Distribution, Gradient, ParamError, Support};
use crate::rng::Stream;

/// A distribution over arrays with independent elements.
#[derive(Clone, Debug)]
pub struct Product {
    elements: Vec<Dist>,
}

impl Product {
    /// One distribution for each element.
    ///
    /// # Errors
    /// None at present: elements have been checked.
    pub fn new(elements: Vec<Dist>) -> Result<Self, ParamError> {
        Ok(Product { elements })
    }

    /// The elements.
    pub fn elements(&self) -> &[Dist] {
        &self.elements
    }
}

impl Distribution for Product {
    fn name(&self) -> &'static str {
        self.elements.first().map_or("product", Dist::name)
    }

    fn support(&self) -> Support {
        Support::Product(self.elements.iter().map(Dist::support).collect())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::from_elements(self.elements.iter().map(|d| d.sample(rng)).collect())
    }

    fn log_density(&self, x: &Datum) -> f64 {
        if x.len() != Some(self.elements.len()) {
            return f64::NEG_INFINITY;
        }
        let each = self.elements.iter().enumerate();
        each.map(|(i, d)| x.element(i).map_or(f64::NEG_INFINITY, |e| d.log_density(&e))).sum()
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let mut all = Gradient { x: Vec::new(), params: Vec::new() };
        for (i, d) in self.elements.iter().enumerate() {
            let g = d.gradient(&x.element(i)?)?;
            all.x.extend(g.x);
            all.params.extend(g.params);
        }
        Some(all)
    }
}
