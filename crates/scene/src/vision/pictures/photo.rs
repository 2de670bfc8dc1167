//! Photographs: reading PNG and JPEG files (8 or 16 bit, grey, palette, colour, alpha)
//! and shrinking them in linear light. This is not a general picture reader. A [`Photo`]
//! is upright (Exif orientation applied), is opaque (alpha composited over white in sRGB
//! values, as viewers do) and has at least one pixel.

use crate::vision::error::{VisionError, read_bytes};
use crate::vision::pictures::color::{linear_table, linear_to_srgb};
use crate::vision::{exif, resize};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, RgbImage};
use std::io::Cursor;
use std::path::Path;

/// Limits on the size of a picture. The size in the header is checked before memory is
/// allocated for pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The maximum longer side, pixels.
    pub max_side: u32,
    /// The maximum total number of pixels.
    pub max_pixels: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { max_side: 16384, max_pixels: 100_000_000 }
    }
}

impl Limits {
    /// Returns an error for a picture that is too large or has no pixels.
    pub fn check(&self, width: u32, height: u32) -> Result<(), VisionError> {
        if width == 0 || height == 0 {
            return Err(VisionError::Damaged("it has no pixels".into()));
        }
        if width.max(height) > self.max_side
            || u64::from(width) * u64::from(height) > self.max_pixels
        {
            let Limits { max_side, max_pixels } = *self;
            return Err(VisionError::TooLarge { width, height, max_side, max_pixels });
        }
        Ok(())
    }

    /// The maximum number of bytes of a file: 16 per pixel, more than any supported
    /// format needs uncompressed.
    pub(crate) fn max_bytes(&self) -> u64 {
        self.max_pixels.saturating_mul(16).saturating_add(1 << 20)
    }
}

/// An upright, opaque photograph in sRGB bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    rgb: RgbImage,
    focal_35mm: Option<f64>,
}

/// A picture in linear light (sRGB primaries, 0..=1).
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Pixels, in row-major order.
    pub rgb: Vec<[f32; 3]>,
}

impl Photo {
    /// Wraps sRGB pixels; an error if there are none.
    pub fn from_rgb(rgb: RgbImage) -> Result<Self, VisionError> {
        Limits { max_side: u32::MAX, max_pixels: u64::MAX }.check(rgb.width(), rgb.height())?;
        Ok(Photo { rgb, focal_35mm: None })
    }

    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.rgb.width()
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.rgb.height()
    }

    /// The sRGB pixels.
    pub fn rgb(&self) -> &RgbImage {
        &self.rgb
    }

    /// The 35 mm equivalent focal length recorded by the camera, mm (for a frame of 36 mm
    /// x 24 mm).
    pub fn focal_35mm(&self) -> Option<f64> {
        self.focal_35mm
    }

    /// Returns the picture in linear light at `width` x `height` pixels, area-averaged.
    pub fn linear(&self, width: u32, height: u32) -> LinearImage {
        let table = linear_table();
        let stride = 3 * self.rgb.width() as usize;
        let bytes = self.rgb.as_raw();
        let rgb = resize::resize_rows(self.rgb.dimensions(), (width, height), |j, row| {
            let pixels = bytes.chunks_exact(stride).nth(j as usize).unwrap_or_default();
            for (p, b) in row.iter_mut().zip(pixels.chunks_exact(3)) {
                *p = [table[usize::from(b[0])], table[usize::from(b[1])], table[usize::from(b[2])]];
            }
        });
        LinearImage { width, height, rgb }
    }

    /// Returns the sRGB values, 0..=1, at `width` x `height` pixels: area-averaged in
    /// linear light, or interpolated if either side is enlarged.
    pub fn srgb(&self, width: u32, height: u32) -> Vec<[f32; 3]> {
        let values =
            |rgb: &RgbImage| rgb.pixels().map(|p| p.0.map(|b| f32::from(b) / 255.0)).collect();
        if (width, height) == self.rgb.dimensions() {
            return values(&self.rgb);
        }
        if width > self.rgb.width() || height > self.rgb.height() {
            return values(&image::imageops::resize(
                &self.rgb,
                width,
                height,
                image::imageops::FilterType::Triangle,
            ));
        }
        let linear = self.linear(width, height).rgb;
        linear
            .iter()
            .map(|p| p.map(|v| linear_to_srgb(f64::from(v).clamp(0.0, 1.0)) as f32))
            .collect()
    }

    /// Returns the photo shrunk, in linear light, to a longer side of at most `longer`
    /// pixels; unchanged if it is smaller.
    pub fn shrunk(&self, longer: u32) -> Photo {
        let (width, height) = resize::fitted(self.width(), self.height(), longer);
        if (width, height) == self.rgb.dimensions() {
            return self.clone();
        }
        let linear = self.linear(width, height);
        let mut rgb = RgbImage::new(width, height);
        for (p, v) in rgb.pixels_mut().zip(&linear.rgb) {
            p.0 = v.map(crate::vision::pictures::color::linear_to_byte);
        }
        Photo { rgb, focal_35mm: self.focal_35mm }
    }
}

/// Reads a photograph from a PNG or JPEG file.
pub fn load(path: &Path, limits: &Limits) -> Result<Photo, VisionError> {
    decode(&read_bytes(path, limits.max_bytes())?, limits).map_err(|e| e.in_file(path))
}

/// Reads a photograph from the bytes of a PNG or JPEG file.
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Photo, VisionError> {
    let (picture, focal_35mm) = decode_dynamic(bytes, limits)?;
    Ok(Photo { rgb: over_white(picture), focal_35mm })
}

