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
        Convolution { window, channels, depth, panels, biases: padded, clip }
    }

    pub fn run(&self, input: &[f32], from: Size, to: Size, out: &mut [f32]) {
        if self.window.size == [1, 1] && self.window.stride == [1, 1] {
            return self.product(input, out);
        }
        let before = self.window.before(from, to);
        let [_, width] = self.window.size;
        // One row of output pixels at a time.
        let mut patches = vec![0.0; to.width * self.depth];
        for row in 0..to.height {
            patches.fill(0.0);
            for (column, patch) in patches.chunks_exact_mut(self.depth).enumerate() {
                self.window.each(from, before, (row, column), |ky, kx, y, x| {
                    let at = (ky * width + kx) * from.channels;
                    patch[at..at + from.channels].copy_from_slice(from.pixel(input, y, x));
                });
            }
            let line = to.width * to.channels;
            self.product(&patches, &mut out[row * line..][..line]);
        }
    }

    /// Multiplies rows of `depth` values with the weights of all channels.
    fn product(&self, rows: &[f32], out: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || {
                let many = ROWS * self.depth;
                let mut groups = rows.chunks_exact(many);
                let mut lines = out.chunks_exact_mut(ROWS * self.channels);
                for (group, lines) in (&mut groups).zip(&mut lines) {
                    self.rows::<ROWS>(group, lines);
                }
                let rest = groups.remainder().chunks_exact(self.depth);
                for (row, line) in rest.zip(lines.into_remainder().chunks_exact_mut(self.channels))
                {
                    self.rows::<1>(row, line);
                }
            },
        );
    }

    #[inline(always)]
    fn rows<const R: usize>(&self, rows: &[f32], out: &mut [f32]) {
        let rows: [&[f32]; R] =
            core::array::from_fn(|r| &rows[r * self.depth..(r + 1) * self.depth]);
        let panels =
            self.panels.chunks_exact(self.depth * PANEL).zip(self.biases.chunks_exact(PANEL));
        for (p, (panel, biases)) in panels.enumerate() {
            let mut sums = [[0f32; PANEL]; R];
            sums.iter_mut().for_each(|s| s.copy_from_slice(biases));
            for (k, weights) in panel.as_chunks::<PANEL>().0.iter().enumerate() {
                for r in 0..R {
                    let x = rows[r][k];
                    for j in 0..PANEL {
                        sums[r][j] += x * weights[j];
                    }
                }
            }
            let width = PANEL.min(self.channels - p * PANEL);
            for (r, sums) in sums.iter_mut().enumerate() {
                sums.iter_mut().for_each(|s| *s = s.max(self.clip.lo).min(self.clip.hi));
                out[r * self.channels + p * PANEL..][..width].copy_from_slice(&sums[..width]);
            }
        }
    }
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
