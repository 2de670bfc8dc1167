//! Contours of a scene in which most meshes are stationary. The stationary meshes form a
//! **backdrop**: their depth image, and the pieces of contour that they do not hide
//! themselves, indexed by the pixels at which the pieces' visibility is tested. When
//! another mesh moves, depth is recomposed only where that mesh was and is, only the
//! pieces tested there are tested again, and the difference is reported as a [`Change`].
//! So the cost of a picture depends on what moves, not on the size of the scene.
//!
//! Invariant: as for [`super::layers`], contours are those of a full drawing, bit for
//! bit. This relies on the depth tests being monotone, in `f64` too: a piece hidden by
//! another mesh or at a smaller depth range stays hidden with both.

mod dynamic_mesh;
mod static_layer;

use self::dynamic_mesh::{DynamicMesh, Tools};
use self::static_layer::StaticLayer;
use super::layers::{Layer, Sight, affine_bits, camera_bits};
use super::lines::contours::Contours;
use super::lines::visibility::Depths;
use super::pixels::raster::Area;
use super::simd::vectorised;
use super::{Camera, work};
use crate::geom::{Instance, Mesh, MeshesMark, Solid};
use std::cell::RefCell;
use std::sync::{Arc, Weak};

/// Solids of fewer meshes are drawn in full, since each mesh is likely to have moved.
const FEWEST: usize = 3;

/// Limit on a backdrop's memory, in pieces; scenes of more pieces are drawn in full.
const MOST_PIECES: usize = 1 << 19;

/// After this many drawings in which most meshes counted as moving, all of them count as
/// stationary again.
const PATIENCE: u32 = 1024;

/// The contours of a drawing: all pieces of the moving meshes, and the difference of the
/// stationary meshes' pieces from the previous drawing in the same picture by the same
/// thread.
#[derive(Debug)]
pub struct Change {
    /// Identifies the previous contours. If the drawing started over, a new identity that
    /// nobody holds; `removed` and `added` are then empty.
    pub from: Arc<()>,
    /// Identifies the current contours.
    pub to: Arc<()>,
    /// Pieces of stationary meshes that are no longer visible.
    pub removed: Contours,
    /// Pieces of stationary meshes that have become visible.
    pub added: Contours,
    /// All visible pieces of the moving meshes.
    pub moving: Contours,
    /// Number of visible pieces now, of all meshes.
    pub count: usize,
}

/// A mesh of the solid, as last drawn.
struct Leaf {
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    moves: bool,
}

/// A list of meshes of the last drawn solid, and the index of its first mesh.
struct Known {
    list: MeshesMark,
    first: usize,
    count: usize,
}

