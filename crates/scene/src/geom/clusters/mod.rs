//! Clusters of faces of a mesh that keeps its shape, in two trees: one tells which faces a
//! silhouette may cross, the other which faces may cover a pixel.
//!
//! They cost as much as several drawings, so they are made when the same mesh has been
//! drawn several times: meshes with new vertices each time never get any.

mod facing;
mod shape;
mod surface;
mod tree;

pub(crate) use facing::{FacingTree, Few};
pub(crate) use shape::Shape;
pub(crate) use surface::{Faces, SurfaceTree};
pub(crate) use tree::{LEAF, Node, WIDE};

use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Drawings of a mesh before its trees are made: they cost about as much.
const DRAWINGS: u32 = 24;
/// Meshes with fewer faces are drawn as quickly without.
const FEWEST: usize = 256;
/// Trees take some 80 bytes a face, so larger meshes do without.
const MOST: usize = 1_000_000;

/// The trees of a mesh, made when it has been drawn several times. As they follow from the
/// mesh, all values compare equal and are printed alike.
#[derive(Default)]
pub struct Clusters {
    drawings: AtomicU32,
    trees: OnceLock<Option<Box<Trees>>>,
}

/// Both trees, and the mesh that they were made from.
pub(crate) struct Trees {
    pub facing: FacingTree,
    pub surface: SurfaceTree,
    /// Where the mesh's lists are in memory, and how long they are.
    made_from: [(usize, usize); 3],
}

impl fmt::Debug for Clusters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Clusters")
    }
}

/// A clone makes its own, since it may get other vertices.
impl Clone for Clusters {
    fn clone(&self) -> Clusters {
        Clusters::default()
    }
}

impl PartialEq for Clusters {
    fn eq(&self, _: &Clusters) -> bool {
        true
    }
}

impl Clusters {
    /// Counts a drawing of the mesh, and returns its trees if it has been drawn often and
    /// has any. `mesh` must be the mesh that this belongs to.
    pub(crate) fn drawn(&self, mesh: Shape<'_>) -> Option<&Trees> {
        let trees = match self.trees.get() {
            Some(trees) => trees,
            // While one thread makes them, others draw without.
            None if self.drawings.fetch_add(1, Ordering::Relaxed) == DRAWINGS => {
                self.trees.get_or_init(|| Trees::new(mesh).map(Box::new))
            }
            None => return None,
        };
        trees.as_deref().filter(|trees| trees.made_from == mesh.lists())
    }

    /// Makes the trees now, for tests.
    #[cfg(test)]
    pub(crate) fn make(&self, mesh: Shape<'_>) -> Option<&Trees> {
        self.trees.get_or_init(|| Trees::new(mesh).map(Box::new)).as_deref()
    }
}

impl Trees {
    /// `None` for a mesh that is too small, too large or not sound.
    fn new(mesh: Shape<'_>) -> Option<Trees> {
        let Shape { positions, normals, triangles } = mesh;
        if !(FEWEST..=MOST).contains(&triangles.len()) || positions.len() != normals.len() {
            return None;
        }
        let mut used = vec![false; positions.len()];
        for v in triangles.as_flattened() {
            *used.get_mut(*v as usize)? = true;
        }
        // The depth range is that of all vertices, with a face or not.
        let sound = used.iter().all(|used| *used)
            && positions
                .iter()
                .chain(normals)
                .all(|v| v.is_finite() && v.abs().max_element() < 1e15);
        let made = || Trees {
            facing: FacingTree::new(mesh),
            surface: SurfaceTree::new(mesh),
            made_from: mesh.lists(),
        };
        sound.then(made)
    }
}

#[cfg(test)]
mod tests;
