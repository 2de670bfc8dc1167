//! Special functions for truncated normal and circular densities: Mills' ratio and the
//! modified Bessel functions of order 0 and 1, for non-negative arguments, without
//! overflow or cancellation.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, TAU};

/// Mills' ratio of the standard normal, (1 - Phi(x)) / phi(x), for x >= 0; Laplace's
/// continued fraction from 4 on.
pub fn mills_ratio(x: f64) -> f64 {
    if x < 4.0 {
        return FRAC_PI_2.sqrt() * libm::erfc(x * FRAC_1_SQRT_2) * libm::exp(0.5 * x * x);
    }
    1.0 / (1..=40).rev().fold(x, |tail, k| x + f64::from(k) / tail)
}

/// From here on, the Bessel functions are summed as series in 1 / x.
const LARGE: f64 = 30.0;

/// ln(I0(x) e^-x) for x >= 0.
pub fn log_scaled_i0(x: f64) -> f64 {
    if x < LARGE {
        return libm::log(power_series(x).0) - x;
    }
    libm::log(inverse_series(x).0) - 0.5 * (libm::log(TAU) + libm::log(x))
}

/// 1 - I1(x) / I0(x) for x >= 0, which falls from 1 at 0 towards 1 / (2 x).
pub fn one_minus_i1_over_i0(x: f64) -> f64 {
    if x < LARGE {
        let (i0, i1) = power_series(x);
        return 1.0 - i1 / i0;
    }
    let (i0, difference) = inverse_series(x);
    difference / i0
}

/// I0 and I1 by their power series, whose terms are all positive (Abramowitz & Stegun
/// 9.6.10).
fn power_series(x: f64) -> (f64, f64) {
    let q = 0.25 * x * x;
    let (mut term, mut i0, mut i1) = (1.0, 1.0, 1.0);
    for k in 1..200 {
        let k = f64::from(k);
        term *= q / (k * k);
        i0 += term;
        i1 += term / (k + 1.0);
        if term < 1e-18 * i1 {
            break;
        }
    }
    (i0, 0.5 * x * i1)
}

/// sqrt(2 pi x) e^-x times I0, and times I0 - I1, subtracted term by term (Abramowitz &
/// Stegun 9.7.1).
fn inverse_series(x: f64) -> (f64, f64) {
    let (mut zero, mut one) = (1.0, 1.0);
    let (mut i0, mut difference) = (1.0, 0.0);
    for k in 1..40 {
        let k = f64::from(k);
        let odd = (2.0 * k - 1.0) * (2.0 * k - 1.0);
        zero *= odd / (8.0 * k * x);
        one *= (odd - 4.0) / (8.0 * k * x);
        i0 += zero;
        difference += zero - one;
        if zero < 1e-18 * difference {
            break;
        }
    }
    (i0, difference)
}
