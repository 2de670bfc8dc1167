//! The uncertainty of a mean over cases.

use pcadlang_numerics::rng::{Purpose, StreamKey};

/// A mean and its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// The 5 % quantile of the means of resampled cases.
    pub low: f64,
    /// The 95 % quantile.
    pub high: f64,
}

/// The number of bootstrap samples.
const RESAMPLED: u64 = 1000;

/// Returns the mean over cases, where each case is the mean of its runs, and its 90 %
/// interval by the bootstrap over cases (Efron 1979; percentiles). Most of the variance
/// is between cases, so the interval estimates the results for other pictures of the same
/// kind. NaN if there are no cases.
pub fn mean_interval(cases: &[Vec<f64>]) -> Interval {
    let each: Vec<f64> = cases.iter().filter(|c| !c.is_empty()).map(|c| mean(c)).collect();
    if each.is_empty() {
        return Interval { mean: f64::NAN, low: f64::NAN, high: f64::NAN };
    }
    let n = each.len();
    let one = |i: u64| {
        let mut random = StreamKey::new(1, 0, Purpose::REPLICATE).stream(i, 0, 0);
        (0..n).map(|_| each[random.index(n)]).sum::<f64>() / n as f64
    };
    let mut means: Vec<f64> = (0..RESAMPLED).map(one).collect();
    means.sort_by(f64::total_cmp);
    let at = |share: f64| means[((means.len() - 1) as f64 * share).round() as usize];
    Interval { mean: mean(&each), low: at(0.05), high: at(0.95) }
}

fn mean(xs: &[f64]) -> f64 {
    xs.iter().sum::<f64>() / xs.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_normal_approximation() {
        let cases: Vec<Vec<f64>> =
            (0..100).map(|i| vec![f64::from(i), f64::from(i) + 2.0]).collect();
        let i = mean_interval(&cases);
        assert!((i.mean - 50.5).abs() < 1e-12);
        // The standard error of the mean is 28.87 / 10.
        let half = 1.645 * 2.887;
        assert!(
            (i.low - (50.5 - half)).abs() < 0.5 && (i.high - (50.5 + half)).abs() < 0.5,
            "{i:?}"
        );
        assert_eq!(
            mean_interval(&[vec![3.0], vec![]]),
            Interval { mean: 3.0, low: 3.0, high: 3.0 }
        );
        assert!(mean_interval(&[]).mean.is_nan());
    }
}
