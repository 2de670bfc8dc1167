//! Convolutions as matrix products: a row for each output pixel, a column for each
//! channel.
//!
//! Sums are taken in the order of the weights, with multiplication and addition rounded
//! separately, so the bits do not depend on the width of the processor's instructions.

use super::shape::{Clip, Size, Window};
use pcadlang_numerics::num::simd::vectorised;

/// The number of columns in a panel of weights, which are summed together.
const PANEL: usize = 16;

/// The number of rows summed together.
const ROWS: usize = 4;

/// The number of weights per column that are summed before the next panel, so that they and
/// the rows stay in the nearest cache.
const DEEP: usize = 256;

/// The number of values in the rows that are summed before the next ones: they stay in the
/// second cache while all panels pass.
const VALUES: usize = 1 << 17;

/// A convolution with its weights and biases.
#[derive(Debug)]
pub(super) struct Convolution {
    pub window: Window,
    channels: usize,
    /// The number of weights per channel: window rows x window columns x input channels.
    depth: usize,
    /// By panel: a row of [`PANEL`] weights for each of `depth`. Like the biases, padded
    /// with zeros.
    panels: Vec<f32>,
    biases: Vec<f32>,
    /// Negative results are multiplied by this, from 0 to 1.
    slope: f32,
    clip: Clip,
}

impl Convolution {
    /// Takes `weights` by output channel, window row, window column and input channel,
    /// and a bias for each output channel.
    pub fn new(window: Window, weights: &[f32], biases: &[f32], clip: Clip) -> Convolution {
        let channels = biases.len();
        let depth = weights.len() / channels.max(1);
        let count = channels.div_ceil(PANEL);
        let mut panels = vec![0.0; count * depth * PANEL];
        for (o, row) in weights.chunks_exact(depth.max(1)).enumerate() {
            let panel = &mut panels[o / PANEL * depth * PANEL..];
            row.iter().enumerate().for_each(|(k, w)| panel[k * PANEL + o % PANEL] = *w);
        }
        let mut padded = biases.to_vec();
        padded.resize(count * PANEL, 0.0);
        Convolution { window, channels, depth, panels, biases: padded, slope: 1.0, clip }
    }

    /// Returns the number of elements stored for these numbers of weights and output channels.
    pub fn stored(weights: usize, channels: usize) -> usize {
        (weights / channels.max(1)).saturating_mul(channels.next_multiple_of(PANEL))
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

    pub fn run(&self, input: &[f32], from: Size, to: Size, out: &mut [f32]) {
        let pixels = (VALUES / self.depth.max(1)).max(ROWS).next_multiple_of(ROWS);
        let blocks = out.chunks_mut(pixels * self.channels).enumerate();
        if self.window.size == [1, 1] && self.window.stride == [1, 1] {
            let rows = input.chunks(pixels * self.depth);
            return blocks.zip(rows).for_each(|((_, out), rows)| self.product(rows, out));
        }
        let before = self.window.before(from, to);
        let [_, width] = self.window.size;
        let mut patches = vec![0.0; pixels.min(to.height * to.width) * self.depth];
        for (i, out) in blocks {
            let count = out.len() / self.channels;
            let patches = &mut patches[..count * self.depth];
            patches.fill(0.0);
            for (j, patch) in patches.chunks_exact_mut(self.depth).enumerate() {
                let pixel = i * pixels + j;
                let place = (pixel / to.width, pixel % to.width);
                self.window.each(from, before, place, |ky, kx, y, x| {
                    let at = (ky * width + kx) * from.channels;
                    patch[at..at + from.channels].copy_from_slice(from.pixel(input, y, x));
                });
            }
            self.product(patches, out);
        }
    }

    /// Multiplies rows of `depth` values with the weights of all channels.
    fn product(&self, rows: &[f32], out: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || {
                for start in (0..self.depth).step_by(DEEP) {
                    for panel in 0..self.biases.len() / PANEL {
                        self.part(rows, out, start, panel);
                    }
                }
            },
        );
    }

