//! Shaded pictures for people to look at: a light at the camera, some ambient light, a
//! light background.
//!
//! Not a physical renderer and not used in inference. Every pixel of the frame gives one
//! pixel of the picture.

use crate::render::Frame;
use image::{Rgb, RgbImage};

/// The background's colour.
const BACKGROUND: [u8; 3] = [246, 246, 243];

/// Base colours of parts, used cyclically.
const PARTS: [[f32; 3]; 6] = [
    [0.55, 0.66, 0.80],
    [0.86, 0.68, 0.46],
    [0.60, 0.75, 0.58],
    [0.80, 0.58, 0.58],
    [0.68, 0.62, 0.80],
    [0.76, 0.76, 0.62],
];

/// Shades a frame. A frame without normals is shown by depth alone (near is dark).
pub fn shade(frame: &Frame) -> RgbImage {
    let (mut near, mut far) = (f32::INFINITY, f32::NEG_INFINITY);
    for &d in frame.depth.iter().filter(|d| d.is_finite()) {
        near = near.min(d);
        far = far.max(d);
    }
    let width = frame.width as usize;
    RgbImage::from_fn(frame.width, frame.height, |x, y| {
        let i = y as usize * width + x as usize;
        let depth = frame.depth.get(i).copied().unwrap_or(f32::INFINITY);
        if !depth.is_finite() {
            return Rgb(BACKGROUND);
        }
        match (frame.normal.get(i), frame.part.get(i)) {
            (Some(n), Some(&part)) => {
                // Slightly to the upper left of the camera, so that round things look
                // round.
                let light = (0.95 * n[2] - 0.18 * n[0] + 0.25 * n[1]).max(0.0);
                let shine = light.powi(24) * 0.18;
                Rgb(PARTS[usize::from(part) % PARTS.len()]
                    .map(|c| tone(c * (0.28 + 0.72 * light) + shine)))
            }
            _ => Rgb([tone(0.15 + 0.7 * (depth - near) / (far - near).max(f32::MIN_POSITIVE)); 3]),
        }
    })
}

fn tone(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facing_is_brighter_than_grazing_and_off_is_background() {
        let frame = Frame {
            width: 3,
            height: 1,
            depth: vec![1.0, 1.0, f32::INFINITY],
            part: vec![0, 0, u16::MAX],
            normal: vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0; 3]],
        };
        let picture = shade(&frame);
        assert!(picture.get_pixel(0, 0)[1] > picture.get_pixel(1, 0)[1]);
        assert_eq!(picture.get_pixel(2, 0).0, BACKGROUND);
    }

    #[test]
    fn depth_alone_is_shown_too() {
        let frame = Frame {
            width: 2,
            height: 1,
            depth: vec![1.0, 2.0],
            part: Vec::new(),
            normal: Vec::new(),
        };
        let picture = shade(&frame);
        assert!(picture.get_pixel(0, 0)[0] < picture.get_pixel(1, 0)[0]);
    }

    #[test]
    fn depth_alone_is_grey_from_0_15_to_0_85_of_white() {
        let grey = |depth: Vec<f32>| {
            let frame = Frame {
                width: depth.len() as u32,
                height: 1,
                depth,
                part: Vec::new(),
                normal: Vec::new(),
            };
            shade(&frame).pixels().map(|p| p.0).collect::<Vec<_>>()
        };
        assert_eq!(grey(vec![1.0, 1.25, 2.0]), [[38_u8; 3], [83; 3], [217; 3]]);
        // At the same depth everywhere.
        assert_eq!(grey(vec![3.0, 3.0, f32::INFINITY]), [[38; 3], [38; 3], BACKGROUND]);
    }
}
