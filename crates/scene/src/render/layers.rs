//! The contribution of each mesh of a solid to the picture, kept from drawing to drawing:
//! its depth in a rectangle, its pieces of contour before any is hidden, its depth range.
//! When one part of a body has moved, the others are not drawn again. The picture is
//! recomposed, with the nearest layer at each pixel, only where layers came or went, and
//! the pieces of another layer are tested again only if some of them are tested there.
//!
//! Invariant: a layer is a function of mesh, placement and camera alone, and 1 / q falls
//! as q grows, in `f32` too, so the nearest of the layers' depths is the depth of a full
//! drawing, and the contours are those of a full drawing, bit for bit.

use super::lines::contours::Contours;
use super::lines::extraction::{Room, extract_mesh};
use super::lines::visibility::{BESIDE, Depths, Piece};
use super::pixels::candidates::Candidates;
use super::pixels::frame::{depth_of, to_depth};
use super::pixels::project::{DepthRange, Lens, Placement, Projected};
use super::pixels::raster::{Area, Wanted, draw_mesh};
use super::simd::vectorised;
use super::{Camera, Projection, work};
use crate::geom::{Affine, Instance, Mesh, Solid};
use std::cell::RefCell;
use std::sync::{Arc, Weak};

/// Solids of fewer meshes are drawn in full, since each mesh is likely to have moved.
const FEWEST: usize = 3;

/// Solids of more meshes are drawn in full, since two drawings would not fit.
const MOST: usize = SLOTS / 2;

/// The most layers kept per thread.
const SLOTS: usize = 128;

/// The most memory that a thread's layers keep after a drawing. Solids that could need
/// more by themselves are drawn in full.
const BYTES: usize = 32 << 20;

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
    /// The pieces visible in the picture that last showed the layer.
    seen: Contours,
    /// Where exact depth was needed. Kept to reuse its memory.
    exact: Vec<u8>,
}

/// By pixel of the picture, the depth behind a mesh: where all of the mesh is nearer than
/// this, its exact depth does not matter.
pub(super) type Behind<'a> = &'a [f32];

/// A layer, with the mesh, placement and camera that it belongs to.
struct Slot {
    /// A weak reference, so that a dropped mesh is detected and its address is not
    /// reused.
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    camera: [u64; 17],
    /// The drawing that used it last.
    used: u64,
    /// The last drawing for which `layer.seen` is valid; 0 for none.
    seen_at: u64,
    /// The drawing that made the layer, and its slot: unique to each layer.
    made: (u64, usize),
    layer: Layer,
}

/// A layer in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shown {
    /// The index of its slot.
    at: usize,
    /// As in [`Slot`].
    made: (u64, usize),
    area: Area,
}

/// A thread's layers, and the picture composed last.
#[derive(Default)]
struct Layers {
    slots: Vec<Slot>,
    /// Drawings so far.
    clock: u64,
    /// Memory of all layers.
    bytes: usize,
    /// Each mesh's layer in the picture.
    shown: Vec<Shown>,
    /// Depth of the picture.
    depth: Vec<f32>,
    /// Size of the picture.
    size: [u32; 2],
    /// Depth range of the picture.
    extent: f64,
    /// Where layers came or went.
    dirty: Vec<Area>,
    projected: Projected,
    candidates: Candidates,
    room: Room,
    /// Number of visible pieces in the last drawing.
    found: usize,
}

thread_local! {
    static LAYERS: RefCell<Layers> = RefCell::new(Layers::default());
}

/// The contours of a solid, composed of layers; `None` for solids that are better drawn
/// in full.
pub(super) fn contours(solid: &Solid, camera: &Camera) -> Option<Contours> {
    let count = solid.mesh_count();
    let most_bytes = camera.pixels().saturating_mul(count).saturating_mul(size_of::<f32>());
    if !(FEWEST..=MOST).contains(&count) || most_bytes > BYTES {
        return None;
    }
    LAYERS.with(|layers| layers.try_borrow_mut().ok()?.contours(solid, camera))
}

impl Layers {
    fn contours(&mut self, solid: &Solid, camera: &Camera) -> Option<Contours> {
        let range = self.compose(solid, camera);
        let same_range = self.extent.to_bits() == range.extent().to_bits();
        self.extent = range.extent();
        let depths = Depths::new(&self.depth, camera.width, camera.height, self.extent)?;
        let mut out = Contours::with_room(camera, self.found);
        for shown in &self.shown {
            let Some(slot) = self.slots.get_mut(shown.at) else { continue };
            // 0 means never, in the first drawing too.
            let seen_before = slot.seen_at > 0 && slot.seen_at + 1 >= self.clock;
            let layer = &mut slot.layer;
            if !(same_range && seen_before)
                || self.dirty.iter().any(|dirty| dirty.meets(&layer.looks))
            {
                self.bytes -= layer.bytes();
                layer.seen.clear();
                layer
                    .pieces
                    .iter()
                    .filter(|piece| depths.visible(piece))
                    .for_each(|piece| layer.seen.push(piece));
                self.bytes += layer.bytes();
            }
            slot.seen_at = self.clock;
            out.append(&layer.seen);
        }
        self.found = out.len();
        self.trim();
        Some(out)
    }

