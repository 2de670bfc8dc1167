//! The rasteriser: cuts the triangles of a solid at the near plane and draws their
//! nearness.
//!
//! It does no shading and keeps no state. [`crate::render::pixels::triangle`] documents which pixels a
//! triangle covers.

use crate::geom::{Mesh, Solid};
use crate::render::Camera;
use crate::render::pixels::area::Area;
use crate::render::pixels::candidates::Candidates;
use crate::render::pixels::pixel_bitmap::PixelBitmap;
use crate::render::pixels::place::Point;
use crate::render::pixels::place::{place, size};
use crate::render::pixels::project::{DepthRange, Lens, Placement, Projected, Vertices, project};
use crate::render::pixels::triangle::Triangle;
use crate::render::simd::vectorised;
use glam::DVec3;

/// Where a triangle comes from.
pub(in crate::render) struct FaceId {
    /// Index of the instance in the solid.
    pub instance: usize,
    /// Face of the instance's mesh.
    pub face: usize,
}

/// Corner weights of a triangle that was not cut.
pub(in crate::render) const WHOLE: [[f64; 3]; 3] =
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Calls `draw` for each triangle that may touch the image, cut at the near plane.
/// `projected` must come from [`project`].
pub(in crate::render) fn each_triangle(
    solid: &Solid,
    camera: &Camera,
    projected: &Projected,
    mut draw: impl FnMut(&Triangle, &FaceId),
) {
    for (instance, item) in solid.instances().iter().enumerate() {
        let placement = &Placement::new(camera, &item.affine);
        mesh_triangles(
            &item.mesh,
            placement,
            camera,
            &projected.mesh(instance),
            |triangle, face| {
                draw(triangle, &FaceId { instance, face });
            },
        );
    }
}

/// As [`each_triangle`] for one mesh; `draw` gets the face's index.
fn mesh_triangles(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    mut draw: impl FnMut(&Triangle, usize),
) {
    if !vertices.whole {
        return cut_triangles(mesh, placement, camera, vertices, |triangle, face, _| {
            draw(triangle, face)
        });
    }
    let (size, back) = (size(camera.width, camera.height), back(mesh, placement, vertices));
    for (face, corners) in mesh.topology.triangles.iter().enumerate() {
        let Some(places) = vertices.places(corners) else { continue };
        if let Some(triangle) =
            Triangle::within(corners.map(|v| vertices.point(v)), places, size, back)
        {
            draw(&triangle, face);
        }
    }
}

/// The orientation of triangles that need not be drawn, as in [`Triangle::new`]. Seen
/// from outside, the back faces of a closed body are hidden by its other faces.
/// Counter-clockwise in the scene is counter-clockwise in the image, unless mirrored.
fn back(mesh: &Mesh, placement: &Placement, vertices: &Vertices<'_>) -> f64 {
    back_of(mesh, placement, vertices.whole)
}

/// The same for a mesh of which all vertices are usable and beyond the near plane, or not.
pub(in crate::render) fn back_of(mesh: &Mesh, placement: &Placement, whole: bool) -> f64 {
    match mesh.topology.encloses && whole {
        false => 0.0,
        true if placement.mirrored => -1.0,
        true => 1.0,
    }
}

/// Calls `draw` for the triangles of a mesh whose vertices are not all beyond the near
/// plane. `draw` gets the face and, for each corner of the triangle, the weights of the
/// face's three corners: the identity unless the near plane cut it.
pub(in crate::render) fn cut_triangles(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    mut draw: impl FnMut(&Triangle, usize, [[f64; 3]; 3]),
) {
    let (size, lens) = (size(camera.width, camera.height), Lens::new(camera));
    for (face, corners) in mesh.topology.triangles.iter().enumerate() {
        let points = corners.map(|v| vertices.point(v));
        if points.iter().any(|p| p.nearness.is_nan())
            || points.iter().all(|p| p.nearness == f64::INFINITY)
        {
            continue;
        }
        let corners = corners.map(|v| placement.point(mesh.positions[v as usize].as_dvec3()));
        let (cut, n) = cut_near(&corners);
        let corner = |w: &[f64; 3]| {
            let p = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            lens.point(DVec3::new(p.x, p.y, p.z.min(-Camera::NEAR)))
        };
        for m in 2..n {
            let weights = [cut[0], cut[m - 1], cut[m]];
            let points = weights.each_ref().map(corner);
            let places = points.map(|p| place(p.x, p.y));
            if let Some(triangle) = Triangle::within(points.map(Point::single), places, size, 0.0) {
                draw(&triangle, face, weights);
            }
        }
    }
}

