//! Nodes with their depth, so that no tree deeper than [`MAX_DEPTH`] is ever built.
//!
//! All functions that walk a tree recurse (including `Drop` and `Clone`), so its depth
//! bounds the stack. It cannot be checked afterwards, since dropping a deep tree would
//! already overflow the stack. The parser therefore tracks the depth, and cuts the tree
//! where it exceeds the limit (see [`Builder`](super::build::Builder)).

/// The maximum depth of a tree: expressions, bodies and loops inside each other.
pub const MAX_DEPTH: u32 = 200;

/// A node (or several) and the height of its tree, the node included.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Deep<T> {
    pub node: T,
    pub depth: u32,
}

impl<T> Deep<T> {
    /// Wraps a node without children.
    pub fn leaf(node: T) -> Self {
        Deep { node, depth: 1 }
    }

    /// Replaces the node with `f(node)` at the same height.
    pub fn map<U>(self, f: impl FnOnce(T) -> U) -> Deep<U> {
        Deep { node: f(self.node), depth: self.depth }
    }

    /// Combines two sibling nodes.
    pub fn and<U>(self, other: Deep<U>) -> Deep<(T, U)> {
        Deep { node: (self.node, other.node), depth: self.depth.max(other.depth) }
    }
}

/// Combines sibling nodes.
pub(crate) fn all<T>(nodes: Vec<Deep<T>>) -> Deep<Vec<T>> {
    let depth = nodes.iter().map(|n| n.depth).max().unwrap_or(0);
    Deep { node: nodes.into_iter().map(|n| n.node).collect(), depth }
}

/// Combines an optional node with its depth, which is 0 if there is none.
pub(crate) fn opt<T>(node: Option<Deep<T>>) -> Deep<Option<T>> {
    match node {
        Some(Deep { node, depth }) => Deep { node: Some(node), depth },
        None => Deep { node: None, depth: 0 },
    }
}
