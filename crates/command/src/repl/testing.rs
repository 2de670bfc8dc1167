//! Helpers for tests of the encoders.

use image::{Rgb, RgbImage};

/// Returns a picture of pseudo-random pixels.
pub fn noise(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let h = (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503).wrapping_mul(x + 7))
            .wrapping_mul(2_246_822_519);
        Rgb([(h >> 24) as u8, (h >> 16) as u8, (h >> 8) as u8])
    })
}

/// Encodes a picture as a PNG.
pub fn png_of(picture: &RgbImage) -> Vec<u8> {
    pcadlang_report::pictures::png(picture).unwrap()
}