/// The part of a triangle beyond the near plane, as a polygon of at most four corners
/// given by weights, and their number.
fn cut_near(corners: &[DVec3; 3]) -> ([[f64; 3]; 4], usize) {
    let mut out = [[0.0; 3]; 4];
    let mut n = 0;
    let mut push = |w: [f64; 3]| {
        out[n] = w;
        n += 1;
    };
    let beyond = corners.map(|p| -p.z - Camera::NEAR);
    for i in 0..3 {
        let j = (i + 1) % 3;
        if beyond[i] >= 0.0 {
            push(WHOLE[i]);
        }
        if (beyond[i] >= 0.0) != (beyond[j] >= 0.0) {
            // Interpolated from the far end in both faces that share the edge, so that
            // both get the same point.
            let (far, near) = if beyond[i] >= 0.0 { (i, j) } else { (j, i) };
            let u = beyond[far] / (beyond[far] - beyond[near]);
            let mut w = [0.0; 3];
            w[far] = 1.0 - u;
            w[near] = u;
            push(w);
        }
    }
    (out, n)
}

/// Draws nearness alone into `buffer` (row by row, cleared here) and returns the depth
/// range of the vertices.
pub(in crate::render) fn draw_nearness(
    solid: &Solid,
    camera: &Camera,
    projected: &mut Projected,
    candidates: &mut Candidates,
    buffer: &mut Vec<f32>,
) -> DepthRange {
    let range = project(solid, camera, projected);
    buffer.clear();
    buffer.resize(camera.pixels(), empty(camera));
    let area = Area::whole(camera);
    for (i, item) in solid.instances().iter().enumerate() {
        let placement = Placement::new(camera, &item.affine);
        let vertices = projected.mesh(i);
        if !vertices.outside(camera) {
            fill_mesh(&item.mesh, &placement, camera, &vertices, candidates, (&area, None), buffer);
        }
    }
    range
}

/// Draws the nearness of one mesh into `buffer` (the rows of the area, cleared here).
pub(in crate::render) fn draw_mesh(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    candidates: &mut Candidates,
    area: &Area,
    buffer: &mut Vec<f32>,
) {
    buffer.clear();
    buffer.resize(area.pixels(), empty(camera));
    fill_mesh(mesh, placement, camera, vertices, candidates, (area, None), buffer);
}

/// Merges the nearness of one mesh into the rows of an area, keeping the nearer value. If
/// only the pixels of a bitmap matter, the area must be the whole image; the values at
/// others are unspecified.
pub(in crate::render) fn fill_mesh(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    candidates: &mut Candidates,
    (area, wanted): (&Area, Option<&PixelBitmap>),
    buffer: &mut [f32],
) {
    if !vertices.whole {
        return cut_triangles(mesh, placement, camera, vertices, |t, _, _| {
            t.keep(buffer, area, wanted)
        });
    }
    let how = (size(camera.width, camera.height), back(mesh, placement, vertices));
    vectorised(
        #[inline(always)]
        || candidates.fill::<false>(&mesh.topology, vertices, how, (area, wanted), buffer, &mut []),
    );
}

/// As [`fill_mesh`], for a mesh with all vertices beyond the near plane. Also writes the
/// face into `faces` at each pixel where this mesh is nearer than `buffer`.
pub(in crate::render) fn fill_faces(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    candidates: &mut Candidates,
    area: &Area,
    (buffer, faces): (&mut [f32], &mut [u32]),
) {
    let how = (size(camera.width, camera.height), back(mesh, placement, vertices));
    let topology = &mesh.topology;
    vectorised(
        #[inline(always)]
        || candidates.fill::<true>(topology, vertices, how, (area, None), buffer, faces),
    );
}

/// The nearness of a pixel that shows nothing.
pub(in crate::render) fn empty(camera: &Camera) -> f32 {
    if Lens::new(camera).pinhole { 0.0 } else { f32::NEG_INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_near_plane_cuts_to_a_triangle_or_a_quad() {
        let p = |z: f64| DVec3::new(0.0, 0.0, z);
        assert_eq!(cut_near(&[p(-1.0), p(1.0), p(1.0)]).1, 3);
        assert_eq!(cut_near(&[p(-1.0), p(-1.0), p(1.0)]).1, 4);
        assert_eq!(cut_near(&[p(1.0), p(1.0), p(1.0)]).1, 0);
    }
}
