//! Depth, normals and parts of a drawn frame as colours, and two sets of contours coloured
//! by how far they are from each other.

use super::strokes::{as_strokes, coverage};
use super::{mix, surface};
use image::{Rgb, RgbImage};
use pcadlang_scene::render::{ContourSlice, Frame};
use pcadlang_scene::vision::ContourMap;

/// The colours of parts, used in turn (Okabe and Ito 2008: distinct also to people who see
/// few colours).
const PARTS: [[f32; 3]; 7] = [
    [86.0, 180.0, 233.0],
    [230.0, 159.0, 0.0],
    [0.0, 158.0, 115.0],
    [240.0, 228.0, 66.0],
    [213.0, 94.0, 0.0],
    [204.0, 121.0, 167.0],
    [0.0, 114.0, 178.0],
];
/// The colours of contours that meet the other kind, and that are far from it.
const NEAR: [f32; 3] = [60.0, 190.0, 90.0];
const FAR: [f32; 3] = [255.0, 70.0, 40.0];
/// The same for contours of the photograph, dimmer.
const SEEN_NEAR: [f32; 3] = [40.0, 90.0, 70.0];
const SEEN_FAR: [f32; 3] = [70.0, 150.0, 255.0];

fn colored(drawn: &Frame, color: impl Fn(usize) -> [f32; 3]) -> RgbImage {
    let mut out = RgbImage::new(drawn.width, drawn.height);
    for (i, p) in out.pixels_mut().enumerate() {
        if drawn.depth.get(i).is_some_and(|z| z.is_finite()) {
            p.0 = mix(p.0, color(i), 1.0);
        }
    }
    out
}

/// Draws depth as brightness: the nearest pixel white, the farthest dark grey, black off
/// the object.
pub fn depth(drawn: &Frame) -> RgbImage {
    let all = || drawn.depth.iter().copied().filter(|z| z.is_finite());
    let (near, far) = (all().fold(f32::INFINITY, f32::min), all().fold(0.0, f32::max));
    let share = |z: f32| if far > near { (far - z) / (far - near) } else { 1.0 };
    colored(drawn, |i| [40.0 + 215.0 * share(drawn.depth[i]); 3])
}

/// Draws normals as colours: x, y and z of the camera's frame from -1 to 1 as red, green
/// and blue from 0 to 255.
pub fn normals(drawn: &Frame) -> RgbImage {
    let of = |i: usize| drawn.normal.get(i).copied().unwrap_or_default();
    colored(drawn, |i| of(i).map(|x| 127.5 * (x + 1.0)))
}

/// Draws each part in a colour of its own, shaded.
pub fn parts(drawn: &Frame) -> RgbImage {
    colored(drawn, |i| {
        let part = usize::from(drawn.part.get(i).copied().unwrap_or(0));
        let light = drawn.normal.get(i).map_or(1.0, |n| surface::light(*n));
        PARTS[part % PARTS.len()].map(|c| c * (0.35 + 0.65 * light))
    })
}

/// Draws the contours of the scene (green where the photograph has one, red where it has
/// none within `far`) and those of the photograph (dim where the scene has one, blue
/// where it has none). `far` is in pixels of the photograph's contours.
pub fn residuals(
    (width, height): (u32, u32),
    own: &ContourSlice,
    seen: &ContourMap,
    far: f32,
) -> RgbImage {
    as_strokes(seen, |seen| apart((width, height), own, seen, far))
}

