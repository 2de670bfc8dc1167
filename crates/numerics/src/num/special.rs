//! Special functions that are stable in log space and in the tails.

use super::saddle::{LN_SQRT_2PI, stirling_error};
use super::tails::mills_ratio;
use core::f64::consts::{FRAC_1_SQRT_2, FRAC_2_SQRT_PI};

/// ln |Gamma(x)|.
pub fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

/// ln n!
pub fn ln_factorial(n: f64) -> f64 {
    ln_gamma(n + 1.0)
}

/// ln B(a, b) for a, b > 0.
pub fn ln_beta(a: f64, b: f64) -> f64 {
    let (small, large) = if a < b { (a, b) } else { (b, a) };
    if large < 10.0 {
        return ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b);
    }
    // Stirling's formula for ln Gamma(large) - ln Gamma(large + small), which would
    // otherwise cancel.
    let sum = small + large;
    let errors = stirling_error(large) - stirling_error(sum);
    let ratio = if small < 10.0 {
        ln_gamma(small) - small * libm::log(sum) + small
    } else {
        LN_SQRT_2PI + stirling_error(small)
            - 0.5 * libm::log(small)
            - small * libm::log1p(large / small)
    };
    ratio - (large - 0.5) * libm::log1p(small / large) + errors
}

/// ln of the binomial coefficient n choose k.
pub fn ln_choose(n: f64, k: f64) -> f64 {
    if k == 0.0 || k == n {
        return 0.0;
    }
    -libm::log(n + 1.0) - ln_beta(k + 1.0, n - k + 1.0)
}

/// ln sum exp x; -inf if there are no terms, or if all are -inf.
pub fn log_sum_exp(xs: &[f64]) -> f64 {
    let max = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if max.is_infinite() {
        return max;
    }
    max + libm::log(xs.iter().map(|x| libm::exp(x - max)).sum())
}

/// ln(1 + e^x).
pub fn log1p_exp(x: f64) -> f64 {
    if x > 0.0 { x + libm::log1p(libm::exp(-x)) } else { libm::log1p(libm::exp(x)) }
}

/// ln(e^a - e^b) for a >= b.
pub fn log_diff_exp(a: f64, b: f64) -> f64 {
    if b == f64::NEG_INFINITY {
        return a;
    }
    let d = b - a;
    a + if d > -core::f64::consts::LN_2 {
        libm::log(-libm::expm1(d))
    } else {
        libm::log1p(-libm::exp(d))
    }
}

/// ln(p / (1 - p)).
pub fn logit(p: f64) -> f64 {
    libm::log(p) - libm::log1p(-p)
}

/// 1 / (1 + e^-x).
pub fn expit(x: f64) -> f64 {
    if x >= 0.0 {
        1.0 / (1.0 + libm::exp(-x))
    } else {
        let e = libm::exp(x);
        e / (1.0 + e)
    }
}

/// The standard normal cumulative distribution function.
pub fn normal_cdf(x: f64) -> f64 {
    let t = -x * FRAC_1_SQRT_2;
    let y = libm::erfc(t);
    if x > -2.0 || y == 0.0 {
        return 0.5 * y;
    }
    // The rounding of the argument, which erfc magnifies by 2 t^2 in its tail.
    let missing = libm::fma(-x, FRAC_1_SQRT_2, -t) - x * REST_OF_FRAC_1_SQRT_2;
    0.5 * y * (1.0 - missing * FRAC_2_SQRT_PI * libm::exp(-t * t) / y)
}

/// 1 / sqrt(2) minus the double nearest to it.
const REST_OF_FRAC_1_SQRT_2: f64 = -4.833_646_656_726_457e-17;

/// The derivative of [`log_normal_cdf`]: the inverse of Mills' ratio of -x.
pub fn log_normal_cdf_slope(x: f64) -> f64 {
    if x < 0.0 {
        return 1.0 / mills_ratio(-x);
    }
    normal_density(x) / normal_cdf(x)
}

/// The standard normal density.
pub fn normal_density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x - LN_SQRT_2PI)
}

/// ln(1 - e^x) for x <= 0 (Mächler 2012, "Accurately computing log(1 - exp(-|a|))").
pub fn log1m_exp(x: f64) -> f64 {
    if x > -core::f64::consts::LN_2 {
        libm::log(-libm::expm1(x))
    } else {
        libm::log1p(-libm::exp(x))
    }
}

/// The logarithm of [`normal_cdf`], accurate far in the tails: below -37, where the
/// function itself underflows, by an asymptotic series.
pub fn log_normal_cdf(x: f64) -> f64 {
    if x > 0.0 {
        return libm::log1p(-normal_cdf(-x));
    }
    if x > -37.0 {
        return libm::log(normal_cdf(x));
    }
    let t = 1.0 / (x * x);
    let series = 1.0 - t * (1.0 - 3.0 * t * (1.0 - 5.0 * t * (1.0 - 7.0 * t)));
    -0.5 * x * x - LN_SQRT_2PI - libm::log(-x) + libm::log(series)
}

