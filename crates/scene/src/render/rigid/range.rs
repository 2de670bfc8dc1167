//! The exact depth range of a mesh's vertices, from the few that may have the least or the
//! greatest depth.

use super::Posed;
use crate::geom::{LEAF, WIDE};
use crate::render::pixels::project::DepthRange;

impl Posed<'_> {
    /// The depth range of all vertices.
    pub fn range(&self) -> DepthRange {
        // Of signed depth, the least.
        DepthRange { near: self.least(1.0), far: -self.least(-1.0) }
    }

    /// The least of the vertices' depth times `sign`.
    fn least(&self, sign: f64) -> f64 {
        let tree = &self.trees.surface;
        let [a, b, c, t] = self.placement.rows()[2];
        let rows = [a, b, c].map(|v| -sign * v);
        let bound = tree.middle.abs() + tree.half;
        let margin = 1e-12 * (a.abs() * bound.x + b.abs() * bound.y + c.abs() * bound.z + t.abs());
        let mut least = f64::INFINITY;
        let mut waiting = [(0.0f64, 0u32); 128];
        waiting[0] = (f64::NEG_INFINITY, tree.root);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (lowest, at) = waiting[count];
            if lowest > least {
                continue;
            }
            if at >= LEAF {
                let Some(leaf) = tree.leaves.get((at - LEAF) as usize) else { continue };
                for corner in &leaf.corners {
                    let [x, y, z] = corner.map(|row| row.to_array());
                    for i in 0..WIDE {
                        let [x, y, z] = [x[i], y[i], z[i]].map(f64::from);
                        let depth = -(x * a + y * b + z * c + t) * sign;
                        least = if depth < least { depth } else { least };
                    }
                }
                continue;
            }
            let Some(node) = tree.nodes.get(at as usize) else { continue };
            // Boxes that may hold a lesser one, the most promising last.
            let first = count;
            let sides = [0, 1, 2].map(|axis| node.sides[usize::from(rows[axis] < 0.0)][axis]);
            let sides = sides.map(|side| side.to_array());
            for i in 0..WIDE {
                let side = |axis: usize| f64::from(sides[axis][i]) * rows[axis];
                let lowest = side(0) + side(1) + side(2) - sign * t - margin;
                // False for NaN, where there is no child.
                if !(lowest <= least && lowest < f64::INFINITY) {
                    continue;
                }
                let mut to = count;
                while to > first && waiting[to - 1].0 < lowest {
                    waiting[to] = waiting[to - 1];
                    to -= 1;
                }
                waiting[to] = (lowest, node.children[i]);
                count += 1;
            }
        }
        least
    }
}
