//! Depth at selected pixels only: those at which pieces of contour are tested. Triangles
//! that cover none of them are not drawn.
//!
//! Invariant: the depth of a marked pixel is that of the full depth image, bit for bit.

use crate::geom::Solid;
use crate::render::Camera;
use crate::render::pixels::area::Area;
use crate::render::pixels::candidates::Candidates;
use crate::render::pixels::frame::depth_of;
use crate::render::pixels::pixel_bitmap::PixelBitmap;
use crate::render::pixels::project::{Lens, Placement, Projected};
use crate::render::pixels::raster::{empty, fill_mesh};
use crate::render::pixels::triangle::bits;

/// Marked pixels of an image, and their depth. Reused from image to image.
#[derive(Default)]
pub(in crate::render) struct SparseDepth {
    bitmap: PixelBitmap,
    /// Nearness, then depth; meaningless at unmarked pixels.
    depth: Vec<f32>,
    empty: f32,
    candidates: Candidates,
}

impl SparseDepth {
    /// Removes all marks.
    pub fn clear(&mut self, camera: &Camera) {
        self.bitmap.clear(camera);
        if self.depth.len() < camera.pixels() {
            self.depth.resize(camera.pixels(), 0.0);
        }
        self.empty = empty(camera);
    }

    /// Marks a pixel.
    #[inline]
    pub fn mark(&mut self, pixel: u32) {
        self.bitmap.set(pixel);
        if let Some(depth) = self.depth.get_mut(pixel as usize) {
            *depth = self.empty;
        }
    }

    /// Draws the solid at the marked pixels and returns the depth image; its other
    /// entries are meaningless.
    pub fn draw(&mut self, solid: &Solid, camera: &Camera, projected: &Projected) -> &[f32] {
        let SparseDepth { bitmap, depth, candidates, .. } = self;
        bitmap.finish();
        let depth = &mut depth[..camera.pixels()];
        let area = Area::whole(camera);
        for (i, item) in solid.instances().iter().enumerate() {
            let (placement, vertices) = (Placement::new(camera, &item.affine), projected.mesh(i));
            if !vertices.outside(camera) {
                fill_mesh(
                    &item.mesh,
                    &placement,
                    camera,
                    &vertices,
                    candidates,
                    (&area, Some(bitmap)),
                    depth,
                );
            }
        }
        let pinhole = Lens::new(camera).pinhole;
        for (i, word) in bitmap.words().iter().enumerate() {
            for bit in bits(*word) {
                let at = &mut depth[i * 64 + bit];
                *at = depth_of(pinhole, *at);
            }
        }
        depth
    }
}
