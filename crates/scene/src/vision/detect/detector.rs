//! Contour detectors. A gradient detector is built in; others, such as those of
//! `crates/contour_detectors`, can replace it through the trait.

use crate::vision::VisionError;
use crate::vision::detect::gradient::{EdgePoint, colour_gradient, hysteresis, suppress};
use crate::vision::detect::soft_map::SoftMap;
use crate::vision::pictures::color::linear_to_labs;
use crate::vision::pictures::contour_map::ContourMap;
use crate::vision::pictures::photo::{Photo, fitted};
use std::fmt::Debug;

/// The default longer side of the picture that a [`ContourDetector`] works on, pixels.
pub const MAP_SIZE: u32 = 512;
/// The maximum longer side of the picture that a [`ContourDetector`] works on, pixels.
pub const MOST_MAP_SIZE: u32 = 2048;

/// Finds contours in photographs in place of the built-in detector. It computes a map of a
/// photograph, which is slow; [`SoftMap::contours_of`] are then found in the map, which is
/// fast. The map is a deterministic function of the photograph.
pub trait ContourDetector: Debug + Send + Sync {
    /// Computes the map of a photograph at a longer side of at most `size` pixels, or at the
    /// detector's own size.
    ///
    /// # Errors
    /// If the detector fails on the photograph, as a network may while it runs.
    fn map(&self, photo: &Photo, size: u32) -> Result<SoftMap, VisionError>;

    /// The default smoothing of its maps, pixels of the map.
    fn sigma(&self) -> f32;

    /// The default threshold on the strength of contours, in 0..=1.
    fn strength(&self) -> f32;
}

/// Contours as maxima of the colour gradient in L*a*b*. It does not recognise objects:
/// shadows and textures have edges too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientDetector {
    /// Longer side of the working picture, pixels; smaller photographs keep their size.
    pub size: u32,
    /// Standard deviation of the smoothing, pixels of the working picture.
    pub sigma: f32,
    /// Points weaker than this are dropped. Thresholds are multiples of the picture's
    /// reference gradient.
    pub low: f32,
    /// Points stronger than this are kept, and points connected to them.
    pub high: f32,
}

impl Default for GradientDetector {
    fn default() -> Self {
        GradientDetector { size: 256, sigma: 1.6, low: 0.2, high: 0.5 }
    }
}

/// Gradients below this (units of L*a*b* per pixel) are never contours: half a step of
/// 8-bit grey over a pixel.
const FLOOR: f32 = 0.2;
/// The fraction of the contour points that are weaker than the reference gradient.
const REFERENCE_QUANTILE: f64 = 0.9;
/// Reference gradient of a typical photograph, units of L*a*b* per pixel. The reference
/// is the geometric mean of this and the picture's own, so that a picture with only weak
/// edges keeps them, but with lower strength.
const COMMON_REFERENCE: f32 = 4.0;
/// Weight of colour relative to lightness: shading and texture change lightness, other
/// objects change colour.
const COLOUR_WEIGHT: f32 = 2.0;

impl GradientDetector {
    /// Returns the contours of a photograph.
    pub fn contours(&self, photo: &Photo) -> ContourMap {
        let (width, height) = fitted(photo.width(), photo.height(), self.size);
        let mut lab = linear_to_labs(&photo.linear(width, height).rgb);
        lab.iter_mut().for_each(|[_, a, b]| (*a, *b) = (COLOUR_WEIGHT * *a, COLOUR_WEIGHT * *b));
        let gradient = colour_gradient(width, height, &lab, self.sigma);
        let points = suppress(&gradient, FLOOR);
        let reference = (quantile(&points, REFERENCE_QUANTILE) * COMMON_REFERENCE).sqrt();
        let kept = hysteresis(width, height, &points, self.low * reference, self.high * reference);
        ContourMap::from_points(width, height, &kept, |m| m / (m + reference))
    }
}

