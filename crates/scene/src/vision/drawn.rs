//! Drawn vases and vessels whose outlines are known, for tests.

use super::{Mask, Photo};
use image::{Rgb, RgbImage};

pub const WIDTH: u32 = 240;
pub const HEIGHT: u32 = 200;
/// The middle of the drawn vase's axis, and its length, pixels.
pub const MIDDLE: [f64; 2] = [108.0, 97.0];
pub const LENGTH: f64 = 120.0;

/// Returns a pseudo-random number in 0..1.
pub fn noise(i: u32) -> f64 {
    let x = i.wrapping_mul(0x9e37_79b9) ^ (i >> 3);
    let x = (x ^ x >> 15).wrapping_mul(0x85eb_ca6b);
    f64::from((x ^ x >> 13) >> 8) / f64::from(1 << 24)
}

/// The half-width of the vase at a fraction of the way from foot to top.
pub fn profile(t: f64) -> f64 {
    22.0 + 14.0 * libm::sin(5.0 * t)
}

/// The position of a pixel along the vase, 0 at the foot and 1 at the top, and across its
/// axis, which leans to the right by an angle.
fn place(i: u32, j: u32, lean: f64) -> (f64, f64) {
    let (x, y) = (f64::from(i) + 0.5 - MIDDLE[0], f64::from(j) + 0.5 - MIDDLE[1]);
    let (s, c) = (libm::sin(lean), libm::cos(lean));
    ((x * s - y * c) / LENGTH + 0.5, x * c + y * s)
}

/// A bright vase before a darker, speckled background, and its mask.
pub fn vase(lean: f64) -> (Photo, Mask) {
    let inside = |i: u32, j: u32| {
        let (t, across) = place(i, j, lean);
        (0.0..=1.0).contains(&t) && across.abs() <= profile(t)
    };
    let picture = RgbImage::from_fn(WIDTH, HEIGHT, |i, j| {
        let speckle = 30.0 * noise(j / 3 * 1000 + i / 3);
        let light = place(i, j, lean).1;
        let [r, g, b] =
            if inside(i, j) { [200.0 + light, 150.0 + light, 90.0] } else { [60.0, 75.0, 80.0] };
        Rgb([r, g, b].map(|v| (v + speckle) as u8))
    });
    let mask = (0..HEIGHT)
        .flat_map(|j| (0..WIDTH).map(move |i| (i, j)))
        .map(|(i, j)| inside(i, j))
        .collect();
    (Photo::from_rgb(picture).unwrap(), Mask::new(WIDTH, HEIGHT, mask).unwrap())
}

/// A bright vessel before a darker background, seen from above by a tilt: a cylinder with
/// a dark inside.
pub fn vessel(tilt: f64, below: bool) -> Photo {
    const RADIUS: f64 = 40.0;
    let (flat, rim, foot) = (RADIUS * libm::sin(tilt), 75.0, 75.0 + 80.0 * libm::cos(tilt));
    let ellipse =
        |x: f64, y: f64, middle: f64| (x / RADIUS).powi(2) + ((y - middle) / flat).powi(2) <= 1.0;
    let picture = RgbImage::from_fn(WIDTH, HEIGHT, |i, j| {
        let (x, y) =
            (f64::from(i) + 0.5 - 120.0, f64::from(if below { HEIGHT - 1 - j } else { j }) + 0.5);
        let body = x.abs() <= RADIUS && (rim..=foot).contains(&y) || ellipse(x, y, foot);
        let colour = match (ellipse(x, y, rim), body) {
            (true, _) => [150.0, 100.0, 60.0],
            (false, true) => [210.0, 160.0, 100.0],
            _ => [60.0, 75.0, 80.0],
        };
        Rgb(colour.map(|v| (v + 12.0 * noise(j / 3 * 1000 + i / 3)) as u8))
    });
    Photo::from_rgb(picture).unwrap()
}
