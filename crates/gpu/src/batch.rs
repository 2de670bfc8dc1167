//! Scenes as the device reads them: numbers of placements, and each mesh's vertices once.

use crate::layout::{Draw, REVOLUTION, SIDES, Scene as Item};
use crate::topologies::{Place, Topologies};
use bytemuck::NoUninit;
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::geom::{Instance, Mesh, Revolution, Ring};
use pcadlang_scene::render::Scene;
use rustc_hash::FxHashMap;
use std::borrow::Cow;
use std::sync::Arc;
use wgpu::WriteOnly;

/// Scenes of a batch.
const MOST_SCENES: usize = 4096;
/// Numbers of vertices of a batch: 96 MB.
const MOST_NUMBERS: usize = 24 << 20;
/// Vertices of a scene.
const MOST_VERTICES: u32 = 1 << 18;
/// Bytes that a task writes at a time.
const BLOCK: usize = 1 << 16;
/// Tasks for the cores.
const TASKS: usize = 64;

/// Consecutive scenes with pictures of one size.
#[derive(Default)]
pub struct Batch<'a> {
    pub items: Vec<Item>,
    pub draws: Vec<Draw>,
    /// Whether each scene is for the CPU.
    pub for_cpu: Vec<bool>,
    /// The most vertices of a scene.
    pub most: u32,
    /// What the list of vertices consists of, and at which number each begins.
    sources: Vec<(usize, Source<'a>)>,
    numbers: usize,
}

/// What is copied into the list of vertices.
enum Source<'a> {
    /// Cosine and sine of each side's angle from x towards z.
    Sides,
    Positions(&'a Mesh),
    Normals(&'a Mesh),
    Rings(&'a Revolution),
}

/// A scene's item, and the draws with its placements.
type Placed = (Item, Vec<Draw>);

fn place(scene: &Scene) -> Placed {
    let draws = match scene.solid.revolution() {
        Some(r) => vec![Draw::placed(&scene.camera, &r.affine)],
        None => {
            let instances = scene.solid.instances().iter();
            instances.map(|i| Draw::placed(&scene.camera, &i.affine)).collect()
        }
    };
    (Item::new(&scene.camera), draws)
}

/// The size of a scene's picture.
pub fn size(scene: &Scene) -> [u32; 2] {
    [scene.camera.width, scene.camera.height]
}

impl<'a> Batch<'a> {
    /// As many of the first scenes as make one batch, at least one if there are any.
    pub fn of(scenes: &'a [Scene], topologies: &mut Topologies, pool: &Pool) -> Batch<'a> {
        let Some(first) = scenes.first() else { return Batch::default() };
        let same = scenes.iter().take_while(|s| size(s) == size(first)).take(MOST_SCENES);
        let scenes = &scenes[..same.count()];
        let tasks = scenes.chunks(scenes.len().div_ceil(TASKS)).collect();
        let placed =
            pool.map(tasks, |scenes: &[Scene]| scenes.iter().map(place).collect::<Vec<Placed>>());
        let numbers = 2 * SIDES as usize;
        let sources = vec![(0, Source::Sides)];
        let mut batch = Batch { sources, numbers, ..Batch::default() };
        let mut gather = Gather { topologies, known: FxHashMap::default(), recent: Vec::new() };
        for (scene, (mut item, mut draws)) in scenes.iter().zip(placed.into_iter().flatten()) {
            if batch.numbers > MOST_NUMBERS {
                break;
            }
            let fits = match scene.solid.revolution() {
                Some(r) => gather.revolution(&r.surface, &mut draws, &mut batch),
                None => gather.meshes(scene.solid.instances(), &mut draws, &mut batch),
            };
            let vertices: u32 = draws.iter().map(|d| d.count).fold(0, u32::saturating_add);
            let fits = fits && vertices <= MOST_VERTICES;
            if fits {
                item.first = batch.draws.len() as u32;
                item.past = item.first + draws.len() as u32;
                batch.draws.append(&mut draws);
                batch.most = batch.most.max(vertices);
            }
            batch.items.push(item);
            batch.for_cpu.push(!fits);
        }
        batch
    }

    /// Bytes of the list of vertices, in whole blocks.
    pub fn vertex_bytes(&self) -> u64 {
        (4 * self.numbers).next_multiple_of(BLOCK) as u64
    }

    /// Writes the list of vertices, on several cores.
    pub fn write_vertices(&self, out: WriteOnly<'_, [u8]>, pool: &Pool) {
        let (blocks, _) = out.into_chunks::<BLOCK>();
        let mut blocks = blocks.into_iter().enumerate();
        let each = blocks.len().div_ceil(TASKS).max(1);
        let mut tasks: Vec<Vec<(usize, WriteOnly<'_, [u8; BLOCK]>)>> = Vec::new();
        while blocks.len() > 0 {
            tasks.push(blocks.by_ref().take(each).collect());
        }
        pool.map(tasks, |task| {
            task.into_iter().for_each(|(i, block)| self.write_block(i * BLOCK, block.into()));
        });
    }

    /// Writes the bytes from `first` on.
    fn write_block(&self, first: usize, mut out: WriteOnly<'_, [u8]>) {
        let source = self.sources.partition_point(|(at, _)| 4 * at <= first).saturating_sub(1);
        for (at, source) in &self.sources[source..] {
            let (at, bytes) = (4 * at, source.bytes());
            let (start, past) = (first.max(at), (first + out.len()).min(at + bytes.len()));
            if at >= first + out.len() {
                break;
            }
            if start < past {
                out.slice(start - first..past - first)
                    .copy_from_slice(&bytes[start - at..past - at]);
            }
        }
    }

    /// Adds to the list of vertices; gives where.
    fn add(&mut self, count: usize, source: Source<'a>) -> u32 {
        let at = self.numbers as u32;
        self.sources.push((self.numbers, source));
        self.numbers += count;
        at
    }
}

impl Source<'_> {
    fn bytes(&self) -> Cow<'_, [u8]> {
        fn owned<T: NoUninit>(list: Vec<T>) -> Cow<'static, [u8]> {
            Cow::Owned(bytemuck::cast_slice(&list).to_vec())
        }
        match self {
            Source::Positions(mesh) => Cow::Borrowed(bytemuck::cast_slice(&mesh.positions)),
            Source::Normals(mesh) => {
                let count = mesh.positions.len();
                Cow::Borrowed(bytemuck::cast_slice(&mesh.normals[..count]))
            }
            Source::Rings(surface) => {
                let numbers = |ring: &Ring| [ring.r, ring.y, ring.nr, ring.ny].map(|v| v as f32);
                owned(surface.rings().iter().map(numbers).collect())
            }
            Source::Sides => {
                let angle = |k| std::f64::consts::TAU * f64::from(k) / f64::from(SIDES);
                let turn = |k| [angle(k).cos() as f32, angle(k).sin() as f32];
                owned((0..SIDES).map(turn).collect())
            }
        }
    }
}

struct Gather<'b> {
    topologies: &'b mut Topologies,
    /// Where the vertices of a mesh or surface begin, by address: all are held by the
    /// scenes.
    known: FxHashMap<usize, u32>,
    /// By place in the solid, the topology met last: most solids differ in vertices only.
    recent: Vec<(usize, Place)>,
}

