//! The surface of a draw: shaded, over a photograph, as a mask, and how often draws cover
//! each pixel.

use super::scale::scaled;
use super::strokes::draw_strokes;
use super::{LONGER_SIDE, mix};
use image::{GrayImage, Luma, Rgb, RgbImage};
use pcadlang_scene::render::{ContourSlice, Frame};

/// The opacity of the surface over the photograph.
const OVER: f32 = 0.55;
/// The colour of contours: unlike the surface's blues and the colours of most
/// photographs.
const STROKE: [f32; 3] = [255.0, 60.0, 20.0];
/// The colours of a part in the dark and in full light, used in turn. They differ
/// slightly in hue only, because a cap and the side below it are also separate parts.
const PALETTE: [[[f32; 3]; 2]; 4] = [
    [[30.0, 42.0, 66.0], [206.0, 232.0, 255.0]],
    [[24.0, 52.0, 62.0], [200.0, 244.0, 246.0]],
    [[42.0, 40.0, 72.0], [220.0, 222.0, 255.0]],
    [[38.0, 46.0, 54.0], [224.0, 232.0, 238.0]],
];

/// Returns the brightness of a pixel, from 0 to 1: a light at the upper left of the
/// camera, a weaker one at the camera, and ambient light (Lambert's law).
pub(super) fn light([x, y, z]: [f32; 3]) -> f32 {
    let key = (0.7 * z - 0.45 * x + 0.55 * y).max(0.0);
    let light = 0.72 * key + 0.22 * z.max(0.0) + 0.06;
    if light.is_finite() { light.clamp(0.0, 1.0) } else { 0.0 }
}

/// Returns the colour of a pixel; `None` outside the object.
fn shade(d: &Frame, i: usize) -> Option<[f32; 3]> {
    if !d.depth.get(i)?.is_finite() {
        return None;
    }
    let light = light(*d.normal.get(i)?);
    let part = usize::from(d.part.get(i).copied().unwrap_or(0));
    let [dark, bright] = PALETTE[part % PALETTE.len()];
    Some([0, 1, 2].map(|c| dark[c] + (bright[c] - dark[c]) * light))
}

/// Doubles the saturation at the same brightness, so that the surface differs from the
/// photograph that shines through it.
fn vivid(c: [f32; 3]) -> [f32; 3] {
    let mean = (c[0] + c[1] + c[2]) / 3.0;
    c.map(|x| (mean + 2.0 * (x - mean)).clamp(0.0, 255.0))
}

/// Draws the surface over the photograph, half transparent, with its contours on top. The
/// result has the drawing's size, but a small picture is enlarged to [`LONGER_SIDE`] so
/// that details are visible.
pub fn overlay(photo: Option<&RgbImage>, drawn: &Frame, strokes: &ContourSlice) -> RgbImage {
    let mut out = blended(photo, drawn);
    let size = super::picture_size(drawn.width, drawn.height);
    if drawn.width > 0 && drawn.height > 0 && drawn.width.max(drawn.height) < LONGER_SIDE {
        out = scaled(&out, size.0, size.1);
    }
    draw_strokes(&mut out, strokes, STROKE);
    out
}

/// Draws an [`overlay`] of exactly the drawing's size.
pub fn overlaid(photo: Option<&RgbImage>, drawn: &Frame, strokes: &ContourSlice) -> RgbImage {
    let mut out = blended(photo, drawn);
    draw_strokes(&mut out, strokes, STROKE);
    out
}

/// Draws the surface over the photograph, half transparent.
fn blended(photo: Option<&RgbImage>, drawn: &Frame) -> RgbImage {
    let mut out = match photo.filter(|p| p.width() > 0 && p.height() > 0) {
        Some(p) => scaled(p, drawn.width, drawn.height),
        None => RgbImage::from_pixel(drawn.width, drawn.height, Rgb([245; 3])),
    };
    for (i, p) in out.pixels_mut().enumerate() {
        if let Some(s) = shade(drawn, i) {
            p.0 = mix(p.0, vivid(s), OVER);
        }
    }
    out
}

