//! Convolutions that treat each channel separately.

use super::shape::{Clip, Size, Window};
use pcadlang_numerics::num::simd::vectorised;

/// The numbers of channels that are summed together, and of pixels.
const LANES: [usize; 2] = [16, 8];
const PIXELS: usize = 4;

/// A convolution that treats each channel separately.
#[derive(Debug)]
pub(super) struct Depthwise {
    pub window: Window,
    /// By row and column of the window, a weight for each channel.
    pub weights: Vec<f32>,
    pub biases: Vec<f32>,
    pub clip: Clip,
}

impl Depthwise {
    pub fn run(&self, input: &[f32], from: Size, to: Size, out: &mut [f32]) {
        let before = self.window.before(from, to);
        vectorised(
            #[inline(always)]
            || {
                for (row, out) in out.chunks_exact_mut(to.width * to.channels).enumerate() {
                    self.row(input, from, before, row, out);
                }
            },
        );
    }

    /// Fills a row of the output.
    #[inline(always)]
    fn row(&self, input: &[f32], from: Size, before: [usize; 2], row: usize, out: &mut [f32]) {
        let ([_, width], [_, stride]) = (self.window.size, self.window.stride);
        let channels = from.channels;
        // Columns whose windows lie inside the image.
        let count = out.len() / channels;
        let first = before[1].div_ceil(stride).min(count);
        let end = (from.width + before[1]).checked_sub(width).map_or(0, |n| n / stride + 1);
        let end = end.clamp(first, count);
        let in_lanes = channels / LANES[1] * LANES[1];
        let mut column = first;
        while column < end {
            let (place, out) = ((row, column), &mut out[column * channels..]);
            column += match end - column {
                PIXELS.. => self.pixels::<PIXELS>(input, from, before, place, out),
                _ => self.pixels::<1>(input, from, before, place, out),
            };
        }
        // What does not fill lanes, and what windows beyond the image's sides see.
        for column in 0..count {
            let inside = (first..end).contains(&column);
            let from_channel = if inside { in_lanes } else { 0 };
            if from_channel == channels {
                continue;
            }
            let sums = &mut out[column * channels + from_channel..(column + 1) * channels];
            sums.copy_from_slice(&self.biases[from_channel..]);
            self.window.each(from, before, (row, column), |ky, kx, y, x| {
                let weights = &self.weights[(ky * width + kx) * channels + from_channel..];
                let values = &from.pixel(input, y, x)[from_channel..];
                add(sums, values, weights);
            });
            sums.iter_mut().for_each(|s| *s = s.max(self.clip.lo).min(self.clip.hi));
        }
    }

    /// Fills `N` pixels from `(row, column)` on, whose windows lie inside the image's columns,
    /// except channels that do not fill lanes; returns `N`.
    #[inline(always)]
    fn pixels<const N: usize>(
        &self,
        input: &[f32],
        from: Size,
        before: [usize; 2],
        place: (usize, usize),
        out: &mut [f32],
    ) -> usize {
        let mut c = 0;
        while c + LANES[0] <= from.channels {
            self.group::<N, { LANES[0] }>(input, from, before, place, c, out);
            c += LANES[0];
        }
        if c + LANES[1] <= from.channels {
            self.group::<N, { LANES[1] }>(input, from, before, place, c, out);
        }
        N
    }

    /// Fills `L` channels from `c` on of such pixels.
    #[inline(always)]
    fn group<const N: usize, const L: usize>(
        &self,
        input: &[f32],
        from: Size,
        before: [usize; 2],
        (row, column): (usize, usize),
        c: usize,
        out: &mut [f32],
    ) {
        let (channels, step) = (from.channels, self.window.stride[1] * from.channels);
        let left = (column * self.window.stride[1] - before[1]) * channels + c;
        let mut sums = [[0.0; L]; N];
        sums.iter_mut().for_each(|s| s.copy_from_slice(&self.biases[c..c + L]));
        for (ky, y) in self.window.rows(from, before[0], row) {
            let line = &input[y * from.width * channels + left..];
            let weights = &self.weights[ky * self.window.size[1] * channels + c..];
            for kx in 0..self.window.size[1] {
                let Some(weights) = weights[kx * channels..].first_chunk() else { return };
                let line = &line[kx * channels..][..(N - 1) * step + L];
                for (p, sums) in sums.iter_mut().enumerate() {
                    let Some(values) = line[p * step..].first_chunk() else { return };
                    *sums = add_products(*sums, values, weights);
                }
            }
        }
        for (p, sums) in sums.iter().enumerate() {
            let out = &mut out[p * channels + c..][..L];
            (0..L).for_each(|j| out[j] = sums[j].max(self.clip.lo).min(self.clip.hi));
        }
    }
}

#[inline(always)]
fn add_products<const L: usize>(
    mut sums: [f32; L],
    values: &[f32; L],
    weights: &[f32; L],
) -> [f32; L] {
    for j in 0..L {
        sums[j] += values[j] * weights[j];
    }
    sums
}

#[inline(always)]
fn add(sums: &mut [f32], values: &[f32], weights: &[f32]) {
    sums.iter_mut().zip(values).zip(weights).for_each(|((s, v), w)| *s += v * w);
}