    /// Updates the depth picture and the list of layers in it.
    fn compose(&mut self, solid: &Solid, camera: &Camera) -> DepthRange {
        self.clock += 1;
        self.dirty.clear();
        let (size, width) = ([camera.width, camera.height], camera.width as usize);
        if self.size != size || self.depth.len() != camera.pixels() {
            self.depth.clear();
            self.depth.resize(camera.pixels(), f32::INFINITY);
            self.shown.clear();
            self.size = size;
        }
        let eye = camera_bits(camera);
        let mut range = DepthRange::EMPTY;
        for (i, instance) in solid.instances().iter().enumerate() {
            let affine = affine_bits(&instance.affine);
            let is_it = |slot: &Slot| {
                std::ptr::eq(slot.mesh.as_ptr(), Arc::as_ptr(&instance.mesh))
                    && slot.affine == affine
                    && slot.camera == eye
            };
            // Usually the layer is in the same slot as before.
            let before = self.shown.get(i).copied();
            let kept =
                before.map(|shown| shown.at).filter(|&at| self.slots.get(at).is_some_and(is_it));
            let found = kept.or_else(|| self.slots.iter().position(is_it));
            work::count(|work| work.kept += u64::from(found.is_some()));
            let at = found.unwrap_or_else(|| self.draw(instance, camera, affine, eye));
            let Some(slot) = self.slots.get_mut(at) else { continue };
            slot.used = self.clock;
            range = range.and(&slot.layer.range);
            let now = Shown { at, made: slot.made, area: slot.layer.area };
            match self.shown.get_mut(i) {
                Some(shown) => *shown = now,
                None => self.shown.push(now),
            }
            if before.is_none_or(|before| before.made != now.made) {
                self.dirty.extend([before.map(|shown| shown.area).unwrap_or_default(), now.area]);
            }
        }
        let gone = self.shown.drain(solid.instances().len().min(self.shown.len())..);
        self.dirty.extend(gone.map(|shown| shown.area));
        Area::join(&mut self.dirty);
        work::count(|work| {
            work.partial += 1;
            work.pixels += self.dirty.iter().map(Area::pixels).sum::<usize>() as u64;
        });
        let Layers { dirty, depth, shown, slots, .. } = self;
        for area in dirty {
            for row in area.top..area.bottom {
                let row = depth.get_mut(row * width + area.left..row * width + area.right);
                row.unwrap_or_default().fill(f32::INFINITY);
            }
            vectorised(
                #[inline(always)]
                || {
                    for slot in shown.iter().filter_map(|shown| slots.get(shown.at)) {
                        slot.layer.show(depth, width, area);
                    }
                },
            );
        }
        range
    }

    /// Draws a layer and returns its slot: that of a dropped mesh, a new one, or the
    /// least recently used one.
    fn draw(
        &mut self,
        instance: &Instance,
        camera: &Camera,
        affine: [u64; 12],
        eye: [u64; 17],
    ) -> usize {
        let gone = self.slots.iter().position(|s| s.mesh.strong_count() == 0);
        let oldest = || (0..self.slots.len()).min_by_key(|&i| self.slots[i].used);
        let at = gone
            .or_else(|| if self.slots.len() < SLOTS { None } else { oldest() })
            .unwrap_or(self.slots.len());
        if at == self.slots.len() {
            let (used, seen_at, made, layer) = (0, 0, (0, 0), Layer::default());
            self.slots.push(Slot {
                mesh: Weak::new(),
                affine,
                camera: eye,
                used,
                seen_at,
                made,
                layer,
            });
        }
        let slot = &mut self.slots[at];
        self.bytes -= slot.layer.bytes();
        (slot.mesh, slot.affine, slot.camera) = (Arc::downgrade(&instance.mesh), affine, eye);
        (slot.made, slot.seen_at) = ((self.clock, at), 0);
        let tools = (&mut self.projected, &mut self.candidates);
        slot.layer.draw(instance, camera, tools, &mut self.room, |_, _| Sight::Whole);
        self.bytes += slot.layer.bytes();
        at
    }

    /// Frees layers until they are within the memory limit: first those of dropped
    /// meshes, then the least recently used ones.
    fn trim(&mut self) {
        while self.bytes > BYTES {
            let age = |slot: &Slot| if slot.mesh.strong_count() == 0 { 0 } else { slot.used };
            let Some(at) = (0..self.slots.len()).min_by_key(|&i| age(&self.slots[i])) else {
                return;
            };
            self.bytes -= self.slots.swap_remove(at).layer.bytes();
        }
    }
}

