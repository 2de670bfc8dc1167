//! The categorical distribution: an index drawn in proportion to weights.

use crate::dist::*;
use crate::num::log_sum_exp;

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
    let mut total = -0.0;
    for w in weights {
        if w.is_nan() || *w < 0.0 {
            return Err(fault(weights));
        }
        total += w;
    }
    // A weight that is not finite makes the sum infinite.
    if total > 0.0 && total < f64::INFINITY { Ok(total) } else { Err(fault(weights)) }
}

#[cold]
fn fault(weights: &[f64]) -> ParamError {
    if let Some(w) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
        return Categorical::bad("weights", w, "must be finite and not negative");
    }
    let total: f64 = weights.iter().sum();
    Categorical::bad("weights", total, "must have a positive, finite sum")
}

#[inline]
fn log_probability(weights: &[f64], total: f64, x: f64) -> f64 {
    let i = x as i64;
    if i as f64 != x {
        return f64::NEG_INFINITY;
    }
    match weights.get(i as usize) {
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

/// `categorical(logits = l)`: 0, 1, … with weights whose logarithms these are; -inf is a
/// weight of 0.
#[derive(Clone, Debug, PartialEq)]
pub struct CategoricalLogits {
    logits: Arc<[f64]>,
    log_total: f64,
}

impl CategoricalLogits {
    /// Creates the distribution; fails unless the logarithms are numbers below inf, not all
    /// of them -inf.
    pub fn new(logits: impl Into<Arc<[f64]>>) -> Result<CategoricalLogits, ParamError> {
        let logits = logits.into();
        let log_total = log_total(&logits)?;
        Ok(CategoricalLogits { logits, log_total })
    }

    /// Returns the log probability of a number under borrowed logarithms.
    pub fn log_probability(logits: &[f64], x: f64) -> Result<f64, ParamError> {
        log_total(logits).map(|total| by_logits(logits, total, x))
    }

    /// Returns the probability of index `i`.
    fn probability(&self, i: usize) -> f64 {
        libm::exp(by_logits(&self.logits, self.log_total, i as f64))
    }
}

fn log_total(logits: &[f64]) -> Result<f64, ParamError> {
    if let Some(l) = logits.iter().find(|l| l.is_nan() || **l == f64::INFINITY) {
        return Err(CategoricalLogits::bad("logits", l, "must be numbers below inf"));
    }
    match log_sum_exp(logits) {
        total if total.is_finite() => Ok(total),
        total => Err(CategoricalLogits::bad("logits", total, "must have a finite log_sum_exp")),
    }
}

#[inline]
fn by_logits(logits: &[f64], total: f64, x: f64) -> f64 {
    let i = x as usize;
    match logits.get(i) {
        Some(l) if i as f64 == x => l - total,
        _ => f64::NEG_INFINITY,
    }
}

impl Scalar for CategoricalLogits {
    fn number_support(&self) -> Support {
        Support::Integers { lo: 0, hi: Some(self.logits.len() as i64 - 1) }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        let weights: Vec<f64> = (0..self.logits.len()).map(|i| self.probability(i)).collect();
        rng.weighted(&weights, weights.iter().sum()) as f64
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        by_logits(&self.logits, self.log_total, x)
    }

    fn slope(&self, x: f64) -> Slope {
        let mut slope = Slope::discrete([]);
        slope.params.extend((0..self.logits.len()).map(|i| -self.probability(i)));
        if let Some(own) = slope.params.get_mut(x as usize) {
            // One minus the probability, from those of the others.
            let but = |l: &[f64]| libm::exp(log_sum_exp(l) - self.log_total);
            let (before, after) = self.logits.split_at(x as usize);
            *own = but(before) + but(&after[1..]);
        }
        slope
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let split = (libm::floor(x).max(-1.0) + 1.0) as usize;
        let (below, above) = self.logits.split_at(split.min(self.logits.len()));
        let part = |all: &[f64]| (log_sum_exp(all) - self.log_total).min(0.0);
        Some(Tails { below: part(below), above: part(above) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let split = (libm::floor(x).max(-1.0) + 1.0) as usize;
        let (own, t) = (self.log_density_num(x), Scalar::tails(self, x)?);
        let by = |(i, l): (usize, &f64)| {
            let share = l - self.log_total - own;
            if i < split { libm::exp(share + t.above) } else { -libm::exp(share + t.below) }
        };
        Some(self.logits.iter().enumerate().map(by).collect())
    }

    fn number_mean(&self) -> Option<f64> {
        Some((0..self.logits.len()).map(|i| i as f64 * self.probability(i)).sum())
    }

    fn number_sd(&self) -> Option<f64> {
        let mean = self.number_mean()?;
        let term = |i: usize| (i as f64 - mean) * (i as f64 - mean) * self.probability(i);
        Some((0..self.logits.len()).map(term).sum::<f64>().sqrt())
    }
}
