//! Exponentials and logarithms for loops over many numbers, and the logarithm of sums of
//! exponentials.
//!
//! Exponential and logarithm are computed by the same operations for every number,
//! without branches, so that loops over them are vectorised; nothing is fused, so results
//! are the same on every platform. Both are accurate to about 1e-15.

use super::exp::normal;
use super::simd::vectorised_if_many;

/// ln 2 in two parts, the first with few enough bits that its multiples are exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// Returns exp(x) for x <= 0; 0 below -700, where it would be at most 1e-304.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let near = x > -700.0;
    let found = normal(if near { x } else { -700.0 });
    if near { found } else { 0.0 }
}

/// Returns ln(x) for a normal x above 0, with an error of at most 1e-15 relative to one
/// plus its magnitude.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    // x = 2^k m with m between sqrt(1/2) and sqrt(2).
    let shifted = x.to_bits() + (0x3ff0_0000_0000_0000 - 0x3fe6_a09e_667f_3bcd);
    let k = f64::from_bits(0x4330_0000_0000_0000 | (shifted >> 52))
        - (4_503_599_627_370_496.0 + 1023.0);
    let m = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff) + 0x3fe6_a09e_667f_3bcd);
    // ln m = 2 atanh(f), a series in f^2 < 0.03.
    let f = (m - 1.0) / (m + 1.0);
    let q = f * f;
    let mut p = 1.0 / 21.0;
    for c in [
        1.0 / 19.0,
        1.0 / 17.0,
        1.0 / 15.0,
        1.0 / 13.0,
        1.0 / 11.0,
        1.0 / 9.0,
        1.0 / 7.0,
        1.0 / 5.0,
        1.0 / 3.0,
    ] {
        p = p * q + c;
    }
    let tail = 2.0 * f * q * p + k * LN_2_LOW;
    2.0 * f + tail + k * LN_2_HIGH
}

/// Takes rows of log weights, each of the length of `out`, and writes the log of the sum
/// of their exponentials by column to `out`, and each one's share of the sum in its
/// place. If all are minus infinity, so is the result, and the shares are 0. Returns
/// false if any of the weights is NaN.
pub fn log_sum_exp_rows(rows: &mut [f64], out: &mut [f64]) -> bool {
    let n = out.len();
    if n == 0 {
        return true;
    }
    if rows.len() == 2 * n {
        return log_sum_exp_of_two(rows, out);
    }
    vectorised_if_many(
        n,
        #[inline(always)]
        || {
            let mut sums = [0.0; STRIP];
            let mut defined = true;
            for from in (0..n).step_by(STRIP) {
                let most = &mut out[from..n.min(from + STRIP)];
                let sums = &mut sums[..most.len()];
                most.fill(f64::NEG_INFINITY);
                sums.fill(0.0);
                for row in rows.chunks_exact(n) {
                    for (m, x) in most.iter_mut().zip(&row[from..]) {
                        *m = if *x > *m { *x } else { *m };
                        defined &= !x.is_nan();
                    }
                }
                for row in rows.chunks_exact_mut(n) {
                    for ((x, m), s) in row[from..].iter_mut().zip(most.iter()).zip(sums.iter_mut())
                    {
                        // The difference of two infinities is not a number; its
                        // exponential is 0 here.
                        *x = exp(*x - *m);
                        *s += *x;
                    }
                }
                for row in rows.chunks_exact_mut(n) {
                    for (x, s) in row[from..].iter_mut().zip(sums.iter()) {
                        *x = if *s > 0.0 { *x / *s } else { 0.0 };
                    }
                }
                for (m, s) in most.iter_mut().zip(sums.iter()) {
                    *m += if *s > 0.0 { ln(*s) } else { 0.0 };
                }
            }
            defined
        },
    )
}

