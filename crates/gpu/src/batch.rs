//! Scenes as the device reads them: numbers of placements, and each mesh's vertices once.
//!
//! Tasks of consecutive scenes are gathered on all cores; only where the vertices of each
//! mesh go is decided in turn.

use crate::layout::{Draw, REVOLUTION, SIDES, Scene as Item};
use crate::scenes::Scene;
use crate::topologies::{Place, Topologies};
use crate::vertices::{VertexData, Vertices};
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::geom::{Revolution, Topology};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Vertices of a scene.
const MOST_VERTICES: u32 = 1 << 18;
/// Tasks for the cores.
pub const TASKS: usize = 64;

/// Consecutive scenes with pictures of one size.
#[derive(Default)]
pub struct Batch<'a> {
    /// The size of the pictures.
    pub size: [u32; 2],
    pub items: Vec<Item>,
    /// The draws of each task, one after the other.
    pub draws: Vec<Vec<Draw>>,
    pub vertices: Vertices<'a>,
    /// By scene: true if it is for the CPU.
    pub for_cpu: Vec<bool>,
    /// The most vertices of a scene.
    pub most: u32,
}

/// The size of a scene's picture.
fn size(scene: &Scene) -> [u32; 2] {
    [scene.camera.width, scene.camera.height]
}

impl<'a> Batch<'a> {
    /// As many of the first scenes as make one batch, at least one if there are any. The
    /// list of vertices has at most a number of bytes.
    pub fn of(
        scenes: &'a [Scene],
        topologies: &mut Topologies,
        most_bytes: u64,
        pool: &Pool,
    ) -> Batch<'a> {
        let Some(first) = scenes.first() else { return Batch::default() };
        let same = scenes.iter().take_while(|s| size(s) == size(first));
        let scenes = &scenes[..same.count()];
        let gather = |topologies: &Topologies| -> Vec<Task<'a>> {
            let tasks = scenes.chunks(scenes.len().div_ceil(TASKS)).collect();
            pool.map(tasks, |scenes| Task::of(scenes, topologies))
        };
        let mut tasks = gather(topologies);
        // Known afterwards, drawable or not.
        let unknown: Vec<Unknown<'a>> =
            tasks.iter_mut().flat_map(|t| t.unknown.drain(..)).collect();
        if !unknown.is_empty() {
            unknown.into_iter().for_each(|unknown| match unknown {
                Unknown::Mesh(topology) => topologies.add_mesh(topology),
                Unknown::Revolution(surface) => topologies.add_revolution(surface),
            });
            tasks = gather(topologies);
        }
        let mut batch = Batch { size: size(first), ..Batch::default() };
        let mut placed = Vec::new();
        let mut draws = 0;
        for mut task in tasks {
            if !batch.items.is_empty() && 4 * batch.vertices.numbers() as u64 > most_bytes {
                break;
            }
            let at = task.sources.iter().map(|(address, of)| batch.vertices.add(*address, of));
            let at: Vec<u32> = at.collect();
            for item in &mut task.items {
                (item.first, item.past) = (item.first + draws, item.past + draws);
            }
            draws += task.draws.len() as u32;
            batch.most = batch.most.max(task.most);
            batch.items.append(&mut task.items);
            batch.for_cpu.append(&mut task.for_cpu);
            placed.push((task.draws, at));
        }
        batch.draws = pool.map(placed, |(mut draws, at)| {
            for draw in &mut draws {
                let first = at[draw.positions as usize];
                (draw.positions, draw.normals) = (first, first + draw.normals);
            }
            draws
        });
        batch
    }
}

