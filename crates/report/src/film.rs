//! Films as animated PNG files (W3C, Portable Network Graphics, third edition, section
//! 11.3.6.1), which browsers play like any picture.

use image::{Rgb, RgbImage};
use png::{BitDepth, BlendOp, ColorType, DisposeOp, Encoder, EncodingError};

/// A picture of a film.
#[derive(Clone, Debug)]
pub struct FilmFrame {
    /// The picture; all pictures of a film have the same size.
    pub picture: RgbImage,
    /// How long it is shown, in milliseconds.
    pub milliseconds: u16,
}

/// Returns a film as an animated PNG file that plays again and again. Of each picture only
/// what differs from the one before is stored. A program that does not play it shows `still`;
/// the film itself does not.
///
/// # Errors
/// If there are no pictures, or they differ in size.
pub fn apng(frames: &[FilmFrame], still: &RgbImage) -> Result<Vec<u8>, String> {
    let first = frames.first().ok_or("a film needs at least one picture")?;
    let (width, height) = first.picture.dimensions();
    let pictures = frames.iter().map(|f| &f.picture).chain([still]);
    if pictures.into_iter().any(|p| p.dimensions() != (width, height)) {
        return Err("the pictures of a film have one size".to_owned());
    }
    let mut bytes = Vec::new();
    encode(&mut bytes, frames, still).map_err(|e| e.to_string())?;
    Ok(bytes)
}

fn encode(out: &mut Vec<u8>, frames: &[FilmFrame], still: &RgbImage) -> Result<(), EncodingError> {
    let (width, height) = still.dimensions();
    let mut encoder = Encoder::new(out, width, height);
    encoder.set_color(ColorType::Rgba);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_animated(frames.len() as u32, 0)?;
    encoder.set_sep_def_img(true)?;
    let mut writer = encoder.write_header()?;
    let opaque = still.pixels().flat_map(|p| [p[0], p[1], p[2], 255]);
    writer.write_image_data(&opaque.collect::<Vec<u8>>())?;
    let mut before: Option<&RgbImage> = None;
    for frame in frames {
        let (left, top, w, h) =
            before.map_or((0, 0, width, height), |b| changed(b, &frame.picture));
        writer.set_frame_delay(frame.milliseconds, 1000)?;
        writer.reset_frame_position()?;
        writer.set_frame_dimension(w, h)?;
        writer.set_frame_position(left, top)?;
        writer.set_dispose_op(DisposeOp::None)?;
        writer.set_blend_op(if before.is_some() { BlendOp::Over } else { BlendOp::Source })?;
        let mut data = Vec::with_capacity(4 * (w * h) as usize);
        for y in top..top + h {
            for x in left..left + w {
                let Rgb([r, g, b]) = *frame.picture.get_pixel(x, y);
                // What has not changed stays: it is left transparent.
                let same = before.is_some_and(|p| p.get_pixel(x, y).0 == [r, g, b]);
                data.extend(if same { [0; 4] } else { [r, g, b, 255] });
            }
        }
        writer.write_image_data(&data)?;
        before = Some(&frame.picture);
    }
    writer.finish()
}

/// Returns the rectangle of the pixels that differ: left, top, width, height; one pixel if
/// none do.
fn changed(a: &RgbImage, b: &RgbImage) -> (u32, u32, u32, u32) {
    let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
    for ((x, y, p), q) in a.enumerate_pixels().zip(b.pixels()) {
        if p != q {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
    }
    match low[0] <= high[0] {
        true => (low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1),
        false => (0, 0, 1, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(at: u32) -> FilmFrame {
        let picture = RgbImage::from_fn(40, 30, |x, y| {
            let on = (at..at + 5).contains(&x) && (10..15).contains(&y);
            Rgb(if on { [250, 10, 20] } else { [x as u8, y as u8, 90] })
        });
        FilmFrame { picture, milliseconds: 80 }
    }

    #[test]
    fn every_picture_comes_back() {
        let frames = [frame(3), frame(8), frame(8), frame(30)];
        let bytes = apng(&frames, &frame(20).picture).unwrap();
        let decoder = png::Decoder::new(std::io::Cursor::new(&bytes));
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 4);
        let mut still = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut still).unwrap();
        assert!(reader.info().frame_control().is_none());
        let seen = RgbImage::from_fn(40, 30, |x, y| {
            let at = 4 * (y * 40 + x) as usize;
            Rgb([still[at], still[at + 1], still[at + 2]])
        });
        assert_eq!(seen, frame(20).picture);
        let mut shown = RgbImage::new(40, 30);
        for f in &frames {
            let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut buffer).unwrap();
            let control = *reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), (80, 1000));
            for y in 0..info.height {
                for x in 0..info.width {
                    let at = 4 * (y * info.width + x) as usize;
                    if buffer[at + 3] == 255 {
                        let pixel = Rgb([buffer[at], buffer[at + 1], buffer[at + 2]]);
                        shown.put_pixel(control.x_offset + x, control.y_offset + y, pixel);
                    }
                }
            }
            assert_eq!(shown, f.picture);
        }
        let whole: usize = 5 * 40 * 30 * 4;
        assert!(bytes.len() < whole / 4, "{} bytes", bytes.len());
    }

    #[test]
    fn films_without_pictures_or_of_two_sizes_are_errors() {
        let still = frame(0).picture;
        assert!(apng(&[], &still).is_err() && apng(&[frame(0)], &RgbImage::new(2, 2)).is_err());
        let other = FilmFrame { picture: RgbImage::new(2, 2), milliseconds: 1 };
        assert!(apng(&[frame(0), other], &still).is_err());
    }
}
