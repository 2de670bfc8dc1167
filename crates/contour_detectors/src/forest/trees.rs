//! Evaluates the trees of a structured forest patch by patch, and combines the
//! predictions of their leaves.

use super::features::{Features, Plane, rounded, smoothed};
use super::{Forest, ForestOptions, Node};

/// Offsets of the features that nodes refer to, relative to the first feature of a patch.
struct Places {
    plain: Vec<usize>,
    pairs: Vec<(usize, usize)>,
}

impl Places {
    fn new(f: &Features, o: &ForestOptions) -> Places {
        let at = |row: usize, column: usize, channel: usize| {
            (row * f.width + column) * f.channels + channel
        };
        let cells = o.cells();
        // Column by column, one channel after the other.
        let plain = |i: usize| at(i % cells, i / cells % cells, i / (cells * cells));
        let grid = grid(o);
        let places = o.grid * o.grid;
        let mut pairs = Vec::with_capacity(o.pairs());
        for channel in 0..f.channels {
            let at = |k: usize| at(grid[k % o.grid], grid[k / o.grid], channel);
            for a in 0..places {
                pairs.extend((a + 1..places).map(|b| (at(a), at(b))));
            }
        }
        Places { plain: (0..o.plain()).map(plain).collect(), pairs }
    }
}

/// Centres of a grid's cells along one side of a patch.
fn grid(o: &ForestOptions) -> Vec<usize> {
    let (cells, half) = (o.cells(), rounded(o.cells(), 2 * o.grid));
    let middle = |i: usize| {
        let end = ((i + 1) * (cells + 2 * half - 1)) as f64 / (o.grid as f64 + 1.0);
        ((end - half as f64 + 0.5).max(0.0) as usize).min(cells - 1)
    };
    (0..o.grid).map(middle).collect()
}

/// Returns the leaf that a patch reaches.
fn leaf(tree: &[Node], places: &Places, plain: &[f32], similar: &[f32]) -> usize {
    let mut at = 0;
    while tree[at].left != 0 {
        let node = &tree[at];
        let feature = node.feature as usize;
        let value = match places.plain.get(feature) {
            Some(place) => plain[*place],
            None => {
                let (a, b) = places.pairs[feature - places.plain.len()];
                similar[a] - similar[b]
            }
        };
        // The right child follows the left one; values that are not smaller (and NaN) go
        // there.
        at = node.left as usize
            + usize::from(!matches!(
                value.partial_cmp(&node.threshold),
                Some(std::cmp::Ordering::Less)
            ));
    }
    at
}

/// Returns the probability of each pixel of a picture to be on an edge, 0 to 1 and
/// occasionally more.
pub(super) fn edges(forest: &Forest, f: &Features, width: usize, height: usize) -> Vec<f32> {
    let o = &forest.options;
    let places = Places::new(f, o);
    let each = forest.nodes.len() / o.trees;
    let patches = |n: usize| (n * o.shrink).saturating_sub(o.patch).div_ceil(o.stride);
    let mut said = vec![0u32; width * height];
    for i in 0..patches(f.height) {
        for j in 0..patches(f.width) {
            let first = (i * o.stride / o.shrink * f.width + j * o.stride / o.shrink) * f.channels;
            let (plain, similar) = (&f.plain[first..], &f.similar[first..]);
            for k in 0..o.evaluated {
                // Neighbouring patches use different trees.
                let tree = ((i + j) % (2 * o.evaluated) + k) % o.trees;
                let leaf = tree * each
                    + leaf(&forest.nodes[tree * each..][..each], &places, plain, similar);
                let pixels = forest.begins[leaf] as usize..forest.begins[leaf + 1] as usize;
                for &p in &forest.pixels[pixels] {
                    let (row, column) = (
                        i * o.stride + usize::from(p) % o.inner,
                        j * o.stride + usize::from(p) / o.inner,
                    );
                    if row < height && column < width {
                        said[row * width + column] += 1;
                    }
                }
            }
        }
    }
    let part = 2.0 * (o.stride * o.stride) as f32 / (o.inner * o.inner * o.evaluated) as f32;
    let data = said.into_iter().map(|n| n as f32 * part).collect();
    smoothed(&Plane { width, height, data }, 1).data
}
