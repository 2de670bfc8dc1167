//! A mesh that moves in front of the static layer: its layer at the current and the previous
//! placement.

use super::layer::{Layer, Shows, Tools, affine_bits};
use super::meshes::Member;
use super::static_layer::StaticLayer;
use crate::geom::Mesh;
use crate::render::lines::visibility::Depths;
use crate::render::pixels::area::Area;
use crate::render::pixels::project::DepthRange;
use crate::render::{Camera, Contours};
use std::sync::{Arc, Weak};

/// A layer, with the mesh and placement that it belongs to.
#[derive(Default)]
pub struct PlacedLayer {
    /// A weak reference, so that the address of a dropped mesh is not reused.
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    pub layer: Layer,
    /// The static layer that hides all of it, for which nothing was drawn.
    hidden_by: Option<Arc<()>>,
}

impl PlacedLayer {
    /// True if it was drawn, so that it is valid in front of any static layer.
    pub fn is_drawn(&self) -> bool {
        self.hidden_by.is_none()
    }
}

/// A mesh that has moved, with its layers at the current and the previous placement.
#[derive(Default)]
pub struct DynamicMesh {
    pub index: usize,
    pub now: PlacedLayer,
    before: PlacedLayer,
    /// The pieces of the current layer that are visible.
    pub seen: Contours,
    /// The drawing in which it moved last.
    pub moved: u64,
}

impl DynamicMesh {
    /// The mesh with an index, not drawn yet.
    pub fn new(index: usize) -> DynamicMesh {
        DynamicMesh { index, ..DynamicMesh::default() }
    }

    /// Moves it to a member's mesh and placement, drawing a layer unless the current
    /// or the previous one fits. Nothing is drawn of a mesh that `behind` hides.
    pub fn move_to(
        &mut self,
        Member { instance, .. }: &Member<'_>,
        (camera, shows): (&Camera, Shows),
        tools: &mut Tools,
        behind: Option<&StaticLayer>,
    ) {
        let affine = affine_bits(&instance.affine);
        let is_it = |own: &PlacedLayer| {
            let hides = |known| behind.is_some_and(|b| Arc::ptr_eq(known, &b.prepared));
            own.hidden_by.as_ref().is_none_or(hides)
                && own.affine == affine
                && std::ptr::eq(own.mesh.as_ptr(), Arc::as_ptr(&instance.mesh))
        };
        if is_it(&self.now) {
            return;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        if is_it(&self.now) {
            return;
        }
        let PlacedLayer { layer, hidden_by, .. } = &mut self.now;
        *hidden_by = None;
        let hidden = |range: &DepthRange, area: &Area| {
            let by = behind.filter(|b| b.hides(range, area, camera));
            *hidden_by = by.map(|b| Arc::clone(&b.prepared));
            by.is_some()
        };
        layer.draw(instance, (camera, shows), tools, hidden);
        (self.now.mesh, self.now.affine) = (Arc::downgrade(&instance.mesh), affine);
    }

    /// Determines which of its pieces are visible.
    pub fn look(&mut self, depths: &Depths<'_>) {
        self.seen.clear();
        let DynamicMesh { now, seen, .. } = self;
        now.layer
            .pieces
            .iter()
            .filter(|piece| depths.visible(piece))
            .for_each(|piece| seen.push(piece));
    }
}
