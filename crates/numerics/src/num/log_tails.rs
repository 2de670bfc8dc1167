//! Both tails of the incomplete gamma and beta functions, as logarithms so that neither
//! underflows.

use super::incomplete::{not_zero, upper_fraction};
use super::saddle::{LN_SQRT_2PI, deviance, stirling_error};
use super::special::{ln_beta, ln_gamma, log_diff_exp};

/// The maximum parameter: the number of terms grows as its square root.
const LARGEST: f64 = 1e8;

/// The maximum number of terms.
fn terms(a: f64) -> u32 {
    500 + (40.0 * a.sqrt()) as u32
}

/// The logarithms of the regularised incomplete gamma functions P(a, x) and Q(a, x) for
/// a > 0: the power series for x below a + 1 (DLMF 8.7.1), and Legendre's continued
/// fraction above (DLMF 8.9.2). `None` for a above 1e8, which would take too long.
pub fn gamma_tails(a: f64, x: f64) -> Option<(f64, f64)> {
    if a.is_nan() || x.is_nan() || a <= 0.0 || a > LARGEST {
        return None;
    }
    if x <= 0.0 {
        return Some((f64::NEG_INFINITY, 0.0));
    }
    if x.is_infinite() {
        return Some((0.0, f64::NEG_INFINITY));
    }
    // ln(x^a e^-x / Gamma(a + 1)).
    let scale = match a < 10.0 {
        true => a * libm::log(x) - x - ln_gamma(a + 1.0),
        false => -LN_SQRT_2PI - 0.5 * libm::log(a) - stirling_error(a) - deviance(a, x),
    };
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0, 1.0);
        for n in 1..terms(a) {
            term *= x / (a + f64::from(n));
            sum += term;
            if term < sum * 0.1 * f64::EPSILON {
                break;
            }
        }
        let below = (scale + libm::log(sum)).min(0.0);
        return Some((below, log_diff_exp(0.0, below)));
    }
    let above = (scale + libm::log(a) + libm::log(upper_fraction(a, x, terms(a)))).min(0.0);
    Some((log_diff_exp(0.0, above), above))
}

/// The logarithms of the regularised incomplete beta function I_x(a, b) and of 1 - I_x(a,
/// b) for a, b > 0, given x and y = 1 - x: by the continued fraction DLMF 8.17.22 and
/// Lentz's method. `None` for a or b above 1e8.
pub fn beta_tails(a: f64, b: f64, x: f64, y: f64) -> Option<(f64, f64)> {
    if !(a > 0.0 && b > 0.0 && a <= LARGEST && b <= LARGEST) || x.is_nan() || y.is_nan() {
        return None;
    }
    if x <= 0.0 {
        return Some((f64::NEG_INFINITY, 0.0));
    }
    if y <= 0.0 {
        return Some((0.0, f64::NEG_INFINITY));
    }
    let n = a + b;
    // ln(x^a y^b / B(a, b)).
    let scale = match a.min(b) < 10.0 {
        true => a * libm::log(x) + b * libm::log(y) - ln_beta(a, b),
        false => {
            0.5 * (libm::log(a) + libm::log(b) - libm::log(n)) - LN_SQRT_2PI + stirling_error(n)
                - stirling_error(a)
                - stirling_error(b)
                - deviance(a, n * x)
                - deviance(b, n * y)
        }
    };
    let one = |scale: f64, a: f64, b: f64, x: f64| {
        (scale + libm::log(fraction(a, b, x)) - libm::log(a)).min(0.0)
    };
    if x < (a + 1.0) / (n + 2.0) {
        let below = one(scale, a, b, x);
        Some((below, log_diff_exp(0.0, below)))
    } else {
        let above = one(scale, b, a, y);
        Some((log_diff_exp(0.0, above), above))
    }
}

fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let (mut c, mut d) = (1.0, 1.0 / not_zero(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    for m in 1..terms(a.max(b)) {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / not_zero(1.0 + even * d);
        c = not_zero(1.0 + even / c);
        h *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / not_zero(1.0 + odd * d);
        c = not_zero(1.0 + odd / c);
        let step = d * c;
        h *= step;
        if (step - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::function::{beta::beta_reg, gamma::gamma_lr, gamma::gamma_ur};

    #[test]
    fn both_sides_agree_with_another_implementation() {
        for a in [0.1, 0.7, 1.0, 3.5, 20.0, 400.0] {
            for share in [0.01, 0.3, 0.9, 1.0, 1.2, 3.0] {
                let x = a * share;
                let (p, q) = gamma_tails(a, x).unwrap();
                assert!((p.exp() - gamma_lr(a, x)).abs() < 1e-11, "{a} {x}");
                assert!((q.exp() - gamma_ur(a, x)).abs() < 1e-11, "{a} {x}");
            }
            for b in [0.3, 1.0, 8.0, 90.0] {
                for x in [0.01, 0.2, 0.5, 0.83, 0.99] {
                    let (p, q) = beta_tails(a, b, x, 1.0 - x).unwrap();
                    let other = beta_reg(a, b, x);
                    assert!(
                        (p.exp() - other).abs() < 1e-11 && (q.exp() - 1.0 + other).abs() < 1e-11,
                        "{a} {b} {x}"
                    );
                }
            }
        }
    }

    #[test]
    fn far_tails_keep_their_digits() {
        let close = |found: f64, wanted: f64| {
            assert!((found - wanted).abs() < 1e-13 * wanted.abs(), "{found} {wanted}")
        };
        // Q(1, x) = e^-x; Q(2, x) = (1 + x) e^-x; P(1, x) = 1 - e^-x.
        close(gamma_tails(1.0, 5000.0).unwrap().1, -5000.0);
        close(gamma_tails(2.0, 3000.0).unwrap().1, -3000.0 + libm::log(3001.0));
        close(gamma_tails(1.0, 1e-200).unwrap().0, libm::log(1e-200));
        // I_x(a, 1) = x^a; I_x(1, b) = 1 - (1 - x)^b.
        close(beta_tails(300.0, 1.0, 1e-3, 0.999).unwrap().0, 300.0 * libm::log(1e-3));
        close(beta_tails(1.0, 700.0, 0.9, 0.1).unwrap().1, 700.0 * libm::log(0.1));
        assert_eq!(gamma_tails(3.0, 0.0), Some((f64::NEG_INFINITY, 0.0)));
        assert!(gamma_tails(1e9, 1.0).is_none() && beta_tails(1.0, f64::NAN, 0.5, 0.5).is_none());
        // The median of a large gamma is about a - 1/3, that of a symmetric beta 1/2.
        assert!((gamma_tails(1e7, 1e7 - 1.0 / 3.0).unwrap().0.exp() - 0.5).abs() < 1e-10);
        assert!((beta_tails(1e6, 1e6, 0.5, 0.5).unwrap().0.exp() - 0.5).abs() < 1e-10);
    }
}
