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
    pcadlang::report::pictures::png(picture).unwrap()
}

/// Decodes base64.
pub fn unbase64(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let mut out = Vec::new();
    for four in text.as_bytes().chunks(4) {
        let known: Vec<u8> = four.iter().filter(|c| **c != b'=').map(|c| digit(*c)).collect();
        let word =
            known.iter().enumerate().fold(0u32, |w, (i, d)| w | u32::from(*d) << (18 - 6 * i));
        out.extend((0..known.len() - 1).map(|i| (word >> (16 - 8 * i)) as u8));
    }
    out
}
