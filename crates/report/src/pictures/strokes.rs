//! Contours: short straight strokes, drawn with anti-aliasing.

use super::{LONGER_SIDE, mix};
use image::RgbImage;
use pcadlang_scene::render::ContourSlice;
use pcadlang_scene::vision::ContourMap;

/// Draws bright contours on black, like a contour map.
pub fn contours(width: u32, height: u32, strokes: &ContourSlice) -> RgbImage {
    let mut out = RgbImage::new(width, height);
    draw_strokes(&mut out, strokes, [255.0; 3]);
    out
}

/// Draws the points of a contour map like the contours of a scene.
pub fn contour_map(width: u32, height: u32, map: &ContourMap) -> RgbImage {
    as_strokes(map, |strokes| contours(width, height, strokes))
}

/// Calls with the points of a map as strokes of one pixel, about which they are apart.
pub(super) fn as_strokes<T>(map: &ContourMap, f: impl FnOnce(&ContourSlice) -> T) -> T {
    let length = vec![1.0; map.len()];
    let ContourMap { x, y, tx, ty, .. } = map;
    f(&ContourSlice { width: map.width, height: map.height, x, y, tx, ty, length: &length })
}

/// Draws strokes, scaled to the picture, about 2 pixels wide in one of [`LONGER_SIDE`].
/// Coverage falls linearly from 1 to 0 over one pixel across the edge of a stroke; where
/// strokes meet, the larger coverage counts, so joints are not visible.
pub(super) fn draw_strokes(out: &mut RgbImage, s: &ContourSlice, color: [f32; 3]) {
    let cover = coverage(out.width(), out.height(), s);
    for (p, c) in out.pixels_mut().zip(cover) {
        if c > 0.0 {
            p.0 = mix(p.0, color, c);
        }
    }
}

/// Returns how far strokes cover each pixel, from 0 to 1, row by row.
pub(super) fn coverage(width: u32, height: u32, s: &ContourSlice) -> Vec<f32> {
    let (width, height) = (width as usize, height as usize);
    let (w, h) = (width as f32, height as f32);
    let (sx, sy) = (w / s.width.max(1) as f32, h / s.height.max(1) as f32);
    let half_width = (w.max(h) / LONGER_SIDE as f32).max(0.7);
    let mut cover = vec![0.0f32; width * height];
    let lists = s.x.iter().zip(s.y).zip(s.tx.iter().zip(s.ty)).zip(s.length);
    for (((x, y), (tx, ty)), length) in lists {
        let (x, y, dx, dy) = (x * sx, y * sy, tx * sx * length * 0.5, ty * sy * length * 0.5);
        if !(x.is_finite() && y.is_finite() && dx.is_finite() && dy.is_finite()) {
            continue;
        }
        let (reach_x, reach_y) = (dx.abs() + half_width + 1.0, dy.abs() + half_width + 1.0);
        let (u0, u1) =
            ((x - reach_x).max(0.0) as usize, (x + reach_x + 1.0).clamp(0.0, w) as usize);
        let (v0, v1) =
            ((y - reach_y).max(0.0) as usize, (y + reach_y + 1.0).clamp(0.0, h) as usize);
        let square = dx * dx + dy * dy;
        for v in v0..v1 {
            for u in u0..u1 {
                let (px, py) = (u as f32 + 0.5 - x, v as f32 + 0.5 - y);
                let t = if square > 0.0 {
                    ((px * dx + py * dy) / square).clamp(-1.0, 1.0)
                } else {
                    0.0
                };
                let (ex, ey) = (px - t * dx, py - t * dy);
                let c = (half_width + 0.5 - (ex * ex + ey * ey).sqrt()).clamp(0.0, 1.0);
                if let Some(at) = cover.get_mut(v * width + u) {
                    *at = at.max(c);
                }
            }
        }
    }
    cover
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one<'a>(
        x: &'a [f32],
        y: &'a [f32],
        t: &'a [[f32; 1]; 2],
        length: &'a [f32],
    ) -> ContourSlice<'a> {
        ContourSlice { width: 20, height: 20, x, y, tx: &t[0], ty: &t[1], length }
    }

    #[test]
    fn a_stroke_is_where_it_should_be() {
        let c = contours(20, 20, &one(&[10.0], &[10.0], &[[1.0], [0.0]], &[8.0]));
        assert!(
            c.get_pixel(8, 10).0[0] > 100
                && c.get_pixel(8, 14).0[0] == 0
                && c.get_pixel(17, 10).0[0] == 0
        );
        // The summed brightness is the stroke's area: width 1.4 by length 8, and round
        // ends.
        let sum: f32 = c.pixels().map(|p| f32::from(p.0[0]) / 255.0).sum();
        let area = 1.4 * 8.0 + std::f32::consts::PI * 0.7 * 0.7;
        assert!((sum - area).abs() < 0.15 * area, "{sum} {area}");
    }

    #[test]
    fn turning_the_picture_turns_the_stroke() {
        let a = contours(20, 20, &one(&[7.3], &[12.1], &[[0.8], [0.6]], &[6.0]));
        let b = contours(20, 20, &one(&[12.1], &[7.3], &[[0.6], [0.8]], &[6.0]));
        for (x, y, p) in a.enumerate_pixels() {
            assert!(p.0[0].abs_diff(b.get_pixel(y, x).0[0]) <= 1, "{x} {y}");
        }
    }

    #[test]
    fn strokes_scale_with_the_picture_and_odd_ones_are_left_out() {
        let large = contours(200, 200, &one(&[10.0], &[10.0], &[[1.0], [0.0]], &[8.0]));
        assert!(large.get_pixel(135, 100).0[0] > 100 && large.get_pixel(145, 100).0[0] == 0);
        for odd in [f32::NAN, f32::INFINITY, -1e30] {
            let c = contours(20, 20, &one(&[odd], &[10.0], &[[1.0], [0.0]], &[8.0]));
            assert!(c.pixels().all(|p| p.0 == [0; 3]), "{odd}");
        }
        assert_eq!(
            contours(0, 3, &one(&[1.0], &[1.0], &[[1.0], [0.0]], &[1.0])).dimensions(),
            (0, 3)
        );
    }
}
