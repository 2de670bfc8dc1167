//! Reduces pictures to few colours: k-means in CIE L*a*b* from a deterministic start, and
//! a label for every pixel.
//!
//! This is not general clustering: there are three coordinates and at most 256 clusters.
//! Invariant: every label is below the number of colours, and the same picture gives the
//! same labels on every machine.

use crate::vision::elements::{ComparatorError, check_size};
use crate::vision::pictures::color::linear_to_labs;
use crate::vision::pictures::photo::LinearImage;
use pcadlang_numerics::num::simd::vectorised;

/// Approximate maximum number of pixels, evenly spaced, that clusters are fitted to; all
/// pixels are then labelled.
const FITTED: usize = 1 << 16;
/// Maximum number of rounds of k-means; they end earlier if no centre moves.
const ROUNDS: usize = 30;

/// A picture whose pixels are indices of colours, in row-major order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantised {
    width: u32,
    height: u32,
    colours: usize,
    labels: Vec<u8>,
}

impl Quantised {
    /// Builds a picture from its labels in row-major order.
    ///
    /// # Errors
    /// A side outside 1 to 16384 pixels, a number of colours outside 1 to 256, a number
    /// of labels other than that of pixels, or a label that is not below the number of
    /// colours.
    pub fn new(
        width: u32,
        height: u32,
        colours: usize,
        labels: Vec<u8>,
    ) -> Result<Self, ComparatorError> {
        check_size(width, height)?;
        let fine = (1..=256).contains(&colours)
            && labels.len() == width as usize * height as usize
            && labels.iter().all(|l| usize::from(*l) < colours);
        if fine {
            Ok(Quantised { width, height, colours, labels })
        } else {
            Err(ComparatorError::Labels)
        }
    }

    /// Reduces a picture to at most `colours` colours (1 to 256; fewer if it has fewer)
    /// by least-squares clustering of L*a*b* values.
    ///
    /// # Errors
    /// As [`Quantised::new`].
    pub fn of(picture: &LinearImage, colours: usize) -> Result<Self, ComparatorError> {
        let lab = linear_to_labs(&picture.rgb);
        let step = lab.len().div_ceil(FITTED).max(1);
        let some: Vec<[f32; 3]> = lab.iter().copied().step_by(step).collect();
        let mut centres = start(&some, colours.clamp(1, 256));
        let mut labels = vec![0; some.len()];
        let lists = planes(&some);
        for _ in 0..ROUNDS {
            label(&lists, &centres, &mut labels);
            if !recentre(&some, &labels, &mut centres) {
                break;
            }
        }
        let mut labels = vec![0; lab.len()];
        label(&planes(&lab), &centres, &mut labels);
        Quantised::new(picture.width, picture.height, centres.len(), labels)
    }

    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The number of colours.
    pub fn colours(&self) -> usize {
        self.colours
    }

    /// The index of every pixel's colour, in row-major order.
    pub fn labels(&self) -> &[u8] {
        &self.labels
    }
}

/// Returns the mean of some points, and the sums of squares about it by coordinate.
fn moments(points: &[[f32; 3]]) -> ([f64; 3], [f64; 3]) {
    let n = points.len().max(1) as f64;
    let mut mean = [0.0; 3];
    for p in points {
        (0..3).for_each(|c| mean[c] += f64::from(p[c]) / n);
    }
    let mut squares = [0.0; 3];
    for p in points {
        for c in 0..3 {
            let d = f64::from(p[c]) - mean[c];
            squares[c] += d * d;
        }
    }
    (mean, squares)
}

/// Returns the initial centres: the box with the largest sum of squares is split at its
/// mean along its widest coordinate until there are enough boxes.
fn start(points: &[[f32; 3]], colours: usize) -> Vec<[f32; 3]> {
    type Cut = (Vec<[f32; 3]>, [f64; 3], [f64; 3]);
    let of = |points: Vec<[f32; 3]>| -> Cut {
        let (mean, squares) = moments(&points);
        (points, mean, squares)
    };
    let mut boxes = vec![of(points.to_vec())];
    while boxes.len() < colours {
        let spread = |b: &Cut| b.2.iter().sum::<f64>();
        let mut widest = 0;
        for (i, b) in boxes.iter().enumerate() {
            if boxes.get(widest).is_some_and(|w| spread(b) > spread(w)) {
                widest = i;
            }
        }
        let Some((points, mean, squares)) = boxes.get(widest).cloned() else { break };
        let axis = (0..3).fold(0, |best, c| if squares[c] > squares[best] { c } else { best });
        let (low, high): (Vec<_>, Vec<_>) =
            points.into_iter().partition(|p| f64::from(p[axis]) < mean[axis]);
        // The remaining points are equal, except for rounding.
        if squares[axis] < 1e-6 || low.is_empty() || high.is_empty() {
            break;
        }
        boxes[widest] = of(low);
        boxes.push(of(high));
    }
    boxes.iter().map(|(_, mean, _)| mean.map(|m| m as f32)).collect()
}

/// Number of points that are compared with a centre at a time.
const BLOCK: usize = 32;

/// Returns the points' coordinates as separate lists, padded with zeros to whole blocks.
fn planes(points: &[[f32; 3]]) -> [Vec<f32>; 3] {
    let list = |c: usize| {
        let mut list: Vec<f32> = points.iter().map(|p| p[c]).collect();
        list.resize(points.len().next_multiple_of(BLOCK), 0.0);
        list
    };
    [list(0), list(1), list(2)]
}

