//! The picture of one camera, kept from drawing to drawing.
//!
//! Contours are those of a full drawing, bit for bit. For pieces of the static layer this
//! relies on the depth tests being monotone, in `f64` too: a piece hidden by another mesh
//! or at a smaller depth range stays hidden with both.

use super::dynamic_mesh::DynamicMesh;
use super::layer::{Layer, Shows, Tools};
use super::meshes::{Member, Meshes, members};
use super::static_layer::StaticLayer;
use crate::geom::Solid;
use crate::render::lines::visibility::Depths;
use crate::render::pixels::area::Area;
use crate::render::simd::vectorised;
use crate::render::{Camera, ContourChange, Contours, work};
use std::sync::Arc;

/// Limit on a static layer's memory, in pieces; scenes of more pieces are drawn in full.
const MOST_PIECES: usize = 1 << 19;

/// Limit on the memory of the moving meshes' layers, in pixels; scenes that could need
/// more are drawn in full.
const MOST_PIXELS: usize = 1 << 23;

/// A mesh that has not moved in that many drawings counts as stationary again, if most
/// meshes count as moving.
const PATIENCE: u64 = 1024;

/// The state of one camera's picture.
pub(super) struct IncrementalImage {
    /// The bits of the camera, and what is shown, which identify the picture.
    camera: [u64; 17],
    shows: Shows,
    /// The meshes shown.
    shown: Meshes,
    /// The meshes of the last solid most of which was not shown.
    last: Meshes,
    dynamic: Vec<DynamicMesh>,
    static_layer: Option<StaticLayer>,
    depth: Vec<f32>,
    extent: f64,
    /// The number of drawings so far.
    clock: u64,
    /// The drawing in which idle meshes were last looked for.
    swept: u64,
    /// Identifies the contours shown.
    at: Arc<()>,
    /// Number of visible pieces: of the stationary meshes, and of all.
    still: usize,
    count: usize,
    // Scratch memory, reused.
    scratch: Layer,
    rows: Vec<f32>,
    pixels: Vec<u32>,
    areas: Vec<Area>,
    /// By pixel of an area: whether the depth tests there must be repeated.
    again: Vec<u8>,
    /// Number of meshes when building last failed because of too many pieces.
    refused: Option<usize>,
}

impl IncrementalImage {
    /// A picture without meshes; nothing is drawn yet.
    pub fn new(camera: [u64; 17], shows: Shows) -> IncrementalImage {
        IncrementalImage {
            camera,
            shows,
            shown: Meshes::default(),
            last: Meshes::default(),
            dynamic: Vec::new(),
            static_layer: None,
            depth: Vec::new(),
            extent: 0.0,
            clock: 0,
            swept: 0,
            at: Arc::default(),
            still: 0,
            count: 0,
            scratch: Layer::default(),
            rows: Vec::new(),
            pixels: Vec::new(),
            areas: Vec::new(),
            again: Vec::new(),
            refused: None,
        }
    }

    /// True if it is the picture of the camera with these bits that shows this.
    pub fn is_of(&self, camera: &[u64; 17], shows: Shows) -> bool {
        self.shows == shows && self.camera == *camera
    }

    /// True if it shows just this solid.
    pub fn shows(&self, solid: &Solid) -> bool {
        self.static_layer.is_some()
            && self.shown.len() == solid.mesh_count()
            && self.shown.changed(solid).is_empty()
    }

    /// Depth, row by row.
    pub fn depth(&self) -> &[f32] {
        &self.depth
    }