/// Draws the shaded surface on a light background.
pub fn shaded(drawn: &Frame) -> RgbImage {
    let mut out = RgbImage::from_pixel(drawn.width, drawn.height, Rgb([250; 3]));
    for (i, p) in out.pixels_mut().enumerate() {
        if let Some(s) = shade(drawn, i) {
            p.0 = mix(p.0, s, 1.0);
        }
    }
    out
}

/// Draws the object white on black.
pub fn mask(drawn: &Frame) -> GrayImage {
    let on = |i: usize| drawn.depth.get(i).is_some_and(|z| z.is_finite());
    from_fn(drawn.width, drawn.height, |i| if on(i) { 255 } else { 0 })
}

/// Draws how often each pixel showed the object, from black (never) to white (`of`
/// times).
pub fn frequency(width: u32, height: u32, counts: &[u32], of: u32) -> GrayImage {
    let share = |i: usize| f64::from(counts.get(i).copied().unwrap_or(0)) / f64::from(of.max(1));
    from_fn(width, height, |i| (255.0 * share(i)).round() as u8)
}

/// Makes a picture from a function of the row-major pixel index.
fn from_fn(width: u32, height: u32, value: impl Fn(usize) -> u8) -> GrayImage {
    GrayImage::from_fn(width, height, |x, y| {
        Luma([value(y as usize * width as usize + x as usize)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn none() -> ContourSlice<'static> {
        ContourSlice { width: 2, height: 2, x: &[], y: &[], tx: &[], ty: &[], length: &[] }
    }

    #[test]
    fn the_surface_shines_through_over_the_object_only() {
        let mut depth = vec![f32::INFINITY; 768 * 2];
        depth[1] = 3.0;
        let normal = vec![[0.0, 0.0, 1.0]; 768 * 2];
        let drawn = Frame { width: 768, height: 2, depth, normal, part: vec![] };
        for ground in [[0, 0, 0], [200, 10, 90]] {
            let o = overlay(Some(&RgbImage::from_pixel(768, 2, Rgb(ground))), &drawn, &none());
            assert_eq!(o.get_pixel(0, 0).0, ground);
            let full = vivid(shaded(&drawn).get_pixel(1, 0).0.map(f32::from));
            for c in 0..3 {
                let expected = 0.45 * f32::from(ground[c]) + 0.55 * full[c];
                assert!((f32::from(o.get_pixel(1, 0).0[c]) - expected).abs() < 1.5, "{o:?}");
            }
        }
    }

    #[test]
    fn small_pictures_are_enlarged() {
        let (depth, normal) = (vec![1.0; 4], vec![[0.0, 0.0, 1.0]; 4]);
        let drawn = Frame { width: 2, height: 2, depth, normal, part: vec![0, 1, 2, 3] };
        assert_eq!(overlay(None, &drawn, &none()).dimensions(), (768, 768));
        let empty = Frame { width: 0, height: 0, depth: vec![], normal: vec![], part: vec![] };
        assert_eq!(overlay(None, &empty, &none()).dimensions(), (0, 0));
    }

    #[test]
    fn light_comes_from_the_upper_left_and_is_always_a_number() {
        let s = std::f32::consts::FRAC_1_SQRT_2;
        assert!(
            light([0.0, s, s]) > light([0.0, -s, s]) && light([-s, 0.0, s]) > light([s, 0.0, s])
        );
        for n in [[f32::NAN; 3], [f32::INFINITY; 3], [0.0; 3], [0.0, 0.0, -1.0], [-9.0, 9.0, 9.0]] {
            assert!((0.0..=1.0).contains(&light(n)), "{n:?}");
        }
    }

    #[test]
    fn parts_differ_and_short_buffers_are_background() {
        let drawn = Frame {
            width: 3,
            height: 1,
            depth: vec![1.0; 2],
            normal: vec![[0.0, 0.0, 1.0]; 2],
            part: vec![0, 1],
        };
        let s = shaded(&drawn);
        assert_ne!(s.get_pixel(0, 0), s.get_pixel(1, 0));
        assert_eq!(s.get_pixel(2, 0).0, [250; 3]);
        assert_eq!(mask(&drawn).into_raw(), [255, 255, 0]);
        assert_eq!(frequency(3, 1, &[0, 3], 4).into_raw(), [0, 191, 0]);
        assert_eq!(frequency(1, 1, &[0], 0).into_raw(), [0]);
    }
}