fn apart(
    (width, height): (u32, u32),
    own: &ContourSlice,
    seen: &ContourSlice,
    far: f32,
) -> RgbImage {
    let mut out = RgbImage::from_pixel(width, height, Rgb([16; 3]));
    for (strokes, other, [near_color, far_color]) in
        [(seen, own, [SEEN_NEAR, SEEN_FAR]), (own, seen, [NEAR, FAR])]
    {
        let shares = shares_of(strokes, other, far);
        // Strokes in ten classes of distance, since a picture of each is needed.
        const CLASSES: usize = 10;
        for class in 0..CLASSES {
            let in_class =
                |i: &usize| ((shares[*i] * CLASSES as f32) as usize).min(CLASSES - 1) == class;
            let of = |xs: &[f32]| -> Vec<f32> {
                (0..shares.len()).filter(in_class).map(|i| xs[i]).collect()
            };
            let [x, y, tx, ty, length] =
                [strokes.x, strokes.y, strokes.tx, strokes.ty, strokes.length].map(of);
            if x.is_empty() {
                continue;
            }
            let some = ContourSlice {
                width: strokes.width,
                height: strokes.height,
                x: &x,
                y: &y,
                tx: &tx,
                ty: &ty,
                length: &length,
            };
            let share = class as f32 / (CLASSES - 1) as f32;
            let color = [0, 1, 2].map(|c| near_color[c] + share * (far_color[c] - near_color[c]));
            for (p, c) in out.pixels_mut().zip(coverage(width, height, &some)) {
                if c > 0.0 {
                    p.0 = mix(p.0, color, c);
                }
            }
        }
    }
    out
}

/// Returns the distance of each stroke to the nearest one of the other kind, as a part of
/// `far`, at most 1. Both may be given at different resolutions.
fn shares_of(strokes: &ContourSlice, other: &ContourSlice, far: f32) -> Vec<f32> {
    let (width, height) = (strokes.width.max(1), strokes.height.max(1));
    let (sx, sy) =
        (width as f32 / other.width.max(1) as f32, height as f32 / other.height.max(1) as f32);
    let mut set = vec![false; (width * height) as usize];
    let index = |x: f32, y: f32| {
        let (u, v) = (x.clamp(0.0, width as f32 - 1.0), y.clamp(0.0, height as f32 - 1.0));
        v as usize * width as usize + u as usize
    };
    for (x, y) in other.x.iter().zip(other.y).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        set[index(x * sx, y * sy)] = true;
    }
    let distances = pcadlang_scene::vision::distance_transform(width, height, &set);
    let at = |x: f32, y: f32| {
        let d = distances.sample(x, y).0;
        if d.is_finite() { (d / far.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0) } else { 1.0 }
    };
    strokes.x.iter().zip(strokes.y).map(|(x, y)| at(*x, *y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        Frame {
            width: 3,
            height: 1,
            depth: vec![1.0, 3.0, f32::INFINITY],
            normal: vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0; 3]],
            part: vec![0, 1, u16::MAX],
        }
    }

    #[test]
    fn depth_normals_and_parts_have_their_colours() {
        let [d, n, p] = [depth(&frame()), normals(&frame()), parts(&frame())];
        assert_eq!((d.get_pixel(0, 0).0, d.get_pixel(1, 0).0), ([255; 3], [40; 3]));
        assert_eq!((n.get_pixel(0, 0).0, n.get_pixel(1, 0).0), ([128, 128, 255], [255, 128, 128]));
        assert_ne!(p.get_pixel(0, 0), p.get_pixel(1, 0));
        for picture in [d, n, p] {
            assert_eq!(picture.get_pixel(2, 0).0, [0; 3], "black off the object");
        }
        let empty = Frame { width: 2, height: 2, depth: vec![], normal: vec![], part: vec![] };
        assert!(depth(&empty).pixels().all(|p| p.0 == [0; 3]));
    }

    #[test]
    fn contours_that_meet_are_green_and_others_red_and_blue() {
        let (t, zero, one) = (vec![1.0; 2], vec![0.0; 2], vec![3.0; 2]);
        let slice = |x: &'static [f32], y: &'static [f32]| ContourSlice {
            width: 100,
            height: 100,
            x,
            y,
            tx: &t,
            ty: &zero,
            length: &one,
        };
        let own = slice(&[20.0, 80.0], &[20.0, 80.0]);
        let seen = slice(&[20.0, 20.0], &[20.0, 80.0]);
        let out = apart((100, 100), &own, &seen, 5.0);
        let at = |x, y| out.get_pixel(x, y).0;
        assert!(at(20, 20)[1] > at(20, 20)[0], "{:?}: met", at(20, 20));
        assert!(at(80, 80)[0] > 150 && at(80, 80)[1] < 100, "{:?}: only the scene", at(80, 80));
        assert!(at(20, 80)[2] > 150 && at(20, 80)[0] < 100, "{:?}: only seen", at(20, 80));
        assert_eq!(at(50, 50), [16; 3]);
    }
}
