//! A mesh that moves before a backdrop: its layer where it is, and where it was before.

use super::still::Still;
use crate::geom::{Instance, Mesh};
use crate::render::Camera;
use crate::render::candidates::Candidates;
use crate::render::contours::Contours;
use crate::render::layers::{Layer, affine_bits};
use crate::render::project::{DepthRange, Projected};
use crate::render::raster::Area;
use crate::render::trace::Room;
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
pub struct Own {
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    pub layer: Layer,
    /// Whether it was left undrawn, since the backdrop hides all of it.
    pub hidden: bool,
}

/// A mesh that has moved: its layer where it is, and where it was before.
#[derive(Default)]
pub struct Mover {
    pub leaf: usize,
    pub now: Own,
    before: Own,
    pub seen: Contours,
}

impl Mover {
    /// A mesh by its number, nowhere yet.
    pub fn new(leaf: usize) -> Mover {
        Mover { leaf, ..Mover::default() }
    }

    /// Its layer is that of the instance from here on; nothing is drawn of one that this backdrop hides.
    pub fn move_to(&mut self, instance: &Instance, camera: &Camera, tools: &mut Tools, behind: Option<&Still>) {
        let affine = affine_bits(&instance.affine);
        let is_it = |own: &Own| {
            !own.hidden && own.affine == affine && std::ptr::eq(own.mesh.as_ptr(), Arc::as_ptr(&instance.mesh))
        };
        if is_it(&self.now) {
            return;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        if !is_it(&self.now) {
            (self.now.mesh, self.now.affine) = (Arc::downgrade(&instance.mesh), affine);
            let Tools { projected, candidates, room } = tools;
            let hides = |range: &DepthRange, area: &Area| behind.is_some_and(|still| still.hides(range, area, camera));
            self.now.hidden = !self.now.layer.draw(instance, camera, (projected, candidates), room, hides);
        }
    }

    /// Tells which of its pieces are seen.
    pub fn look(&mut self, depths: &Depths<'_>) {
        self.seen.clear();
        let Mover { now, seen, .. } = self;
        now.layer.pieces.iter().filter(|piece| depths.visible(piece)).for_each(|piece| seen.push(piece));
    }
}
