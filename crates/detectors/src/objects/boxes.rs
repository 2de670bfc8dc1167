//! From the network's outputs to boxes, as NanoDet's authors define them.

use super::sample::Placed;
use super::{BINS, CLASSES, FoundObject, STRIDES};
use crate::boxes::overlap;

/// Of two boxes of one class with a larger intersection over union, the worse is dropped.
const OVERLAP: f64 = 0.6;
/// The maximum number of candidates, the best ones, among which overlapping ones are
/// dropped.
const CANDIDATES: usize = 1000;

/// Returns the candidates with a score of at least `least`, best first, within a photograph.
/// `grids` are, for each stride, the scores by cell and class, and the bins by cell, side of
/// the box and distance.
pub(super) fn decode(grids: &[[&[f32]; 2]; 3], placed: &Placed, least: f64) -> Vec<FoundObject> {
    let mut all = Vec::new();
    for ([scores, sides], stride) in grids.iter().zip(STRIDES) {
        let cells = scores.chunks_exact(CLASSES.len()).zip(sides.chunks_exact(4 * BINS));
        for (i, (scores, sides)) in cells.enumerate() {
            let mut bounds = None;
            for (class, score) in scores.iter().map(|s| f64::from(*s)).enumerate() {
                if score >= least && score <= 1.0 {
                    let bounds = *bounds.get_or_insert_with(|| within(i, stride, sides, placed));
                    all.extend(bounds.map(|bounds| FoundObject { bounds, class, score }));
                }
            }
        }
    }
    // Among equals, the order of cells and classes stays.
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    all.truncate(CANDIDATES);
    all
}

/// Returns the box of a cell, clipped to the photograph; `None` if nothing of it is left.
fn within(cell: usize, stride: usize, sides: &[f32], placed: &Placed) -> Option<[f64; 4]> {
    let row = placed.input[0] / stride;
    let centre = [cell % row, cell / row].map(|i| (i as f64 + 0.5) * stride as f64 - 0.5);
    let (mut bounds, scale) = ([0.0; 4], placed.scale());
    for (k, (bound, bins)) in bounds.iter_mut().zip(sides.chunks_exact(BINS)).enumerate() {
        let distance = expectation(bins) * stride as f64;
        let at = centre[k % 2] + if k < 2 { -distance } else { distance };
        let c = k % 2;
        *bound = ((at - placed.origin[c] as f64) / scale[c]).clamp(0.0, placed.size[c]);
    }
    if placed.mirrored {
        (bounds[0], bounds[2]) = (placed.size[0] - bounds[2], placed.size[0] - bounds[0]);
    }
    let [left, top, right, bottom] = bounds;
    (right > left && bottom > top).then_some(bounds)
}

/// Returns the mean of 0, 1, 2, … with probabilities that are the softmax of these numbers.
fn expectation(bins: &[f32]) -> f64 {
    let largest = bins.iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
    let (mut total, mut sum) = (0.0, 0.0);
    for (i, bin) in bins.iter().enumerate() {
        let weight = libm::exp(f64::from(bin - largest));
        total += weight;
        sum += weight * i as f64;
    }
    sum / total
}

/// Returns up to `most` candidates, given best first, that no better one of their class
/// overlaps.
pub(super) fn best(candidates: Vec<FoundObject>, most: usize) -> Vec<FoundObject> {
    let mut kept: Vec<FoundObject> = Vec::new();
    for c in candidates {
        if kept.len() == most {
            break;
        }
        let is_new = |k: &FoundObject| k.class != c.class || overlap(k.bounds, c.bounds) <= OVERLAP;
        if kept.iter().all(is_new) {
            kept.push(c);
        }
    }
    kept
}
