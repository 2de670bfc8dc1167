//! How the fractions of pixels that a solid covers change with its vertices.
//!
//! Where the edge of a triangle lies between a sample that is covered and one that is not, it
//! is the outline there. Its place in a row is a smooth function of its two vertices, which
//! gives exact derivatives, save for the steps of samples.

use crate::geom::{Instance, Mesh, Solid};
use crate::render::Camera;
use crate::render::pixels::fractions::{
    COLUMNS, Edge, Fractions, ROWS, Samples, first, in_samples, is_back,
};
use crate::render::pixels::project::{Placement, Vertices};
use crate::render::pixels::raster::back_of;
use crate::render::simd::vectorised;
use glam::DVec3;

impl Fractions {
    /// The derivatives of the sum of `gain` times the fraction of each pixel with respect to
    /// each vertex of the solid's meshes in turn, in world coordinates. `None` without
    /// samples, or if the near plane cuts a mesh.
    pub fn vjp(&self, solid: &Solid, camera: &Camera, gain: &[f64]) -> Option<Vec<DVec3>> {
        let samples = self.samples.as_ref()?;
        let mut outline = Outline { samples, found: vec![0; samples.words.len()], gain };
        let mut out = Vec::with_capacity(solid.vertex_count());
        for (i, item) in solid.instances().iter().enumerate() {
            let vertices = self.projected.mesh(i);
            if !vertices.whole {
                return None;
            }
            let mut by_vertex = vec![[0.0; 2]; vertices.len()];
            if !vertices.outside(camera) {
                let back = back_of(&item.mesh, &Placement::new(camera, &item.affine), true);
                outline.follow(&item.mesh, &vertices, back, &mut by_vertex);
            }
            out.extend(in_world(item, camera, &by_vertex));
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

/// The search for the edges that are the outline.
struct Outline<'a> {
    samples: &'a Samples,
    /// The samples whose left side is the outline and has been found to be an edge: two
    /// triangles may have it.
    found: Vec<u64>,
    gain: &'a [f64],
}

impl Outline<'_> {
    /// Adds to the derivatives with respect to the places of a mesh's vertices, in pixels.
    fn follow(
        &mut self,
        mesh: &Mesh,
        vertices: &Vertices<'_>,
        back: f64,
        by_vertex: &mut [[f64; 2]],
    ) {
        vectorised(
            #[inline(always)]
            || {
                for corners in &mesh.topology.triangles {
                    let points = corners.map(|v| vertices.point(v));
                    if is_back(&points, back) {
                        continue;
                    }
                    let places = points.each_ref().map(in_samples);
                    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                        let (i, j) = if places[i][1] <= places[j][1] { (i, j) } else { (j, i) };
                        let by = self.along(&Edge::new(places[i], places[j]));
                        if by == [[0.0; 2]; 2] {
                            continue;
                        }
                        for (v, by) in [corners[i], corners[j]].into_iter().zip(by) {
                            if let Some(sum) = by_vertex.get_mut(v as usize) {
                                *sum = [sum[0] + by[0], sum[1] + by[1]];
                            }
                        }
                    }
                }
            },
        );
    }

    /// The derivatives with respect to the ends of an edge, in pixels.
    #[inline(always)]
    fn along(&mut self, edge: &Edge) -> [[f64; 2]; 2] {
        let mut by = [[0.0; 2]; 2];
        let (width, most) = (self.samples.width, self.samples.width * COLUMNS);
        for row in edge.rows(self.samples.rows) {
            let column = first(edge.at(row), most);
            if column == 0 || column == most {
                continue;
            }
            let sides = [column - 1, column].map(|column| self.samples.has(row, column));
            let (at, bit) = (row * width + column / COLUMNS, 1 << (column % COLUMNS));
            if sides[0] == sides[1] || self.found[at] & bit != 0 {
                continue;
            }
            self.found[at] |= bit;
            // What an edge gains by a pixel to the right.
            let gain = self.gain.get(row / ROWS * width + column / COLUMNS).copied().unwrap_or(0.0);
            let gain = if sides[0] { gain } else { -gain } / ROWS as f64;
            let share = (row as f64 - edge.from[1]) / (edge.to[1] - edge.from[1]);
            // Of x by y, in pixels.
            let slope = edge.slope * (ROWS as f64 / COLUMNS as f64);
            for (by, share) in by.iter_mut().zip([1.0 - share, share]) {
                *by = [by[0] + gain * share, by[1] - gain * share * slope];
            }
        }
        by
    }
}
