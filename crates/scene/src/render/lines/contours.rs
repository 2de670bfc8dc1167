//! Visible contours of a solid: smooth silhouettes, boundaries and creases, as short
//! oriented pieces.
//!
//! A smooth silhouette is the zero set of (interpolated vertex normal . direction to the
//! camera) inside each face, so it moves smoothly with the pose and does not follow the
//! mesh's edges. Texture and shading edges are not contours here. Invariant: the five
//! lists have one entry per piece, all finite, positions inside the image, tangents of
//! unit length.

use crate::contours::Contours;
use crate::geom::Solid;
use crate::render::lines::extraction::{Room, extract_mesh};
use crate::render::lines::visibility::{Depths, Piece};
use crate::render::pixels::project::{DepthRange, Placement, Projected, project};
use crate::render::pixels::sparse_depth::SparseDepth;
use crate::render::{Camera, work};
use std::cell::RefCell;

/// Buffers reused from call to call.
#[derive(Default)]
struct Scratch {
    projected: Projected,
    room: Room,
    looked: SparseDepth,
    /// Pieces, hidden or not.
    pieces: Vec<Piece>,
    hidden: Vec<bool>,
    /// Number of visible pieces the last time.
    found: usize,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::new(Scratch::default());
}

impl Contours {
    /// The contours of a solid in a camera's image.
    pub fn of(solid: &Solid, camera: &Camera) -> Contours {
        if let Some(r) = solid.revolution() {
            return Contours::of_revolution(&r.surface, &r.affine, camera);
        }
        with_scratch(|scratch| scratch.of_meshes(solid, camera))
    }

    /// As [`Contours::of`], with the depth image of the same solid and camera already
    /// drawn.
    pub(in crate::render) fn with_depth(solid: &Solid, camera: &Camera, depth: &[f32]) -> Contours {
        if let Some(r) = solid.revolution() {
            return Contours::of_revolution(&r.surface, &r.affine, camera);
        }
        with_scratch(|scratch| {
            let range = scratch.trace(solid, camera);
            let depths = Depths::new(depth, camera.width, camera.height, range.extent());
            let visible =
                |piece: &&Piece| depths.as_ref().is_some_and(|depths| depths.visible(piece));
            seen(scratch.pieces.iter().filter(visible), camera, &mut scratch.found)
        })
    }

    /// No pieces yet, with room for about as many as were `found` the last time.
    pub(in crate::render) fn with_room(camera: &Camera, found: usize) -> Contours {
        let room = || Vec::with_capacity(found + found / 8 + 16);
        let (width, height) = (camera.width, camera.height);
        Contours { x: room(), y: room(), tx: room(), ty: room(), length: room(), width, height }
    }

    /// Adds a visible piece.
    #[inline]
    pub(in crate::render) fn push(&mut self, piece: &Piece) {
        self.x.push(piece.x);
        self.y.push(piece.y);
        self.tx.push(piece.tx);
        self.ty.push(piece.ty);
        self.length.push(piece.length);
    }
}

fn with_scratch<T>(work: impl FnOnce(&mut Scratch) -> T) -> T {
    SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
        Ok(mut scratch) => work(&mut scratch),
        Err(_) => work(&mut Scratch::default()),
    })
}

impl Scratch {
    /// Projects a solid and extracts its pieces of contour, hidden or not.
    fn trace(&mut self, solid: &Solid, camera: &Camera) -> DepthRange {
        work::count(|work| work.whole += 1);
        let range = project(solid, camera, &mut self.projected);
        self.pieces.clear();
        for (i, instance) in solid.instances().iter().enumerate() {
            let (placement, vertices) =
                (Placement::new(camera, &instance.affine), self.projected.mesh(i));
            if vertices.outside(camera) {
                work::count(|work| work.outside += 1);
                continue;
            }
            work::drawn(&instance.mesh);
            let pieces = &mut self.pieces;
            extract_mesh(
                &instance.mesh,
                &placement,
                camera,
                &vertices,
                &mut self.room,
                |piece, _| pieces.push(piece),
            );
        }
        range
    }

    /// The contours of the solid's meshes.
    fn of_meshes(&mut self, solid: &Solid, camera: &Camera) -> Contours {
        let range = self.trace(solid, camera);
        let Scratch { projected, looked, pieces, hidden, found, .. } = self;
        hidden.clear();
        hidden.resize(pieces.len(), true);
        // Most pieces pass their first test: only the others need the second one.
        for side in 0..2 {
            let pixels = || {
                hidden
                    .iter()
                    .zip(&*pieces)
                    .filter(|(hidden, _)| **hidden)
                    .filter_map(|(_, p)| p.pixel(side))
            };
            if pixels().next().is_none() {
                break;
            }
            looked.clear(camera);
            pixels().for_each(|pixel| looked.mark(pixel));
            let depth = looked.draw(solid, camera, projected);
            let Some(depths) = Depths::new(depth, camera.width, camera.height, range.extent())
            else {
                break;
            };
            for (hidden, piece) in hidden.iter_mut().zip(&*pieces) {
                *hidden = *hidden && !depths.visible_by(piece, side);
            }
        }
        seen(
            pieces.iter().zip(hidden).filter(|(_, hidden)| !**hidden).map(|(piece, _)| piece),
            camera,
            found,
        )
    }
}

/// The contours of the visible pieces; `found` is their number the last time, and is
/// updated.
fn seen<'a>(
    pieces: impl Iterator<Item = &'a Piece>,
    camera: &Camera,
    found: &mut usize,
) -> Contours {
    let mut out = Contours::with_room(camera, *found);
    pieces.for_each(|piece| out.push(piece));
    *found = out.len();
    out
}

#[cfg(test)]
#[path = "contours_tests.rs"]
mod tests;
