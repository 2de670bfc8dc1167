//! Photographs: reading PNG and JPEG files (8 or 16 bit, grey, palette, colour, alpha)
//! and shrinking them in linear light. This is not a general picture reader. A [`Photo`]
//! is upright (Exif orientation applied), is opaque (alpha composited over white in sRGB
//! values, as viewers do) and has at least one pixel.

use super::exif;
use crate::vision::error::VisionError;
use crate::vision::pictures::color::{linear_table, linear_to_byte, linear_to_srgb};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, RgbImage};
use std::io::Cursor;

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

    /// The maximum number of bytes to decode: 16 per pixel, more than any supported format
    /// needs uncompressed.
    pub(crate) fn max_bytes(&self) -> u64 {
        self.max_pixels.saturating_mul(16).saturating_add(1 << 20)
    }
}

/// An upright, opaque photograph in sRGB bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    rgb: RgbImage,
    focal: Option<f64>,
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
        Ok(Photo { rgb, focal: None })
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

    /// The focal length that the camera recorded, in longer sides of the picture; `None` also if
    /// the picture was cropped.
    pub fn focal(&self) -> Option<f64> {
        self.focal
    }

    /// Returns the picture in linear light at `width` x `height` pixels, area-averaged.
    pub fn linear(&self, width: u32, height: u32) -> LinearImage {
        let table = linear_table();
        let stride = 3 * self.rgb.width() as usize;
        let bytes = self.rgb.as_raw();
        let rgb = resize_rows(self.rgb.dimensions(), (width, height), |j, row| {
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
        let (width, height) = fitted(self.width(), self.height(), longer);
        if (width, height) == self.rgb.dimensions() {
            return self.clone();
        }
        let linear = self.linear(width, height);
        let mut rgb = RgbImage::new(width, height);
        for (p, v) in rgb.pixels_mut().zip(&linear.rgb) {
            p.0 = v.map(linear_to_byte);
        }
        Photo { rgb, focal: self.focal }
    }
}

/// Reads a photograph from the bytes of a PNG or JPEG file.
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Photo, VisionError> {
    let (picture, focal) = decode_dynamic(bytes, limits)?;
    Ok(Photo { rgb: over_white(picture), focal })
}

/// Decodes a picture, upright, in the file's own pixel format, and the camera's focal
/// length in longer sides.
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
    let chunk = decoder.exif_metadata().ok().flatten();
    let focal = chunk.and_then(|chunk| exif::focal(&chunk, (width, height)));
    let mut picture = DynamicImage::from_decoder(decoder).map_err(cause)?;
    picture.apply_orientation(orientation);
    Ok((picture, focal))
}

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// True if bytes begin as those of a PNG do.
pub(crate) fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(PNG)
}

fn format_of(bytes: &[u8]) -> Result<ImageFormat, VisionError> {
    if bytes.is_empty() {
        Err(VisionError::Empty)
    } else if is_png(bytes) {
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

/// True if a JPEG file has an end marker after the start of its first scan (thumbnails in
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

// Area-averaged resizing: every target pixel is the mean of the source over the rectangle it
// covers, so the overall mean is preserved. It is not meant for enlarging: enlarged pixels
// become blocks.

/// The source pixels `first..` that each target pixel covers along one axis, with weights
/// that sum to 1.
fn spans(from: u32, to: u32) -> Vec<(usize, Vec<f64>)> {
    let ratio = f64::from(from) / f64::from(to);
    (0..to)
        .map(|i| {
            // Span ends are exact where they fall on pixel borders.
            let end = |k: u32| (u64::from(k) * u64::from(from)) as f64 / f64::from(to);
            let (a, b) = (end(i), end(i + 1));
            let first = a.floor() as usize;
            let last = (b.ceil() as usize).clamp(first + 1, from as usize);
            let weights = (first..last)
                .map(|s| ((b.min((s + 1) as f64) - a.max(s as f64)) / ratio).max(0.0))
                .collect();
            (first, weights)
        })
        .collect()
}

/// Resizes a picture by area averaging, reading its rows on demand: `row(j, buffer)`
/// fills row `j` (of `width` pixels). A side of 0 gives an empty picture.
pub fn resize_rows<const N: usize>(
    (width, height): (u32, u32),
    (to_width, to_height): (u32, u32),
    mut row: impl FnMut(u32, &mut [[f32; N]]),
) -> Vec<[f32; N]> {
    if width == 0 || height == 0 || to_width == 0 || to_height == 0 {
        return Vec::new();
    }
    let columns = spans(width, to_width);
    let mut source = vec![[0.0f32; N]; width as usize];
    let mut narrow = vec![[0.0f64; N]; to_width as usize];
    let mut read = None;
    let mut out = Vec::with_capacity(to_width as usize * to_height as usize);
    for (first, weights) in spans(height, to_height) {
        let mut sum = vec![[0.0f64; N]; to_width as usize];
        for (k, &wy) in weights.iter().enumerate() {
            if read != Some(first + k) {
                row((first + k) as u32, &mut source);
                read = Some(first + k);
                for (n, (x0, wx)) in narrow.iter_mut().zip(&columns) {
                    *n = [0.0; N];
                    for (p, w) in source.iter().skip(*x0).zip(wx) {
                        for c in 0..N {
                            n[c] += w * f64::from(p[c]);
                        }
                    }
                }
            }
            for (s, n) in sum.iter_mut().zip(&narrow) {
                for c in 0..N {
                    s[c] += wy * n[c];
                }
            }
        }
        out.extend(sum.into_iter().map(|s| s.map(|v| v as f32)));
    }
    out
}

/// Returns the size with the same aspect ratio whose longer side is at most `longer` (at
/// least 1); never larger than the original.
pub fn fitted(width: u32, height: u32, longer: u32) -> (u32, u32) {
    let (side, longer) = (width.max(height), longer.max(1));
    if side <= longer {
        return (width, height);
    }
    let scale = |v: u32| {
        ((u64::from(v) * u64::from(longer) + u64::from(side) / 2) / u64::from(side))
            .clamp(1, u64::from(longer)) as u32
    };
    (scale(width), scale(height))
}

#[cfg(test)]
#[path = "photo_tests.rs"]
mod tests;
