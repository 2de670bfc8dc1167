//! Scenes as the device reads them: numbers of placements, and each mesh's vertices once.

use crate::layout::{Draw, REVOLUTION, SIDES, Scene as Item};
use crate::topologies::Topologies;
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::geom::{Mesh, PlacedRevolution};
use pcadlang_scene::render::Scene;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Scenes of a batch.
const MOST_SCENES: usize = 4096;
/// Numbers of vertices of a batch: 96 MB.
const MOST_NUMBERS: usize = 24 << 20;
/// Vertices of a scene.
const MOST_VERTICES: u32 = 1 << 18;
/// Tasks for the cores.
const TASKS: usize = 64;

/// Consecutive scenes with pictures of one size.
#[derive(Default)]
pub struct Batch {
    pub items: Vec<Item>,
    pub draws: Vec<Draw>,
    pub vertices: Vec<f32>,
    /// Whether each scene is for the CPU.
    pub for_cpu: Vec<bool>,
    /// The most vertices of a scene.
    pub most: u32,
}

/// A scene's item, and the draws with its placements.
type Placed = (Item, Vec<Draw>);

/// What a scene shows.
enum Shape<'a> {
    Meshes(Vec<&'a Arc<Mesh>>),
    Revolution(&'a PlacedRevolution),
}

fn shape(scene: &Scene) -> Shape<'_> {
    match scene.solid.revolution() {
        Some(r) => Shape::Revolution(r),
        None => Shape::Meshes(scene.solid.instances().iter().map(|i| &i.mesh).collect()),
    }
}

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

impl Batch {
    /// As many of the first scenes as make one batch, at least one if there are any.
    pub fn of(scenes: &[Scene], topologies: &mut Topologies, pool: &Pool) -> Batch {
        let Some(first) = scenes.first() else { return Batch::default() };
        let same = scenes.iter().take_while(|s| size(s) == size(first)).take(MOST_SCENES);
        let scenes = &scenes[..same.count()];
        let tasks = scenes.chunks(scenes.len().div_ceil(TASKS)).collect();
        let placed = pool.map(tasks, |scenes: &[Scene]| {
            scenes.iter().map(place).collect::<Vec<Placed>>()
        });
        let mut batch = Batch::default();
        // The sines of the sides come first.
        for k in 0..SIDES {
            let turn = std::f64::consts::TAU * f64::from(k) / f64::from(SIDES);
            batch.vertices.extend([turn.cos() as f32, turn.sin() as f32]);
        }
        let mut gather = Gather { topologies, known: FxHashMap::default(), copies: Vec::new() };
        let mut numbers = batch.vertices.len();
        for (scene, (mut item, mut draws)) in scenes.iter().zip(placed.into_iter().flatten()) {
            if numbers > MOST_NUMBERS {
                break;
            }
            let fits = match shape(scene) {
                Shape::Revolution(r) => gather.revolution(r, &mut draws, &mut numbers),
                Shape::Meshes(meshes) => gather.meshes(&meshes, &mut draws, &mut numbers),
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
        batch.vertices.resize(numbers, 0.0);
        gather.copy(&mut batch.vertices, pool);
        batch
    }
}

/// What is copied into the list of vertices.
enum Source<'a> {
    Positions(&'a Mesh),
    Normals(&'a Mesh),
    Rings(&'a PlacedRevolution),
}

struct Gather<'a, 'b> {
    topologies: &'b mut Topologies,
    /// Where the vertices of a mesh or surface begin, by address: all are held by the
    /// scenes.
    known: FxHashMap<usize, u32>,
    /// In order, without gaps.
    copies: Vec<(usize, Source<'a>)>,
}

impl<'a> Gather<'a, '_> {
    fn meshes(&mut self, meshes: &[&'a Arc<Mesh>], draws: &mut [Draw], numbers: &mut usize) -> bool {
        let mut projected = 0;
        for (mesh, draw) in meshes.iter().zip(draws) {
            let count = mesh.positions.len();
            let Some(place) = self.topologies.mesh(&mesh.topology) else { return false };
            if (place.vertices as usize) > count || mesh.normals.len() < count {
                return false;
            }
            let at = *self.known.entry(Arc::as_ptr(mesh) as usize).or_insert_with(|| {
                let at = *numbers as u32;
                self.copies.push((3 * count, Source::Positions(mesh)));
                self.copies.push((3 * count, Source::Normals(mesh)));
                *numbers += 6 * count;
                at
            });
            *draw = Draw {
                positions: at,
                normals: at + 3 * count as u32,
                count: count as u32,
                projected,
                ..topology(draw, &place)
            };
            projected += count as u32;
        }
        true
    }

    fn revolution(
        &mut self,
        placed: &'a PlacedRevolution,
        draws: &mut [Draw],
        numbers: &mut usize,
    ) -> bool {
        let ([draw], Some(place)) = (draws, self.topologies.revolution(&placed.surface)) else {
            return false;
        };
        let rings = placed.surface.rings().len();
        let at = *self.known.entry(Arc::as_ptr(&placed.surface) as usize).or_insert_with(|| {
            let at = *numbers as u32;
            self.copies.push((4 * rings, Source::Rings(placed)));
            *numbers += 4 * rings;
            at
        });
        *draw = Draw { positions: at, count: rings as u32 * SIDES, ..topology(draw, &place) };
        draw.flags |= REVOLUTION;
        true
    }

    /// Copies everything into the end of the list.
    fn copy(self, vertices: &mut [f32], pool: &Pool) {
        let total: usize = self.copies.iter().map(|(count, _)| count).sum();
        let first = vertices.len() - total;
        let mut rest = &mut vertices[first..];
        let (mut tasks, mut task, mut size) = (Vec::new(), Vec::new(), 0);
        for (count, source) in self.copies {
            let (own, after) = std::mem::take(&mut rest).split_at_mut(count);
            rest = after;
            task.push((own, source));
            size += count;
            if size * TASKS > total {
                tasks.push(std::mem::take(&mut task));
                size = 0;
            }
        }
        tasks.push(task);
        pool.map(tasks, |task| task.into_iter().for_each(|(out, source)| source.write(out)));
    }
}

impl Source<'_> {
    fn write(&self, out: &mut [f32]) {
        match self {
            Source::Positions(mesh) => out.copy_from_slice(bytemuck::cast_slice(&mesh.positions)),
            Source::Normals(mesh) => {
                let count = out.len() / 3;
                out.copy_from_slice(bytemuck::cast_slice(&mesh.normals[..count]));
            }
            Source::Rings(placed) => {
                for (out, ring) in out.chunks_exact_mut(4).zip(placed.surface.rings()) {
                    let numbers = [ring.r, ring.y, ring.nr, ring.ny].map(|v| v as f32);
                    out.copy_from_slice(&numbers);
                }
            }
        }
    }
}

fn topology(draw: &Draw, place: &crate::topologies::Place) -> Draw {
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
