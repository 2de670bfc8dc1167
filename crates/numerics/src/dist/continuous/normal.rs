//! The normal distribution.

use crate::dist::draw::standard;
use crate::dist::*;
use crate::num::simd::vectorised;
use crate::num::{Column, LN_SQRT_2PI, log_normal_cdf};

/// `normal(mean, sd)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    mean: f64,
    sd: f64,
    log_norm: f64,
}

impl Normal {
    pub(in crate::dist) fn of(mean: f64, sd: f64) -> Result<Normal, ParamError> {
        Ok(Normal { mean, sd, log_norm: log_norm(sd) })
    }

    pub(in crate::dist) fn location(&self) -> f64 {
        self.mean
    }

    pub(in crate::dist) fn scale(&self) -> f64 {
        self.sd
    }

    pub(in crate::dist) fn log_norm(&self) -> f64 {
        self.log_norm
    }

    /// Like [`Normal::new`], but reuses the normalising constant of `self` if the
    /// standard deviation is the same.
    #[inline]
    pub fn near(&self, mean: f64, sd: f64) -> Result<Normal, ParamError> {
        self.reused(&[mean, sd]).map_or_else(|| Normal::new(mean, sd), Ok)
    }
}

/// Returns the log density at the mean.
pub(in crate::dist) fn log_norm(sd: f64) -> f64 {
    -libm::log(sd) - LN_SQRT_2PI
}

impl Scalar for Normal {
    fn draw(&self, rng: &mut Stream) -> f64 {
        (self.mean + self.sd * rng.standard_normal()).clamp(f64::MIN, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        let z = standard(x, self.mean, self.sd);
        if z.is_nan() { f64::NEG_INFINITY } else { self.log_norm - 0.5 * z * z }
    }

    fn slope(&self, x: f64) -> Slope {
        let z = standard(x, self.mean, self.sd);
        Slope::new(-z / self.sd, [z / self.sd, (z * z - 1.0) / self.sd])
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let z = standard(x, self.mean, self.sd);
        Some(Tails { below: log_normal_cdf(z), above: log_normal_cdf(-z) })
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        Some(smallvec![-1.0, -standard(x, self.mean, self.sd)])
    }

    fn number_mean(&self) -> Option<f64> {
        Some(self.mean)
    }

    fn number_sd(&self) -> Option<f64> {
        Some(self.sd)
    }

    #[inline]
    fn reused(&self, params: &[f64]) -> Option<Normal> {
        match params {
            [mean, sd] if sd.to_bits() == self.sd.to_bits() && mean.is_finite() => {
                Some(Normal { mean: *mean, ..*self })
            }
            _ => None,
        }
    }

    fn score_columns(
        buffer: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> Option<bool> {
        let [mean, sd @ Column { step: 0, .. }] = *params else { return None };
        let (before, out) = buffer.split_at_mut(out);
        let out = &mut out[..n];
        let Ok(one) = Normal::new(0.0, before[sd.at]) else { return Some(false) };
        let (sd, log_norm) = (one.sd, one.log_norm);
        Some(vectorised(
            #[inline(always)]
            || {
                let mut there = true;
                each_pair(before, x, mean, out, |x, mean, out| {
                    there &= !x.is_nan() && mean.is_finite();
                    let z = (x - mean) / sd;
                    *out = log_norm - 0.5 * z * z;
                });
                there
            },
        ))
    }

    fn vjp_columns(
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> bool {
        let [mean, sd @ Column { step: 0, .. }] = *params else { return false };
        let scale = buffer[sd.at];
        let (by, weights) = by.split_at_mut(out);
        let weights = &mut weights[..n];
        // The weights become the derivatives with respect to the means.
        let mut of_sd = [0.0; 4];
        vectorised(
            #[inline(always)]
            || {
                let mut sums = [0.0; 4];
                let mut i = 0;
                each_pair(buffer, x, mean, weights, |x, mean, weight| {
                    let z = (x - mean) / scale;
                    let used = *weight != 0.0;
                    sums[i % 4] += if used { (z * z - 1.0) * *weight } else { 0.0 };
                    *weight = if used { z * *weight / scale } else { 0.0 };
                    i += 1;
                });
                of_sd = sums;
            },
        );
        let mut give = |c: Column, sign: f64| match c {
            Column { live: false, .. } => {}
            Column { step: 0, at, .. } => by[at] += sign * weights.iter().sum::<f64>(),
            Column { at, .. } => {
                by[at..at + n].iter_mut().zip(weights.iter()).for_each(|(b, w)| *b += sign * w);
            }
        };
        give(mean, 1.0);
        give(x, -1.0);
        if sd.live {
            by[sd.at] += of_sd.iter().sum::<f64>() / scale;
        }
        true
    }

    fn standardised(&self, x: f64) -> Option<f64> {
        Some(standard(x, self.mean, self.sd))
    }

    fn unstandardised(&self, z: f64) -> Option<f64> {
        Some(self.mean + self.sd * z)
    }
}

/// Calls `f` with the elements of two columns of a buffer and of `out`.
#[inline(always)]
fn each_pair(
    buffer: &[f64],
    x: Column,
    y: Column,
    out: &mut [f64],
    mut f: impl FnMut(f64, f64, &mut f64),
) {
    let n = out.len();
    match (x.step, y.step) {
        (0, 0) => out.iter_mut().for_each(|o| f(buffer[x.at], buffer[y.at], o)),
        (0, _) => {
            let x = buffer[x.at];
            out.iter_mut().zip(&buffer[y.at..y.at + n]).for_each(|(o, y)| f(x, *y, o));
        }
        (_, 0) => {
            let y = buffer[y.at];
            out.iter_mut().zip(&buffer[x.at..x.at + n]).for_each(|(o, x)| f(*x, y, o));
        }
        _ => {
            let pairs = buffer[x.at..x.at + n].iter().zip(&buffer[y.at..y.at + n]);
            out.iter_mut().zip(pairs).for_each(|(o, (x, y))| f(*x, *y, o));
        }
    }
}
