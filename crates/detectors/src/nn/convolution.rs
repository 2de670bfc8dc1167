//! Convolutions as matrix products: a row for each output pixel, a column for each
//! channel.
//!
//! Sums are taken in the order of the weights, with multiplication and addition rounded
//! separately, so the bits do not depend on the width of the processor's instructions.

use super::shape::{Clip, Size, Window};
use super::weights::{DEEP, Weights};
use core::ops::Range;
use pcadlang_numerics::num::simd::vectorised;

/// The number of columns that are summed together, and of rows; of narrow convolutions, which
/// have no more channels than the latter, the reverse.
pub(super) const WIDE: usize = 16;
const NARROW: usize = 8;
pub(super) const ROWS: [usize; 2] = [4, 8];

/// The number of values in the parts of rows that are summed before the next ones: they stay in
/// the second cache while all panels pass.
pub(super) const VALUES: usize = 1 << 17;

/// A convolution with its weights and biases.
#[derive(Debug)]
pub(super) struct Convolution<'a> {
    pub window: Window,
    pub(super) channels: usize,
    /// The number of weights per channel: window rows x window columns x input channels.
    depth: usize,
    pub(super) weights: Weights<'a>,
    /// Padded with zeros to whole panels.
    pub(super) biases: Vec<f32>,
    /// Negative results are multiplied by this, from 0 to 1.
    pub(super) slope: f32,
    pub(super) clip: Clip,
}

impl<'a> Convolution<'a> {
    /// Takes `depth` weights and a bias for each output channel.
    pub fn new(
        window: Window,
        (weights, depth): (Weights<'a>, usize),
        biases: &[f32],
        clip: Clip,
    ) -> Convolution<'a> {
        let channels = biases.len();
        let mut padded = biases.to_vec();
        padded.resize(channels.next_multiple_of(WIDE), 0.0);
        Convolution { window, channels, depth, weights, biases: padded, slope: 1.0, clip }
    }

    /// Adds to the biases, if there is one for each channel and nothing is done to the
    /// results; returns whether it did.
    pub fn add_biases(&mut self, more: &[f32]) -> bool {
        let is_plain = self.is_linear() && more.len() == self.channels;
        if is_plain {
            self.biases.iter_mut().zip(more).for_each(|(b, m)| *b += m);
        }
        is_plain
    }

    /// Multiplies negative results by `slope`, if nothing else is done to the results;
    /// returns whether it does.
    pub fn make_leaky(&mut self, slope: f32) -> bool {
        let is_plain = self.is_linear();
        if is_plain {
            self.slope = slope;
        }
        is_plain
    }

    fn is_linear(&self) -> bool {
        self.slope == 1.0 && self.clip == Clip::NONE
    }

    /// The number of elements that [`Convolution::run`] needs for parts of the image.
    pub fn memory(&self, from: Size, to: Size) -> usize {
        match (self.is_tiled(from), self.takes_pixels(from, to)) {
            (true, _) => self.tiling(from, to).size(),
            (_, true) => 0,
            _ => self.pixels().min(to.pixels()) * self.depth.min(DEEP),
        }
    }

    /// The number of pixels that are computed together.
    fn pixels(&self) -> usize {
        VALUES / self.depth.clamp(1, DEEP)
    }

    /// True if each pixel is a row to multiply.
    fn takes_pixels(&self, from: Size, to: Size) -> bool {
        self.window.is_pixel() && from.pixels() == to.pixels()
    }

    /// Fills `out`; `patches` is memory for parts of the image.
    pub fn run(&self, input: &[f32], from: Size, to: Size, patches: &mut [f32], out: &mut [f32]) {
        if self.is_tiled(from) {
            return self.run_tiled(input, from, to, patches, out);
        }
        let before = self.window.before(from, to);
        let (pixels, takes_pixels) = (self.pixels(), self.takes_pixels(from, to));
        for (i, out) in out.chunks_mut(pixels * self.channels).enumerate() {
            let (first, count) = (i * pixels, out.len() / self.channels);
            for start in (0..self.depth).step_by(DEEP) {
                let part = start..(start + DEEP).min(self.depth);
                if takes_pixels {
                    let rows = &input[first * self.depth..][..count * self.depth];
                    self.product(Rows { values: rows, depth: self.depth, at: start }, part, out);
                    continue;
                }
                let patches = &mut patches[..count * part.len()];
                for (j, patch) in patches.chunks_exact_mut(part.len()).enumerate() {
                    let place = ((first + j) / to.width, (first + j) % to.width);
                    self.window.copy(input, from, before, place, start, patch);
                }
                self.product(Rows { values: patches, depth: part.len(), at: 0 }, part, out);
            }
        }
    }

    /// Adds the products of rows with a part of the weights of all channels.
    fn product(&self, rows: Rows, part: Range<usize>, out: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || match self.channels <= NARROW {
                true => self.panels::<NARROW, { ROWS[1] }>(rows, part, out),
                false => self.panels::<WIDE, { ROWS[0] }>(rows, part, out),
            },
        );
    }

    /// The same by panels of `P` channels, `R` rows at a time.
    #[inline(always)]
    fn panels<const P: usize, const R: usize>(
        &self,
        rows: Rows,
        part: Range<usize>,
        out: &mut [f32],
    ) {
        let mut weights = [[0.0; P]; DEEP];
        let weights = &mut weights[..part.len()];
        for first in (0..self.channels).step_by(P) {
            let panel = (first, self.channels);
            self.weights.panel((part.start, self.depth), panel, weights);
            let width = P.min(self.channels - first);
            let groups = rows.values.chunks(R * rows.depth);
            for (group, out) in groups.zip(out.chunks_mut(R * self.channels)) {
                // If there are fewer rows, the last one is summed more than once.
                let last = group.len() / rows.depth - 1;
                let row = |r: usize| &group[r.min(last) * rows.depth + rows.at..][..part.len()];
                let mut sums = [[0f32; P]; R];
                for (r, sums) in sums[..=last].iter_mut().enumerate() {
                    if part.start == 0 {
                        sums.copy_from_slice(&self.biases[first..first + P]);
                    } else {
                        sums[..width].copy_from_slice(&out[r * self.channels + first..][..width]);
                    }
                }
                let mut sums = add_products(sums, weights, core::array::from_fn(row));
                for (r, sums) in sums[..=last].iter_mut().enumerate() {
                    if part.end == self.depth {
                        let Clip { lo, hi } = self.clip;
                        sums.iter_mut().for_each(|s| *s = s.max(self.slope * *s).max(lo).min(hi));
                    }
                    out[r * self.channels + first..][..width].copy_from_slice(&sums[..width]);
                }
            }
        }
    }
}

/// Rows of `depth` values, whose part from `at` on is multiplied.
#[derive(Clone, Copy)]
struct Rows<'a> {
    values: &'a [f32],
    depth: usize,
    at: usize,
}

/// Adds the products of rows and columns to sums, which stay in registers.
#[inline(always)]
pub(super) fn add_products<const P: usize, const R: usize>(
    mut sums: [[f32; P]; R],
    weights: &[[f32; P]],
    rows: [&[f32]; R],
) -> [[f32; P]; R] {
    let rows = rows.map(|row| &row[..weights.len()]);
    for (k, weights) in weights.iter().enumerate() {
        for r in 0..R {
            let x = rows[r][k];
            for j in 0..P {
                sums[r][j] += x * weights[j];
            }
        }
    }
    sums
}
