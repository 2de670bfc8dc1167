//! Contours, limbs and dots: short straight strokes and discs, drawn with anti-aliasing.

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

/// The colour of points of the scene.
pub const OF_SCENE: [f32; 3] = [255.0, 220.0, 0.0];
/// The colour of detected points.
pub const DETECTED: [f32; 3] = [90.0, 220.0, 255.0];
/// The colour of the ring that separates a dot from its background.
const RING: [f32; 3] = [20.0, 20.0, 20.0];

/// Draws dots, about 9 pixels wide in a picture of [`LONGER_SIDE`]. Positions are in
/// pixels of a picture of `width` x `height` and are scaled to this one; positions that
/// are not finite are left out.
pub fn dots(out: &mut RgbImage, (width, height): (u32, u32), at: &[[f64; 2]], color: [f32; 3]) {
    let (w, h) = (out.width() as f32, out.height() as f32);
    let (sx, sy) = (w / width.max(1) as f32, h / height.max(1) as f32);
    let radius = (4.5 * w.max(h) / LONGER_SIDE as f32).max(2.0);
    for [x, y] in at {
        let (x, y) = (*x as f32 * sx, *y as f32 * sy);
        if !(x.is_finite() && y.is_finite()) {
            continue;
        }
        let reach = radius + 1.0;
        let (u0, u1) = ((x - reach).max(0.0) as u32, (x + reach + 1.0).clamp(0.0, w) as u32);
        let (v0, v1) = ((y - reach).max(0.0) as u32, (y + reach + 1.0).clamp(0.0, h) as u32);
        for v in v0..v1 {
            for u in u0..u1 {
                let (px, py) = (u as f32 + 0.5 - x, v as f32 + 0.5 - y);
                let inside = |r: f32| (r + 0.5 - (px * px + py * py).sqrt()).clamp(0.0, 1.0);
                let Some(p) = out.get_pixel_mut_checked(u, v) else { continue };
                p.0 = mix(mix(p.0, RING, inside(radius)), color, inside(0.65 * radius));
            }
        }
    }
}

/// Draws lines between points. Positions are in pixels of a picture of `width` x `height`
/// and are scaled to this one; lines with ends that are not finite are left out.
pub fn limbs(
    out: &mut RgbImage,
    (width, height): (u32, u32),
    ends: &[[[f64; 2]; 2]],
    color: [f32; 3],
) {
    let middle =
        |k: usize| ends.iter().map(|[a, b]| (0.5 * (a[k] + b[k])) as f32).collect::<Vec<f32>>();
    let along = |k: usize| ends.iter().map(|[a, b]| (b[k] - a[k]) as f32).collect::<Vec<f32>>();
    let (x, y, tx, ty) = (middle(0), middle(1), along(0), along(1));
    // The tangents have the lengths of the lines.
    let length = vec![1.0; ends.len()];
    draw_strokes(
        out,
        &ContourSlice { width, height, x: &x, y: &y, tx: &tx, ty: &ty, length: &length },
        color,
    );
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

    #[test]
    fn a_dot_is_where_it_should_be_and_nowhere_else() {
        let mut p = RgbImage::new(200, 100);
        dots(
            &mut p,
            (20, 10),
            &[[10.0, 5.0], [f64::NAN, 1.0], [1e300, 1.0], [-50.0, 5.0]],
            OF_SCENE,
        );
        assert_eq!(p.get_pixel(100, 50).0, [255, 220, 0]);
        let lit: Vec<(u32, u32)> =
            p.enumerate_pixels().filter(|(.., c)| c.0 != [0; 3]).map(|(x, y, _)| (x, y)).collect();
        assert!(
            lit.len() > 8 && lit.iter().all(|(x, y)| x.abs_diff(100) < 5 && y.abs_diff(50) < 5),
            "{lit:?}"
        );
        dots(&mut RgbImage::new(0, 0), (0, 0), &[[0.0, 0.0]], OF_SCENE);
    }

    #[test]
    fn a_limb_goes_from_joint_to_joint() {
        let mut p = RgbImage::new(100, 50);
        limbs(
            &mut p,
            (10, 5),
            &[[[2.0, 1.0], [8.0, 4.0]], [[f64::NAN, 1.0], [1.0, 1.0]]],
            [255.0, 0.0, 0.0],
        );
        for (x, y, lit) in [
            (21, 10, true),
            (50, 25, true),
            (79, 39, true),
            (50, 30, false),
            (90, 45, false),
            (10, 5, false),
        ] {
            assert_eq!(p.get_pixel(x, y).0[0] > 90, lit, "{x} {y}");
        }
    }
}
