//! Maps that detectors compute from a picture, one number per pixel, and the contours in
//! them: along the ridges of a map of contours, or around the regions in a map of
//! objects.

use crate::vision::detect::gradient::{EdgePoint, Gradient, colour_gradient, smoothed, suppress};
use crate::vision::pictures::contour_map::ContourMap;
use crate::vision::pictures::photo::{Photo, fitted};

/// The content of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shows {
    /// The probability that a pixel is on a contour.
    #[default]
    Contours,
    /// The probability that a pixel belongs to an object.
    Objects,
}

/// A number for each pixel, in row-major order: about 0 to 1, finite.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftMap {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// The numbers.
    pub values: Vec<f32>,
    /// Their meaning.
    pub shows: Shows,
}

/// Values below this are not contours; the scale is 1.
const FLOOR: f32 = 0.01;

impl SoftMap {
    /// Returns the contours of the map after smoothing by a Gaussian of `sigma` pixels.
    /// The strength of a point is the map's value there or, for the contour of an object,
    /// the height of the step, if it is sharp.
    pub fn contours(&self, sigma: f32) -> ContourMap {
        let (width, height) = (self.width, self.height);
        match self.shows {
            Shows::Contours => {
                let ridges = ridges(width, height, &self.values, sigma);
                // Beside a ridge the map has stronger, positive curvature, and a maximum
                // along the ridge is not one across it.
                let bends =
                    |p: &EdgePoint| ridges.tensor[p.pixel][0] + ridges.tensor[p.pixel][2] > 0.0;
                let points = suppress(&ridges, FLOOR).into_iter().filter(bends);
                let points: Vec<EdgePoint> =
                    points.map(|p| EdgePoint { magnitude: self.around(p.pixel), ..p }).collect();
                ContourMap::from_points(width, height, &points, |m| m)
            }
            Shows::Objects => {
                let pixels: Vec<[f32; 1]> =
                    self.values.iter().map(|v| [v.clamp(0.0, 1.0)]).collect();
                // The steepest slope of a smoothed step of height 1.
                let step = 1.0 / (f64::from(sigma) * (2.0 * std::f64::consts::PI).sqrt()) as f32;
                let points =
                    suppress(&colour_gradient(width, height, &pixels, sigma), FLOOR * step);
                ContourMap::from_points(width, height, &points, |m| m / step)
            }
        }
    }

    /// Returns the [`contours`](SoftMap::contours) of the map of a photograph, scaled to the
    /// photograph's aspect ratio.
    pub fn contours_of(&self, photo: &Photo, sigma: f32) -> ContourMap {
        let found = self.contours(sigma);
        let shape = fitted(photo.width(), photo.height(), self.width.max(self.height));
        if shape == (self.width, self.height) { found } else { found.scaled_to(shape.0, shape.1) }
    }

    /// Returns the largest value within a pixel's distance: smoothing moves ridges a
    /// little and flattens them.
    fn around(&self, pixel: usize) -> f32 {
        let (w, h) = (self.width as usize, self.height as usize);
        let (x, y) = (pixel % w, pixel / w);
        let rows = y.saturating_sub(1)..(y + 2).min(h);
        let row = |j: usize| &self.values[j * w + x.saturating_sub(1)..j * w + (x + 2).min(w)];
        rows.flat_map(row).copied().fold(0.0, f32::max)
    }
}

/// Presents the smoothed map as a gradient: its values are the magnitudes, and the
/// negative second derivatives are the tensor, so that the direction of strongest change
/// is the one across a ridge.
fn ridges(width: u32, height: u32, values: &[f32], sigma: f32) -> Gradient {
    let (w, h) = (width as usize, height as usize);
    let magnitude = smoothed(width, height, values, sigma);
    // Directions come from a larger neighbourhood: they vary slowly, unlike noise.
    let soft = smoothed(width, height, &magnitude, sigma);
    let mut tensor = Vec::with_capacity(w * h);
    for j in 0..h {
        let (up, down) = (j.saturating_sub(1) * w, (j + 1).min(h - 1) * w);
        for i in 0..w {
            let (left, right) = (i.saturating_sub(1), (i + 1).min(w - 1));
            let middle = 2.0 * soft[j * w + i];
            let xx = soft[j * w + left] + soft[j * w + right] - middle;
            let yy = soft[up + i] + soft[down + i] - middle;
            let xy = 0.25
                * (soft[down + right] + soft[up + left] - soft[down + left] - soft[up + right]);
            tensor.push([-xx, -xy, -yy]);
        }
    }
    Gradient { width, height, magnitude, tensor }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(n: u32, shows: Shows, value: impl Fn(f32, f32) -> f32) -> SoftMap {
        let middle = n as f32 / 2.0;
        let at = |k: u32| value((k % n) as f32 + 0.5 - middle, (k / n) as f32 + 0.5 - middle);
        SoftMap { width: n, height: n, values: (0..n * n).map(at).collect(), shows }
    }

    fn ring(map: &ContourMap, middle: f32, radius: f32, off: f32) {
        assert!(
            (map.len() as f32 - 2.0 * std::f32::consts::PI * radius).abs() < 0.35 * 6.3 * radius,
            "{}",
            map.len()
        );
        for k in 0..map.len() {
            let (x, y) = (map.x[k] - middle, map.y[k] - middle);
            let r = x.hypot(y);
            assert!((r - radius).abs() < off, "{r}");
            assert!(
                ((map.tx[k] * x + map.ty[k] * y) / r).abs() < 0.1,
                "a tangent crosses the contour"
            );
        }
    }

    #[test]
    fn ridges_are_contours() {
        // A ring that is brighter on the right.
        let soft = map(96, Shows::Contours, |x, y| {
            let d = (x.hypot(y) - 30.0) / 1.5;
            (0.5 + 0.3 * x / x.hypot(y)) * libm::expf(-0.5 * d * d)
        });
        let found = soft.contours(1.0);
        ring(&found, 48.0, 30.0, 0.15);
        for k in 0..found.len() {
            let expected = 0.5 + 0.3 * (found.x[k] - 48.0) / 30.0;
            assert!(
                (found.strength[k] - expected).abs() < 0.05,
                "{} {expected}",
                found.strength[k]
            );
        }
    }

    #[test]
    fn objects_have_contours_around_them() {
        let soft = map(96, Shows::Objects, |x, y| (30.5 - x.hypot(y)).clamp(0.0, 1.0));
        let found = soft.contours(1.5);
        ring(&found, 48.0, 30.0, 0.25);
        assert!(found.strength.iter().all(|s| (0.85..=1.0).contains(s)), "{:?}", found.strength);
    }

    #[test]
    fn flat_and_tiny_maps_have_none() {
        for shows in [Shows::Contours, Shows::Objects] {
            assert!(map(20, shows, |_, _| 0.7).contours(1.0).is_empty());
            assert!(map(1, shows, |_, _| 1.0).contours(1.0).is_empty());
            let line = SoftMap { width: 30, height: 1, values: vec![0.2; 30], shows };
            assert!(line.contours(2.0).is_empty());
        }
    }
}
