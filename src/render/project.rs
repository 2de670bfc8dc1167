//! Vertices in camera and image coordinates, the common ground of the rasteriser and the contours.
//!
//! Camera coordinates: x right, y up, z towards the camera, eye at the origin. `nearness` is 1 / depth for a pinhole
//! and -depth for a parallel projection: linear over the image inside a triangle, larger is nearer in both.

use super::triangle::place;
use super::{Camera, Projection};
use crate::geom::{Affine, Mesh, Solid};
use glam::{DMat3, DVec3};

/// Coordinates beyond this (scene units) mark a vertex as unusable.
const HUGE: f64 = 1e9;

/// A vertex in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the top edge.
    pub y: f64,
    /// See the module's head.
    pub nearness: f64,
    /// Scene units along the viewing axis; NaN when the vertex cannot be used.
    pub depth: f64,
    /// Position for the rasteriser: see [`place`].
    pub place: [i32; 2],
}

impl Point {
    #[inline(always)]
    pub fn new(x: f64, y: f64, nearness: f64, depth: f64) -> Point {
        Point { x, y, nearness, depth, place: [place(x), place(y)] }
    }
}

/// The image side of a camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    pub pinhole: bool,
    /// Focal length in pixels, or pixels per unit.
    pub scale: f64,
    pub cx: f64,
    pub cy: f64,
}

impl Lens {
    pub fn new(camera: &Camera) -> Lens {
        match camera.projection {
            Projection::Pinhole { focal_px, cx, cy } => Lens { pinhole: true, scale: focal_px, cx, cy },
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                Lens { pinhole: false, scale: 1.0 / units_per_pixel, cx, cy }
            }
        }
    }

    /// The image of a point in camera coordinates, in front of the near plane.
    #[inline]
    pub fn point(&self, p: DVec3) -> Point {
        let depth = -p.z;
        if self.pinhole {
            let nearness = 1.0 / depth;
            let k = self.scale * nearness;
            Point::new(self.cx + k * p.x, self.cy - k * p.y, nearness, depth)
        } else {
            Point::new(self.cx + self.scale * p.x, self.cy - self.scale * p.y, -depth, depth)
        }
    }

    /// Depth from nearness.
    #[inline]
    pub fn depth(&self, nearness: f64) -> f64 {
        if self.pinhole { 1.0 / nearness } else { -nearness }
    }
}

/// An instance's way into camera coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    m: DMat3,
    t: DVec3,
    /// Cofactors of `m` times the sign of its determinant: takes outward normals to outward normals.
    cofactor: DMat3,
    /// Whether the instance is mirrored, so that its faces turn the other way round.
    pub mirrored: bool,
    /// `facing = n . (view - bend * p)` in the mesh's own coordinates.
    view: DVec3,
    bend: f64,
}

impl Placement {
    pub fn new(camera: &Camera, affine: &Affine) -> Placement {
        let rotation = DMat3::from_cols(camera.right, camera.up, -camera.forward).transpose();
        let m = rotation * affine.0.matrix3;
        let t = rotation * (affine.0.translation - camera.eye);
        let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
        let determinant = a.dot(b.cross(c));
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let cofactor = DMat3::from_cols(b.cross(c) * sign, c.cross(a) * sign, a.cross(b) * sign);
        let pinhole = matches!(camera.projection, Projection::Pinhole { .. });
        let (view, bend) = if pinhole {
            (cofactor.transpose() * -t, determinant * sign)
        } else {
            (cofactor.transpose() * DVec3::Z, 0.0)
        };
        Placement { m, t, cofactor, mirrored: sign < 0.0, view, bend }
    }

    /// A mesh point in camera coordinates.
    #[inline]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.m * p + self.t
    }

    /// A mesh normal in camera coordinates, outward, not of unit length.
    #[inline]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.cofactor * n
    }

    /// Positive where the outward normal `n` at `p` (mesh coordinates) faces the camera, zero at right angles to the
    /// line of sight; linear in `p`.
    #[inline]
    pub fn facing(&self, n: DVec3, p: DVec3) -> f64 {
        n.dot(self.view - p * self.bend)
    }
}

/// Nearest and farthest depth of the usable vertices in front of the near plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthRange {
    pub near: f64,
    pub far: f64,
}

impl Default for DepthRange {
    fn default() -> DepthRange {
        DepthRange::EMPTY
    }
}

impl DepthRange {
    /// Of no vertices.
    pub const EMPTY: DepthRange = DepthRange { near: f64::INFINITY, far: f64::NEG_INFINITY };

    /// The extent, 0 when nothing is in front of the camera.
    pub fn extent(&self) -> f64 {
        (self.far - self.near).max(0.0)
    }

    /// Of these vertices and others.
    pub fn and(&self, other: &DepthRange) -> DepthRange {
        DepthRange { near: self.near.min(other.near), far: self.far.max(other.far) }
    }
}

/// Projects every vertex of a solid, instance after instance, into `out` (cleared first).
pub(super) fn project(solid: &Solid, camera: &Camera, out: &mut Vec<Point>) -> DepthRange {
    out.clear();
    solid.instances().iter().fold(DepthRange::EMPTY, |range, instance| {
        let placement = Placement::new(camera, &instance.affine);
        range.and(&project_mesh(&instance.mesh, &placement, &Lens::new(camera), out))
    })
}

/// Projects the vertices of one mesh to the end of `out`.
pub(super) fn project_mesh(mesh: &Mesh, placement: &Placement, lens: &Lens, out: &mut Vec<Point>) -> DepthRange {
    let mut range = DepthRange::EMPTY;
    out.extend(mesh.positions.iter().map(|p| {
        let p = placement.point(p.as_dvec3());
        // Written so that NaN fails it.
        if !(p.x.abs() < HUGE && p.y.abs() < HUGE && p.z.abs() < HUGE) {
            return Point::new(0.0, 0.0, 0.0, f64::NAN);
        }
        if -p.z < Camera::NEAR {
            return Point::new(0.0, 0.0, 0.0, -p.z);
        }
        range.near = range.near.min(-p.z);
        range.far = range.far.max(-p.z);
        lens.point(p)
    }));
    range
}
