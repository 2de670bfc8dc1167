//! The list of vertices that the device reads: of each mesh and surface once.

use crate::batch::TASKS;
use crate::layout::SIDES;
use bytemuck::NoUninit;
use pcadlang_numerics::platform::threads::Pool;
use pcadlang_scene::geom::{Mesh, Revolution, Ring};
use rustc_hash::FxHashMap;
use std::borrow::Cow;
use wgpu::WriteOnly;

/// Bytes that a task writes at a time.
const BLOCK: usize = 1 << 16;

/// The elements of the list.
#[derive(Clone, Copy)]
pub enum VertexData<'a> {
    /// Positions, then normals.
    Mesh(&'a Mesh),
    Rings(&'a Revolution),
}

/// A part of the list, to be copied.
enum Part<'a> {
    /// Cosine and sine of each side's angle from x towards z.
    Sides,
    Positions(&'a Mesh),
    Normals(&'a Mesh),
    Rings(&'a Revolution),
}

/// The list.
pub struct Vertices<'a> {
    /// At which number each part begins.
    parts: Vec<(usize, Part<'a>)>,
    numbers: usize,
    known: FxHashMap<usize, u32>,
}

impl Default for Vertices<'_> {
    /// The turns by each side, with which every list begins.
    fn default() -> Self {
        let parts = vec![(0, Part::Sides)];
        Vertices { parts, numbers: 2 * SIDES as usize, known: FxHashMap::default() }
    }
}

impl<'a> Vertices<'a> {
    /// How many numbers it has.
    pub fn numbers(&self) -> usize {
        self.numbers
    }

    /// Where the vertices of a source are, which is known by its address.
    pub fn add(&mut self, address: usize, source: &VertexData<'a>) -> u32 {
        let (parts, numbers) = (&mut self.parts, &mut self.numbers);
        *self.known.entry(address).or_insert_with(|| {
            let at = *numbers;
            let mut part = |count: usize, part| {
                parts.push((*numbers, part));
                *numbers += count;
            };
            match source {
                VertexData::Mesh(mesh) => {
                    part(3 * mesh.positions.len(), Part::Positions(mesh));
                    part(3 * mesh.positions.len(), Part::Normals(mesh));
                }
                VertexData::Rings(surface) => part(4 * surface.rings().len(), Part::Rings(surface)),
            }
            at as u32
        })
    }

    /// Bytes of the list, in whole blocks.
    pub fn bytes(&self) -> u64 {
        (4 * self.numbers).next_multiple_of(BLOCK) as u64
    }

    /// Writes the list on several cores.
    pub fn write(&self, out: WriteOnly<'_, [u8]>, pool: &Pool) {
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
        let past = first + out.len();
        let part = self.parts.partition_point(|(at, _)| 4 * at <= first).saturating_sub(1);
        for (at, part) in &self.parts[part..] {
            let (at, bytes) = (4 * at, part.bytes());
            if at >= past {
                break;
            }
            let (from, to) = (first.max(at), past.min(at + bytes.len()));
            if from < to {
                out.slice(from - first..to - first).copy_from_slice(&bytes[from - at..to - at]);
            }
        }
    }
}

impl Part<'_> {
    fn bytes(&self) -> Cow<'_, [u8]> {
        fn owned<T: NoUninit>(list: Vec<T>) -> Cow<'static, [u8]> {
            Cow::Owned(bytemuck::cast_slice(&list).to_vec())
        }
        match self {
            Part::Positions(mesh) => Cow::Borrowed(bytemuck::cast_slice(&mesh.positions)),
            Part::Normals(mesh) => {
                let count = mesh.positions.len();
                Cow::Borrowed(bytemuck::cast_slice(&mesh.normals[..count]))
            }
            Part::Rings(surface) => {
                let numbers = |ring: &Ring| [ring.r, ring.y, ring.nr, ring.ny].map(|v| v as f32);
                owned(surface.rings().iter().map(numbers).collect())
            }
            Part::Sides => {
                let angle = |k| std::f64::consts::TAU * f64::from(k) / f64::from(SIDES);
                let turn = |k| [angle(k).cos() as f32, angle(k).sin() as f32];
                owned((0..SIDES).map(turn).collect())
            }
        }
    }
}
