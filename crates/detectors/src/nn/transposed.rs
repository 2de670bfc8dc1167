//! Transposed convolutions.

use super::shape::{Size, Window};

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
