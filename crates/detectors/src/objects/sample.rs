//! A photograph as the network's input.

use super::{SIDE, STRIDES, View};
use pcadlang_scene::vision::Photo;

/// The means and standard deviations of blue, green and red that the network was trained
/// with.
const MEANS: [f32; 3] = [103.53, 116.28, 123.675];
const DEVIATIONS: [f32; 3] = [57.375, 57.12, 58.395];

/// Where a photograph is among the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// The width and height of the input, of whole cells.
    pub input: [usize; 2],
    /// The sample of the photograph's upper left corner, across and down.
    pub origin: [usize; 2],
    /// The number of samples that it covers, across and down.
    pub samples: [usize; 2],
    /// Its size, pixels.
    pub size: [f64; 2],
    /// True if left and right are exchanged.
    pub mirrored: bool,
}

impl Placed {
    /// The number of samples to a pixel, across and down.
    pub fn scale(&self) -> [f64; 2] {
        [0, 1].map(|i| self.samples[i] as f64 / self.size[i])
    }
}

/// The number of samples around a photograph in a smaller view, both sides together, at least.
const MARGIN: usize = 32;

/// Returns where a photograph is that is scaled so that its longer side takes up a view's part
/// of [`SIDE`] samples: at the upper left of a whole view, which is a square, and in the middle of
/// a smaller one, which is hardly larger.
pub(super) fn place(photo: &Photo, view: View) -> Placed {
    let size = [photo.width(), photo.height()].map(|n| n.max(1) as usize);
    let longer = size[0].max(size[1]) as f64;
    let taken = view.part * SIDE as f64;
    let fit = |n: usize| (libm::round(n as f64 * taken / longer) as usize).clamp(1, SIDE);
    let samples = size.map(fit);
    let (input, origin) = match view.part < 1.0 {
        true => {
            let input = samples.map(|n| (n + MARGIN).next_multiple_of(STRIDES[2]));
            (input, [0, 1].map(|i| (input[i] - samples[i]) / 2))
        }
        false => ([SIDE; 2], [0; 2]),
    };
    let size = size.map(|n| n as f64);
    Placed { input, origin, samples, size, mirrored: view.mirrored }
}

/// Fills `out`, planes of blue, green and red samples, with a photograph so placed, the rest
/// black. A sample is the mean of the area that it covers.
pub(super) fn letterbox(photo: &Photo, placed: &Placed, out: &mut [f32]) {
    let ([across, down], [left, top]) = (placed.input, placed.origin);
    let (width, height) = (photo.width() as usize, photo.height() as usize);
    let rgb = photo.rgb().as_raw();
    let (columns, rows) = (parts(width, placed.samples[0]), parts(height, placed.samples[1]));
    out.fill(0.0);
    let mut line = vec![[0f32; 3]; columns.len()];
    for (j, row) in rows.iter().enumerate() {
        line.fill([0.0; 3]);
        for (y, down) in (row.first..).zip(&row.shares) {
            let pixels = rgb[3 * y * width..][..3 * width].as_chunks::<3>().0;
            for (sum, column) in line.iter_mut().zip(&columns) {
                for (pixel, across) in pixels[column.first..].iter().zip(&column.shares) {
                    let share = down * across;
                    (0..3).for_each(|c| sum[c] += share * f32::from(pixel[c]));
                }
            }
        }
        for (i, sum) in line.iter().enumerate() {
            let i = if placed.mirrored { line.len() - 1 - i } else { i };
            // Blue first.
            (0..3).for_each(|c| out[(c * down + top + j) * across + left + i] = sum[2 - c]);
        }
    }
    for (c, plane) in out.chunks_exact_mut(across * down).enumerate() {
        plane.iter_mut().for_each(|v| *v = (*v - MEANS[c]) / DEVIATIONS[c]);
    }
}

/// The pixels of a sample along a side: the first one, and the shares of it and the next ones.
struct Part {
    first: usize,
    shares: Vec<f32>,
}