    /// Adds the products of the weights of a panel from `start` on to all rows.
    #[inline(always)]
    fn part(&self, rows: &[f32], out: &mut [f32], start: usize, panel: usize) {
        let end = (start + DEEP).min(self.depth);
        let weights = &self.panels[(panel * self.depth + start) * PANEL..][..(end - start) * PANEL];
        let weights = weights.as_chunks().0;
        let (first, width) = (panel * PANEL, PANEL.min(self.channels - panel * PANEL));
        let groups = rows.chunks(ROWS * self.depth);
        for (rows, out) in groups.zip(out.chunks_mut(ROWS * self.channels)) {
            // If there are fewer rows, the last one is summed more than once.
            let last = rows.len() / self.depth - 1;
            let row = |r: usize| &rows[r.min(last) * self.depth + start..][..end - start];
            let mut sums = [[0f32; PANEL]; ROWS];
            for (r, sums) in sums[..=last].iter_mut().enumerate() {
                if start == 0 {
                    sums.copy_from_slice(&self.biases[first..first + PANEL]);
                } else {
                    sums[..width].copy_from_slice(&out[r * self.channels + first..][..width]);
                }
            }
            let mut sums = add_products(sums, weights, [row(0), row(1), row(2), row(3)]);
            for (r, sums) in sums[..=last].iter_mut().enumerate() {
                if end == self.depth {
                    let Clip { lo, hi } = self.clip;
                    sums.iter_mut().for_each(|s| *s = s.max(self.slope * *s).max(lo).min(hi));
                }
                out[r * self.channels + first..][..width].copy_from_slice(&sums[..width]);
            }
        }
    }
}

/// Adds the products of rows and columns to sums, which stay in registers.
#[inline(always)]
fn add_products(
    mut sums: [[f32; PANEL]; ROWS],
    weights: &[[f32; PANEL]],
    rows: [&[f32]; ROWS],
) -> [[f32; PANEL]; ROWS] {
    let [a, b, c, d] = rows;
    for ((((weights, a), b), c), d) in weights.iter().zip(a).zip(b).zip(c).zip(d) {
        let x = [*a, *b, *c, *d];
        for r in 0..ROWS {
            for j in 0..PANEL {
                sums[r][j] += x[r] * weights[j];
            }
        }
    }
    sums
}

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
        let (width, channels) = (self.window.size[1], to.channels);
        vectorised(
            #[inline(always)]
            || {
                for row in 0..to.height {
                    for column in 0..to.width {
                        let sums = &mut out[(row * to.width + column) * channels..][..channels];
                        sums.copy_from_slice(&self.biases);
                        self.window.each(
                            from,
                            before,
                            (row, column),
                            #[inline(always)]
                            |ky, kx, y, x| {
                                let weights =
                                    &self.weights[(ky * width + kx) * channels..][..channels];
                                let values = from.pixel(input, y, x);
                                for ((s, v), w) in sums.iter_mut().zip(values).zip(weights) {
                                    *s += v * w;
                                }
                            },
                        );
                        for s in sums {
                            *s = s.max(self.clip.lo).min(self.clip.hi);
                        }
                    }
                }
            },
        );
    }
}

/// A transposed convolution with biases: each input pixel adds a window to the output
/// (MediaPipe's own operator).
#[derive(Debug)]
pub(super) struct Transposed {
    pub window: Window,
    /// By output channel, row and column of the window, a weight for each input channel.
    pub weights: Vec<f32>,
    pub biases: Vec<f32>,
}

impl Transposed {
    /// Returns the size of the output, which has one stride per input pixel.
    pub fn output(&self, from: Size) -> Size {
        let [sy, sx] = self.window.stride;
        Size { height: from.height * sy, width: from.width * sx, channels: self.biases.len() }
    }

    pub fn run(&self, input: &[f32], from: Size, to: Size, out: &mut [f32]) {
        out.chunks_exact_mut(to.channels).for_each(|p| p.copy_from_slice(&self.biases));
        let before = self.window.before(to, from);
        let [height, width] = self.window.size;
        for row in 0..from.height {
            for column in 0..from.width {
                let values = from.pixel(input, row, column);
                self.window.each(to, before, (row, column), |ky, kx, y, x| {
                    for (o, sum) in to.pixel_mut(out, y, x).iter_mut().enumerate() {
                        let at = ((o * height + ky) * width + kx) * from.channels;
                        let weights = &self.weights[at..at + from.channels];
                        *sum += values.iter().zip(weights).map(|(v, w)| v * w).sum::<f32>();
                    }
                });
            }
        }
    }
}
