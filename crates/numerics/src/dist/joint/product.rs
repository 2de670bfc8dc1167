//! Independent elements, each with its own distribution, such as `normal([0, 1], 1)`.

use crate::dist::*;

/// A product of distributions. In the language, its elements are choices with their own
/// addresses.
///
/// Elements are stored as values: a Gaussian process among them becomes a centred one.
#[derive(Clone, Debug)]
pub struct Product {
    parts: Vec<Dist>,
}

impl Product {
    /// Creates the product of these distributions; the list may be empty.
    pub fn new(parts: Vec<Dist>) -> Result<Product, ParamError> {
        Ok(Product { parts: parts.into_iter().map(Dist::centred).collect() })
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// Returns whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Returns the elements' distributions.
    pub fn parts(&self) -> &[Dist] {
        &self.parts
    }
}

impl From<Product> for Dist {
    fn from(d: Product) -> Dist {
        Dist::Product(Arc::new(d))
    }
}

impl Distribution for Product {
    /// The family of the elements if they are all of one family.
    fn name(&self) -> &str {
        let first = self.parts.first().map_or("product", Dist::name);
        if self.parts.iter().all(|p| p.name() == first) { first } else { "product" }
    }

    fn support(&self) -> Support {
        Support::Each(self.parts.iter().map(Dist::support).collect())
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::from_elements(self.parts.iter().map(|p| p.sample(rng)).collect())
    }

    fn log_density(&self, x: &Datum) -> f64 {
        score(&self.parts, self.parts.len(), x)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        slopes(&self.parts, self.parts.len(), x, |all, one| all.extend(one))
    }

    fn is_gaussian(&self) -> bool {
        self.parts.iter().all(Dist::is_gaussian)
    }

    fn whiten(&self, x: &Datum) -> Option<Vec<f64>> {
        whiten(&self.parts, self.parts.len(), x)
    }

    fn colour(&self, z: &[f64]) -> Option<Datum> {
        colour(&self.parts, self.parts.len(), z)
    }

    fn is_scalar(&self) -> bool {
        false
    }

    fn is_improper(&self) -> bool {
        self.parts.iter().any(Dist::is_improper)
    }

    fn param_count(&self) -> usize {
        self.parts.iter().map(Dist::param_count).sum()
    }

    fn has_moving_support(&self) -> bool {
        self.parts.iter().any(Dist::has_moving_support)
    }

    fn made_of(&self) -> Option<(&[Dist], usize)> {
        Some((&self.parts, 1))
    }
}

/// Sums the log densities of the elements; -inf if an element is impossible.
pub(in crate::dist) fn score<'a>(
    parts: impl IntoIterator<Item = &'a Dist>,
    n: usize,
    x: &Datum,
) -> f64 {
    if x.len() != Some(n) {
        return f64::NEG_INFINITY;
    }
    let mut sum = 0.0;
    for (i, p) in parts.into_iter().enumerate() {
        let one = x.element(i).map_or(f64::NEG_INFINITY, |x| p.log_density(&x));
        if one == f64::NEG_INFINITY {
            return one;
        }
        sum += one;
    }
    sum
}

/// Concatenates the elements' derivatives with respect to the value; `join` combines
/// those with respect to the parameters.
pub(in crate::dist) fn slopes<'a>(
    parts: impl IntoIterator<Item = &'a Dist>,
    n: usize,
    x: &Datum,
    join: impl Fn(&mut Vec<f64>, Vec<f64>),
) -> Option<Gradient> {
    if x.len() != Some(n) {
        return None;
    }
    let mut all = Gradient { x: Vec::new(), params: Vec::new() };
    for (i, p) in parts.into_iter().enumerate() {
        let one = p.gradient(&x.element(i)?)?;
        all.x.extend(one.x);
        join(&mut all.params, one.params);
    }
    Some(all)
}

/// Returns the white noise of all elements.
pub(in crate::dist) fn whiten<'a>(
    parts: impl IntoIterator<Item = &'a Dist>,
    n: usize,
    x: &Datum,
) -> Option<Vec<f64>> {
    if x.len() != Some(n) {
        return None;
    }
    let mut z = Vec::with_capacity(n);
    for (i, p) in parts.into_iter().enumerate() {
        z.extend(p.whiten(&x.element(i)?)?);
    }
    Some(z)
}

/// Returns the elements that correspond to this white noise.
pub(in crate::dist) fn colour<'a>(
    parts: impl IntoIterator<Item = &'a Dist>,
    n: usize,
    z: &[f64],
) -> Option<Datum> {
    let mut xs = Vec::with_capacity(n);
    let mut rest = z;
    for p in parts {
        let (own, after) = rest.split_at_checked(p.support().free_dim())?;
        xs.push(p.colour(own)?);
        rest = after;
    }
    rest.is_empty().then(|| Datum::from_elements(xs))
}
