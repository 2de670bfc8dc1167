//! How the fractions of pixels that a solid covers change with its vertices.
//!
//! Where the side of a face lies between a sample that is covered and one that is not, it is
//! the outline there. Its place in a row is a smooth function of its two vertices, which gives
//! exact derivatives, save for the steps of samples.

use crate::geom::{Instance, Solid};
use crate::render::Camera;
use crate::render::pixels::fractions::{COLUMNS, Crossing, Fractions, ROWS};
use glam::DVec3;

impl Fractions {
    /// The derivatives of the sum of `gain` times the fraction of each pixel with respect to
    /// each vertex of the solid's meshes in turn, in world coordinates. `None` without
    /// samples, or if the near plane cuts a mesh.
    pub fn vjp(&self, solid: &Solid, camera: &Camera, gain: &[f64]) -> Option<Vec<DVec3>> {
        let outline = self.outline.as_ref()?;
        let (width, count) = (camera.width as usize, solid.vertex_count());
        // With respect to places in the picture, in pixels.
        let mut by_place = vec![[0.0; 2]; count];
        for Crossing { row, column, edge, enters } in &outline.crossings {
            let (row, column) = (*row as usize, *column as usize);
            let Some(edge) = outline.edges.get(*edge as usize) else { continue };
            if column == 0 || column == width * COLUMNS {
                continue;
            }
            // What it gains by a pixel to the right.
            let gain = gain.get(row / ROWS * width + column / COLUMNS).copied().unwrap_or(0.0);
            let gain = if *enters { -gain } else { gain } / ROWS as f64;
            let share = (row as f64 - edge.from[1]) / (edge.to[1] - edge.from[1]);
            // Of x by y, in pixels.
            let slope = edge.slope * (ROWS as f64 / COLUMNS as f64);
            for (v, share) in edge.vertices.into_iter().zip([1.0 - share, share]) {
                if let Some(by) = by_place.get_mut(v as usize) {
                    *by = [by[0] + gain * share, by[1] - gain * share * slope];
                }
            }
        }
        let mut out = Vec::with_capacity(count);
        for item in solid.instances() {
            let own = by_place.get(out.len()..).unwrap_or_default();
            out.extend(in_world(item, camera, own));
        }
        Some(out)
    }
}

/// The derivatives with respect to vertices in the world, from those with respect to their
/// places in the picture.
fn in_world<'a>(
    item: &'a Instance,
    camera: &'a Camera,
    by_vertex: &'a [[f64; 2]],
) -> impl Iterator<Item = DVec3> + 'a {
    item.mesh.positions.iter().zip(by_vertex).map(|(p, by)| {
        if *by == [0.0; 2] {
            return DVec3::ZERO;
        }
        let by = camera.vjp_point(item.affine.point(p.as_dvec3()), *by);
        if by.is_finite() { by } else { DVec3::ZERO }
    })
}
