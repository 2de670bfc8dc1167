//! Curves through the middle of a grid's interior, as a tree of points.
//!
//! All paths come from one tree of cheapest paths to the root, so paths that join never
//! separate again.

use crate::voxels::Grid;
use glam::DVec3;

/// A path covers the cells within this multiple of its clearance plus a few cells;
/// covered cells need no path of their own.
const COVERED: f64 = 1.5;
const COVERED_CELLS: f64 = 2.0;
/// The cap of a curve: the cells at most this much nearer to the root than the tip, in
/// cells. The curve ends at the cap's centroid.
const CAP_CELLS: f64 = 2.0;
/// The maximum number of curves.
const MOST_CURVES: usize = 256;

/// A point of the curves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub at: DVec3,
    /// The previous point on the path from the root, which has a smaller index; `None`
    /// for the root, which comes first.
    pub parent: Option<usize>,
    /// The distance to the surface, in the mesh's units.
    pub clearance: f64,
}

/// Returns the tree of curves, the longest first.
pub(super) fn curves(grid: &Grid) -> Vec<Node> {
    let root = centre(grid);
    let (far, _) = grid.shortest_paths(root, |_| 1.0);
    let (_, before) = grid.shortest_paths(root, |i| 1.0 / (grid.clearance(i) * grid.clearance(i)));
    let mut number: Vec<Option<usize>> = vec![None; grid.len()];
    let mut covered = vec![false; grid.len()];
    let node = |i: usize, parent| Node {
        at: grid.middle(i),
        parent,
        clearance: grid.clearance(i) * grid.cell(),
    };
    let mut nodes = vec![node(root, None)];
    number[root] = Some(0);
    cover(grid, root, &mut covered);
    for _ in 0..MOST_CURVES {
        let open = grid.cells().filter(|i| !covered[*i] && far[*i].is_finite());
        let Some(tip) =
            open.fold(
                None,
                |best, i| if best.is_none_or(|b| far[i] > far[b]) { Some(i) } else { best },
            )
        else {
            break;
        };
        let end = grid.flood(tip, |i| far[i] >= far[tip] - CAP_CELLS && !covered[i]);
        let cap = end.iter().map(|i| grid.middle(*i)).sum::<DVec3>() / end.len() as f64;
        let mut way = vec![tip];
        let mut last = tip;
        while number[last].is_none() {
            last = before[last];
            way.push(last);
        }
        for i in end.iter().chain(&way) {
            cover(grid, *i, &mut covered);
        }
        // Near the tip the path leaves the middle for the surface: drop it up to the last
        // cell whose ball contains the cap's centroid; from there the curve runs
        // straight.
        let beside = way
            .iter()
            .rposition(|i| (grid.middle(*i) - cap).length() <= grid.clearance(*i) * grid.cell());
        way.drain(..beside.map_or(0, |k| (k + 1).min(way.len() - 1)));
        let mut parent = None;
        for i in way.iter().rev() {
            let k = *number[*i].get_or_insert_with(|| {
                nodes.push(node(*i, parent));
                nodes.len() - 1
            });
            parent = Some(k);
        }
        nodes.push(Node { at: cap, parent, clearance: grid.cell() });
    }
    nodes
}

fn cover(grid: &Grid, i: usize, covered: &mut [bool]) {
    for j in grid.ball(i, COVERED * grid.clearance(i) + COVERED_CELLS) {
        covered[j] = true;
    }
}

/// Returns the cell that minimises (distance to the centre of mass)^2 - (distance to the
/// surface)^2; the first, if several do.
fn centre(grid: &Grid) -> usize {
    let (sum, count) =
        grid.cells().fold((DVec3::ZERO, 0.0), |(s, n), i| (s + grid.middle(i), n + 1.0));
    let mean = sum / f64::max(count, 1.0);
    let power = |i: usize| {
        (grid.middle(i) - mean).length_squared() - (grid.clearance(i) * grid.cell()).powi(2)
    };
    let best = grid.cells().fold(None, |best: Option<(usize, f64)>, i| {
        let p = power(i);
        if best.is_none_or(|(_, b)| p < b) { Some((i, p)) } else { best }
    });
    best.map_or(0, |(i, _)| i)
}
