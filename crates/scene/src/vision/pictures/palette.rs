//! The entries of pictures with a palette: in masks they are labels, whose colours mean nothing.

use super::photo::{Limits, is_png};
use crate::vision::error::VisionError;
use std::io::Cursor;

/// Returns width, height and the entries of a PNG with a palette, in row-major order; `None` for
/// other pictures, and those whose palette has transparent colours: they are cut out.
///
/// # Errors
/// If the picture is larger than the limits, or damaged.
pub(crate) fn palette_entries(
    bytes: &[u8],
    limits: &Limits,
) -> Result<Option<(u32, u32, Vec<u8>)>, VisionError> {
    let damaged = |e: png::DecodingError| VisionError::Damaged(e.to_string());
    if !is_png(bytes) {
        return Ok(None);
    }
    let within = png::Limits { bytes: usize::try_from(limits.max_bytes()).unwrap_or(usize::MAX) };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), within);
    decoder.set_transformations(png::Transformations::IDENTITY);
    let Ok(mut reader) = decoder.read_info() else {
        // What is wrong is said by those that read any picture.
        return Ok(None);
    };
    let (width, height) = reader.info().size();
    if reader.info().color_type != png::ColorType::Indexed || reader.info().trns.is_some() {
        return Ok(None);
    }
    limits.check(width, height)?;
    let size = reader.output_buffer_size().ok_or(VisionError::Truncated)?;
    let mut packed = vec![0; size];
    let frame = reader.next_frame(&mut packed).map_err(damaged)?;
    // An entry takes 1, 2, 4 or 8 bits; a row begins with a byte.
    let bits = frame.bit_depth as usize;
    let entry = |row: &[u8], x: usize| {
        let shift = 8 - bits - (x * bits) % 8;
        let byte = row.get(x * bits / 8).copied().unwrap_or(0);
        (byte >> shift) & (0xff >> (8 - bits))
    };
    let rows = packed.chunks_exact(frame.line_size.max(1)).take(height as usize);
    let entries = rows.flat_map(|row| (0..width as usize).map(move |x| entry(row, x))).collect();
    Ok(Some((width, height, entries)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_of_every_depth() {
        let entries: Vec<u8> = vec![0, 1, 1, 0, 1, 0, 0, 1, 1];
        for (depth, bits) in [
            (png::BitDepth::One, 1),
            (png::BitDepth::Two, 2),
            (png::BitDepth::Four, 4),
            (png::BitDepth::Eight, 8),
        ] {
            let mut row = vec![0u8; (9 * bits as usize).div_ceil(8)];
            for (x, e) in entries.iter().enumerate() {
                row[x * bits as usize / 8] |= e << (8 - bits - (x as u32 * bits) % 8);
            }
            let mut file = Vec::new();
            let mut encoder = png::Encoder::new(&mut file, 9, 1);
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_depth(depth);
            encoder.set_palette(vec![0, 0, 0, 128, 0, 0]);
            encoder.write_header().unwrap().write_image_data(&row).unwrap();
            let read = palette_entries(&file, &Limits::default()).unwrap();
            assert_eq!(read, Some((9, 1, entries.clone())), "{bits} bits");
            // A dark red is on the object, by its entry.
            let mask = crate::vision::mask::decode(&file, None, &Limits::default()).unwrap();
            let on: Vec<bool> = entries.iter().map(|e| *e == 1).collect();
            assert_eq!(mask.data(), on);
        }
    }

    #[test]
    fn void_is_not_the_object() {
        let file = |entries: &[u8]| {
            let mut file = Vec::new();
            let mut encoder = png::Encoder::new(&mut file, entries.len() as u32, 1);
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_palette(vec![0; 3 * 256]);
            encoder.write_header().unwrap().write_image_data(entries).unwrap();
            file
        };
        let limits = Limits::default();
        let read = |bytes: &[u8], label| {
            crate::vision::mask::decode(bytes, label, &limits).unwrap().data().to_vec()
        };
        let voc = file(&[0, 15, 255, 3]);
        assert_eq!(read(&voc, None), [false, true, false, true]);
        assert_eq!(read(&voc, Some(3)), [false, false, false, true]);
        assert_eq!(read(&file(&[0, 255]), None), [false, true]);
        // The first colour is opaque, the second one transparent.
        let mut cut = Vec::new();
        let mut encoder = png::Encoder::new(&mut cut, 2, 1);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(vec![9; 6]);
        encoder.set_trns(vec![255, 0]);
        encoder.write_header().unwrap().write_image_data(&[0, 1]).unwrap();
        assert_eq!(read(&cut, None), [true, false]);
        assert!(palette_entries(b"no picture", &limits).unwrap().is_none());
    }
}
