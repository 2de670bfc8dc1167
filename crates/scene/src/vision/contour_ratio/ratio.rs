//! The log ratio of a piece as a function of the distance to the nearest edge,
//! `ln(foreground f(d) / b + 1 - foreground)`, for many distances `d` and densities `b`,
//! several at a time. Invariant: every score equals that of [`Ratio::plain`] to the last
//! bit.
//!
//! Exponentials and logarithms are computed to 13 digits. Where this does not determine
//! the nearest single precision number, about once in many thousand scores, the plain
//! formula decides.

use super::ContourRatioOptions;
use pcadlang_numerics::num::simd::vectorised;
use pcadlang_numerics::num::wide::{exp, ln};
use std::f64::consts::PI;

/// Error bound of the fast path relative to one plus the score's magnitude; many times
/// the actual error.
const DOUBT: f64 = 1e-12;

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
                    let own = self.norm * exp(-0.5 * z * z);
                    let score = ln(self.foreground * own / density + 1.0 - self.foreground);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quick_functions_are_right_to_thirteen_digits() {
        for i in 0..200_000 {
            let x = -f64::from(i) * 3.45e-3;
            assert!((exp(x) / libm::exp(x) - 1.0).abs() < 1e-13, "exp {x}");
            let y = libm::exp(f64::from(i - 100_000) * 6.5e-3);
            let expected = libm::log(y);
            assert!((ln(y) - expected).abs() < 1e-14 * (1.0 + expected.abs()), "ln {y}");
        }
        assert!(exp(-1e300) < 1e-300 && ln(1.0) == 0.0 && exp(-0.0) == 1.0);
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