/// Decodes a picture, upright, in the file's own pixel format, and the camera's focal
/// length.
pub(crate) fn decode_dynamic(
    bytes: &[u8],
    limits: &Limits,
) -> Result<(DynamicImage, Option<f64>), VisionError> {
    let format = format_of(bytes)?;
    // A PNG begins with its size; check it first, because the decoder may fail on an
    // absurd one before it reports the size.
    if let (ImageFormat::Png, Some(&[w0, w1, w2, w3, h0, h1, h2, h3])) = (format, bytes.get(16..24))
    {
        limits.check(u32::from_be_bytes([w0, w1, w2, w3]), u32::from_be_bytes([h0, h1, h2, h3]))?;
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut allowed = image::Limits::no_limits();
    allowed.max_alloc = Some(limits.max_bytes());
    reader.limits(allowed);
    let mut decoder = reader.into_decoder().map_err(cause)?;
    let (width, height) = decoder.dimensions();
    limits.check(width, height)?;
    if format == ImageFormat::Jpeg && !jpeg_ends(bytes) {
        return Err(VisionError::Truncated);
    }
    // Damaged metadata count as missing.
    let orientation = decoder.orientation().unwrap_or(image::metadata::Orientation::NoTransforms);
    let focal = decoder.exif_metadata().ok().flatten().and_then(|chunk| exif::focal_35mm(&chunk));
    let mut picture = DynamicImage::from_decoder(decoder).map_err(cause)?;
    picture.apply_orientation(orientation);
    Ok((picture, focal))
}

fn format_of(bytes: &[u8]) -> Result<ImageFormat, VisionError> {
    const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
    if bytes.is_empty() {
        Err(VisionError::Empty)
    } else if bytes.starts_with(PNG) {
        Ok(ImageFormat::Png)
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        Ok(ImageFormat::Jpeg)
    } else if PNG.starts_with(bytes) || b"\xff\xd8\xff".starts_with(bytes) {
        Err(VisionError::Truncated)
    } else {
        Err(VisionError::NotAnImage(match bytes {
            [b'G', b'I', b'F', b'8', ..] => " (it is a GIF)",
            [b'B', b'M', ..] => " (it looks like a BMP)",
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => " (it is a WebP)",
            [b'I', b'I', 0x2a, 0, ..] | [b'M', b'M', 0, 0x2a, ..] => " (it is a TIFF)",
            [_, _, _, _, b'f', b't', b'y', b'p', ..] => " (it is a HEIF, AVIF or video file)",
            _ if std::str::from_utf8(bytes).is_ok() => " (it is text)",
            _ => "",
        }))
    }
}

/// Whether a JPEG file has an end marker after the start of its first scan (thumbnails in
/// the metadata have theirs before). The decoder silently fills missing data with grey.
fn jpeg_ends(bytes: &[u8]) -> bool {
    let mut at = 2;
    loop {
        match bytes.get(at..at + 4) {
            Some([0xff, 0xff, ..]) => at += 1,
            Some([0xff, 0xda, ..]) => {
                return bytes
                    .get(at..)
                    .is_some_and(|rest| rest.windows(2).any(|w| w == [0xff, 0xd9]));
            }
            Some([0xff, 0x01 | 0xd0..=0xd8, ..]) => at += 2,
            Some([0xff, _, high, low]) => at += 2 + usize::from(*high) * 256 + usize::from(*low),
            _ => return false,
        }
    }
}

fn cause(error: ImageError) -> VisionError {
    match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            VisionError::Truncated
        }
        ImageError::IoError(e) => VisionError::Io(e),
        ImageError::Limits(_) => {
            VisionError::Damaged("it needs more memory than any picture of permitted size".into())
        }
        other => {
            let text = other.to_string();
            let lower = text.to_ascii_lowercase();
            match ["unexpected end", "end of file", "eof", "exhausted", "no more bytes"]
                .iter()
                .any(|s| lower.contains(s))
            {
                true => VisionError::Truncated,
                false => VisionError::Damaged(text),
            }
        }
    }
}

fn over_white(picture: DynamicImage) -> RgbImage {
    match picture {
        DynamicImage::ImageRgb8(rgb) => rgb,
        p @ (DynamicImage::ImageLumaA8(_) | DynamicImage::ImageRgba8(_)) => {
            let rgba = p.into_rgba8();
            let over = |v: u8, a: u8| {
                let (v, a) = (u32::from(v), u32::from(a));
                ((v * a + 255 * (255 - a) + 127) / 255) as u8
            };
            let mut rgb = RgbImage::new(rgba.width(), rgba.height());
            for (to, from) in rgb.pixels_mut().zip(rgba.pixels()) {
                let [r, g, b, a] = from.0;
                to.0 = [over(r, a), over(g, a), over(b, a)];
            }
            rgb
        }
        p @ (DynamicImage::ImageLumaA16(_) | DynamicImage::ImageRgba16(_)) => {
            let rgba = p.into_rgba16();
            let over = |v: u16, a: u16| {
                let (v, a) = (u64::from(v), u64::from(a));
                let most = 65535 * 65535;
                ((255 * (v * a + 65535 * (65535 - a)) + most / 2) / most) as u8
            };
            let mut rgb = RgbImage::new(rgba.width(), rgba.height());
            for (to, from) in rgb.pixels_mut().zip(rgba.pixels()) {
                let [r, g, b, a] = from.0;
                to.0 = [over(r, a), over(g, a), over(b, a)];
            }
            rgb
        }
        other => other.into_rgb8(),
    }
}

#[cfg(test)]
#[path = "photo_tests.rs"]
mod tests;
