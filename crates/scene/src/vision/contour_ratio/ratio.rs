//! The log ratio of a piece as a function of the distance to the nearest edge,
//! `ln(foreground f(d) / b + 1 - foreground)`, for many distances `d` and densities `b`,
//! several at a time. Invariant: every score equals that of [`Ratio::plain`] to the last
//! bit.
//!
//! Exponentials and logarithms are computed to 13 digits. Where this does not determine
//! the nearest single precision number, about once in many thousand scores, the plain
//! formula decides.

use super::options::ContourRatioOptions;
use pcadlang_numerics::num::simd::vectorised;
use std::f64::consts::{LN_2, LOG2_E, PI};

/// Error bound of the fast path relative to one plus the score's magnitude; many times
/// the actual error.
const DOUBT: f64 = 1e-12;

/// Adding and subtracting this number rounds to an integer, which the lowest bits of the
/// sum hold.
const ROUND: f64 = 6755399441055744.0;

/// The parameters of the score other than distance and density.
pub(super) struct Ratio {
    foreground: f64,
    sd: f64,
    /// Density of the half-normal distance at 0.
    norm: f64,
}

impl Ratio {
    pub fn new(options: &ContourRatioOptions) -> Self {
        let norm = 2.0 / (libm::sqrt(2.0 * PI) * options.sd);
        Ratio { foreground: options.foreground, sd: options.sd, norm }
    }

    /// Returns the score at a distance for a given background density.
    fn plain(&self, distance: f64, density: f64) -> f32 {
        let z = distance / self.sd;
        let own = self.norm * libm::exp(-0.5 * z * z);
        libm::log(self.foreground * own / density + 1.0 - self.foreground) as f32
    }

    /// Computes the scores of pairs of distance and density into `out`.
    pub fn scores(&self, distance: &[f64], density: &[f64], out: &mut Vec<f32>) {
        out.clear();
        out.resize(distance.len().min(density.len()), f32::NAN);
        vectorised(
            #[inline(always)]
            || {
                for ((out, &distance), &density) in out.iter_mut().zip(distance).zip(density) {
                    let z = distance / self.sd;
                    let own = self.norm * quick_exp(-0.5 * z * z);
                    let score = quick_ln(self.foreground * own / density + 1.0 - self.foreground);
                    let doubt = DOUBT * (1.0 + score.abs());
                    let (low, high) = ((score - doubt) as f32, (score + doubt) as f32);
                    *out = if low == high { low } else { f32::NAN };
                }
            },
        );
        for (i, out) in out.iter_mut().enumerate().filter(|(_, s)| !s.is_finite()) {
            *out = self.plain(distance[i], density[i]);
        }
    }
}

/// Returns the exponential of a number of at most 0 with a relative error of at most
/// 1e-14. Numbers below -700 are treated as -700.
#[inline(always)]
fn quick_exp(x: f64) -> f64 {
    let x = if x < -700.0 { -700.0 } else { x };
    let shifted = x * LOG2_E + ROUND;
    let r = x - (shifted - ROUND) * LN_2;
    // Taylor series for magnitudes of at most half of ln 2, from the last term.
    let mut sum = 1.0 / 6227020800.0;
    for factorial in [
        479001600.0,
        39916800.0,
        3628800.0,
        362880.0,
        40320.0,
        5040.0,
        720.0,
        120.0,
        24.0,
        6.0,
        2.0,
        1.0,
    ] {
        sum = sum * r + 1.0 / factorial;
    }
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    (sum * r + 1.0) * power
}

/// Returns the natural logarithm of a number above 1e-300, with an error of at most 1e-14
/// relative to one plus its magnitude.
#[inline(always)]
fn quick_ln(x: f64) -> f64 {
    const HALF: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    const MANTISSA: u64 = (1 << 52) - 1;
    // x = m 2^e with m between sqrt(1/2) and sqrt(2).
    let above = x.to_bits().wrapping_sub(HALF).wrapping_add(1023 << 52);
    let m = f64::from_bits((above & MANTISSA).wrapping_add(HALF));
    let e = f64::from_bits((above >> 52) | 0x4330_0000_0000_0000) - (4503599627370496.0 + 1023.0);
    let s = (m - 1.0) / (m + 1.0);
    let squared = s * s;
    let mut sum = 1.0 / 21.0;
    for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        sum = sum * squared + 1.0 / odd;
    }
    e * LN_2 + 2.0 * s * (sum * squared + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quick_functions_are_right_to_thirteen_digits() {
        for i in 0..200_000 {
            let x = -f64::from(i) * 3.45e-3;
            assert!((quick_exp(x) / libm::exp(x) - 1.0).abs() < 1e-13, "exp {x}");
            let y = libm::exp(f64::from(i - 100_000) * 6.5e-3);
            let expected = libm::log(y);
            assert!((quick_ln(y) - expected).abs() < 1e-14 * (1.0 + expected.abs()), "ln {y}");
        }
        assert!(quick_exp(-1e300) < 1e-300 && quick_ln(1.0) == 0.0 && quick_exp(-0.0) == 1.0);
    }

    #[test]
    fn scores_are_those_of_the_plain_way() {
        for (foreground, sd) in [(0.75, 0.4), (1e-6, 1e-3), (1.0 - 1e-9, 50.0)] {
            let ratio = Ratio::new(&ContourRatioOptions {
                foreground,
                sd,
                ..ContourRatioOptions::default()
            });
            let distance: Vec<f64> =
                (0..40_000).map(|i| f64::from(i * 7919 % 40_000) * 1e-4).collect();
            let density: Vec<f64> = (0..40_000).map(|i| 1e-4 + f64::from(i % 997) * 2e-3).collect();
            let mut scores = Vec::new();
            ratio.scores(&distance, &density, &mut scores);
            for (i, s) in scores.iter().enumerate() {
                assert_eq!(
                    s.to_bits(),
                    ratio.plain(distance[i], density[i]).to_bits(),
                    "{} {}",
                    distance[i],
                    density[i]
                );
            }
        }
    }
}
