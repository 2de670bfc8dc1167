//! Pictures of draws, made from plain buffers: over the photograph, alone, or many on one
//! sheet.
//!
//! This module does not render scenes; it colours rendered buffers. Rows go down, pixel
//! (0, 0) is the upper left one, and its centre is at (0.5, 0.5). Missing pixels of short
//! buffers count as background, so no input panics.

mod layers;
mod scale;
mod sheet;
mod strokes;
mod surface;

pub use layers::{depth, normals, parts, residuals};
pub use scale::scaled;
pub use sheet::contact_sheet;
pub use strokes::{DETECTED, OF_SCENE, contour_map, contours, dots, limbs};
pub use surface::{frequency, mask, overlaid, overlay, shaded};

use jpeg_encoder::{ColorType, Encoder, EncodingError, SamplingFactor};

/// Pictures are enlarged until their longer side has this many pixels.
pub const LONGER_SIDE: u32 = 768;

/// Returns the size of the pictures for a photograph of the given size: at least
/// [`LONGER_SIDE`] along the longer side.
pub fn picture_size(width: u32, height: u32) -> (u32, u32) {
    let longer = width.max(height).max(1);
    if longer >= LONGER_SIDE {
        return (width, height);
    }
    let scale = |x: u32| (u64::from(x) * u64::from(LONGER_SIDE) / u64::from(longer)).max(1) as u32;
    (scale(width), scale(height))
}

/// Encodes a picture as a PNG file.
///
/// # Errors
/// Returns an error if the picture has no pixels.
pub fn png<P>(picture: &image::ImageBuffer<P, Vec<u8>>) -> Result<Vec<u8>, image::ImageError>
where
    P: image::Pixel<Subpixel = u8> + image::PixelWithColorType,
{
    let mut bytes = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png)?;
    Ok(bytes)
}

/// Encodes a picture as a JPEG file of a quality from 1 to 100: with one channel if it is grey,
/// else with colours at half the resolution.
///
/// # Errors
/// Returns an error if the picture has no pixels, or a side of more than 65,535.
pub fn jpeg(picture: &image::RgbImage, quality: u8) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    // A side of 0 is refused.
    let [width, height] =
        [picture.width(), picture.height()].map(|n| u16::try_from(n).unwrap_or(0));
    if picture.pixels().all(|p| p.0 == [p.0[0]; 3]) {
        let grey: Vec<u8> = picture.pixels().map(|p| p.0[0]).collect();
        encoder.encode(&grey, width, height, ColorType::Luma)?;
    } else {
        encoder.encode(picture.as_raw(), width, height, ColorType::Rgb)?;
    }
    Ok(bytes)
}

/// Blends one colour over another.
fn mix(under: [u8; 3], over: [f32; 3], share: f32) -> [u8; 3] {
    [0, 1, 2].map(|c| {
        (f32::from(under[c]) * (1.0 - share) + over[c].clamp(0.0, 255.0) * share).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_files() {
        assert_eq!(picture_size(256, 128), (768, 384));
        assert_eq!(picture_size(4000, 10), (4000, 10));
        assert_eq!(picture_size(1, 100_000), (1, 100_000));
        assert_eq!(picture_size(0, 0), (1, 1));
        let picture = image::RgbImage::from_fn(5, 3, |x, y| image::Rgb([x as u8, y as u8, 7]));
        assert!(jpeg(&image::RgbImage::new(0, 3), 90).is_err());
        let back = image::load_from_memory(&png(&picture).unwrap()).unwrap().to_rgb8();
        assert_eq!(back, picture);
        for (picture, color) in [
            (picture, image::ColorType::Rgb8),
            (image::RgbImage::from_pixel(9, 4, image::Rgb([90; 3])), image::ColorType::L8),
        ] {
            let back = image::load_from_memory(&jpeg(&picture, 90).unwrap()).unwrap();
            assert_eq!((back.color(), back.width()), (color, picture.width()));
            let near = |(a, b): (&u8, &u8)| a.abs_diff(*b) < 9;
            assert!(back.to_rgb8().iter().zip(picture.iter()).all(near));
        }
        assert_eq!(mix([0, 100, 200], [100.0, 100.0, 300.0], 0.5), [50, 100, 228]);
    }
}