/// The standard normal quantile: Acklam's rational approximation, refined by one Halley
/// step.
pub fn inv_normal_cdf(p: f64) -> f64 {
    if p.is_nan() || !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if p == 0.0 {
        return f64::NEG_INFINITY;
    }
    if p == 1.0 {
        return f64::INFINITY;
    }
    if p > 0.5 {
        return -inv_normal_cdf(1.0 - p);
    }
    const A: [f64; 6] = [
        -3.969683028665376e1,
        2.209460984245205e2,
        -2.759285104469687e2,
        1.38357751867269e2,
        -3.066479806614716e1,
        2.506628277459239,
    ];
    const B: [f64; 5] = [
        -5.447609879822406e1,
        1.615858368580409e2,
        -1.556989798598866e2,
        6.680131188771972e1,
        -1.328068155288572e1,
    ];
    const C: [f64; 6] = [
        -7.784894002430293e-3,
        -3.223964580411365e-1,
        -2.400758277161838,
        -2.549732539343734,
        4.374664141464968,
        2.938163982698783,
    ];
    const D: [f64; 4] =
        [7.784695709041462e-3, 3.224671290700398e-1, 2.445134137142996, 3.754408661907416];
    let poly = |c: &[f64], x: f64| c.iter().fold(0.0, |s, c| s * x + c);
    let x = if p < 0.02425 {
        let q = (-2.0 * libm::log(p)).sqrt();
        poly(&C, q) / (poly(&D, q) * q + 1.0)
    } else {
        let q = p - 0.5;
        let r = q * q;
        poly(&A, r) * q / (poly(&B, r) * r + 1.0)
    };
    let e = normal_cdf(x) - p;
    let u = e * libm::exp(0.5 * x * x + LN_SQRT_2PI);
    x - u / (1.0 + 0.5 * x * u)
}

/// The derivative of ln Gamma: recurrence up to 10, then the asymptotic series.
pub fn digamma(x: f64) -> f64 {
    if x <= 0.0 {
        if x == libm::trunc(x) {
            return f64::NAN;
        }
        return digamma(1.0 - x) - core::f64::consts::PI / libm::tan(core::f64::consts::PI * x);
    }
    let mut x = x;
    let mut shift = 0.0;
    while x < 10.0 {
        shift -= 1.0 / x;
        x += 1.0;
    }
    let t = 1.0 / (x * x);
    // The coefficients are B_2k / (2 k).
    const C: [f64; 7] = [
        1.0 / 12.0,
        -1.0 / 120.0,
        1.0 / 252.0,
        -1.0 / 240.0,
        1.0 / 132.0,
        -691.0 / 32_760.0,
        1.0 / 12.0,
    ];
    let series = C.iter().rev().fold(0.0, |s, c| t * (c + s));
    shift + libm::log(x) - 0.5 / x - series
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, rel: f64) {
        assert!((a - b).abs() <= rel * b.abs().max(1e-300), "{a} against {b}");
    }

    #[test]
    fn quantiles_invert_the_distribution_function() {
        // mpmath, 40 digits; the other functions are compared in
        // tests/numbers/dist_reference.rs.
        close(inv_normal_cdf(1e-10), -6.361340902404056, 1e-14);
        close(inv_normal_cdf(0.3), -0.524400512708041, 1e-14);
        close(inv_normal_cdf(0.975), 1.959963984540054, 1e-14);
        for p in [1e-300, 1e-20, 0.02, 0.03, 0.499] {
            close(normal_cdf(inv_normal_cdf(p)), p, 1e-12);
        }
        assert_eq!((inv_normal_cdf(0.0), inv_normal_cdf(1.0)), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(inv_normal_cdf(-0.1).is_nan());
    }

    const TAILS: &[(f64, f64, f64)] = &[
        (-0.3, 0.3820885778110474, -0.9621028181688507),
        (-1.7, 0.04456546275854304, -3.1107960975524813),
        (-2.1, 0.017864420562816553, -4.024944222243985),
        (-5.3, 5.790134039964594e-08, -16.664525302382472),
        (-12.7, 2.95648536485205e-37, -84.11164725467316),
        (-20.3, 6.429244467698346e-92, -209.97697152524202),
        (-31.9, 1.3350261805130758e-223, -513.1875248351411),
        (-36.9, 2.3105244811406173e-298, -685.3328831653506),
        (0.7, 0.758036347776927, -0.2770239422771313),
        (3.1, 0.9990323967867817, -0.0009680716434015497),
    ];

    #[test]
    fn tails_keep_their_digits() {
        // mpmath, 40 digits.
        for (x, cdf, log) in TAILS {
            close(normal_cdf(*x), *cdf, 1e-15);
            close(log_normal_cdf(*x), *log, 4e-16);
            let h = 1e-4 * x.abs();
            let slope = (log_normal_cdf(x + h) - log_normal_cdf(x - h)) / (2.0 * h);
            close(log_normal_cdf_slope(*x), slope, 1e-6);
        }
        close(log_normal_cdf_slope(-1e8), 1e8, 1e-15);
        close(log1m_exp(-1e-20), libm::log(1e-20), 1e-15);
        close(log1m_exp(-50.0), -libm::exp(-50.0), 1e-15);
        assert_eq!((log1m_exp(0.0), log1m_exp(1.0).is_nan()), (f64::NEG_INFINITY, true));
    }

    #[test]
    fn edges_are_defined() {
        assert_eq!(log_sum_exp(&[]), f64::NEG_INFINITY);
        assert_eq!(log_sum_exp(&[f64::NEG_INFINITY; 3]), f64::NEG_INFINITY);
        close(log_sum_exp(&[-1000.0, -1000.0]), -1000.0 + core::f64::consts::LN_2, 1e-15);
        assert_eq!(log1p_exp(800.0), 800.0);
        close(log1p_exp(-40.0), libm::exp(-40.0), 1e-15);
        close(log_diff_exp(0.0, -1e-12), libm::log(1e-12), 1e-3);
        assert_eq!(expit(-1000.0), 0.0);
        assert_eq!(expit(1000.0), 1.0);
        assert_eq!(ln_choose(5.0, 0.0), 0.0);
        close(ln_choose(20.0, 14.0), libm::log(38760.0), 1e-13);
    }
}
