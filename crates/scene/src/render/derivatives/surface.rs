//! How depth moves with the surface: from derivatives with respect to the depth at each
//! pixel to derivatives with respect to the vertices.
//!
//! The depth at a pixel is where its line of sight meets the plane of the visible face;
//! the choice of that face is held fixed. [`View::vjp_mask`] accounts for the motion of
//! the outline.

use crate::render::View;
use crate::render::pixels::project::{Projected, project};
use crate::render::pixels::raster::{each_triangle, empty};
use glam::DVec3;

impl View {
    /// The derivatives with respect to each vertex of the solid's meshes in turn, in
    /// world coordinates, from those with respect to the depth at each pixel, row by row,
    /// of the picture whose longer side has `size` pixels. Pixels that do not show the
    /// solid are ignored.
    pub fn vjp_depth(&self, size: u32, by_depth: &[f64]) -> Vec<DVec3> {
        let (solid, camera) = (self.solid(), self.camera().scaled_to(size));
        let mut projected = Projected::default();
        project(solid, &camera, &mut projected);
        let mut nearest = vec![empty(&camera); camera.pixels()];
        let mut faces: Vec<Option<(usize, usize)>> = vec![None; camera.pixels()];
        each_triangle(solid, &camera, &projected, |triangle, source| {
            triangle.runs(|run| {
                for column in run.from..run.to {
                    let i = run.row * camera.width as usize + column;
                    let q = run.nearness(column);
                    if let (Some(at), Some(face)) = (nearest.get_mut(i), faces.get_mut(i))
                        && q > *at
                    {
                        (*at, *face) = (q, Some((source.instance, source.face)));
                    }
                }
            });
        });
        let first =
            |n: usize| solid.instances()[..n].iter().map(|i| i.mesh.positions.len()).sum::<usize>();
        let firsts: Vec<usize> = (0..solid.instances().len()).map(first).collect();
        let mut out = vec![DVec3::ZERO; solid.vertex_count()];
        for (i, (face, by)) in faces.iter().zip(by_depth).enumerate() {
            let Some((instance, face)) = face.filter(|_| *by != 0.0) else { continue };
            let (x, y) = (i % camera.width as usize, i / camera.width as usize);
            let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
            let start = camera.unproject(x, y, 0.0);
            let ray = camera.unproject(x, y, 1.0) - start;
            let item = &solid.instances()[instance];
            let corners = item.mesh.topology.triangles[face];
            let [a, b, c] =
                corners.map(|v| item.affine.point(item.mesh.positions[v as usize].as_dvec3()));
            let normal = (b - a).cross(c - a);
            let slope = normal / normal.dot(ray);
            let hit = start + ray * slope.dot(a - start);
            // The barycentric coordinates of the visible point.
            let area = normal.length_squared();
            let share = |p: DVec3, q: DVec3| (p - hit).cross(q - hit).dot(normal) / area;
            let g = slope * *by;
            if !g.is_finite() {
                continue;
            }
            for (v, share) in corners.into_iter().zip([share(b, c), share(c, a), share(a, b)]) {
                out[firsts[instance] + v as usize] += g * share;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing::solid;
    use crate::render::{Camera, Projection};
    use glam::Vec3;

    #[test]
    fn depth_moves_with_the_plane_of_the_face_that_is_seen() {
        // On the plane z = x / 8, whose depth at a pixel grows by dx / 8 - dz when it
        // moves by (dx, 0, dz), where the line of sight is along -z.
        let corners = [
            Vec3::new(-2.0, -2.0, -0.25),
            Vec3::new(14.0, -2.0, 1.75),
            Vec3::new(-2.0, 6.0, -0.25),
        ];
        let triangle = solid(corners.to_vec(), vec![[0, 1, 2]]);
        let pinhole = Camera::default_for(3, 3);
        let projection = Projection::Orthographic { units_per_pixel: 1.0, cx: 1.5, cy: 1.5 };
        let parallel = Camera { projection, ..pinhole };
        // The middle pixel shows the origin, the one to its right (1, 0, 1 / 8); `shares`
        // are the barycentric coordinates there.
        for (camera, pixel, shares) in [
            (pinhole, 4, [0.625, 0.125, 0.25]),
            (parallel, 4, [0.625, 0.125, 0.25]),
            (parallel, 5, [0.5625, 0.1875, 0.25]),
        ] {
            let mut by_depth = [0.0; 9];
            by_depth[pixel] = 2.0;
            let by_vertex = View::new(triangle.clone(), camera).vjp_depth(3, &by_depth);
            assert_eq!(by_vertex.len(), 3);
            for (p, g) in triangle.vertices().zip(by_vertex) {
                let corner = corners.iter().position(|c| c.as_dvec3() == p).unwrap();
                let expected = DVec3::new(0.125, 0.0, -1.0) * (2.0 * shares[corner]);
                assert!((g - expected).length() < 1e-12, "{camera:?}: {g} {expected}");
            }
        }
    }
}
