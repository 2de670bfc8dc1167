//! How the fractions of pixels that a solid covers change with its vertices.
//!
//! Where the side of a face lies between a sample that is covered and one that is not, it is
//! the outline there. Its place in a row is a smooth function of its two vertices, which gives
//! exact derivatives, save for the steps of samples.

use crate::geom::{ByVertex, Solid};
use crate::render::Camera;
use crate::render::pixels::fractions::{COLUMNS, Crossing, Fractions, ROWS};
use std::cell::RefCell;

impl Fractions {
    /// The derivatives of the sum of the fraction of each pixel times its `gain` with respect to the
    /// vertices at the outline, in world coordinates, by their numbers among those of the solid's
    /// meshes in turn. `None` without samples, or if the near plane cuts a mesh.
    pub fn vjp(
        &self,
        solid: &Solid,
        camera: &Camera,
        gain: impl Fn(usize) -> f64,
    ) -> Option<ByVertex> {
        let outline = self.outline.as_ref()?;
        let width = camera.width as usize;
        SCRATCH.with_borrow_mut(|Scratch { by_edge, places }| {
            by_edge.clear();
            by_edge.resize(outline.edges.len(), [0.0; 2]);
            for Crossing { row, column, edge, enters } in &outline.crossings {
                let (row, column) = (*row as usize, *column as usize);
                let Some([all, moment]) = by_edge.get_mut(*edge as usize) else { continue };
                if column == 0 || column == width * COLUMNS {
                    continue;
                }
                let gain = gain(row / ROWS * width + column / COLUMNS);
                let gain = if *enters { -gain } else { gain };
                *all += gain;
                *moment += gain * row as f64;
            }
            places.begin(solid.vertex_count());
            for (edge, [all, moment]) in outline.edges.iter().zip(&*by_edge) {
                if *all == 0.0 && *moment == 0.0 {
                    continue;
                }
                // A place in a row is a mean of the ends, whose weights are linear in the row.
                let lower = (moment - all * edge.from[1]) / (edge.to[1] - edge.from[1]);
                // Of x by y, in pixels.
                let slope = edge.slope * (ROWS as f64 / COLUMNS as f64);
                for (v, gain) in edge.vertices.into_iter().zip([all - lower, lower]) {
                    let gain = gain / ROWS as f64;
                    places.add(v, [gain, -gain * slope]);
                }
            }
            let mut out = Vec::with_capacity(places.by.len());
            let number = |v: u32| outline.body.as_ref().map_or(v, |body| body.number(v));
            let by = places.by.iter().map(|(v, by)| (number(*v), *by));
            solid.each_of(by, |v, at, by| {
                let by = camera.vjp_point(at, by);
                if by.is_finite() {
                    out.push((v, by));
                }
            });
            Some(out)
        })
    }
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Buffers that are reused.
#[derive(Default)]
struct Scratch {
    /// For each side, what it gains by a pixel to the right in all rows that it crosses, and the
    /// sum of each row's gain times the row.
    by_edge: Vec<[f64; 2]>,
    places: ByPlace,
}

/// Derivatives with respect to the places of vertices in the picture, in pixels.
#[derive(Default)]
struct ByPlace {
    /// For each vertex, where it is in `by`, if it is there.
    slots: Vec<u32>,
    by: Vec<(u32, [f64; 2])>,
}

impl ByPlace {
    /// Forgets all, for this number of vertices.
    fn begin(&mut self, vertices: usize) {
        for (v, _) in self.by.drain(..) {
            self.slots[v as usize] = u32::MAX;
        }
        if self.slots.len() < vertices {
            self.slots.resize(vertices, u32::MAX);
        }
    }

    #[inline(always)]
    fn add(&mut self, v: u32, [x, y]: [f64; 2]) {
        let Some(slot) = self.slots.get_mut(v as usize) else { return };
        match self.by.get_mut(*slot as usize) {
            Some((_, by)) => *by = [by[0] + x, by[1] + y],
            None => {
                *slot = self.by.len() as u32;
                self.by.push((v, [x, y]));
            }
        }
    }
}
