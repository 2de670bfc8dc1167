//! The terms of Loader's saddle-point form of densities (2000, "Fast and accurate
//! computation of binomial probabilities"), in which large terms do not cancel.

/// ln sqrt(2 pi).
pub const LN_SQRT_2PI: f64 = 0.918_938_533_204_672_8;

/// The error of Stirling's formula for ln Gamma(x), x > 0:
/// ln Gamma(x) - ((x - 1/2) ln x - x + ln sqrt(2 pi)). For x = n it is also the error for
/// ln n!.
pub fn stirling_error(x: f64) -> f64 {
    if x < 10.0 {
        return libm::lgamma(x) - ((x - 0.5) * libm::log(x) - x + LN_SQRT_2PI);
    }
    let t = 1.0 / (x * x);
    let series = 1.0 / 1260.0
        - t * (1.0 / 1680.0 - t * (1.0 / 1188.0 - t * (691.0 / 360_360.0 - t / 156.0)));
    (1.0 / 12.0 - t * (1.0 / 360.0 - t * series)) / x
}

/// The deviance x ln(x / m) + m - x for x >= 0, m > 0, without cancellation near x = m.
pub fn deviance(x: f64, m: f64) -> f64 {
    if x == 0.0 {
        return m;
    }
    let difference = x - m;
    if difference.abs() < 0.1 * (x + m) {
        let v = difference / (x + m);
        let mut sum = difference * v;
        let mut term = 2.0 * x * v;
        for j in 1..1000 {
            term *= v * v;
            let next = sum + term / f64::from(2 * j + 1);
            if next == sum {
                return sum;
            }
            sum = next;
        }
        return sum;
    }
    let ratio = x / m;
    let log = if ratio.is_finite() && ratio > 0.0 {
        libm::log(ratio)
    } else {
        libm::log(x) - libm::log(m)
    };
    x * log + m - x
}
