//! Trees of boxes, eight to a node, over boxes of any dimension.

use wide::f32x8;

/// The number of children of a node.
pub(crate) const WIDE: usize = 8;
/// Added to the numbers of leaves among children.
pub(crate) const LEAF: u32 = 1 << 31;

/// The boxes of a node's children.
#[repr(align(32))]
pub(crate) struct Node<const D: usize> {
    /// The least coordinates along each axis, then the greatest. Where there is no child
    /// the least are infinite and the greatest negative infinite.
    pub sides: [[f32x8; D]; 2],
    /// Nodes, or [`LEAF`] plus the number of a leaf.
    pub children: [u32; WIDE],
}

/// A box to be put into a tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item<const D: usize> {
    pub low: [f32; D],
    pub high: [f32; D],
    pub id: u32,
}

impl<const D: usize> Item<D> {
    /// The box around some points.
    pub fn around(id: u32, points: impl IntoIterator<Item = [f32; D]>) -> Item<D> {
        let mut own = Item { low: [f32::INFINITY; D], high: [f32::NEG_INFINITY; D], id };
        for point in points {
            own.low = std::array::from_fn(|i| own.low[i].min(point[i]));
            own.high = std::array::from_fn(|i| own.high[i].max(point[i]));
        }
        own
    }

    /// Twice the middle along an axis.
    fn middle(&self, axis: usize) -> f32 {
        self.low[axis] + self.high[axis]
    }
}

/// Makes a tree.
pub(super) struct Builder<const D: usize, L> {
    pub nodes: Vec<Node<D>>,
    /// What distances along each axis count.
    pub weights: [f32; D],
    /// The most boxes of a leaf.
    pub most: usize,
    /// Makes a leaf of some boxes and returns its number; `None` if they do not fit.
    pub leaf: L,
}

impl<const D: usize, L: FnMut(&[Item<D>]) -> Option<u32>> Builder<D, L> {
    /// Makes the subtree of some boxes, and returns its number as in [`Node::children`].
    pub fn add(&mut self, items: &mut [Item<D>]) -> u32 {
        if items.len() <= self.most
            && let Some(leaf) = (self.leaf)(items)
        {
            return LEAF | leaf;
        }
        // All children but one are complete subtrees, so few nodes are half empty.
        let mut unit = self.most;
        while unit * WIDE < items.len() {
            unit *= WIDE;
        }
        let unit = if items.len() <= self.most { items.len().div_ceil(2) } else { unit };
        let mut parts = Vec::with_capacity(WIDE);
        self.split(items, unit, &mut parts);
        let at = self.nodes.len();
        let mut sides = [[[f32::INFINITY; WIDE]; D], [[f32::NEG_INFINITY; WIDE]; D]];
        let mut children = [LEAF; WIDE];
        self.nodes.push(Node { sides: [[f32x8::ZERO; D]; 2], children });
        for (i, part) in parts.into_iter().enumerate() {
            let around = Item::around(0, part.iter().flat_map(|item| [item.low, item.high]));
            children[i] = self.add(part);
            for axis in 0..D {
                sides[0][axis][i] = around.low[axis];
                sides[1][axis][i] = around.high[axis];
            }
        }
        self.nodes[at] = Node { sides: sides.map(|rows| rows.map(f32x8::new)), children };
        at as u32
    }

    /// Splits a list at its medians into at most [`WIDE`] parts of `unit` boxes; the last
    /// may have fewer.
    fn split<'a>(&self, items: &'a mut [Item<D>], unit: usize, parts: &mut Vec<&'a mut [Item<D>]>) {
        if items.len() <= unit {
            return parts.push(items);
        }
        let wide = |axis: usize| {
            let ends =
                items.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), item| {
                    (low.min(item.middle(axis)), high.max(item.middle(axis)))
                });
            (ends.1 - ends.0) * self.weights[axis]
        };
        let widths: [f32; D] = std::array::from_fn(wide);
        let axis =
            (1..D).fold(0, |most, axis| if widths[axis] > widths[most] { axis } else { most });
        let at = items.len().div_ceil(unit) / 2 * unit;
        items.select_nth_unstable_by(at, |a, b| a.middle(axis).total_cmp(&b.middle(axis)));
        let (first, second) = items.split_at_mut(at);
        self.split(first, unit, parts);
        self.split(second, unit, parts);
    }
}
