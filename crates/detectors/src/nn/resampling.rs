//! Operators that resize images without weights: padding, pooling, interpolation, depth
//! to space.

use super::shape::{Size, Window};

/// Copies an image into a larger one, offset by `before` rows, columns and channels; the
/// rest is `value`.
pub(super) fn pad(
    input: &[f32],
    from: Size,
    to: Size,
    before: [usize; 3],
    value: f32,
    out: &mut [f32],
) {
    out.fill(value);
    for row in 0..from.height {
        for column in 0..from.width {
            let pixel = to.pixel_mut(out, row + before[0], column + before[1]);
            pixel[before[2]..before[2] + from.channels]
                .copy_from_slice(from.pixel(input, row, column));
        }
    }
}

/// Computes the maximum in each window, or the mean of the values inside the image.
pub(super) fn pool(
    input: &[f32],
    from: Size,
    to: Size,
    window: &Window,
    largest: bool,
    out: &mut [f32],
) {
    let before = window.before(from, to);
    for row in 0..to.height {
        for column in 0..to.width {
            let (pixel, mut count) = (to.pixel_mut(out, row, column), 0u16);
            pixel.fill(if largest { f32::MIN } else { 0.0 });
            window.each(from, before, (row, column), |_, _, y, x| {
                count += 1;
                let values = pixel.iter_mut().zip(from.pixel(input, y, x));
                values.for_each(|(p, v)| *p = if largest { p.max(*v) } else { *p + v });
            });
            if !largest {
                pixel.iter_mut().for_each(|p| *p /= f32::from(count.max(1)));
            }
        }
    }
}

/// Computes the mean of each channel.
pub(super) fn mean(input: &[f32], from: Size, out: &mut [f32]) {
    out.fill(0.0);
    for pixel in input.chunks_exact(from.channels) {
        out.iter_mut().zip(pixel).for_each(|(o, p)| *o += p);
    }
    let count = (from.height * from.width) as f32;
    out.iter_mut().for_each(|o| *o /= count);
}

/// The alignment of output pixels with input pixels.
#[derive(Clone, Copy, Debug)]
pub(super) enum Alignment {
    /// The centres of the first pixels coincide.
    First,
    /// The centres of the first and of the last pixels coincide.
    Corners,
    /// The outlines of the images coincide.
    HalfPixels,
}

impl Alignment {
    /// Returns the two input pixels around an output pixel, and its distance from the
    /// first.
    fn between(self, i: usize, from: usize, to: usize) -> (usize, usize, f32) {
        let scale = match self {
            Alignment::Corners if to > 1 => (from - 1) as f32 / (to - 1) as f32,
            _ => from as f32 / to as f32,
        };
        let x = match self {
            Alignment::HalfPixels => (i as f32 + 0.5) * scale - 0.5,
            _ => i as f32 * scale,
        };
        let low = (x.floor().max(0.0) as usize).min(from - 1);
        (low, (x.ceil().max(0.0) as usize).min(from - 1), x - low as f32)
    }
}

/// Interpolates bilinearly.
pub(super) fn resize(input: &[f32], from: Size, to: Size, alignment: Alignment, out: &mut [f32]) {
    for row in 0..to.height {
        let (top, bottom, fy) = alignment.between(row, from.height, to.height);
        for column in 0..to.width {
            let (left, right, fx) = alignment.between(column, from.width, to.width);
            let (a, b) = (from.pixel(input, top, left), from.pixel(input, top, right));
            let (c, d) = (from.pixel(input, bottom, left), from.pixel(input, bottom, right));
            for (j, o) in to.pixel_mut(out, row, column).iter_mut().enumerate() {
                let (ab, cd) = (a[j] * (1.0 - fx) + b[j] * fx, c[j] * (1.0 - fx) + d[j] * fx);
                *o = ab * (1.0 - fy) + cd * fy;
            }
        }
    }
}

/// Lays out the channels of each pixel as a block of `side` x `side` pixels.
pub(super) fn depth_to_space(input: &[f32], from: Size, to: Size, side: usize, out: &mut [f32]) {
    for row in 0..from.height {
        for column in 0..from.width {
            let parts = from.pixel(input, row, column).chunks_exact(to.channels);
            for (i, part) in parts.enumerate() {
                to.pixel_mut(out, row * side + i / side, column * side + i % side)
                    .copy_from_slice(part);
            }
        }
    }
}
