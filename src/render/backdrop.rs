//! Contours of a scene most of which stands still. The meshes that have not moved make a
//! **backdrop**: its depth, and its pieces of contour that it does not hide itself, by
//! the pixels that they look at. When one of the others moves, depth is composed anew
//! where it was and is, and only the pieces that look there are looked at again; what
//! came and went is told as a [`Change`]. So a picture costs what moves, not what is in
//! it.
//!
//! Invariant: as for [`super::layers`], contours are those drawn at once, bit for bit.
//! That rests on looks being monotone: what another mesh or a smaller depth range hides
//! stays hidden with both, in `f64` too.

mod dynamic_mesh;
mod static_layer;

use self::dynamic_mesh::{DynamicMesh, Tools};
use self::static_layer::StaticLayer;
use super::contours::Contours;
use super::layers::{Layer, Sight, affine_bits, camera_bits};
use super::raster::Area;
use super::simd::vectorised;
use super::visibility::Depths;
use super::{Camera, work};
use crate::geom::{Instance, Mesh, MeshesMark, Solid};
use std::cell::RefCell;
use std::sync::{Arc, Weak};

/// A solid of fewer meshes is drawn at once: each is likely to have moved.
const FEWEST: usize = 3;

/// Memory of a backdrop, in pieces; a scene of more is drawn at once.
const MOST_PIECES: usize = 1 << 19;

/// How many drawings later a scene of which most moved is looked at again.
const PATIENCE: u32 = 1024;

/// A drawing's contours: those of what moves, and what the rest have more and less than
/// in the drawing before, by the same thread in the same picture.
#[derive(Debug)]
pub struct Change {
    /// Stands for the contours before; another one, that nobody has, where everything
    /// came.
    pub from: Arc<()>,
    /// Stands for the contours now.
    pub to: Arc<()>,
    /// Pieces of what stands still that are no longer seen.
    pub gone: Contours,
    /// Pieces of what stands still that were not seen before.
    pub come: Contours,
    /// All pieces that are seen of what moves.
    pub moving: Contours,
    /// How many pieces are seen now.
    pub count: usize,
}

/// A mesh of the solid, as it was drawn last.
struct Leaf {
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    moves: bool,
}

/// A list of meshes of the solid that was drawn last, and the number of its first one.
struct Known {
    list: MeshesMark,
    first: usize,
    count: usize,
}

/// A scene in the picture of one camera.
pub(super) struct Backdrop {
    camera: [u64; 17],
    lists: Vec<Known>,
    leaves: Vec<Leaf>,
    dynamic: Vec<DynamicMesh>,
    static_layer: Option<StaticLayer>,
    depth: Vec<f32>,
    extent: f64,
    /// Drawings since most of it moved.
    waited: u32,
    at: Arc<()>,
    /// How many pieces are seen of what stands still, and of all.
    shown: usize,
    count: usize,
    // Kept for their memory.
    scratch: Layer,
    rows: Vec<f32>,
    pixels: Vec<u32>,
    areas: Vec<Area>,
    /// By pixel of an area: whether looks there are to be made again.
    again: Vec<u8>,
    /// How many meshes there were when there were too many pieces.
    refused: Option<usize>,
}

/// A thread's scenes, the one drawn last in front.
#[derive(Default)]
struct Backdrops {
    scenes: Vec<Backdrop>,
    tools: Tools,
}

/// Pictures that a thread keeps a scene of: several cameras, or several sizes.
const PICTURES: usize = 4;

thread_local! {
    static BACKDROPS: RefCell<Backdrops> = RefCell::default();
}

/// The contours of a solid most of which stands still, and with them what has changed;
/// `None` for one that is better drawn in another way.
pub(super) fn contours(solid: &Solid, camera: &Camera) -> Option<Contours> {
    with_scene(solid, camera, |scene, tools| {
        scene.draw(solid, camera, tools).map(|_| scene.contours(camera))
    })
}

/// As [`contours`], only what has changed.
pub(super) fn change(solid: &Solid, camera: &Camera) -> Option<Change> {
    with_scene(solid, camera, |scene, tools| scene.draw(solid, camera, tools))
}

/// Works on the scene in a camera's picture.
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
    /// Nothing drawn yet.
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

    /// Brings it up to date; `None` for solids that are better drawn in another way: of
    /// few meshes, or most of which have moved.
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
            // What was hidden, or did not matter, need not be so with another depth
            // range.
            let mut dynamic = self.dynamic.iter_mut().peekable();
            for (leaf, instance) in solid.lists().flat_map(|list| list.iter()).enumerate() {
                if let Some(dynamic_mesh) = dynamic.next_if(|m| m.leaf == leaf) {
                    dynamic_mesh.move_to(instance, camera, tools, None, only);
                }
            }
        }
        self.begin(camera)
    }

    /// The contours that it shows.
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

    /// Forgets what has moved.
    fn forget(&mut self) {
        self.dynamic.clear();
        self.leaves.iter_mut().for_each(|leaf| leaf.moves = false);
        (self.static_layer, self.waited, self.refused) = (None, 0, None);
    }

    /// The meshes that are not as they were drawn last; what is known of the solid
    /// becomes that of this one.
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

    /// Draws all meshes, those that stand still and the others.
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

    /// Composes the whole picture and looks at everything.
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
        self.shown = static_layer.look_at_all(&depths);
        dynamic.iter_mut().for_each(|dynamic_mesh| dynamic_mesh.look(&depths));
        self.at = Arc::default();
        let none = || Contours::with_room(camera, 0);
        Some(self.change(camera, Arc::default(), [none(), none()]))
    }

    /// The change to what is there now.
    fn change(&mut self, camera: &Camera, from: Arc<()>, [gone, come]: [Contours; 2]) -> Change {
        let mut moving =
            Contours::with_room(camera, self.dynamic.iter().map(|m| m.seen.len()).sum());
        self.dynamic.iter().for_each(|dynamic_mesh| moving.append(&dynamic_mesh.seen));
        self.count = self.shown + moving.len();
        Change { from, to: self.at.clone(), gone, come, moving, count: self.count }
    }

    /// Composes the picture where some have moved, and looks again where they were and
    /// are.
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
                            // Where something is so near that all looks of the backdrop end at
                            // it, a change means nothing; where there is a mover, what is seen
                            // may also change with the depth range.
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
        let [mut gone, mut come] = [0; 2].map(|_| Contours::with_room(camera, 256));
        static_layer.look_again(&depths, pixels, extents, |piece, shown| {
            if shown { &mut come } else { &mut gone }.push(piece);
        });
        for dynamic_mesh in dynamic {
            let (area, moved) = (dynamic_mesh.now.layer.looks, moved(dynamic_mesh));
            if moved || !same_extent || areas.iter().any(|dirty| dirty.meets(&area)) {
                dynamic_mesh.look(&depths);
            }
        }
        self.shown = self.shown + come.len() - gone.len();
        let from = self.at.clone();
        if anything {
            self.at = Arc::default();
        }
        Some(self.change(camera, from, [gone, come]))
    }
}

#[cfg(test)]
#[path = "backdrop_tests.rs"]
mod tests;