/// Returns the magnitude below which the given fraction of the points lies; 1 without
/// points.
fn quantile(points: &[EdgePoint], part: f64) -> f32 {
    let mut magnitudes: Vec<f32> = points.iter().map(|p| p.magnitude).collect();
    let at = (part * magnitudes.len().saturating_sub(1) as f64) as usize;
    if magnitudes.is_empty() {
        1.0
    } else {
        *magnitudes.select_nth_unstable_by(at, f32::total_cmp).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};

    fn disc(n: u32, r: f32, inside: [u8; 3], outside: [u8; 3]) -> Photo {
        let rgb = RgbImage::from_fn(n, n, |i, j| {
            let (x, y) = (i as f32 + 0.5 - n as f32 / 2.0, j as f32 + 0.5 - n as f32 / 2.0);
            Rgb(if (x * x + y * y).sqrt() < r { inside } else { outside })
        });
        Photo::from_rgb(rgb).unwrap()
    }

    #[test]
    fn discs_have_their_circle() {
        // The last one differs in colour only.
        for (a, b) in [
            ([255, 255, 255], [0, 0, 0]),
            ([90, 90, 90], [120, 120, 120]),
            ([170, 60, 60], [0, 111, 111]),
        ] {
            let map = GradientDetector::default().contours(&disc(512, 160.0, a, b));
            assert_eq!((map.width, map.height), (256, 256));
            assert!((450..=700).contains(&map.len()), "{}", map.len());
            for k in 0..map.len() {
                let (x, y) = (map.x[k] - 128.0, map.y[k] - 128.0);
                let r = (x * x + y * y).sqrt();
                assert!((r - 80.0).abs() < 0.6, "{r}");
                assert!(((map.tx[k] * x + map.ty[k] * y) / r).abs() < 0.15);
                assert!((0.0..=1.0).contains(&map.strength[k]));
            }
        }
    }

    #[test]
    fn flat_and_tiny_pictures_have_no_contours() {
        let detector = GradientDetector::default();
        assert!(detector.contours(&disc(100, 0.0, [9; 3], [200; 3])).is_empty());
        for (w, h) in [(1, 1), (1, 300), (300, 1)] {
            let photo = Photo::from_rgb(RgbImage::from_pixel(w, h, Rgb([5, 90, 200]))).unwrap();
            assert!(detector.contours(&photo).is_empty());
        }
    }

    #[test]
    fn weak_edges_are_kept_where_they_go_on_from_strong_ones() {
        // The contrast of the disc fades along its rim.
        let n = 256;
        let faint = RgbImage::from_fn(n, n, |i, j| {
            let (x, y) = (i as f32 + 0.5 - 128.0, j as f32 + 0.5 - 128.0);
            let contrast = 90.0 * (0.5 + 0.5 * (y.atan2(x)).cos());
            Rgb([if x.hypot(y) < 80.0 { 90 + contrast as u8 } else { 90 }; 3])
        });
        let d = GradientDetector::default();
        let map = d.contours(&Photo::from_rgb(faint).unwrap());
        let weakest = map.strength.iter().copied().fold(1.0, f32::min);
        // A strength is m / (m + reference).
        assert!(weakest >= d.low / (1.0 + d.low), "{weakest}");
        assert!(weakest < 0.9 * d.high / (1.0 + d.high), "{weakest}");
    }

    #[test]
    fn brightness_does_not_matter() {
        let strong = GradientDetector::default().contours(&disc(200, 60.0, [255; 3], [60; 3]));
        let weak = GradientDetector::default().contours(&disc(200, 60.0, [120; 3], [100; 3]));
        let common = weak
            .to_image()
            .pixels()
            .zip(strong.to_image().pixels())
            .filter(|(a, b)| a.0[0] > 0 && b.0[0] > 0)
            .count();
        assert!(common * 10 > 8 * strong.len(), "{common} {}", strong.len());
    }
}
