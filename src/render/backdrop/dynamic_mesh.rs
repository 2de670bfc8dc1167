//! A mesh that moves before a backdrop: its layer where it is, and where it was before.

use super::static_layer::StaticLayer;
use crate::geom::{Instance, Mesh};
use crate::render::Camera;
use crate::render::candidates::Candidates;
use crate::render::contours::Contours;
use crate::render::extraction::Room;
use crate::render::layers::{Layer, Sight, affine_bits};
use crate::render::project::{DepthRange, Projected};
use crate::render::raster::Area;
use crate::render::visibility::Depths;
use std::sync::{Arc, Weak};

/// What drawing a layer needs room for.
#[derive(Default)]
pub struct Tools {
    pub projected: Projected,
    pub candidates: Candidates,
    pub room: Room,
}

/// A layer and whose it is.
#[derive(Default)]
pub struct PlacedLayer {
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    pub layer: Layer,
    /// What it was drawn before, if that left out some of it: what hides all of it, or
    /// does not mind how near it is.
    settled: Option<Arc<()>>,
}

impl PlacedLayer {
    /// Whether it may be looked at before something else, too.
    pub fn is_whole(&self) -> bool {
        self.settled.is_none()
    }
}

/// A mesh that has moved: its layer where it is, and where it was before.
#[derive(Default)]
pub struct DynamicMesh {
    pub leaf: usize,
    pub now: PlacedLayer,
    before: PlacedLayer,
    pub seen: Contours,
}

impl DynamicMesh {
    /// A mesh by its number, nowhere yet.
    pub fn new(leaf: usize) -> DynamicMesh {
        DynamicMesh { leaf, ..DynamicMesh::default() }
    }

    /// Its layer is that of the instance from here on. Nothing is drawn of one that this
    /// backdrop hides; if it is the only mover, its depth need only be known where it
    /// matters.
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

    /// Tells which of its pieces are seen.
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
