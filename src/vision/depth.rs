//! Depth maps, and how probable an observed one is given a rendered one.

use super::mask::resized;
use super::photo::decode;
use super::{Limits, VisionError, npy};
use crate::num::LN_SQRT_2PI;

/// Distances along the viewing axis, in scene units; infinite on the background, NaN where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row.
    pub values: Vec<f32>,
}

impl DepthMap {
    /// Reads a two-dimensional `.npy` array, or a 16-bit grey picture whose values are `scale` times the depth, 0 where
    /// nothing was measured.
    ///
    /// # Errors
    /// If it is neither, or of another shape.
    pub fn decode(bytes: &[u8], scale: f64, limits: &Limits) -> Result<DepthMap, VisionError> {
        if bytes.starts_with(b"\x93NUMPY") {
            let a = npy::read(bytes)?;
            let [height, width] = a.shape[..] else {
                return Err(VisionError::Array(format!("a depth map has two axes, this array has {}", a.shape.len())));
            };
            let side = limits.side as usize;
            if width.max(height) > side {
                return Err(VisionError::Array(format!("a depth map of {width} x {height}; at most {side} a side")));
            }
            let values = a.values.iter().map(|z| *z as f32).collect();
            return Ok(DepthMap { width: width as u32, height: height as u32, values });
        }
        let image = decode(bytes, limits)?.to_luma16();
        let depth = |v: u16| if v == 0 { f32::NAN } else { (f64::from(v) / scale) as f32 };
        Ok(DepthMap {
            width: image.width(),
            height: image.height(),
            values: image.pixels().map(|p| depth(p.0[0])).collect(),
        })
    }
}

/// The density of an observed depth map. A measured depth on the rendered object is normal about the rendered one with
/// probability 1 - outlier, else uniform over `range`; beside the object it is uniform over the range with probability
/// outlier, else background. Background is an event of its own: on the object it has half of outlier's probability.
#[derive(Clone, Debug)]
pub struct DepthLikelihood {
    observed: Vec<f32>,
    sd: f64,
    outlier: f64,
    range: f64,
}

impl DepthLikelihood {
    /// Prepares an observed map for frames of a size. `sd` and `range` in scene units.
    ///
    /// # Errors
    /// Unless `sd` and `range` are positive and `outlier` is above 0 and below 1.
    pub fn prepare(
        observed: &DepthMap,
        width: u32,
        height: u32,
        [sd, outlier, range]: [f64; 3],
    ) -> Result<Self, VisionError> {
        let wrong = |what: &str| Err(VisionError::Array(what.to_owned()));
        if !(sd > 0.0 && sd.is_finite() && range > 0.0 && range.is_finite()) {
            return wrong("`sd` and `range` must be positive and finite");
        }
        if !(outlier > 0.0 && outlier < 1.0) {
            return wrong("`outlier` must be above 0 and below 1");
        }
        let observed = resized(&observed.values, (observed.width, observed.height), (width, height));
        Ok(DepthLikelihood { observed, sd, outlier, range })
    }

    /// The log density of one observed depth given a rendered one (infinite where there is no object).
    pub fn pixel(&self, observed: f32, rendered: f32) -> f64 {
        if observed.is_nan() {
            return 0.0;
        }
        let uniform = libm::log(self.outlier / self.range);
        match (observed.is_finite(), rendered.is_finite()) {
            (true, true) => {
                let z = (f64::from(observed) - f64::from(rendered)) / self.sd;
                let close = libm::log1p(-self.outlier) - 0.5 * z * z - libm::log(self.sd) - LN_SQRT_2PI;
                crate::num::log_sum_exp(&[close, uniform - core::f64::consts::LN_2])
            }
            (true, false) => uniform,
            (false, true) => libm::log(0.5 * self.outlier),
            (false, false) => libm::log1p(-self.outlier),
        }
    }

    /// The log density of the observed map given the rendered one.
    pub fn log_likelihood(&self, rendered: &[f32]) -> f64 {
        let rendered = rendered.iter().copied().chain(std::iter::repeat(f32::INFINITY));
        self.observed.iter().zip(rendered).map(|(o, r)| self.pixel(*o, r)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn like(sd: f64, outlier: f64, range: f64) -> DepthLikelihood {
        let one = DepthMap { width: 1, height: 1, values: vec![f32::NAN] };
        DepthLikelihood::prepare(&one, 1, 1, [sd, outlier, range]).unwrap()
    }

    #[test]
    fn a_proper_density_over_depths_and_background() {
        let l = like(0.05, 0.1, 6.0);
        for rendered in [3.0f32, f32::INFINITY] {
            let h = 1e-3;
            let depths: f64 = (0..6000).map(|i| l.pixel((i as f32 + 0.5) * h, rendered).exp() * f64::from(h)).sum();
            let total = depths + l.pixel(f32::INFINITY, rendered).exp();
            assert!((total - 1.0).abs() < 1e-4, "{total}");
        }
    }

    #[test]
    fn edges_are_defined() {
        let l = like(1e-6, 0.01, 10.0);
        assert_eq!(l.pixel(f32::NAN, 2.0), 0.0);
        assert!(l.pixel(1e30, 2.0).is_finite());
        let d = DepthMap { width: 2, height: 1, values: vec![1.0, f32::INFINITY] };
        let l = DepthLikelihood::prepare(&d, 2, 1, [0.1, 0.1, 5.0]).unwrap();
        assert!(l.log_likelihood(&[1.0, f32::INFINITY]) > l.log_likelihood(&[1.3, f32::INFINITY]));
        assert!(l.log_likelihood(&[1.0, f32::INFINITY]) > l.log_likelihood(&[1.0, 1.0]));
        assert!(l.log_likelihood(&[]).is_finite());
        assert!(DepthLikelihood::prepare(&d, 2, 1, [0.0, 0.1, 5.0]).is_err());
    }
}
