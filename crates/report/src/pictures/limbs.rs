//! Limbs: lines from joint to joint.

use super::strokes::draw_strokes;
use image::RgbImage;
use pcadlang_scene::render::ContourSlice;

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