/// Divides `from` pixels among `to` samples: by area where samples are larger than pixels,
/// else linearly between the two nearest.
fn parts(from: usize, to: usize) -> Vec<Part> {
    let step = from as f64 / to as f64;
    let part = |i: usize| {
        if step >= 1.0 {
            let (start, end) = (i as f64 * step, ((i + 1) as f64 * step).min(from as f64));
            let (first, last) = (start as usize, libm::ceil(end) as usize);
            let within = |k: usize| end.min((k + 1) as f64) - start.max(k as f64);
            let shares = (first..last).map(|k| (within(k) / (end - start)) as f32).collect();
            return Part { first, shares };
        }
        let at = ((i as f64 + 0.5) * step - 0.5).clamp(0.0, (from - 1) as f64);
        let first = at as usize;
        let share = (at - first as f64) as f32;
        let shares = if share > 0.0 { vec![1.0 - share, share] } else { vec![1.0] };
        Part { first, shares }
    };
    (0..to).map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};

    /// Returns the input that shows a photograph in a view, as numbers of a channel, row and
    /// column, from its upper left corner on.
    fn seen(rgb: RgbImage, view: View) -> (impl Fn(usize, usize, usize) -> f32, Placed) {
        let photo = Photo::from_rgb(rgb).unwrap();
        let placed = place(&photo, view);
        let ([across, down], [left, top]) = (placed.input, placed.origin);
        let mut out = vec![7.0; 3 * across * down];
        letterbox(&photo, &placed, &mut out);
        let value = move |c: usize, j: usize, i: usize| {
            out[(c * down + top + j) * across + left + i] * DEVIATIONS[c] + MEANS[c]
        };
        (value, placed)
    }

    /// A view in which a photograph's longer side takes up this number of samples.
    fn taking(samples: usize, mirrored: bool) -> View {
        View { part: samples as f64 / SIDE as f64, mirrored }
    }

    #[test]
    fn samples_are_means_of_areas_and_the_rest_is_black() {
        // Five columns on two samples: 1, 1, 1/2 and 1/2, 1, 1.
        let rgb = RgbImage::from_fn(5, 2, |x, y| Rgb([10 * x as u8, 100 * y as u8, 7]));
        let (value, placed) = seen(rgb, taking(2, false));
        assert_eq!((placed.scale(), placed.input), ([2.0 / 5.0, 1.0 / 2.0], [64, 64]));
        for (c, expected) in [(0, [7.0, 7.0]), (1, [50.0, 50.0]), (2, [8.0, 32.0])] {
            for i in 0..2 {
                assert!((value(c, 0, i) - expected[i]).abs() < 1e-4, "{c} {i}");
                assert!(value(c, 1, i).abs() < 1e-4, "black below");
            }
        }
    }

    #[test]
    fn small_photographs_are_interpolated() {
        let rgb = RgbImage::from_fn(1, 2, |_, y| Rgb([80 * y as u8; 3]));
        let (value, placed) = seen(rgb, taking(4, false));
        assert_eq!(placed.scale(), [2.0, 2.0]);
        for (j, expected) in [0.0, 20.0, 60.0, 80.0].into_iter().enumerate() {
            assert!((value(0, j, 0) - expected).abs() < 1e-4, "{j}");
        }
    }

    #[test]
    fn smaller_views_are_hardly_larger_than_photographs_and_may_be_mirrored() {
        let rgb = RgbImage::from_fn(400, 100, |x, _| Rgb([(x / 2) as u8; 3]));
        let (value, placed) = seen(rgb, taking(200, true));
        assert_eq!((placed.input, placed.samples), ([256, 96], [200, 50]));
        assert_eq!(placed.origin, [28, 23]);
        for (i, expected) in [(0, 199.0), (99, 100.0), (199, 0.0), (200, 0.0)] {
            assert!((value(0, 20, i) - expected).abs() < 1e-3, "{i}: {}", value(0, 20, i));
        }
        assert!(value(0, 50, 0).abs() < 1e-4, "black below");
        let (_, whole) = seen(RgbImage::new(400, 300), View::WHOLE);
        assert_eq!((whole.input, whole.origin), ([416, 416], [0, 0]));
    }
}