/// The state of one camera's picture, kept from drawing to drawing.
pub(super) struct Backdrop {
    camera: [u64; 17],
    lists: Vec<Known>,
    leaves: Vec<Leaf>,
    dynamic: Vec<DynamicMesh>,
    static_layer: Option<StaticLayer>,
    depth: Vec<f32>,
    extent: f64,
    /// Drawings in a row in which most meshes counted as moving; see [`PATIENCE`].
    waited: u32,
    at: Arc<()>,
    /// Number of visible pieces: of the stationary meshes, and of all.
    shown: usize,
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

/// A thread's scenes, the one drawn last first.
#[derive(Default)]
struct Backdrops {
    scenes: Vec<Backdrop>,
    tools: Tools,
}

/// Number of pictures that a thread keeps a scene for: several cameras, or several sizes.
const PICTURES: usize = 4;

thread_local! {
    static BACKDROPS: RefCell<Backdrops> = RefCell::default();
}

/// The contours of a solid most of which is stationary; `None` if it is better drawn in
/// another way.
pub(super) fn contours(solid: &Solid, camera: &Camera) -> Option<Contours> {
    with_scene(solid, camera, |scene, tools| {
        scene.draw(solid, camera, tools).map(|_| scene.contours(camera))
    })
}

/// As [`contours`], but returns the change only.
pub(super) fn change(solid: &Solid, camera: &Camera) -> Option<Change> {
    with_scene(solid, camera, |scene, tools| scene.draw(solid, camera, tools))
}

/// Runs `work` on the scene of a camera's picture, which is made if missing. `None` for
/// solids of few meshes.
fn with_scene<T>(
    solid: &Solid,
    camera: &Camera,
    work: impl FnOnce(&mut Backdrop, &mut Tools) -> Option<T>,
) -> Option<T> {
    if solid.mesh_count() < FEWEST {
        return None;
    }
    BACKDROPS.with(|all| {
        let mut all = all.try_borrow_mut().ok()?;
        let Backdrops { scenes, tools } = &mut *all;
        let eye = camera_bits(camera);
        match scenes.iter().position(|scene| scene.camera == eye) {
            Some(at) => scenes[..=at].rotate_right(1),
            None => {
                scenes.truncate(PICTURES - 1);
                scenes.insert(0, Backdrop::new(camera));
            }
        }
        work(scenes.first_mut()?, tools)
    })
}

impl Backdrop {
    /// A backdrop without meshes; nothing is drawn yet.
    pub fn new(camera: &Camera) -> Backdrop {
        Backdrop {
            camera: camera_bits(camera),
            lists: Vec::new(),
            leaves: Vec::new(),
            dynamic: Vec::new(),
            static_layer: None,
            depth: Vec::new(),
            extent: 0.0,
            waited: 0,
            at: Arc::default(),
            shown: 0,
            count: 0,
            scratch: Layer::default(),
            rows: Vec::new(),
            pixels: Vec::new(),
            areas: Vec::new(),
            again: Vec::new(),
            refused: None,
        }
    }

    /// Updates the backdrop to a solid and returns the change. `None` if the solid is
    /// better drawn in another way: most of its meshes have moved, or it has too many
    /// pieces.
    pub fn draw(&mut self, solid: &Solid, camera: &Camera, tools: &mut Tools) -> Option<Change> {
        let count = solid.mesh_count();
        let changed = self.find_changed(solid);
        if self.static_layer.is_none() && changed.is_empty() {
            // The same solid again, which was better drawn in another way.
            return None;
        }
        if 2 * changed.len() > count {
            self.forget();
            return None;
        }
        for (leaf, _) in &changed {
            if !std::mem::replace(&mut self.leaves[*leaf].moves, true) {
                let at = self.dynamic.partition_point(|m| m.leaf < *leaf);
                self.dynamic.insert(at, DynamicMesh::new(*leaf));
                self.static_layer = None;
            }
        }
        if 2 * self.dynamic.len() > count {
            self.static_layer = None;
            self.waited += 1;
            if self.waited > PATIENCE {
                self.forget();
            }
            return None;
        }
        self.waited = 0;
        let known = self.static_layer.is_some();
        if !known && (self.refused == Some(count) || self.build(solid, camera, tools).is_none()) {
            self.refused = Some(count);
            return None;
        }
        self.areas.clear();
        let only = self.dynamic.len() == 1;
        for (leaf, instance) in &changed {
            let Some(dynamic_mesh) = self.dynamic.iter_mut().find(|m| m.leaf == *leaf) else {
                continue;
            };
            self.areas.push(dynamic_mesh.now.layer.area);
            dynamic_mesh.move_to(
                instance,
                camera,
                tools,
                self.static_layer.as_ref().filter(|_| known),
                only,
            );
            self.areas.push(dynamic_mesh.now.layer.area);
        }
        if known && !changed.is_empty() {
            work::count(|work| work.kept += (count - changed.len()) as u64);
        }
        let static_layer = self.static_layer.as_mut()?;
        let range =
            self.dynamic.iter().fold(static_layer.range, |range, m| range.and(&m.now.layer.range));
        let (extent, before) = (range.extent(), self.extent);
        self.extent = extent;
        if known && static_layer.holds(extent) {
            let moved = |m: &DynamicMesh| changed.iter().any(|(leaf, _)| *leaf == m.leaf);
            return self.step(camera, [before, extent], moved);
        }
        static_layer.sort_pieces(camera, extent, known)?;
        if self.dynamic.iter().any(|m| !m.now.is_whole()) {
            // Layers that were skipped as hidden, or drawn inexactly where it did not
            // matter, may not be valid at another depth range.
            let mut dynamic = self.dynamic.iter_mut().peekable();
            for (leaf, instance) in solid.lists().flat_map(|list| list.iter()).enumerate() {
                if let Some(dynamic_mesh) = dynamic.next_if(|m| m.leaf == leaf) {
                    dynamic_mesh.move_to(instance, camera, tools, None, only);
                }
            }
        }
        self.begin(camera)
    }