/// A topology that the device does not have yet.
enum Unknown<'a> {
    Mesh(&'a Arc<Topology>),
    Revolution(&'a Arc<Revolution>),
}

/// The draws of some scenes: numbered from 0, and with the numbers of their sources
/// instead of the places of their vertices.
#[derive(Default)]
struct Task<'a> {
    items: Vec<Item>,
    draws: Vec<Draw>,
    for_cpu: Vec<bool>,
    most: u32,
    sources: Vec<(usize, VertexData<'a>)>,
    /// The number of a source, by address: all are held by the scenes.
    known: FxHashMap<usize, u32>,
    /// By place in the solid, the topology met last: most solids differ in vertices only.
    recent: Vec<(usize, Option<Place>)>,
    unknown: Vec<Unknown<'a>>,
}

impl<'a> Task<'a> {
    fn of(scenes: &'a [Scene], topologies: &Topologies) -> Task<'a> {
        let mut task = Task::default();
        for scene in scenes {
            let first = task.draws.len();
            let vertices = match scene.solid.revolution() {
                Some(r) => {
                    let draw = Draw::placed(&scene.camera, &r.affine);
                    task.revolution(draw, &r.surface, topologies)
                }
                None => task.meshes(scene, topologies),
            };
            let fits = vertices.is_some_and(|count| count <= MOST_VERTICES);
            if !fits {
                task.draws.truncate(first);
            }
            let (first, past) = (first as u32, task.draws.len() as u32);
            task.items.push(Item { first, past, ..Item::new(&scene.camera) });
            task.for_cpu.push(!fits);
            task.most = task.most.max(vertices.filter(|_| fits).unwrap_or(0));
        }
        task
    }

    /// Adds the draws of a scene's meshes; gives the number of vertices, `None` if they
    /// cannot be drawn on the device.
    fn meshes(&mut self, scene: &'a Scene, topologies: &Topologies) -> Option<u32> {
        let (mut projected, mut fits) = (0u32, true);
        for (i, instance) in scene.solid.instances().iter().enumerate() {
            let mesh = &instance.mesh;
            let address = Arc::as_ptr(&mesh.topology) as usize;
            if self.recent.get(i).is_none_or(|(known, _)| *known != address) {
                let place = topologies.mesh(&mesh.topology);
                if place.is_none() {
                    self.unknown.push(Unknown::Mesh(&mesh.topology));
                }
                self.recent.resize(self.recent.len().max(i + 1), (0, None));
                self.recent[i] = (address, place.flatten());
            }
            // Goes on, so that all unknown topologies are found at once.
            let Some(place) = self.recent[i].1 else {
                fits = false;
                continue;
            };
            let count = u32::try_from(mesh.positions.len()).ok()?;
            if place.vertices > count || mesh.normals.len() < count as usize {
                return None;
            }
            let positions = self.source(Arc::as_ptr(mesh) as usize, || VertexData::Mesh(mesh));
            self.draws.push(Draw {
                positions,
                normals: 3 * count,
                count,
                projected,
                ..Draw::placed(&scene.camera, &instance.affine).with(&place)
            });
            projected = projected.saturating_add(count);
        }
        fits.then_some(projected)
    }

    fn revolution(
        &mut self,
        draw: Draw,
        surface: &'a Arc<Revolution>,
        topologies: &Topologies,
    ) -> Option<u32> {
        let place = topologies.revolution(surface);
        if place.is_none() {
            self.unknown.push(Unknown::Revolution(surface));
        }
        let count = u32::try_from(surface.rings().len()).ok()?.checked_mul(SIDES)?;
        let place = place.flatten()?;
        let positions = self.source(Arc::as_ptr(surface) as usize, || VertexData::Rings(surface));
        let mut draw = Draw { positions, count, ..draw.with(&place) };
        draw.flags |= REVOLUTION;
        self.draws.push(draw);
        Some(count)
    }

    /// The number of a source.
    fn source(&mut self, address: usize, make: impl FnOnce() -> VertexData<'a>) -> u32 {
        let sources = &mut self.sources;
        *self.known.entry(address).or_insert_with(|| {
            sources.push((address, make()));
            sources.len() as u32 - 1
        })
    }
}