    /// Shows a solid and returns the change. `None` if the solid is better drawn in full:
    /// most of its meshes have moved since the last drawing, or it needs too much memory.
    pub fn draw(
        &mut self,
        solid: &Solid,
        camera: &Camera,
        tools: &mut Tools,
    ) -> Option<ContourChange> {
        self.clock += 1;
        let count = solid.mesh_count();
        if self.refused == Some(count) {
            return None;
        }
        let most = |some: &[Member<'_>]| 2 * some.len() > count;
        let changed = self.shown.changed(solid);
        if most(&changed) {
            // The picture shows something else. Whether it is worth showing this solid
            // depends on how much it differs from the last one.
            let since = self.last.changed(solid);
            self.last.set(solid, &since);
            if most(&since) {
                return None;
            }
            self.static_layer = None;
            self.mark(&since);
        } else {
            self.mark(&changed);
        }
        self.dynamic.retain(|m| m.index < count);
        if self.shown.len() != count {
            self.static_layer = None;
        }
        if 2 * self.dynamic.len() > count {
            self.sweep(count);
        }
        if self.dynamic.len().saturating_mul(camera.pixels()) > MOST_PIXELS {
            self.forget();
            return None;
        }
        let known = self.static_layer.is_some();
        if !known && self.build(solid, camera, tools).is_none() {
            self.refused = Some(count);
            self.forget();
            return None;
        }
        self.shown.set(solid, &changed);
        let static_layer = self.static_layer.as_mut()?;
        self.areas.clear();
        if known {
            work::count(|work| work.kept += (count - changed.len()) as u64);
            for member in &changed {
                let found = self.dynamic.binary_search_by_key(&member.index, |m| m.index);
                let Some(mesh) = found.ok().and_then(|at| self.dynamic.get_mut(at)) else {
                    continue;
                };
                self.areas.push(mesh.now.layer.area);
                mesh.move_to(member, (camera, self.shows), tools, Some(static_layer));
                self.areas.push(mesh.now.layer.area);
            }
        }
        let range =
            self.dynamic.iter().fold(static_layer.range, |range, m| range.and(&m.now.layer.range));
        let before = std::mem::replace(&mut self.extent, range.extent());
        if known && static_layer.holds(self.extent) {
            return self.step(camera, [before, self.extent]);
        }
        static_layer.sort_pieces(camera, self.extent, known)?;
        if self.dynamic.iter().any(|m| !m.now.is_drawn()) {
            // What was skipped as hidden may be visible at another depth range.
            self.move_all(solid, camera, tools);
        }
        self.begin(camera)
    }

    /// Counts meshes as moving from now on.
    fn mark(&mut self, moved: &[Member<'_>]) {
        for Member { index, .. } in moved {
            let at = match self.dynamic.binary_search_by_key(index, |m| m.index) {
                Ok(at) => at,
                Err(at) => {
                    self.dynamic.insert(at, DynamicMesh::new(*index));
                    self.static_layer = None;
                    at
                }
            };
            self.dynamic[at].moved = self.clock;
        }
    }

    /// Where most meshes count as moving, all others count as moving too; now and then,
    /// those that have not moved for long count as stationary.
    fn sweep(&mut self, count: usize) {
        if self.clock - self.swept > PATIENCE {
            let since = self.clock.saturating_sub(PATIENCE);
            let before = self.dynamic.len();
            self.dynamic.retain(|m| m.moved >= since);
            if self.dynamic.len() < before {
                self.static_layer = None;
            }
            self.swept = self.clock;
        }
        if 2 * self.dynamic.len() > count && self.dynamic.len() < count {
            for index in 0..count {
                if self.dynamic.get(index).is_none_or(|m| m.index != index) {
                    let mut mesh = DynamicMesh::new(index);
                    mesh.moved = self.clock;
                    self.dynamic.insert(index, mesh);
                    self.static_layer = None;
                }
            }
        }
    }

    /// Forgets what is shown.
    fn forget(&mut self) {
        self.static_layer = None;
        self.dynamic.clear();
        self.shown = Meshes::default();
    }

    /// Draws all moving meshes for which nothing was drawn.
    fn move_all(&mut self, solid: &Solid, camera: &Camera, tools: &mut Tools) {
        let mut dynamic = self.dynamic.iter_mut().peekable();
        for member in members(solid) {
            if let Some(mesh) = dynamic.next_if(|m| m.index == member.index) {
                mesh.move_to(&member, (camera, self.shows), tools, None);
            }
        }
    }

    /// Returns all visible contours, in the order of the meshes.
    pub fn contours(&self, camera: &Camera) -> Contours {
        let mut out = Contours::with_room(camera, self.count);
        let mut dynamic = self.dynamic.iter().peekable();
        for (piece, index) in self.static_layer.iter().flat_map(StaticLayer::shown) {
            while let Some(mesh) = dynamic.next_if(|m| m.index < *index) {
                out.append(&mesh.seen);
            }
            out.push(piece);
        }
        dynamic.for_each(|mesh| out.append(&mesh.seen));
        out
    }

    /// Draws all meshes: the stationary ones into a new static layer, each of the others
    /// into its own layer. `None` if there are too many pieces.
    fn build(&mut self, solid: &Solid, camera: &Camera, tools: &mut Tools) -> Option<()> {
        let mut static_layer = StaticLayer::new(camera);
        let (whole, width) = (Area::whole(camera), camera.width as usize);
        let mut dynamic = self.dynamic.iter_mut().peekable();
        for member in members(solid) {
            if let Some(mesh) = dynamic.next_if(|m| m.index == member.index) {
                mesh.move_to(&member, (camera, self.shows), tools, None);
                continue;
            }
            let layer = &mut self.scratch;
            layer.draw(member.instance, (camera, self.shows), tools, |_, _| false);
            layer.show(&mut static_layer.depth, width, &whole);
            static_layer.range = static_layer.range.and(&layer.range);
            static_layer.pieces.extend(layer.pieces.iter().map(|piece| (*piece, member.index)));
            if static_layer.pieces.len() > MOST_PIECES {
                return None;
            }
        }
        self.static_layer = Some(static_layer);
        Some(())
    }

    /// Composes the whole picture and tests all pieces.
    fn begin(&mut self, camera: &Camera) -> Option<ContourChange> {
        let IncrementalImage { static_layer, dynamic, depth, extent, .. } = self;
        let static_layer = static_layer.as_mut()?;
        work::count(|work| {
            work.partial += 1;
            work.pixels += camera.pixels() as u64;
        });
        depth.clone_from(&static_layer.depth);
        dynamic
            .iter()
            .for_each(|m| m.now.layer.show(depth, camera.width as usize, &Area::whole(camera)));
        let depths = Depths::new(depth, camera.width, camera.height, *extent)?;
        self.still = static_layer.test_all(&depths);
        dynamic.iter_mut().for_each(|mesh| mesh.look(&depths));
        self.at = Arc::default();
        let none = || Contours::new(camera.width, camera.height);
        Some(self.change(camera, Arc::default(), [none(), none()]))
    }

    /// The change to the current state, from the one that `from` identifies.
    fn change(
        &mut self,
        camera: &Camera,
        from: Arc<()>,
        [removed, added]: [Contours; 2],
    ) -> ContourChange {
        let mut moving =
            Contours::with_room(camera, self.dynamic.iter().map(|m| m.seen.len()).sum());
        self.dynamic.iter().for_each(|mesh| moving.append(&mesh.seen));
        self.count = self.still + moving.len();
        let (to, moving) = (Arc::clone(&self.at), Arc::new(moving));
        ContourChange { from, to, removed, added, moving, count: self.count }
    }

    /// Recomposes the picture where meshes have moved, and repeats the depth tests where
    /// they were and are.
    fn step(&mut self, camera: &Camera, extents: [f64; 2]) -> Option<ContourChange> {
        let same_extent = extents[0].to_bits() == extents[1].to_bits();
        let clock = self.clock;
        let moved = |m: &DynamicMesh| m.moved == clock;
        let anything = !same_extent || self.dynamic.iter().any(moved);
        let IncrementalImage {
            static_layer,
            dynamic,
            depth,
            extent,
            rows,
            pixels,
            areas,
            again,
            ..
        } = self;
        let (static_layer, width) = (static_layer.as_mut()?, camera.width as usize);
        Area::join(areas);
        work::count(|work| {
            work.partial += u64::from(anything);
            work.pixels += areas.iter().map(Area::pixels).sum::<usize>() as u64;
        });
        pixels.clear();
        let anything_still = !static_layer.pieces.is_empty();
        for area in &*areas {
            let (columns, span) = (area.right - area.left, |row: usize| {
                row * width + area.left..row * width + area.right
            });
            rows.clear();
            for row in area.top..area.bottom {
                let (Some(there), Some(static_layer)) =
                    (depth.get_mut(span(row)), static_layer.depth.get(span(row)))
                else {
                    continue;
                };
                rows.extend_from_slice(there);
                there.copy_from_slice(static_layer);
            }
            vectorised(|| dynamic.iter().for_each(|m| m.now.layer.show(depth, width, area)));
            if !anything_still {
                continue;
            }
            again.clear();
            again.resize(area.pixels(), 0);
            vectorised(
                #[inline(always)]
                || {
                    let lists = rows.chunks_exact(columns).zip(again.chunks_exact_mut(columns));
                    for (row, (before, again)) in (area.top..area.bottom).zip(lists) {
                        let lists = (
                            depth.get(span(row)),
                            static_layer.depth.get(span(row)),
                            static_layer.nearest.get(span(row)),
                        );
                        let (Some(now), Some(static_layer), Some(nearest)) = lists else {
                            continue;
                        };
                        let lists =
                            now.iter().zip(before).zip(static_layer.iter().zip(nearest)).zip(again);
                        for (((now, before), (static_layer, nearest)), again) in lists {
                            // Where both depths are nearer than `nearest`, every test of the
                            // static layer fails before and after, so the change does not matter.
                            // Where a dynamic mesh is in front, results may also change with the
                            // depth range.
                            let hidden = (now < nearest) & (before < nearest);
                            *again = u8::from(
                                !hidden
                                    & ((now != before) | (!same_extent & (now != static_layer))),
                            );
                        }
                    }
                },
            );
            let at = |i: usize| ((area.top + i / columns) * width + area.left + i % columns) as u32;
            let (eights, rest) = again.as_chunks::<8>();
            let lists = eights.iter().map(|eight| &eight[..]).chain([rest]).enumerate();
            for (k, some) in lists.filter(|(_, some)| some.iter().any(|again| *again != 0)) {
                pixels.extend(
                    (8 * k..).zip(some).filter(|(_, again)| **again != 0).map(|(i, _)| at(i)),
                );
            }
        }
        if !same_extent && anything_still {
            for mesh in dynamic.iter().filter(|m| !moved(m)) {
                let area = mesh.now.layer.area;
                let all = (area.top..area.bottom)
                    .flat_map(|row| row * width + area.left..row * width + area.right);
                let open = |at: &usize| match (
                    depth.get(*at),
                    static_layer.depth.get(*at),
                    static_layer.nearest.get(*at),
                ) {
                    (Some(now), Some(static_layer), Some(nearest)) => {
                        now != static_layer && now >= nearest
                    }
                    _ => false,
                };
                pixels.extend(all.filter(open).map(|at| at as u32));
            }
        }
        let depths = Depths::new(depth, camera.width, camera.height, *extent)?;
        let room = || match anything && anything_still {
            true => Contours::with_room(camera, 256),
            false => Contours::new(camera.width, camera.height),
        };
        let [mut removed, mut added] = [room(), room()];
        static_layer.retest(&depths, pixels, extents, |piece, shown| {
            if shown { &mut added } else { &mut removed }.push(piece);
        });
        for mesh in dynamic {
            let (area, moved) = (mesh.now.layer.looks, moved(mesh));
            if moved || !same_extent || areas.iter().any(|dirty| dirty.meets(&area)) {
                mesh.look(&depths);
            }
        }
        self.still = self.still + added.len() - removed.len();
        let from = self.at.clone();
        if anything {
            self.at = Arc::default();
        }
        Some(self.change(camera, from, [removed, added]))
    }
}

#[cfg(test)]
#[path = "picture_tests.rs"]
mod tests;
