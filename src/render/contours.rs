//! Visible contours of a solid: smooth silhouettes, boundaries and creases, as short oriented pieces.
//!
//! A smooth silhouette is the zero set of (interpolated vertex normal . direction to the eye) inside each face, so it
//! moves smoothly with the pose and does not follow the mesh's edges. Texture and shading edges are not contours here.
//! Invariant: the five lists have one entry per piece, all finite, positions inside the image, tangents of unit length.

use super::project::{Lens, Placement, Point};
use super::raster::draw_nearness;
use super::visibility::{Depths, EDGE_SLACK, Look, SILHOUETTE_SLACK};
use super::{Camera, frame::to_depth};
use crate::geom::{Instance, Mesh, Solid};
use glam::DVec3;
use std::cell::RefCell;

/// Visible contour pieces in an image. A piece's object side lies to the right of its tangent as seen in the image
/// (outward is `(ty, -tx)`); creases that show both their faces, and boundaries, have an arbitrary sense.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contours {
    /// Middle of each piece, pixels from the left edge.
    pub x: Vec<f32>,
    /// Middle of each piece, pixels from the top edge.
    pub y: Vec<f32>,
    /// Unit tangent, to the right.
    pub tx: Vec<f32>,
    /// Unit tangent, downwards.
    pub ty: Vec<f32>,
    /// Length of each piece in pixels, at most 1.5.
    pub length: Vec<f32>,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

/// Buffers reused from call to call.
#[derive(Default)]
struct Scratch {
    points: Vec<Point>,
    depth: Vec<f32>,
    facing: Vec<f64>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::new(Scratch::default());
}

impl Contours {
    /// The contours of a solid, seen in a camera's image. Draws its own depth image.
    pub fn of(solid: &Solid, camera: &Camera) -> Contours {
        with_scratch(|scratch| {
            let range = draw_nearness(solid, camera, &mut scratch.points, &mut scratch.depth);
            to_depth(camera, &mut scratch.depth);
            trace(solid, camera, &scratch.points, &scratch.depth, range.extent(), &mut scratch.facing)
        })
    }

    /// As [`Contours::of`], and the depth image it drew.
    pub(super) fn and_depth(solid: &Solid, camera: &Camera) -> (Contours, Vec<f32>) {
        with_scratch(|scratch| {
            let mut depth = Vec::new();
            let range = draw_nearness(solid, camera, &mut scratch.points, &mut depth);
            to_depth(camera, &mut depth);
            let contours = trace(solid, camera, &scratch.points, &depth, range.extent(), &mut scratch.facing);
            (contours, depth)
        })
    }

    /// As [`Contours::of`], with the depth image of the same solid and camera drawn before.
    pub(super) fn with_depth(solid: &Solid, camera: &Camera, depth: &[f32]) -> Contours {
        with_scratch(|scratch| {
            let range = super::project::project(solid, camera, &mut scratch.points);
            trace(solid, camera, &scratch.points, depth, range.extent(), &mut scratch.facing)
        })
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether nothing is in view.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Sum of the lengths, in pixels.
    pub fn total_length(&self) -> f64 {
        self.length.iter().map(|&l| f64::from(l)).sum()
    }
}

fn with_scratch<T>(work: impl FnOnce(&mut Scratch) -> T) -> T {
    SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
        Ok(mut scratch) => work(&mut scratch),
        Err(_) => work(&mut Scratch::default()),
    })
}

fn trace(
    solid: &Solid,
    camera: &Camera,
    points: &[Point],
    depth: &[f32],
    extent: f64,
    facing: &mut Vec<f64>,
) -> Contours {
    let out = Contours { width: camera.width, height: camera.height, ..Contours::default() };
    let Some(depths) = Depths::new(depth, camera.width, camera.height, extent) else { return out };
    let mut tracer = Tracer { lens: Lens::new(camera), depths, extent, out };
    let mut base = 0;
    for instance in solid.instances() {
        let count = instance.mesh.positions.len();
        let Some(points) = points.get(base..base + count) else { break };
        base += count;
        let placement = Placement::new(camera, &instance.affine);
        tracer.instance(instance, &placement, points, facing);
    }
    tracer.out
}

/// Whether a point's image may be used.
fn usable(p: &Point) -> bool {
    p.depth >= Camera::NEAR
}

struct Tracer<'a> {
    lens: Lens,
    depths: Depths<'a>,
    /// Depth range of the object.
    extent: f64,
    out: Contours,
}

