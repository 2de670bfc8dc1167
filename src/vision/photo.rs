//! Photographs: decoding with limits that are checked before any pixel is allocated, and the right way up.

use super::VisionError;
use image::{DynamicImage, ImageDecoder, ImageReader, RgbImage, Rgba};
use std::io::Cursor;

/// Bounds on what is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest side in pixels.
    pub side: u32,
    /// The most pixels, in millions.
    pub megapixels: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { side: 16384, megapixels: 100 }
    }
}

/// A photograph, 8 bits a channel, upright.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photo {
    pixels: RgbImage,
}

impl Photo {
    /// A photograph from its pixels.
    pub fn new(pixels: RgbImage) -> Self {
        Photo { pixels }
    }

    /// Decodes PNG or JPEG. The EXIF orientation is honoured, transparent pixels lie on white.
    ///
    /// # Errors
    /// If the bytes are none of these, are damaged, or the picture is too large.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Photo, VisionError> {
        let image = decode(bytes, limits)?;
        let pixels = match image.color().has_alpha() {
            true => {
                let mut flat = RgbImage::new(image.width(), image.height());
                for (out, Rgba([r, g, b, a])) in flat.pixels_mut().zip(image.to_rgba8().pixels()) {
                    let over = |c: u8| ((u32::from(c) * u32::from(*a) + 255 * (255 - u32::from(*a)) + 127) / 255) as u8;
                    out.0 = [over(*r), over(*g), over(*b)];
                }
                flat
            }
            false => image.to_rgb8(),
        };
        Ok(Photo { pixels })
    }

    /// Its pixels.
    pub fn pixels(&self) -> &RgbImage {
        &self.pixels
    }

    /// Its width in pixels.
    pub fn width(&self) -> u32 {
        self.pixels.width()
    }

    /// Its height in pixels.
    pub fn height(&self) -> u32 {
        self.pixels.height()
    }
}

/// Decodes a picture of any kind of pixel, upright.
pub(super) fn decode(bytes: &[u8], limits: &Limits) -> Result<DynamicImage, VisionError> {
    if bytes.is_empty() {
        return Err(VisionError::Empty);
    }
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|_| VisionError::NotAnImage)?;
    if reader.format().is_none() {
        return Err(VisionError::NotAnImage);
    }
    let mut decoder = reader.into_decoder().map_err(|e| match e {
        image::ImageError::Unsupported(_) => VisionError::NotAnImage,
        e => VisionError::Damaged(e.to_string()),
    })?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if width.max(height) > limits.side || pixels > limits.megapixels * 1_000_000 {
        return Err(VisionError::TooLarge { width, height, side: limits.side, megapixels: limits.megapixels });
    }
    let orientation = decoder.orientation().unwrap_or(image::metadata::Orientation::NoTransforms);
    let mut image = DynamicImage::from_decoder(decoder).map_err(|e| VisionError::Damaged(e.to_string()))?;
    image.apply_orientation(orientation);
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageFormat, RgbaImage};

    fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Vec::new();
        image.into().write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        bytes
    }

    #[test]
    fn transparent_pixels_lie_on_white() {
        let photo =
            Photo::decode(&png(RgbaImage::from_pixel(2, 1, Rgba([100, 0, 200, 0]))), &Limits::default()).unwrap();
        assert_eq!(photo.pixels().get_pixel(1, 0).0, [255; 3]);
        let half = Photo::decode(&png(RgbaImage::from_pixel(1, 1, Rgba([0, 0, 0, 128]))), &Limits::default()).unwrap();
        assert_eq!(half.pixels().get_pixel(0, 0).0, [127; 3]);
        let grey = Photo::decode(&png(GrayImage::from_pixel(3, 2, image::Luma([9]))), &Limits::default()).unwrap();
        assert_eq!((grey.width(), grey.height(), grey.pixels().get_pixel(2, 1).0), (3, 2, [9; 3]));
    }

    #[test]
    fn what_is_no_picture_is_an_error() {
        let fails = |bytes: &[u8]| Photo::decode(bytes, &Limits::default()).unwrap_err();
        assert_eq!(fails(b""), VisionError::Empty);
        assert_eq!(fails(b"hello, this is text"), VisionError::NotAnImage);
        assert_eq!(fails(b"GIF89a\x01\x00\x01\x00"), VisionError::NotAnImage);
        let whole = png(RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8])));
        for cut in [10, 40, whole.len() / 2, whole.len() - 20] {
            assert!(matches!(fails(&whole[..cut]), VisionError::Damaged(_)), "cut at {cut}");
        }
    }

    #[test]
    fn size_is_checked_before_pixels() {
        // A PNG header that claims 60000 x 60000 pixels.
        let mut header = png(RgbImage::new(1, 1));
        header[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
        let crc = crc32(&header[12..29]).to_be_bytes();
        header[29..33].copy_from_slice(&crc);
        let e = Photo::decode(&header, &Limits::default()).unwrap_err();
        assert!(matches!(e, VisionError::TooLarge { width: 60000, .. }), "{e}");
        let wide = Photo::decode(&png(GrayImage::new(16384, 1)), &Limits::default()).unwrap();
        assert_eq!(wide.width(), 16384);
        assert!(Photo::decode(&png(GrayImage::new(16385, 1)), &Limits::default()).is_err());
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |c, b| {
            (0..8).fold(c ^ u32::from(*b), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        })
    }
}
