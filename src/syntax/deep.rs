//! Nodes with their depth, so that no tree deeper than [`MAX_DEPTH`] is ever built.
//!
//! Everything that walks a tree recurses (also `Drop` and `Clone`), so its depth bounds
//! the stack. It cannot be checked afterwards: dropping a deep tree would already
//! overflow. So the parser carries the depth along, and cuts the tree where it passes the
//! limit (see [`Builder`](super::build::Builder)).

/// The deepest tree that is built: expressions, bodies and loops inside each other.
pub const MAX_DEPTH: u32 = 200;

/// A node (or several) and the height of the tree below it, the node included.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Deep<T> {
    pub node: T,
    pub depth: u32,
}

impl<T> Deep<T> {
    /// A node with nothing below it.
    pub fn leaf(node: T) -> Self {
        Deep { node, depth: 1 }
    }

    /// A node made of this one, at the same height.
    pub fn map<U>(self, f: impl FnOnce(T) -> U) -> Deep<U> {
        Deep { node: f(self.node), depth: self.depth }
    }

    /// Both nodes, beside each other.
    pub fn and<U>(self, other: Deep<U>) -> Deep<(T, U)> {
        Deep { node: (self.node, other.node), depth: self.depth.max(other.depth) }
    }
}

/// All nodes, beside each other.
pub(crate) fn all<T>(nodes: Vec<Deep<T>>) -> Deep<Vec<T>> {
    let depth = nodes.iter().map(|n| n.depth).max().unwrap_or(0);
    Deep { node: nodes.into_iter().map(|n| n.node).collect(), depth }
}

/// The node, if there is one.
pub(crate) fn opt<T>(node: Option<Deep<T>>) -> Deep<Option<T>> {
    match node {
        Some(Deep { node, depth }) => Deep { node: Some(node), depth },
        None => Deep { node: None, depth: 0 },
    }
}
