//! Contours of a picture as points with tangents and strengths: the output of detectors
//! and the input of comparators.

use crate::contours::ContourSlice;
use crate::vision::detect::gradient::{EdgePoint, principal, ridge_offset, smoothed};
use crate::vision::detect::thin::thinned;
use crate::vision::pictures::photo::Photo;
use image::{DynamicImage, GrayImage, Luma};

/// Contour points of a picture. The five lists have the same length; all numbers are
/// finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContourMap {
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
    /// Columns, pixels (pixel centres at +0.5), within `0..=width`.
    pub x: Vec<f32>,
    /// Rows from the top, pixels (pixel centres at +0.5), within `0..=height`.
    pub y: Vec<f32>,
    /// Unit tangents along the contour, x component; the sign of a tangent is arbitrary.
    pub tx: Vec<f32>,
    /// Unit tangents along the contour, y component.
    pub ty: Vec<f32>,
    /// Confidence of the detector, in `0..=1`; the scale depends on the detector.
    pub strength: Vec<f32>,
}

impl ContourMap {
    /// A map without points.
    pub fn new(width: u32, height: u32) -> Self {
        ContourMap { width, height, ..ContourMap::default() }
    }

    /// Drawn contours as if they were seen in a picture of their size, all equally strong.
    pub fn of(drawn: &ContourSlice<'_>) -> Self {
        ContourMap {
            width: drawn.width,
            height: drawn.height,
            x: drawn.x.to_vec(),
            y: drawn.y.to_vec(),
            tx: drawn.tx.to_vec(),
            ty: drawn.ty.to_vec(),
            strength: vec![1.0; drawn.len()],
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True if there are no points.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Adds a point with a unit normal.
    fn push(&mut self, x: f32, y: f32, normal: [f32; 2], strength: f32) {
        self.x.push(x);
        self.y.push(y);
        self.tx.push(-normal[1]);
        self.ty.push(normal[0]);
        self.strength.push(strength.clamp(0.0, 1.0));
    }

    /// Builds the map of edge points, with strengths computed from their magnitudes.
    pub(in crate::vision) fn from_points(
        width: u32,
        height: u32,
        points: &[EdgePoint],
        strength: impl Fn(f32) -> f32,
    ) -> Self {
        let mut map = ContourMap::new(width, height);
        for p in points {
            map.push(p.x, p.y, p.normal, strength(p.magnitude));
        }
        map
    }

    /// Reads a finished contour map from a decoded picture, by its brightness.
    pub fn from_photo(picture: &Photo) -> Self {
        ContourMap::from_image(&DynamicImage::from(picture.rgb().clone()).to_luma8())
    }

    /// Reads a finished contour map (bright = contour, 255 = strength 1). Lines thicker
    /// than a pixel are thinned to their strongest pixels, or to the middle ones among
    /// equals; tangents come from the strengths within about three pixels; points have
    /// sub-pixel positions according to the brightness. Filled areas, which are not
    /// contours, shrink to lines in their middle.
    pub fn from_image(picture: &GrayImage) -> Self {
        let (width, height) = picture.dimensions();
        let mut map = ContourMap::new(width, height);
        let (w, h) = (width as usize, height as usize);
        let bytes = &picture.as_raw()[..w * h];
        let left = thinned(width, height, bytes);
        let values: Vec<f32> = bytes.iter().map(|&b| f32::from(b) / 255.0).collect();
        // Directions come from the thinned lines, and offsets from the original
        // brightness, slightly smoothed.
        let lines: Vec<f32> =
            values.iter().zip(&left).map(|(v, &l)| if l { *v } else { 0.0 }).collect();
        let soft = smoothed(width, height, &values, 0.7);
        for k in (0..w * h).filter(|&k| left[k]) {
            let (cx, cy) = (k % w, k / w);
            // Second moments of the line's points around this one.
            let mut spread = [0.0f32; 3];
            for j in cy.saturating_sub(3)..(cy + 4).min(h) {
                for i in cx.saturating_sub(3)..(cx + 4).min(w) {
                    let (dx, dy) = (i as f32 - cx as f32, j as f32 - cy as f32);
                    let d2 = dx * dx + dy * dy;
                    if d2 > 0.0 && d2 <= 12.0 {
                        let weight = lines[j * w + i] / d2;
                        spread = [
                            spread[0] + weight * dx * dx,
                            spread[1] + weight * dx * dy,
                            spread[2] + weight * dy * dy,
                        ];
                    }
                }
            }
            let (_, tangent) = principal(spread[0], spread[1], spread[2]);
            let normal = [tangent[1], -tangent[0]];
            let t = ridge_offset(width, height, &soft, k, normal);
            let x = (cx as f32 + 0.5 + t * normal[0]).clamp(0.0, width as f32);
            let y = (cy as f32 + 0.5 + t * normal[1]).clamp(0.0, height as f32);
            map.push(x, y, normal, values[k]);
        }
        map
    }

    /// Returns a grey picture of the map's size, in which every pixel has the strength of
    /// the strongest point in it (255 for 1).
    pub fn to_image(&self) -> GrayImage {
        let mut out = GrayImage::new(self.width, self.height);
        if self.width == 0 || self.height == 0 {
            return out;
        }
        for ((&x, &y), &s) in self.x.iter().zip(&self.y).zip(&self.strength) {
            let pixel =
                out.get_pixel_mut((x as u32).min(self.width - 1), (y as u32).min(self.height - 1));
            *pixel = Luma([pixel.0[0].max((s * 255.0 + 0.5) as u8)]);
        }
        out
    }

    /// Returns the same points for a picture of another size (at least 1 x 1), with
    /// positions and directions scaled.
    pub fn scaled_to(&self, width: u32, height: u32) -> ContourMap {
        let (width, height) = (width.max(1), height.max(1));
        let (sx, sy) =
            (width as f32 / self.width.max(1) as f32, height as f32 / self.height.max(1) as f32);
        let mut map = ContourMap::new(width, height);
        map.x = self.x.iter().map(|x| (x * sx).min(width as f32)).collect();
        map.y = self.y.iter().map(|y| (y * sy).min(height as f32)).collect();
        (map.tx, map.ty) = self
            .tx
            .iter()
            .zip(&self.ty)
            .map(|(tx, ty)| {
                let (tx, ty) = (tx * sx, ty * sy);
                let length = (tx * tx + ty * ty).sqrt();
                if length > 0.0 { (tx / length, ty / length) } else { (1.0, 0.0) }
            })
            .unzip();
        map.strength.clone_from(&self.strength);
        map
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(n: u32, r: f32, sd: f32) -> GrayImage {
        GrayImage::from_fn(n, n, |i, j| {
            let (x, y) = (i as f32 + 0.5 - n as f32 / 2.0, j as f32 + 0.5 - n as f32 / 2.0);
            let d = (x * x + y * y).sqrt() - r;
            Luma([(240.0 * (-0.5 * d * d / (sd * sd)).exp()) as u8])
        })
    }

    #[test]
    fn soft_rings_give_places_and_tangents() {
        let map = ContourMap::from_image(&ring(64, 20.0, 1.5));
        assert!((105..=135).contains(&map.len()), "{}", map.len());
        let mut worst = 0.0f32;
        for k in 0..map.len() {
            let (x, y) = (map.x[k] - 32.0, map.y[k] - 32.0);
            let r = (x * x + y * y).sqrt();
            worst = worst.max((r - 20.0).abs());
            let radial = (map.tx[k] * x + map.ty[k] * y) / r;
            assert!(radial.abs() < 0.35, "{radial}");
            assert!((map.tx[k].hypot(map.ty[k]) - 1.0).abs() < 1e-5);
            assert!(map.strength[k] > 0.85);
        }
        assert!(worst < 0.25, "{worst}");
    }

    #[test]
    fn thin_lines_come_back_as_they_were() {
        let picture = GrayImage::from_fn(30, 20, |i, j| {
            Luma([if j == 4 && (3..25).contains(&i) {
                200
            } else if i == 27 && j > 6 {
                90
            } else {
                0
            }])
        });
        let map = ContourMap::from_image(&picture);
        assert_eq!(map.to_image(), picture);
        for k in 0..map.len() {
            let (along, t) =
                if map.y[k] < 5.0 { (map.tx[k], map.y[k]) } else { (map.ty[k], map.x[k]) };
            assert!(along.abs() > 0.999 && (t - t.floor() - 0.5).abs() < 1e-4);
        }
    }

    #[test]
    fn empty_full_and_odd_pictures() {
        assert!(ContourMap::from_image(&GrayImage::new(5, 4)).is_empty());
        assert!(ContourMap::from_image(&GrayImage::new(0, 0)).is_empty());
        let full = ContourMap::from_image(&GrayImage::from_pixel(6, 6, Luma([255])));
        assert!(!full.is_empty() && full.len() <= 12, "{}", full.len());
        let one = ContourMap::from_image(&GrayImage::from_pixel(1, 1, Luma([128])));
        assert_eq!((one.x[0], one.y[0], one.len()), (0.5, 0.5, 1));
        assert_eq!(ContourMap::new(0, 3).to_image().dimensions(), (0, 3));
    }

    #[test]
    fn scaling() {
        let mut map = ContourMap::new(10, 20);
        map.push(5.0, 10.0, [0.8, -0.6], 0.5);
        let big = map.scaled_to(20, 20);
        assert_eq!(
            (big.width, big.height, big.x[0], big.y[0], big.strength[0]),
            (20, 20, 10.0, 10.0, 0.5)
        );
        // Tangent (0.6, 0.8) becomes (1.2, 0.8).
        assert!((big.ty[0] / big.tx[0] - 2.0 / 3.0).abs() < 1e-6);
        let back = big.scaled_to(10, 20);
        assert!((back.x[0] - 5.0).abs() < 1e-6 && (back.tx[0] - 0.6).abs() < 1e-6);
    }
}
