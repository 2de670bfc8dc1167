//! The contribution of one mesh to a picture: its depth in a rectangle, its pieces of
//! contour before any is hidden, its depth range.
//!
//! Invariant: a layer is a function of mesh, placement and camera alone, and 1 / q falls
//! as q grows, in `f32` too, so the nearest of the layers' depths is the depth of a full
//! drawing, and the contours are those of a full drawing, bit for bit.

use crate::geom::{Affine, Instance};
use crate::render::lines::extraction::{Room, extract_mesh};
use crate::render::lines::visibility::{BESIDE, Piece};
use crate::render::pixels::area::Area;
use crate::render::pixels::candidates::Candidates;
use crate::render::pixels::frame::to_depth;
use crate::render::pixels::project::{DepthRange, Lens, Placement, Projected};
use crate::render::pixels::raster::draw_mesh;
use crate::render::{Camera, Projection, work};

/// Scratch memory for drawing a layer.
#[derive(Default)]
pub struct Tools {
    pub projected: Projected,
    pub candidates: Candidates,
    pub room: Room,
}

/// The channels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shows {
    /// Depth alone.
    Depth,
    /// Depth and contours.
    Contours,
}

/// The contribution of one mesh to a picture.
#[derive(Default)]
pub(super) struct Layer {
    pub area: Area,
    /// Depth in the area, row by row, infinite off the mesh.
    depth: Vec<f32>,
    pub range: DepthRange,
    pub pieces: Vec<Piece>,
    /// Contains all pixels at which the pieces are tested.
    pub looks: Area,
}

impl Layer {
    /// Draws a mesh alone, unless `hidden`, given its depth range and the area that it
    /// covers, holds.
    pub fn draw(
        &mut self,
        instance: &Instance,
        (camera, shows): (&Camera, Shows),
        Tools { projected, candidates, room }: &mut Tools,
        hidden: impl FnOnce(&DepthRange, &Area) -> bool,
    ) {
        let placement = Placement::new(camera, &instance.affine);
        projected.clear();
        self.range = projected.add(&instance.mesh, &placement, &Lens::new(camera));
        let vertices = projected.mesh(0);
        self.area = vertices.area(camera);
        self.pieces.clear();
        self.depth.clear();
        self.looks = Area::default();
        if vertices.outside(camera) {
            work::count(|work| work.outside += 1);
            return;
        }
        // If the near plane cuts the mesh, its depth range does not include the cut
        // itself.
        if vertices.whole && hidden(&self.range, &self.area) {
            work::count(|work| work.hidden += 1);
            self.area = Area::default();
            return;
        }
        work::drawn(&instance.mesh);
        if shows == Shows::Contours {
            extract_mesh(&instance.mesh, &placement, camera, &vertices, room, |piece, _| {
                self.pieces.push(piece)
            });
        }
        self.looks = Area::looked_at(&self.pieces, camera);
        let (mesh, area) = (&instance.mesh, &self.area);
        draw_mesh(mesh, &placement, camera, &vertices, candidates, area, &mut self.depth);
        to_depth(camera, &mut self.depth);
    }

    /// Merges the layer into an area of the picture, keeping the nearer depth.
    #[inline(always)]
    pub fn show(&self, picture: &mut [f32], width: usize, within: &Area) {
        let area = self.area.common(within);
        if area.pixels() == 0 {
            return;
        }
        let columns = self.area.right - self.area.left;
        for row in area.top..area.bottom {
            let start = (row - self.area.top) * columns + area.left - self.area.left;
            let own = self.depth.get(start..start + area.right - area.left);
            let there = picture.get_mut(row * width + area.left..row * width + area.right);
            let (Some(own), Some(there)) = (own, there) else { return };
            for (there, own) in there.iter_mut().zip(own) {
                *there = if *own < *there { *own } else { *there };
            }
        }
    }
}

impl Area {
    /// A rectangle that contains all pixels at which pieces are tested.
    fn looked_at(pieces: &[Piece], camera: &Camera) -> Area {
        let ends = |side: u32, at: fn(&Piece) -> f32| {
            let (low, high) =
                pieces.iter().map(at).fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| {
                    (low.min(v), high.max(v))
                });
            // Positions outside of the image are tested at the nearest pixel inside.
            let (reach, last) = (BESIDE as f32 + 1.0, side as f32 - 1.0);
            let index = |v: f32| v.max(0.0).min(last) as usize;
            if pieces.is_empty() { (0, 0) } else { (index(low - reach), index(high + reach) + 1) }
        };
        let ((left, right), (top, bottom)) =
            (ends(camera.width, |p| p.x), ends(camera.height, |p| p.y));
        Area { left, right, top, bottom }
    }
}

pub(in crate::render) fn affine_bits(affine: &Affine) -> [u64; 12] {
    affine.0.to_cols_array().map(f64::to_bits)
}

pub(in crate::render) fn camera_bits(camera: &Camera) -> [u64; 17] {
    let (kind, scale, cx, cy) = match camera.projection {
        Projection::Pinhole { focal_px, cx, cy } => (0, focal_px, cx, cy),
        Projection::Orthographic { units_per_pixel, cx, cy } => (1, units_per_pixel, cx, cy),
    };
    let axes = [camera.eye, camera.right, camera.up, camera.forward]
        .map(|v| v.to_array().map(f64::to_bits));
    let mut out = [0; 17];
    out[..12].copy_from_slice(axes.as_flattened());
    let size = u64::from(camera.width) << 32 | u64::from(camera.height);
    out[12..].copy_from_slice(&[size, kind, scale.to_bits(), cx.to_bits(), cy.to_bits()]);
    out
}
