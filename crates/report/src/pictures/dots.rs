//! Dots at the positions of named points of a draw.

use super::{LONGER_SIDE, mix};
use image::RgbImage;

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