    /// Returns all visible contours, in the order of the meshes.
    pub fn contours(&self, camera: &Camera) -> Contours {
        let mut out = Contours::with_room(camera, self.count);
        let mut dynamic = self.dynamic.iter().peekable();
        for (piece, leaf) in self.static_layer.iter().flat_map(StaticLayer::shown) {
            while let Some(dynamic_mesh) = dynamic.next_if(|m| m.leaf < *leaf) {
                out.append(&dynamic_mesh.seen);
            }
            out.push(piece);
        }
        dynamic.for_each(|dynamic_mesh| out.append(&dynamic_mesh.seen));
        out
    }

    /// Forgets which meshes have moved: all count as stationary again.
    fn forget(&mut self) {
        self.dynamic.clear();
        self.leaves.iter_mut().for_each(|leaf| leaf.moves = false);
        (self.static_layer, self.waited, self.refused) = (None, 0, None);
    }

    /// Returns the meshes that differ from those drawn last, with their indices, and
    /// records the meshes of this solid.
    fn find_changed<'a>(&mut self, solid: &'a Solid) -> Vec<(usize, &'a Instance)> {
        let (mut changed, mut first, mut lists) = (Vec::new(), 0, 0);
        for meshes in solid.lists() {
            let known = self
                .lists
                .get(lists)
                .filter(|known| known.first == first && meshes.is(&known.list));
            if let Some(known) = known {
                first += known.count;
                lists += 1;
                continue;
            }
            let now = Known { list: meshes.mark(), first, count: meshes.len() };
            for (leaf, instance) in (first..).zip(meshes.iter()) {
                let affine = affine_bits(&instance.affine);
                match self.leaves.get_mut(leaf) {
                    Some(l)
                        if l.affine == affine
                            && std::ptr::eq(l.mesh.as_ptr(), Arc::as_ptr(&instance.mesh)) => {}
                    Some(l) => {
                        (l.mesh, l.affine) = (Arc::downgrade(&instance.mesh), affine);
                        changed.push((leaf, instance));
                    }
                    None => {
                        self.leaves.push(Leaf {
                            mesh: Arc::downgrade(&instance.mesh),
                            affine,
                            moves: false,
                        });
                        self.static_layer = None;
                        changed.push((leaf, instance));
                    }
                }
            }
            first += now.count;
            match self.lists.get_mut(lists) {
                Some(known) => *known = now,
                None => self.lists.push(now),
            }
            lists += 1;
        }
        self.lists.truncate(lists);
        if first < self.leaves.len() {
            self.leaves.truncate(first);
            self.dynamic.retain(|m| m.leaf < first);
            self.static_layer = None;
        }
        changed
    }