/// [`log_sum_exp_rows`] for two rows, with the same bits: the exponential of the larger
/// weight, less itself, is 1, so one exponential is enough.
fn log_sum_exp_of_two(rows: &mut [f64], out: &mut [f64]) -> bool {
    let n = out.len();
    let (first, second) = rows.split_at_mut(n);
    let second = &mut second[..n];
    vectorised_if_many(
        n,
        #[inline(always)]
        || {
            let mut defined = true;
            for ((a, b), out) in first.iter_mut().zip(second.iter_mut()).zip(out.iter_mut()) {
                defined &= !(a.is_nan() | b.is_nan());
                let (most, least) = if *a > *b { (*a, *b) } else { (*b, *a) };
                let small = exp(least - most);
                let large = if most.abs() < f64::INFINITY { 1.0 } else { 0.0 };
                let sum = large + small;
                let some = sum > 0.0;
                let shares = if some { (large / sum, small / sum) } else { (0.0, 0.0) };
                let a_is_most = *a > *b;
                *out = most + if some { ln(sum) } else { 0.0 };
                *a = if a_is_most { shares.0 } else { shares.1 };
                *b = if a_is_most { shares.1 } else { shares.0 };
            }
            defined
        },
    )
}

/// How many numbers are handled at a time.
const STRIP: usize = 128;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::log_sum_exp;

    #[test]
    fn exponentials_and_logarithms_are_those_of_libm() {
        for i in 0..20_000 {
            let x = -(f64::from(i) * 0.0349);
            let (found, expected) = (exp(x), libm::exp(x));
            assert!((found / expected - 1.0).abs() < 2e-15, "exp {x}: {found} {expected}");
            let x = 1.0 + f64::from(i) * f64::from(i) * 1e-5;
            let (found, expected) = (ln(x), libm::log(x));
            assert!((found - expected).abs() < 1e-15 * expected.max(1.0), "ln {x}: {found}");
        }
        assert_eq!((exp(0.0), exp(f64::NEG_INFINITY), exp(-1e300), ln(1.0)), (1.0, 0.0, 0.0, 0.0));
    }

    #[test]
    fn two_rows_have_the_bits_of_more() {
        let mut rows: Vec<f64> = (0..400).map(|i| 40.0 * libm::sin(f64::from(i) * 1.3)).collect();
        let special = [0.0, -0.0, 1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY, 3.0, -750.0];
        rows.extend(special.iter().flat_map(|_| special));
        rows.extend(special.iter().flat_map(|x| [*x; 8]));
        // Two columns of 264 numbers: the last 64 of each are all pairs of special ones.
        let (tail, n) = (rows.split_off(400), 264);
        let mut two: Vec<f64> = [&rows[..200], &tail[..64], &rows[200..], &tail[64..]].concat();
        // A third row that is impossible changes nothing.
        let mut three = two.clone();
        three.extend(vec![f64::NEG_INFINITY; n]);
        let (mut found, mut expected) = (vec![0.0; n], vec![0.0; n]);
        assert!(log_sum_exp_rows(&mut two, &mut found));
        assert!(log_sum_exp_rows(&mut three, &mut expected));
        let bits = |xs: &[f64]| xs.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&found), bits(&expected));
        assert_eq!(bits(&two), bits(&three[..2 * n]));
    }

    #[test]
    fn sums_by_column_are_those_of_each_column() {
        let n = 333;
        for k in [1, 2, 5] {
            let mut rows: Vec<f64> =
                (0..k * n).map(|i| 50.0 * libm::sin(i as f64 * 1.7) - i as f64 % 600.0).collect();
            rows[3] = f64::NEG_INFINITY;
            let columns: Vec<Vec<f64>> =
                (0..n).map(|i| rows.iter().skip(i).step_by(n).copied().collect()).collect();
            let mut out = vec![0.0; n];
            assert!(log_sum_exp_rows(&mut rows, &mut out));
            for (i, column) in columns.iter().enumerate() {
                let expected = log_sum_exp(column);
                let near = (out[i] - expected).abs() <= 1e-14 * (1.0 + expected.abs());
                assert!(near || out[i] == expected, "{column:?}: {} {expected}", out[i]);
                for (j, x) in column.iter().enumerate() {
                    let share = if expected.is_finite() { libm::exp(x - expected) } else { 0.0 };
                    assert!((rows[j * n + i] - share).abs() < 1e-13, "{column:?}");
                }
            }
        }
        assert!(!log_sum_exp_rows(&mut [0.0, f64::NAN], &mut [0.0]));
    }
}