/// How much of a mesh can be visible.
pub(super) enum Sight<'a> {
    /// All of it.
    Whole,
    /// All of it; what is behind it is known.
    Before(Behind<'a>),
    /// Nothing.
    Hidden,
}

impl Layer {
    /// Draws a mesh alone. `sight` decides how much of it can be visible, from its depth
    /// range and the area that it covers. In front of something known, depth is exact
    /// where the mesh's own pieces are tested and where it may matter to what is behind;
    /// elsewhere it may be too large, but not by so much that it would matter.
    pub fn draw<'a>(
        &mut self,
        instance: &Instance,
        camera: &Camera,
        (projected, candidates): (&mut Projected, &mut Candidates),
        room: &mut Room,
        sight: impl FnOnce(&DepthRange, &Area) -> Sight<'a>,
    ) {
        let placement = Placement::new(camera, &instance.affine);
        projected.clear();
        self.range = projected.add(&instance.mesh, &placement, &Lens::new(camera));
        let vertices = projected.mesh(0);
        self.area = Area::around(&vertices, camera);
        self.pieces.clear();
        self.seen.clear();
        self.depth.clear();
        self.looks = Area::default();
        if vertices.outside(camera) {
            work::count(|work| work.outside += 1);
            return;
        }
        // If the near plane cuts the mesh, its depth range does not include the cut
        // itself.
        let sight = if vertices.whole { sight(&self.range, &self.area) } else { Sight::Whole };
        if let Sight::Hidden = sight {
            work::count(|work| work.hidden += 1);
            self.area = Area::default();
            return;
        }
        work::drawn(&instance.mesh);
        extract_mesh(&instance.mesh, &placement, camera, &vertices, room, |piece, _| {
            self.pieces.push(piece)
        });
        self.looks = Area::looked_at(&self.pieces, camera);
        let wanted = match sight {
            Sight::Before(behind) => {
                let least = vertices.least_nearness();
                self.find_exact(camera, behind, depth_of(Lens::new(camera).pinhole, least));
                Wanted::Exact(&self.exact, least)
            }
            _ => Wanted::All,
        };
        draw_mesh(
            &instance.mesh,
            &placement,
            camera,
            &vertices,
            candidates,
            (&self.area, wanted),
            &mut self.depth,
        );
        to_depth(camera, &mut self.depth);
    }

    /// Finds where exact depth is needed: where the mesh's own pieces are tested, and
    /// where its farthest point is not nearer than what is behind.
    fn find_exact(&mut self, camera: &Camera, behind: Behind<'_>, farthest: f32) {
        let Layer { area, exact, pieces, .. } = self;
        let (columns, width) = (area.right - area.left, camera.width as usize);
        exact.clear();
        exact.resize(area.pixels(), 1);
        if columns == 0 {
            return;
        }
        vectorised(
            #[inline(always)]
            || {
                for (row, exact) in (area.top..).zip(exact.chunks_exact_mut(columns)) {
                    let behind = behind
                        .get(row * width + area.left..row * width + area.right)
                        .unwrap_or_default();
                    exact
                        .iter_mut()
                        .zip(behind)
                        .for_each(|(exact, behind)| *exact = u8::from(farthest >= *behind));
                }
            },
        );
        for pixel in pieces.iter().flat_map(|piece| [0, 1].map(|side| piece.pixel(side))).flatten()
        {
            let (row, column) = (pixel as usize / width, pixel as usize % width);
            if (area.top..area.bottom).contains(&row) && (area.left..area.right).contains(&column) {
                exact[(row - area.top) * columns + column - area.left] = 1;
            }
        }
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

    fn bytes(&self) -> usize {
        let numbers = self.depth.capacity() + 5 * self.seen.x.capacity();
        numbers * size_of::<f32>()
            + self.exact.capacity()
            + self.pieces.capacity() * size_of::<Piece>()
    }
}

impl Area {
    /// Removes areas without pixels. If the areas overlap so much that a single one
    /// around all of them has fewer pixels than their sum, replaces them by that one.
    pub(super) fn join(areas: &mut Vec<Area>) {
        areas.retain(|area| area.pixels() > 0);
        let around = areas.iter().fold(Area::default(), |all, area| all.with(area));
        if areas.iter().map(Area::pixels).sum::<usize>() > around.pixels() {
            areas.clear();
            areas.push(around);
        }
    }

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

pub(super) fn affine_bits(affine: &Affine) -> [u64; 12] {
    affine.0.to_cols_array().map(f64::to_bits)
}

pub(super) fn camera_bits(camera: &Camera) -> [u64; 17] {
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

#[cfg(test)]
#[path = "layers_tests.rs"]
mod tests;
