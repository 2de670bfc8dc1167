//! The autocovariance of a chain at every lag, by the fast Fourier transform in O(n log
//! n): chains that mix badly need all lags.

use super::chains::mean;
use std::f64::consts::PI;

/// The biased autocovariances, lags 0 to n - 1: (1/n) Σ (x_t - m)(x_{t+lag} - m) with m
/// the mean.
pub(super) fn autocovariance(x: &[f64]) -> Vec<f64> {
    let (n, m) = (x.len(), mean(x));
    // Padding to twice the length keeps the circular correlation from wrapping round.
    let size = (2 * n).next_power_of_two();
    let mut re: Vec<f64> = x.iter().map(|v| v - m).collect();
    re.resize(size, 0.0);
    let mut im = vec![0.0; size];
    fourier(&mut re, &mut im);
    for (a, b) in re.iter_mut().zip(&mut im) {
        (*a, *b) = (*a * *a + *b * *b, 0.0);
    }
    // The power spectrum is real and even, so that the forward transform inverts it up to
    // the factor `size`.
    fourier(&mut re, &mut im);
    re.truncate(n);
    re.iter_mut().for_each(|v| *v /= size as f64 * n as f64);
    re
}

/// The discrete Fourier transform in place, by decimation in time (Cooley & Tukey 1965);
/// the length is a power of two.
fn fourier(re: &mut [f64], im: &mut [f64]) {
    let n = re.len();
    let mut j = 0;
    for i in 1..n {
        let mut bit = n >> 1;
        while j & bit != 0 {
            j ^= bit;
            bit >>= 1;
        }
        j |= bit;
        if i < j {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    let turns: Vec<(f64, f64)> = (0..n / 2)
        .map(|k| {
            let (sin, cos) = libm::sincos(-2.0 * PI * k as f64 / n as f64);
            (cos, sin)
        })
        .collect();
    let mut half = 1;
    while half < n {
        let stride = n / (2 * half);
        for start in (0..n).step_by(2 * half) {
            for k in 0..half {
                let (c, s) = turns[k * stride];
                let (a, b) = (start + k, start + k + half);
                let (x, y) = (re[b] * c - im[b] * s, re[b] * s + im[b] * c);
                (re[b], im[b]) = (re[a] - x, im[a] - y);
                (re[a], im[a]) = (re[a] + x, im[a] + y);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_sum_of_products() {
        for n in [2, 3, 5, 8, 100, 257] {
            let x: Vec<f64> =
                (0..n).map(|i| ((i * i * 31 + 7 * i) % 101) as f64 / 7.0 + 1000.0).collect();
            let m = mean(&x);
            let fast = autocovariance(&x);
            assert_eq!(fast.len(), n);
            for (lag, f) in fast.iter().enumerate() {
                let slow =
                    (0..n - lag).map(|t| (x[t] - m) * (x[t + lag] - m)).sum::<f64>() / n as f64;
                assert!((f - slow).abs() < 1e-11 * fast[0].max(1.0), "n {n} lag {lag}: {f} {slow}");
            }
        }
    }

    #[test]
    fn the_transform_is_that_of_the_definition() {
        let n = 16;
        let re: Vec<f64> = (0..n).map(|i| f64::from(i * i % 7) - 2.0).collect();
        let im: Vec<f64> = (0..n).map(|i| f64::from(i * 5 % 11) - 4.0).collect();
        let (mut a, mut b) = (re.clone(), im.clone());
        fourier(&mut a, &mut b);
        for k in 0..n {
            let (mut x, mut y) = (0.0, 0.0);
            for t in 0..n {
                let (s, c) = libm::sincos(-2.0 * PI * f64::from(k * t) / f64::from(n));
                x += re[t as usize] * c - im[t as usize] * s;
                y += re[t as usize] * s + im[t as usize] * c;
            }
            assert!((a[k as usize] - x).abs() < 1e-12 && (b[k as usize] - y).abs() < 1e-12, "{k}");
        }
    }
}