/// Assigns every point to its nearest centre, the first one among equals.
fn label([l, a, b]: &[Vec<f32>; 3], centres: &[[f32; 3]], labels: &mut [u8]) {
    let blocks = l.as_chunks().0.iter().zip(a.as_chunks().0).zip(b.as_chunks().0);
    for (((l, a), b), labels) in blocks.zip(labels.chunks_mut(BLOCK)) {
        let [l, a, b]: [&[f32; BLOCK]; 3] = [l, a, b];
        let (mut least, mut nearest) = ([f32::INFINITY; BLOCK], [0u32; BLOCK]);
        vectorised(
            #[inline(always)]
            || {
                for (k, c) in centres.iter().enumerate() {
                    for i in 0..BLOCK {
                        let d = [l[i] - c[0], a[i] - c[1], b[i] - c[2]];
                        let d = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                        let nearer = d < least[i];
                        nearest[i] = if nearer { k as u32 } else { nearest[i] };
                        least[i] = if nearer { d } else { least[i] };
                    }
                }
            },
        );
        labels.iter_mut().zip(nearest).for_each(|(l, k)| *l = k as u8);
    }
}

/// Moves every centre to the mean of its points, and returns whether any has moved. A
/// centre without points stays.
fn recentre(points: &[[f32; 3]], labels: &[u8], centres: &mut [[f32; 3]]) -> bool {
    let mut sums = vec![([0.0f64; 3], 0u32); centres.len()];
    for (p, l) in points.iter().zip(labels) {
        if let Some((sum, n)) = sums.get_mut(usize::from(*l)) {
            (0..3).for_each(|c| sum[c] += f64::from(p[c]));
            *n += 1;
        }
    }
    let mut moved = false;
    for (centre, (sum, n)) in centres.iter_mut().zip(sums).filter(|(_, (_, n))| *n > 0) {
        let mean = sum.map(|s| (s / f64::from(n)) as f32);
        moved |= mean != *centre;
        *centre = mean;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, rgb: Vec<[f32; 3]>) -> LinearImage {
        LinearImage { width, height: rgb.len() as u32 / width, rgb }
    }

    #[test]
    fn distinct_colours_get_labels_of_their_own() {
        let palette = [[0.0; 3], [0.9, 0.1, 0.1], [0.1, 0.7, 0.1], [0.1, 0.1, 0.8], [1.0; 3]];
        // Noise that is too small to matter.
        let pixels: Vec<usize> = (0..400).map(|i| (i * i / 7) % 5).collect();
        let rgb = pixels
            .iter()
            .enumerate()
            .map(|(i, p)| palette[*p].map(|v| v + 1e-3 * (i % 3) as f32))
            .collect();
        let q = Quantised::of(&picture(20, rgb), 5).unwrap();
        assert_eq!((q.width(), q.height(), q.colours()), (20, 20, 5));
        for (i, p) in pixels.iter().enumerate() {
            for (j, r) in pixels.iter().enumerate() {
                assert_eq!(p == r, q.labels()[i] == q.labels()[j]);
            }
        }
    }

    #[test]
    fn no_more_colours_than_there_are() {
        assert_eq!(Quantised::of(&picture(4, vec![[0.3; 3]; 12]), 32).unwrap().colours(), 1);
        let two = (0..12).map(|i| [if i % 3 == 0 { 0.2 } else { 0.6 }; 3]).collect();
        assert_eq!(Quantised::of(&picture(3, two), 32).unwrap().colours(), 2);
    }

    #[test]
    fn rounds_lower_the_squares_of_the_start() {
        let points: Vec<[f32; 3]> = (0..900u32)
            .map(|i| {
                [i * 37 % 101, i * i % 97, i * 53 % 89]
                    .map(|v| v as f32 + if i % 4 == 0 { 60.0 } else { 0.0 })
            })
            .collect();
        let squares = |centres: &[[f32; 3]]| {
            let mut labels = vec![0; points.len()];
            label(&planes(&points), centres, &mut labels);
            let d = |p: &[f32; 3], l: &u8| {
                (0..3).map(|c| (p[c] - centres[*l as usize][c]).powi(2)).sum::<f32>()
            };
            points.iter().zip(&labels).map(|(p, l)| f64::from(d(p, l))).sum::<f64>()
        };
        let mut centres = start(&points, 12);
        assert_eq!(centres.len(), 12);
        let mut last = squares(&centres);
        let first = last;
        let mut labels = vec![0; points.len()];
        for _ in 0..8 {
            label(&planes(&points), &centres, &mut labels);
            recentre(&points, &labels, &mut centres);
            let now = squares(&centres);
            assert!(now <= last * (1.0 + 1e-6));
            last = now;
        }
        assert!(last < 0.97 * first, "{last} of {first}");
    }

    #[test]
    fn labels_are_checked() {
        assert!(Quantised::new(2, 2, 3, vec![0, 1, 2, 0]).is_ok());
        assert!(Quantised::new(2, 2, 2, vec![0, 1, 2, 0]).is_err());
        assert!(Quantised::new(2, 2, 3, vec![0, 1, 2]).is_err());
        assert!(Quantised::new(0, 2, 3, vec![]).is_err());
        assert!(Quantised::new(1, 1, 0, vec![0]).is_err());
    }
}
