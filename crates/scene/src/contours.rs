//! Pieces of contour: what drawing makes and comparing reads. Neither depends on the other.

use std::sync::Arc;

/// Pieces of contour in an image of `width` x `height` pixels; the centre of pixel (0, 0) is
/// (0.5, 0.5), and y points down. A piece's object side lies to the right of its
/// tangent as seen in the image (outward is `(ty, -tx)`); creases with both faces
/// visible, and boundaries, have an arbitrary orientation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contours {
    /// Middle of each piece, pixels from the left edge.
    pub x: Vec<f32>,
    /// Middle of each piece, pixels from the top edge.
    pub y: Vec<f32>,
    /// Unit tangent, component to the right.
    pub tx: Vec<f32>,
    /// Unit tangent, downward component.
    pub ty: Vec<f32>,
    /// Length of each piece in pixels, at most 1.5.
    pub length: Vec<f32>,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

/// Borrowed pieces of contour, as in [`Contours`]. If the lists differ in length, the shortest
/// one counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourSlice<'a> {
    /// Middle of each piece, pixels from the left edge.
    pub x: &'a [f32],
    /// Middle of each piece, pixels from the top edge.
    pub y: &'a [f32],
    /// Unit tangent, component to the right.
    pub tx: &'a [f32],
    /// Unit tangent, downward component.
    pub ty: &'a [f32],
    /// Length of each piece in pixels, about 1.
    pub length: &'a [f32],
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

/// A change from one set of contours to another. A set is identified by the address of its
/// `Arc`.
#[derive(Debug)]
pub struct ContourChange {
    /// Identifies the contours before. If they are unknown, a new identity that nobody
    /// holds; `removed` and `added` are then empty.
    pub from: Arc<()>,
    /// Identifies the contours now.
    pub to: Arc<()>,
    /// Pieces that disappeared, excluding moving ones.
    pub removed: Contours,
    /// Pieces that appeared, excluding moving ones.
    pub added: Contours,
    /// All moving pieces; given in full at every change.
    pub moving: Arc<Contours>,
    /// Number of pieces now.
    pub count: usize,
}

impl Contours {
    /// No pieces in an image of this size.
    pub fn new(width: u32, height: u32) -> Contours {
        Contours { width, height, ..Contours::default() }
    }

    /// All pieces, borrowed.
    pub fn slice(&self) -> ContourSlice<'_> {
        let Contours { x, y, tx, ty, length, width, height } = self;
        ContourSlice { x, y, tx, ty, length, width: *width, height: *height }
    }

    /// Removes all pieces.
    pub(crate) fn clear(&mut self) {
        let Contours { x, y, tx, ty, length, .. } = self;
        [x, y, tx, ty, length].into_iter().for_each(Vec::clear);
    }

    /// Adds another's pieces.
    pub(crate) fn append(&mut self, other: &Contours) {
        self.x.extend_from_slice(&other.x);
        self.y.extend_from_slice(&other.y);
        self.tx.extend_from_slice(&other.tx);
        self.ty.extend_from_slice(&other.ty);
        self.length.extend_from_slice(&other.length);
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// True if there are no pieces.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Sum of the lengths, in pixels.
    pub fn total_length(&self) -> f64 {
        self.length.iter().map(|&l| f64::from(l)).sum()
    }
}

impl ContourSlice<'_> {
    /// The number of pieces.
    pub fn len(&self) -> usize {
        self.x.len().min(self.y.len()).min(self.tx.len()).min(self.ty.len()).min(self.length.len())
    }

    /// True if there are no pieces.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl ContourChange {
    /// Contours that no earlier ones help to count.
    pub(crate) fn whole(contours: Arc<Contours>) -> ContourChange {
        let none = || Contours::new(contours.width, contours.height);
        let (from, removed, added, count) = (Arc::default(), none(), none(), contours.len());
        ContourChange { to: Arc::clone(&from), from, removed, added, moving: contours, count }
    }

    /// True if no pieces stay from change to change.
    pub(crate) fn all_move(&self) -> bool {
        self.moving.len() == self.count
    }

    /// True if the change starts from the known contours and is shorter than starting from
    /// scratch.
    pub(crate) fn follows(&self, known: Option<&Arc<()>>) -> bool {
        self.removed.len() + self.added.len() < self.count
            && known.is_some_and(|known| Arc::ptr_eq(known, &self.from))
    }

    /// True if the change ends at the known contours.
    pub(crate) fn leads_to(&self, known: Option<&Arc<()>>) -> bool {
        known.is_some_and(|known| Arc::ptr_eq(known, &self.to))
    }
}