impl Gather<'_> {
    fn meshes<'a>(
        &mut self,
        instances: &'a [Instance],
        draws: &mut [Draw],
        batch: &mut Batch<'a>,
    ) -> bool {
        let mut projected = 0;
        for (i, (Instance { mesh, .. }, draw)) in instances.iter().zip(draws).enumerate() {
            let count = mesh.positions.len();
            let Some(place) = self.topology(i, mesh) else { return false };
            if (place.vertices as usize) > count || mesh.normals.len() < count {
                return false;
            }
            let at = *self.known.entry(Arc::as_ptr(mesh) as usize).or_insert_with(|| {
                let at = batch.add(3 * count, Source::Positions(mesh));
                batch.add(3 * count, Source::Normals(mesh));
                at
            });
            *draw = Draw {
                positions: at,
                normals: at + 3 * count as u32,
                count: count as u32,
                projected,
                ..with(draw, &place)
            };
            projected += count as u32;
        }
        true
    }

    /// The topology of the mesh at a place in a solid.
    fn topology(&mut self, i: usize, mesh: &Mesh) -> Option<Place> {
        let address = Arc::as_ptr(&mesh.topology) as usize;
        if let Some((_, place)) = self.recent.get(i).filter(|(known, _)| *known == address) {
            return Some(*place);
        }
        let place = self.topologies.mesh(&mesh.topology)?;
        if self.recent.len() <= i {
            self.recent.resize(i + 1, (0, Place::default()));
        }
        self.recent[i] = (address, place);
        Some(place)
    }

    fn revolution<'a>(
        &mut self,
        surface: &'a Arc<Revolution>,
        draws: &mut [Draw],
        batch: &mut Batch<'a>,
    ) -> bool {
        let ([draw], Some(place)) = (draws, self.topologies.revolution(surface)) else {
            return false;
        };
        let rings = surface.rings().len();
        let at = *self
            .known
            .entry(Arc::as_ptr(surface) as usize)
            .or_insert_with(|| batch.add(4 * rings, Source::Rings(surface)));
        *draw = Draw { positions: at, count: rings as u32 * SIDES, ..with(draw, &place) };
        draw.flags |= REVOLUTION;
        true
    }
}

/// A draw with its topology.
fn with(draw: &Draw, place: &Place) -> Draw {
    Draw {
        triangles: place.triangles,
        triangle_count: place.triangle_count,
        edges: place.edges,
        edge_count: place.edge_count,
        lines: place.lines,
        line_count: place.line_count,
        flags: draw.flags | place.flags,
        ..*draw
    }
}
