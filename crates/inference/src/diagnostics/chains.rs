//! A rectangle of draws, chain by chain, and the moments that the diagnostics need.

/// Draws of several chains of equal length, scaled so that squares and fourth powers of
/// draws of any size neither overflow nor underflow.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chains {
    values: Vec<f64>,
    draws: usize,
    unit: f64,
}

impl Chains {
    /// Copies the draws; `None` if a chain has fewer than four, or a draw is not finite. Chains
    /// without draws, such as those that could not start, do not count.
    pub fn new<C: AsRef<[f64]>>(chains: &[C]) -> Option<Chains> {
        let drawn = || chains.iter().map(AsRef::as_ref).filter(|c| !c.is_empty());
        let draws = drawn().map(<[f64]>::len).min()?;
        let mut values: Vec<f64> = drawn().flat_map(|c| c.iter().take(draws)).copied().collect();
        let unit = unit(&values);
        values.iter_mut().for_each(|x| *x /= unit);
        (draws >= 4 && values.iter().all(|x| x.is_finite())).then_some(Chains {
            values,
            draws,
            unit,
        })
    }

    /// The unit of the scaled draws: a power of 2.
    pub fn unit(&self) -> f64 {
        self.unit
    }

    /// The number of chains.
    pub fn count(&self) -> usize {
        self.values.len() / self.draws
    }

    /// The number of draws in each.
    pub fn draws(&self) -> usize {
        self.draws
    }

    /// Every draw.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Iterates over the chains.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.draws)
    }

    /// Splits each chain into its first and last half as separate chains; the middle draw
    /// of an odd number is left out.
    pub fn split(&self) -> Chains {
        let half = self.draws / 2;
        let mut values = Vec::with_capacity(2 * half * self.count());
        values.extend(self.iter().flat_map(|c| &c[..half]));
        values.extend(self.iter().flat_map(|c| &c[c.len() - half..]));
        Chains { values, draws: half, ..*self }
    }

    /// The same chains with a function applied to every draw.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Chains {
        self.with_values(self.values.iter().map(|&x| f(x)).collect())
    }

    /// The same shape with other values.
    pub fn with_values(&self, values: Vec<f64>) -> Chains {
        debug_assert_eq!(values.len(), self.values.len());
        Chains { values, ..*self }
    }
}

/// The largest power of 2 that is at most the largest absolute value, so that division by
/// it is exact; 1 if there is none.
pub(super) fn unit(x: &[f64]) -> f64 {
    let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if largest > 0.0 && largest.is_finite() { libm::ldexp(1.0, libm::ilogb(largest)) } else { 1.0 }
}

/// The mean; NaN for an empty slice.
pub(super) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// The unbiased variance, over n - 1; NaN for fewer than two numbers.
pub(super) fn variance(x: &[f64]) -> f64 {
    let m = mean(x);
    x.iter().map(|v| (v - m) * (v - m)).sum::<f64>() / (x.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn split_leaves_out_the_middle_draw() {
        let c = Chains::new(&[vec![1., 2., 3., 4., 5.], vec![6., 7., 8., 9., 10.]]).unwrap();
        let s = c.split();
        let draws: Vec<Vec<f64>> =
            s.iter().map(|c| c.iter().map(|x| x * s.unit()).collect()).collect();
        assert_eq!(draws, [[1., 2.], [6., 7.], [4., 5.], [9., 10.]]);
        assert_eq!(s.unit(), 8.0);
    }

    #[test]
    fn ragged_chains_are_cut_and_bad_ones_refused() {
        assert_eq!(Chains::new(&[vec![0.; 9], vec![0.; 6]]).unwrap().draws(), 6);
        assert_eq!(Chains::new(&[vec![0.; 3]]), None);
        assert_eq!(Chains::new(&[vec![0., 1., f64::INFINITY, 2.]]), None);
        assert_eq!(Chains::new::<Vec<f64>>(&[]), None);
    }
}
