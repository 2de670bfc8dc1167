//! A photograph as the network's input.

use super::View;
use pcadlang_scene::vision::Photo;

/// The means and standard deviations of blue, green and red that the network was trained
/// with.
const MEANS: [f32; 3] = [103.53, 116.28, 123.675];
const DEVIATIONS: [f32; 3] = [57.375, 57.12, 58.395];

/// Where a photograph is among the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// The sample of the photograph's upper left corner, across and down.
    pub origin: [usize; 2],
    /// The number of samples that it covers.
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

/// Returns where a photograph is that is scaled so that its longer side takes up a view's part
/// of `side` samples: a whole view has black at the right or below, a smaller one around it.
pub(super) fn place(photo: &Photo, side: usize, view: View) -> Placed {
    let size = [photo.width(), photo.height()].map(|n| n.max(1) as usize);
    let longer = size[0].max(size[1]) as f64;
    let taken = view.part * side as f64;
    let fit = |n: usize| (libm::round(n as f64 * taken / longer) as usize).clamp(1, side);
    let margin = |n: usize| (0.5 * (1.0 - view.part) * n as f64 * side as f64 / longer) as usize;
    Placed {
        origin: size.map(margin),
        samples: size.map(fit),
        size: size.map(|n| n as f64),
        mirrored: view.mirrored,
    }
}

/// Fills `out`, planes of blue, green and red of `side` x `side` samples, with a photograph so
/// placed, the rest black. A sample is the mean of the area that it covers.
pub(super) fn letterbox(photo: &Photo, side: usize, placed: &Placed, out: &mut [f32]) {
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
            let p = (placed.origin[1] + j) * side + placed.origin[0] + i;
            // Blue first.
            (0..3).for_each(|c| out[c * side * side + p] = sum[2 - c]);
        }
    }
    for (c, plane) in out.chunks_exact_mut(side * side).enumerate() {
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

    fn seen(rgb: RgbImage, side: usize, view: View) -> (Vec<f32>, Placed) {
        let photo = Photo::from_rgb(rgb).unwrap();
        let (mut out, placed) = (vec![7.0; 3 * side * side], place(&photo, side, view));
        letterbox(&photo, side, &placed, &mut out);
        (out, placed)
    }

    #[test]
    fn samples_are_means_of_areas_and_the_rest_is_black() {
        // Five columns on two samples: 1, 1, 1/2 and 1/2, 1, 1.
        let rgb = RgbImage::from_fn(5, 2, |x, y| Rgb([10 * x as u8, 100 * y as u8, 7]));
        let (out, placed) = seen(rgb, 2, View::WHOLE);
        assert_eq!((placed.scale(), placed.origin), ([2.0 / 5.0, 1.0 / 2.0], [0, 0]));
        let value =
            |c: usize, j: usize, i: usize| out[(c * 2 + j) * 2 + i] * DEVIATIONS[c] + MEANS[c];
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
        let (out, placed) = seen(rgb, 4, View::WHOLE);
        assert_eq!(placed.scale(), [2.0, 2.0]);
        let column: Vec<f32> = (0..4).map(|j| out[4 * j] * DEVIATIONS[0] + MEANS[0]).collect();
        for (got, expected) in column.iter().zip([0.0, 20.0, 60.0, 80.0]) {
            assert!((got - expected).abs() < 1e-4, "{column:?}");
        }
    }

    #[test]
    fn smaller_views_are_in_the_middle_and_may_be_mirrored() {
        let rgb = RgbImage::from_fn(4, 2, |x, _| Rgb([10 + 20 * x as u8; 3]));
        let view = View { part: 0.5, mirrored: true };
        let (out, placed) = seen(rgb, 8, view);
        assert_eq!((placed.origin, placed.scale()), ([2, 1], [1.0, 1.0]));
        let is = |j: usize, wanted: [f32; 8]| {
            let row = out[8 * j..][..8].iter().map(|v| v * DEVIATIONS[0] + MEANS[0]);
            row.zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4)
        };
        assert!(is(1, [0.0, 0.0, 70.0, 50.0, 30.0, 10.0, 0.0, 0.0]));
        assert!(is(3, [0.0; 8]));
    }
}
