//! Sample quantiles.

/// The quantile at `p` in [0, 1] by linear interpolation between order statistics (R's
/// type 7, numpy's default); NaN for an empty slice, or if a draw is NaN.
pub fn quantile(x: &[f64], p: f64) -> f64 {
    in_order(x).map_or(f64::NAN, |sorted| quantile_sorted(&sorted, p))
}

/// Returns draws in ascending order; `None` if one is NaN.
fn in_order(x: &[f64]) -> Option<Vec<f64>> {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    (!x.iter().any(|v| v.is_nan())).then_some(sorted)
}

/// As [`quantile`], for draws already in ascending order.
pub fn quantile_sorted(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = last as f64 * p.clamp(0.0, 1.0);
    let below = (at as usize).min(last);
    let (lo, hi) = (sorted[below], sorted[(below + 1).min(last)]);
    let share = at - below as f64;
    // Between equal values there is nothing to interpolate, and rounding must not lead
    // outside of them.
    if lo == hi || share == 0.0 {
        lo
    } else if (hi - lo).is_finite() {
        lo + share * (hi - lo)
    } else {
        // The difference overflows, or is infinite.
        (1.0 - share) * lo + share * hi
    }
}

/// The median, for an even number of draws half the sum of the two in the middle, rounded
/// as numpy does. NaN as for [`quantile`].
pub fn median(x: &[f64]) -> f64 {
    let Some(sorted) = in_order(x).filter(|s| !s.is_empty()) else { return f64::NAN };
    let half = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2]);
    if half.is_finite() { half } else { quantile_sorted(&sorted, 0.5) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolates_between_order_statistics() {
        let x = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(quantile(&x, 0.0), 1.0);
        assert_eq!(quantile(&x, 1.0), 4.0);
        assert_eq!(quantile(&x, 0.5), 2.5);
        assert_eq!(quantile(&x, 0.25), 1.75);
        assert_eq!(quantile(&[7.0], 0.3), 7.0);
    }

    #[test]
    fn medians_are_rounded_as_half_a_sum() {
        assert_eq!([median(&[3.0, 1.0, 2.0]), median(&[4.0, 1.0, 2.0, 3.0])], [2.0, 2.5]);
        // Where lo + (hi - lo) / 2 rounds otherwise.
        let mut differ = 0;
        for i in 1..200 {
            let (lo, hi) = (-0.1 / f64::from(i), 0.37 / f64::from(i * i));
            assert_eq!(median(&[hi, lo]), 0.5 * (lo + hi));
            differ += u32::from(median(&[hi, lo]) != quantile(&[hi, lo], 0.5));
        }
        assert!(differ > 0);
        assert_eq!(median(&[f64::MAX, f64::MAX]), f64::MAX);
        assert!(median(&[]).is_nan() && median(&[1.0, f64::NAN]).is_nan());
    }

    #[test]
    fn what_cannot_be_said_is_nan() {
        assert!(quantile(&[], 0.5).is_nan());
        assert!(quantile(&[1.0, f64::NAN], 0.5).is_nan());
        assert!(quantile(&[1.0, 2.0], f64::NAN).is_nan());
    }

    #[test]
    fn infinite_draws_have_quantiles() {
        assert_eq!(quantile(&[f64::INFINITY, f64::INFINITY, 0.0], 0.9), f64::INFINITY);
        assert_eq!(quantile(&[f64::NEG_INFINITY, 0.0, 1.0], 0.75), 0.5);
    }
}