    /// Draws all meshes: the stationary ones into a new static layer, each of the others
    /// into its own layer. `None` if there are too many pieces.
    fn build(&mut self, solid: &Solid, camera: &Camera, tools: &mut Tools) -> Option<()> {
        let mut static_layer = StaticLayer::new(camera);
        let (whole, width) = (Area::whole(camera), camera.width as usize);
        let mut dynamic = self.dynamic.iter_mut().peekable();
        for (leaf, instance) in solid.lists().flat_map(|list| list.iter()).enumerate() {
            if let Some(dynamic_mesh) = dynamic.next_if(|m| m.leaf == leaf) {
                dynamic_mesh.move_to(instance, camera, tools, None, false);
                continue;
            }
            let layer = &mut self.scratch;
            let Tools { projected, candidates, room } = tools;
            layer.draw(instance, camera, (projected, candidates), room, |_, _| Sight::Whole);
            layer.show(&mut static_layer.depth, width, &whole);
            static_layer.range = static_layer.range.and(&layer.range);
            static_layer.pieces.extend(layer.pieces.iter().map(|piece| (*piece, leaf)));
            if static_layer.pieces.len() > MOST_PIECES {
                return None;
            }
        }
        self.static_layer = Some(static_layer);
        Some(())
    }

    /// Composes the whole picture and tests all pieces.
    fn begin(&mut self, camera: &Camera) -> Option<Change> {
        let Backdrop { static_layer, dynamic, depth, extent, .. } = self;
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
        self.shown = static_layer.test_all(&depths);
        dynamic.iter_mut().for_each(|dynamic_mesh| dynamic_mesh.look(&depths));
        self.at = Arc::default();
        let none = || Contours::with_room(camera, 0);
        Some(self.change(camera, Arc::default(), [none(), none()]))
    }

    /// The change to the current state, from the one that `from` identifies.
    fn change(
        &mut self,
        camera: &Camera,
        from: Arc<()>,
        [removed, added]: [Contours; 2],
    ) -> Change {
        let mut moving =
            Contours::with_room(camera, self.dynamic.iter().map(|m| m.seen.len()).sum());
        self.dynamic.iter().for_each(|dynamic_mesh| moving.append(&dynamic_mesh.seen));
        self.count = self.shown + moving.len();
        Change { from, to: self.at.clone(), removed, added, moving, count: self.count }
    }

    /// Recomposes the picture where meshes have moved, and repeats the depth tests where
    /// they were and are.
    fn step(
        &mut self,
        camera: &Camera,
        extents: [f64; 2],
        moved: impl Fn(&DynamicMesh) -> bool,
    ) -> Option<Change> {
        let same_extent = extents[0].to_bits() == extents[1].to_bits();
        let anything = !same_extent || self.dynamic.iter().any(&moved);
        let Backdrop { static_layer, dynamic, depth, extent, rows, pixels, areas, again, .. } =
            self;
        let (static_layer, width) = (static_layer.as_mut()?, camera.width as usize);
        Area::join(areas);
        work::count(|work| {
            work.partial += u64::from(anything);
            work.pixels += areas.iter().map(Area::pixels).sum::<usize>() as u64;
        });
        pixels.clear();
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
            again.clear();
            again.resize(area.pixels(), 0);
            vectorised(
                #[inline(always)]
                || {
                    dynamic.iter().for_each(|m| m.now.layer.show(depth, width, area));
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
                            // backdrop fails before and after, so the change does not matter.
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
        if !same_extent {
            for dynamic_mesh in dynamic.iter().filter(|m| !moved(m)) {
                let area = dynamic_mesh.now.layer.area;
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
        let [mut removed, mut added] = [0; 2].map(|_| Contours::with_room(camera, 256));
        static_layer.retest(&depths, pixels, extents, |piece, shown| {
            if shown { &mut added } else { &mut removed }.push(piece);
        });
        for dynamic_mesh in dynamic {
            let (area, moved) = (dynamic_mesh.now.layer.looks, moved(dynamic_mesh));
            if moved || !same_extent || areas.iter().any(|dirty| dirty.meets(&area)) {
                dynamic_mesh.look(&depths);
            }
        }
        self.shown = self.shown + added.len() - removed.len();
        let from = self.at.clone();
        if anything {
            self.at = Arc::default();
        }
        Some(self.change(camera, from, [removed, added]))
    }
}

#[cfg(test)]
#[path = "backdrop_tests.rs"]
mod tests;