impl Tracer<'_> {
    fn instance(&mut self, instance: &Instance, placement: &Placement, points: &[Point], facing: &mut Vec<f64>) {
        let mesh = &*instance.mesh;
        let open = mesh.topology.edges.iter().any(|e| e.faces[1] == u32::MAX);
        facing.clear();
        facing.extend(
            mesh.positions.iter().zip(&mesh.normals).map(|(p, n)| placement.facing(n.as_dvec3(), p.as_dvec3())),
        );
        for face in &mesh.topology.triangles {
            let [Some(a), Some(b), Some(c)] = face.map(|v| facing.get(v as usize)) else { continue };
            let signs = [*a >= 0.0, *b >= 0.0, *c >= 0.0];
            if signs[0] != signs[1] || signs[0] != signs[2] {
                // The corner that differs from the other two.
                let odd = if signs[0] == signs[1] { 2 } else { usize::from(signs[0] == signs[2]) };
                let order = [odd, (odd + 1) % 3, (odd + 2) % 3];
                self.silhouette(mesh, placement, points, order.map(|i| face[i]), order.map(|i| [*a, *b, *c][i]), open);
            }
        }
        for edge in &mesh.topology.edges {
            if edge.crease || edge.faces[1] == u32::MAX {
                self.edge(mesh, placement, points, edge.vertices, edge.faces, open);
            }
        }
    }

    /// The zero set in one face; the first corner's sign differs from the others'.
    fn silhouette(
        &mut self,
        mesh: &Mesh,
        placement: &Placement,
        points: &[Point],
        corners: [u32; 3],
        facing: [f64; 3],
        open: bool,
    ) {
        let own = corners.map(|v| points[v as usize]);
        if own.iter().any(|p| p.depth.is_nan()) || !own.iter().any(usable) {
            return;
        }
        let p = corners.map(|v| mesh.positions[v as usize].as_dvec3());
        let n = corners.map(|v| mesh.normals.get(v as usize).map_or(DVec3::ZERO, |n| n.as_dvec3()));
        let share = |i: usize| facing[0] / (facing[0] - facing[i]);
        let (u, v) = (share(1), share(2));
        let (from, to) = (p[0] + (p[1] - p[0]) * u, p[0] + (p[2] - p[0]) * v);
        let Some((a, b)) = self.segment(placement.point(from), placement.point(to)) else { return };
        let normal = placement.normal(n[0] * 2.0 + (n[1] - n[0]) * u + (n[2] - n[0]) * v);
        let Some([tx, ty, length]) = tangent(&a, &b) else { return };
        // The plane through the eye with this normal cuts the image in a line at right angles to (x, y) of it.
        let size = (normal.x * normal.x + normal.y * normal.y).sqrt();
        let direction = if size > 1e-12 { [normal.x / size, -normal.y / size] } else { [ty, -tx] };
        let slack = if own.iter().all(usable) {
            let steep = if length > 0.02 { (b.nearness - a.nearness) / length } else { 0.0 };
            let ahead = own.iter().map(|p| p.nearness - a.nearness - steep * ((p.x - a.x) * tx + (p.y - a.y) * ty));
            self.in_depth(ahead.fold(0.0, f64::max), &a, SILHOUETTE_SLACK)
        } else {
            0.0
        };
        let look = match open {
            false => Look::Outward { direction, slack },
            true => Look::BothSides { direction, slack: [slack; 2] },
        };
        let flip = ty * direction[0] - tx * direction[1] < 0.0;
        self.cut(&a, &b, if flip { [-tx, -ty] } else { [tx, ty] }, &look);
    }

    /// A crease or boundary edge.
    fn edge(
        &mut self,
        mesh: &Mesh,
        placement: &Placement,
        points: &[Point],
        vertices: [u32; 2],
        faces: [u32; 2],
        open: bool,
    ) {
        let [Some(from), Some(to)] = vertices.map(|v| mesh.positions.get(v as usize)) else { return };
        let ends = vertices.map(|v| points[v as usize]);
        if ends.iter().any(|p| p.depth.is_nan()) || !ends.iter().any(usable) {
            return;
        }
        let camera_ends = [placement.point(from.as_dvec3()), placement.point(to.as_dvec3())];
        let Some((a, b)) = self.segment(camera_ends[0], camera_ends[1]) else { return };
        let Some([tx, ty, length]) = tangent(&a, &b) else { return };
        let direction = [ty, -tx];
        let steep = (b.nearness - a.nearness) / length;
        let mut slack = [0.0f64; 2];
        let (mut any_front, mut side) = (false, 0.0f64);
        for face in faces {
            let Some(face) = mesh.topology.triangles.get(face as usize) else { continue };
            // The corner off the edge; the vertices of a crease are split, so positions are compared.
            let opposite = face.iter().find(|&&v| mesh.positions.get(v as usize).is_some_and(|p| p != from && p != to));
            let Some(&opposite) = opposite else { continue };
            let corners = face.map(|v| placement.point(mesh.positions[v as usize].as_dvec3()));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let towards = if self.lens.pinhole { -normal.dot(corners[0]) } else { normal.z };
            let front = (towards > 0.0) != placement.mirrored;
            any_front |= front;
            let p = points[opposite as usize];
            if !usable(&p) {
                continue;
            }
            let away = (p.x - a.x) * direction[0] + (p.y - a.y) * direction[1];
            if front || open {
                side -= away.signum();
                if away.abs() > 1e-3 {
                    let along = (p.x - a.x) * tx + (p.y - a.y) * ty;
                    let per_pixel = (p.nearness - a.nearness - steep * along) / away.abs();
                    let i = usize::from(away < 0.0);
                    slack[i] = slack[i].max(self.in_depth(2.0 * per_pixel, &a, EDGE_SLACK));
                }
            }
        }
        if any_front || open {
            self.cut(&a, &b, if side < 0.0 { [-tx, -ty] } else { [tx, ty] }, &Look::BothSides { direction, slack });
        }
    }

    /// A difference of nearness at a point as a difference of depth, from 0 to a share of the depth range.
    fn in_depth(&self, nearness: f64, at: &Point, most: f64) -> f64 {
        let depth = if self.lens.pinhole { nearness * at.depth * at.depth } else { nearness };
        depth.max(0.0).min(most * self.extent)
    }

    /// A segment in camera coordinates, cut at the near plane, in the image.
    fn segment(&self, mut from: DVec3, mut to: DVec3) -> Option<(Point, Point)> {
        let near = -Camera::NEAR;
        if from.z > near && to.z > near {
            return None;
        }
        if from.z > near || to.z > near {
            let u = (near - from.z) / (to.z - from.z);
            let mut at = from + (to - from) * u;
            at.z = near;
            *(if from.z > near { &mut from } else { &mut to }) = at;
        }
        Some((self.lens.point(from), self.lens.point(to)))
    }

    /// Clips a segment to the image and keeps its visible pieces.
    fn cut(&mut self, a: &Point, b: &Point, tangent: [f64; 2], look: &Look) {
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let Some((t0, t1)) = clip(a, [dx, dy], f64::from(self.out.width), f64::from(self.out.height)) else { return };
        let length = (dx * dx + dy * dy).sqrt() * (t1 - t0);
        if !(length > 1e-9 && length.is_finite()) {
            return;
        }
        let pieces = (length + 0.5).floor().max(1.0);
        let step = (t1 - t0) / pieces;
        for i in 0..pieces as usize {
            let t = t0 + step * (i as f64 + 0.5);
            let (x, y) = (a.x + dx * t, a.y + dy * t);
            let depth = self.lens.depth(a.nearness + (b.nearness - a.nearness) * t);
            if depth.is_finite() && self.depths.visible(x, y, depth, look) {
                let out = &mut self.out;
                out.x.push(x as f32);
                out.y.push(y as f32);
                out.tx.push(tangent[0] as f32);
                out.ty.push(tangent[1] as f32);
                out.length.push((length / pieces) as f32);
            }
        }
    }
}

/// Unit direction and length in pixels; `None` for a segment too short or too long to have one.
fn tangent(a: &Point, b: &Point) -> Option<[f64; 3]> {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let length = (dx * dx + dy * dy).sqrt();
    (length > 1e-9 && length.is_finite()).then(|| [dx / length, dy / length, length])
}

/// The part of `a + t d`, t in 0..1, inside the image (Liang and Barsky 1984).
fn clip(a: &Point, d: [f64; 2], width: f64, height: f64) -> Option<(f64, f64)> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for (start, delta, limit) in [(a.x, d[0], width), (a.y, d[1], height)] {
        if delta == 0.0 {
            if start < 0.0 || start > limit {
                return None;
            }
            continue;
        }
        let (u, v) = (-start / delta, (limit - start) / delta);
        t0 = t0.max(u.min(v));
        t1 = t1.min(u.max(v));
    }
    (t0 < t1).then_some((t0, t1))
}

#[cfg(test)]
#[path = "contours_tests.rs"]
mod tests;
