//! The categorical distribution: an index drawn in proportion to weights.

use crate::dist::*;

/// `categorical(weights)`: 0, 1, … with these weights, which need not sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Categorical {
    weights: Arc<[f64]>,
    total: f64,
}

impl Categorical {
    /// Creates the distribution; fails unless all weights are finite and not negative,
    /// and their sum is positive and finite.
    pub fn new(weights: impl Into<Arc<[f64]>>) -> Result<Categorical, ParamError> {
        let weights = weights.into();
        let total = total(&weights)?;
        Ok(Categorical { weights, total })
    }

    /// Returns the log probability of a number under borrowed weights.
    pub fn log_probability(weights: &[f64], x: f64) -> Result<f64, ParamError> {
        total(weights).map(|total| log_probability(weights, total, x))
    }

    /// Returns the weights.
    pub(in crate::dist) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Returns the probability of index `i`.
    pub fn probability(&self, i: usize) -> f64 {
        self.weights.get(i).map_or(0.0, |w| w / self.total)
    }
}

/// Returns the sum of the weights, if they are valid.
fn total(weights: &[f64]) -> Result<f64, ParamError> {
    let total: f64 = weights.iter().sum();
    // A weight that is not finite makes the sum infinite or NaN.
    if total > 0.0 && total.is_finite() && weights.iter().all(|w| *w >= 0.0) {
        return Ok(total);
    }
    if let Some(w) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
        return Err(Categorical::bad("weights", w, "must be finite and not negative"));
    }
    Err(Categorical::bad("weights", total, "must have a positive, finite sum"))
}

#[inline]
fn log_probability(weights: &[f64], total: f64, x: f64) -> f64 {
    let i = x as usize;
    if i as f64 != x {
        return f64::NEG_INFINITY;
    }
    match weights.get(i) {
        Some(w) if *w > 0.0 && total == 1.0 => libm::log(*w),
        Some(w) if *w > 0.0 => libm::log(*w) - libm::log(total),
        _ => f64::NEG_INFINITY,
    }
}

impl Scalar for Categorical {
    fn number_support(&self) -> Support {
        Support::Integers { lo: 0, hi: Some(self.weights.len() as i64 - 1) }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        rng.weighted(&self.weights, self.total) as f64
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        log_probability(&self.weights, self.total, x)
    }

    fn slope(&self, x: f64) -> Slope {
        let mut slope = Slope::discrete([]);
        slope.params.extend(self.weights.iter().map(|_| -1.0 / self.total));
        if let (Some(s), Some(w)) = (slope.params.get_mut(x as usize), self.weights.get(x as usize))
        {
            *s += 1.0 / w;
        }
        slope
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let split = if x < 0.0 {
            0
        } else {
            (libm::floor(x) as usize).saturating_add(1).min(self.weights.len())
        };
        let (below, above) = self.weights.split_at(split);
        let part = |all: &[f64]| libm::log((all.iter().sum::<f64>() / self.total).min(1.0));
        Some(Tails { below: part(below), above: part(above) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let split = (libm::floor(x).max(-1.0) + 1.0) as usize;
        let own = libm::exp(self.log_density_num(x));
        let below = libm::exp(Scalar::tails(self, x)?.below);
        let by = |i: usize| (f64::from(u8::from(i < split)) - below) / self.total / own;
        Some((0..self.weights.len()).map(by).collect())
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.weights.iter().enumerate().map(|(i, w)| i as f64 * (w / self.total)).sum())
    }

    fn number_sd(&self) -> Option<f64> {
        let mean = self.number_mean()?;
        let square = |x: f64| x * x;
        Some(
            self.weights
                .iter()
                .enumerate()
                .map(|(i, w)| square(i as f64 - mean) * (w / self.total))
                .sum::<f64>()
                .sqrt(),
        )
    }
}
