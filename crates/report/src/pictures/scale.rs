//! Pictures at another size, row by row, so that hardly more memory is needed than for the result.

use image::RgbImage;

/// The pixels that one is made of, along a side: the first, and their shares.
struct Part {
    first: usize,
    shares: Vec<f32>,
}

/// Returns of which of `from` pixels each of `to` is made: of those within a pixel of either size,
/// the more the nearer.
fn parts(from: u32, to: u32) -> Vec<Part> {
    let step = f64::from(from) / f64::from(to);
    let reach = step.max(1.0);
    let part = |i: u32| {
        let middle = (f64::from(i) + 0.5) * step;
        let first = (middle - reach).floor().max(0.0);
        let last = (middle + reach).ceil().min(f64::from(from));
        let share = |j: u32| 1.0 - (f64::from(j) + 0.5 - middle).abs() / reach;
        let shares: Vec<f64> = (first as u32..last as u32).map(|j| share(j).max(0.0)).collect();
        let sum: f64 = shares.iter().sum();
        Part { first: first as usize, shares: shares.iter().map(|s| (s / sum) as f32).collect() }
    };
    (0..to).map(part).collect()
}

/// Scales a picture; a smaller one is interpolated.
pub fn scaled(picture: &RgbImage, width: u32, height: u32) -> RgbImage {
    if picture.dimensions() == (width, height) {
        return picture.clone();
    }
    let stride = 3 * picture.width() as usize;
    let mut out = RgbImage::new(width, height);
    if stride == 0 || picture.height() == 0 || width == 0 {
        return out;
    }
    let (columns, rows) = (parts(picture.width(), width), parts(picture.height(), height));
    let mut line = vec![0.0; stride];
    for (row, to) in rows.iter().zip(out.chunks_exact_mut(3 * width as usize)) {
        line.fill(0.0);
        let from = picture.as_raw().chunks_exact(stride).skip(row.first);
        for (from, share) in from.zip(&row.shares) {
            line.iter_mut().zip(from).for_each(|(sum, byte)| *sum += share * f32::from(*byte));
        }
        let line = line.as_chunks::<3>().0;
        for (column, to) in columns.iter().zip(to.as_chunks_mut::<3>().0) {
            // Conversion rounds down.
            let mut sum = [0.5; 3];
            for (pixel, share) in line[column.first..].iter().zip(&column.shares) {
                (0..3).for_each(|c| sum[c] += share * pixel[c]);
            }
            *to = sum.map(|s| s as u8);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::imageops::{FilterType, resize};

    #[test]
    fn pictures_are_those_of_a_triangle_filter() {
        let wave = |x: u32, y: u32| image::Rgb([(x * 37) as u8, (y * 91) as u8, (x * y) as u8]);
        let picture = RgbImage::from_fn(40, 23, wave);
        for (width, height) in [(40, 23), (100, 70), (13, 9), (80, 5), (1, 1), (0, 4)] {
            let expected = resize(&picture, width, height, FilterType::Triangle);
            let found = scaled(&picture, width, height);
            assert_eq!(found.dimensions(), (width, height));
            let near = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
            assert!(found.iter().zip(expected.iter()).all(near), "{width} x {height}");
        }
        assert_eq!(scaled(&RgbImage::new(0, 3), 5, 5).dimensions(), (5, 5));
    }
}
