//! A mesh that moves relative to a backdrop: its layer at the current and the previous
//! placement.

use super::static_layer::StaticLayer;
use crate::geom::{Instance, Mesh};
use crate::render::Camera;
use crate::render::layers::{Layer, Sight, affine_bits};
use crate::render::lines::contours::Contours;
use crate::render::lines::extraction::Room;
use crate::render::lines::visibility::Depths;
use crate::render::pixels::candidates::Candidates;
use crate::render::pixels::project::{DepthRange, Projected};
use crate::render::pixels::raster::Area;
use std::sync::{Arc, Weak};

/// Scratch memory for drawing a layer.
#[derive(Default)]
pub struct Tools {
    pub projected: Projected,
    pub candidates: Candidates,
    pub room: Room,
}

/// A layer, with the mesh and placement that it belongs to.
#[derive(Default)]
pub struct PlacedLayer {
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    pub layer: Layer,
    /// If something was left out, the static layer that it was drawn against: because
    /// that layer hides all of it, or because exact depth did not matter in front of it.
    settled: Option<Arc<()>>,
}

impl PlacedLayer {
    /// Whether nothing was left out, so that it is valid against any static layer.
    pub fn is_whole(&self) -> bool {
        self.settled.is_none()
    }
}

/// A mesh that has moved, with its layers at the current and the previous placement.
#[derive(Default)]
pub struct DynamicMesh {
    pub leaf: usize,
    pub now: PlacedLayer,
    before: PlacedLayer,
    pub seen: Contours,
}

impl DynamicMesh {
    /// The mesh with an index, not drawn yet.
    pub fn new(leaf: usize) -> DynamicMesh {
        DynamicMesh { leaf, ..DynamicMesh::default() }
    }

    /// Moves it to an instance's mesh and placement, drawing a layer unless the current
    /// or the previous one fits. Nothing is drawn of a mesh that `behind` hides; if it is
    /// the `only` dynamic mesh, its depth is exact only where that matters.
    pub fn move_to(
        &mut self,
        instance: &Instance,
        camera: &Camera,
        tools: &mut Tools,
        behind: Option<&StaticLayer>,
        only: bool,
    ) {
        let affine = affine_bits(&instance.affine);
        let holds = |own: &PlacedLayer| {
            own.settled
                .as_ref()
                .is_none_or(|known| only && behind.is_some_and(|b| Arc::ptr_eq(known, &b.settled)))
        };
        let is_it = |own: &PlacedLayer| {
            holds(own)
                && own.affine == affine
                && std::ptr::eq(own.mesh.as_ptr(), Arc::as_ptr(&instance.mesh))
        };
        if is_it(&self.now) {
            return;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        if !is_it(&self.now) {
            (self.now.mesh, self.now.affine) = (Arc::downgrade(&instance.mesh), affine);
            let Tools { projected, candidates, room } = tools;
            let settled = &mut self.now.settled;
            *settled = None;
            let sight = |range: &DepthRange, area: &Area| {
                let Some(static_layer) = behind else { return Sight::Whole };
                let sight = match static_layer.hides(range, area, camera) {
                    true => Sight::Hidden,
                    false if only => Sight::Before(&static_layer.nearest),
                    false => return Sight::Whole,
                };
                *settled = Some(Arc::clone(&static_layer.settled));
                sight
            };
            self.now.layer.draw(instance, camera, (projected, candidates), room, sight);
        }
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
