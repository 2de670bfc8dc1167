//! The rasteriser: the triangles of a solid, cut at the near plane, and the picture of their nearness.
//!
//! It does no shading and keeps no state. Which pixels a triangle covers is said in [`super::triangle`].

use super::Camera;
use super::project::{DepthRange, Lens, Placement, Point, project};
use super::triangle::Triangle;
use crate::geom::{Mesh, Solid};
use glam::DVec3;

/// What a triangle is, besides its corners in the image.
pub(super) struct Source<'a> {
    /// Index of the instance in the solid.
    pub instance: usize,
    /// Face of the instance's mesh.
    pub face: usize,
    pub placement: &'a Placement,
    /// Weights of the face's three corners at each corner of the triangle: other than the identity where the near
    /// plane cut the face.
    pub weights: [[f64; 3]; 3],
}

const WHOLE: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Calls `draw` for each triangle that may touch the image, cut at the near plane. `points` are those of [`project`].
pub(super) fn each_triangle(
    solid: &Solid,
    camera: &Camera,
    points: &[Point],
    mut draw: impl FnMut(&Triangle, &Source<'_>),
) {
    let mut base = 0;
    for (instance, item) in solid.instances().iter().enumerate() {
        let placement = &Placement::new(camera, &item.affine);
        let count = item.mesh.positions.len();
        let Some(points) = points.get(base..base + count) else { return };
        base += count;
        mesh_triangles(&item.mesh, placement, camera, points, |triangle, face, weights| {
            draw(triangle, &Source { instance, face, placement, weights });
        });
    }
}

/// As [`each_triangle`] for one mesh: `draw` gets the face and the weights of [`Source`].
fn mesh_triangles(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    points: &[Point],
    mut draw: impl FnMut(&Triangle, usize, [[f64; 3]; 3]),
) {
    let (width, height) = (camera.width, camera.height);
    // With the eye outside, the faces of a body that are turned away are hidden by others.
    let fronts_only = mesh.topology.encloses && points.iter().all(|p| p.depth >= Camera::NEAR);
    for (face, &[i, j, k]) in mesh.topology.triangles.iter().enumerate() {
        let (Some(a), Some(b), Some(c)) = (points.get(i as usize), points.get(j as usize), points.get(k as usize))
        else {
            continue;
        };
        if fronts_only && turned_away(a, b, c, placement.mirrored) {
            continue;
        }
        if a.depth >= Camera::NEAR && b.depth >= Camera::NEAR && c.depth >= Camera::NEAR {
            if let Some(triangle) = Triangle::new([*a, *b, *c], width, height) {
                draw(&triangle, face, WHOLE);
            }
        } else if a.depth >= Camera::NEAR || b.depth >= Camera::NEAR || c.depth >= Camera::NEAR {
            if a.depth.is_nan() || b.depth.is_nan() || c.depth.is_nan() {
                continue;
            }
            let corners = [i, j, k].map(|v| placement.point(mesh.positions[v as usize].as_dvec3()));
            let (cut, n) = cut_near(&corners);
            let lens = Lens::new(camera);
            let corner = |w: &[f64; 3]| {
                let p = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
                lens.point(DVec3::new(p.x, p.y, p.z.min(-Camera::NEAR)))
            };
            for m in 2..n {
                let weights = [cut[0], cut[m - 1], cut[m]];
                if let Some(triangle) = Triangle::new(weights.each_ref().map(corner), width, height) {
                    draw(&triangle, face, weights);
                }
            }
        }
    }
}

/// Whether a triangle shows its back, or nothing. Counter-clockwise in the scene is clockwise in numbers of the image, whose y
/// runs down.
#[inline]
fn turned_away(a: &Point, b: &Point, c: &Point, mirrored: bool) -> bool {
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if mirrored { area <= 0.0 } else { area >= 0.0 }
}

/// The part of a triangle beyond the near plane as a polygon of at most four corners, each as weights.
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
            // From the far end in both of the faces that share the edge: the same point in both.
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

/// Draws nearness alone into `buffer` (row by row, refilled here) and returns the depth range of the vertices.
pub(super) fn draw_nearness(
    solid: &Solid,
    camera: &Camera,
    points: &mut Vec<Point>,
    buffer: &mut Vec<f32>,
) -> DepthRange {
    let range = project(solid, camera, points);
    buffer.clear();
    buffer.resize(camera.pixels(), empty(camera));
    let area = Area::whole(camera);
    each_triangle(solid, camera, points, |triangle, _| triangle.fill(buffer, [area.left, area.right], area.top));
    range
}

/// Draws the nearness of one mesh into `buffer` (the rows of the area, refilled here).
pub(super) fn draw_mesh(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    points: &[Point],
    area: &Area,
    buffer: &mut Vec<f32>,
) {
    buffer.clear();
    buffer.resize(area.pixels(), empty(camera));
    mesh_triangles(mesh, placement, camera, points, |triangle, _, _| {
        triangle.fill(buffer, [area.left, area.right], area.top);
    });
}

/// A rectangle of pixels inside an image: columns `left..right`, rows `top..bottom`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Area {
    pub left: usize,
    pub right: usize,
    pub top: usize,
    pub bottom: usize,
}

impl Area {
    /// The whole image.
    pub fn whole(camera: &Camera) -> Area {
        Area { left: 0, right: camera.width as usize, top: 0, bottom: camera.height as usize }
    }

    /// All pixels that a mesh with these vertices can reach, and a margin of one for what rounding may do along long
    /// edges. The whole image if the near plane cuts the mesh.
    pub fn around(points: &[Point], camera: &Camera) -> Area {
        let (mut x, mut y) = ([f64::INFINITY, f64::NEG_INFINITY], [f64::INFINITY, f64::NEG_INFINITY]);
        let mut behind = false;
        for p in points {
            if p.depth >= Camera::NEAR {
                x = [x[0].min(p.x), x[1].max(p.x)];
                y = [y[0].min(p.y), y[1].max(p.y)];
            } else {
                behind |= !p.depth.is_nan();
            }
        }
        // Nothing to draw.
        if x[0] > x[1] {
            return Area::default();
        }
        if behind {
            return Area::whole(camera);
        }
        let span = |[low, high]: [f64; 2], side: u32| {
            let (from, to) = (first_centre(low - 1.0, side) as usize, first_centre(high + 1.0, side) as usize);
            (from, to.max(from))
        };
        let ((left, right), (top, bottom)) = (span(x, camera.width), span(y, camera.height));
        Area { left, right, top, bottom }
    }

    /// The smallest rectangle around two; one without pixels counts for nothing.
    pub fn with(&self, other: &Area) -> Area {
        match (self.pixels(), other.pixels()) {
            (_, 0) => *self,
            (0, _) => *other,
            _ => Area {
                left: self.left.min(other.left),
                right: self.right.max(other.right),
                top: self.top.min(other.top),
                bottom: self.bottom.max(other.bottom),
            },
        }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        (self.right - self.left) * (self.bottom - self.top)
    }
}

/// The first pixel whose centre is not before `at`, from 0 to `side`. The same as rounding up, without a call to the
/// library: NaN gives 0.
#[inline]
fn first_centre(at: f64, side: u32) -> u32 {
    let (at, side) = (at - 0.5, f64::from(side));
    let at = if at > 0.0 { at } else { 0.0 };
    let at = if at < side { at } else { side };
    let whole = at as u32;
    whole + u32::from(f64::from(whole) < at)
}

/// The nearness of a pixel that shows nothing.
pub(super) fn empty(camera: &Camera) -> f32 {
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
