//! A camera in the coordinates of a surface of revolution, and the surface in the camera's.
//!
//! The surface is turned about its axis so that the camera (for a parallel projection, the
//! direction to it) has z = 0 and x > 0. Invariant: the placement is invertible and all
//! numbers are finite.

use super::lanes::{LANES, Row};
use crate::geom::{Affine, Revolution, Ring};
use crate::render::Camera;
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{DepthRange, Lens};
use glam::{DMat3, DVec3};

/// Lines of sight, by depth: `origin + depth * way` in the surface's turned coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lines {
    pub origin: [Row; 3],
    pub way: [Row; 3],
}

/// Lines of sight as they meet a surface of revolution.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rays {
    /// Squared distance from the axis: `square[0] + 2 square[1] depth + square[2] depth^2`.
    pub square: [Row; 3],
    /// Height: `height[0] + height[1] depth`.
    pub height: [Row; 2],
}

impl Rays {
    #[inline(always)]
    pub fn of(Lines { origin: [x, y, z], way: [u, v, w] }: &Lines) -> Rays {
        let mut rays = Rays::default();
        for i in 0..LANES {
            rays.square[0][i] = x[i] * x[i] + z[i] * z[i];
            rays.square[1][i] = x[i] * u[i] + z[i] * w[i];
            rays.square[2][i] = u[i] * u[i] + w[i] * w[i];
            // Never quite level, so that it meets each height once.
            let least = 1e-9 * rays.square[2][i].sqrt();
            rays.height[0][i] = y[i];
            rays.height[1][i] = if v[i].abs() < least { least } else { v[i] };
        }
        rays
    }
}

/// A camera and a placed surface of revolution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub lens: Lens,
    /// From turned coordinates to the camera's.
    pub m: DMat3,
    pub t: DVec3,
    /// The inverse of `m`, and that of `t`.
    inverse: DMat3,
    back: [f64; 3],
    /// Maps outward normals to outward normals.
    pub cofactor: DMat3,
    /// `facing = normal . (view - bend * point)`; the third component of `view` is 0.
    pub view: [f64; 2],
    pub bend: f64,
    /// The reciprocal of the lens's scale.
    per_pixel: f64,
    /// How far one unit across the axis shows at most, divided by the lens's scale: at
    /// depth 1, for a pinhole.
    across: f64,
    /// How much depth changes at most along one unit across the axis.
    turn: f64,
}

/// The camera's distance from the axis is at least this fraction of its distance from the
/// middle, so that silhouettes seen from the axis itself have a beginning and an end.
const ASIDE: f64 = 1e-9;

impl Sight {
    /// `None` if the placement is not invertible or not finite.
    pub fn new(camera: &Camera, affine: &Affine) -> Option<Sight> {
        let turn = DMat3::from_cols(camera.right, camera.up, -camera.forward).transpose();
        let m = turn * affine.0.matrix3;
        let t = turn * (affine.0.translation - camera.eye);
        let lens = Lens::new(camera);
        let inverse = finite_inverse(m)?;
        let view = if lens.pinhole { inverse * -t } else { inverse * DVec3::Z };
        let rho = libm::hypot(view.x, view.z);
        let least = ASIDE * view.y.abs();
        let (c, s) = if rho > least { (view.x / rho, view.z / rho) } else { (1.0, 0.0) };
        let turned = DMat3::from_cols(DVec3::new(c, 0.0, s), DVec3::Y, DVec3::new(-s, 0.0, c));
        let m = m * turned;
        let inverse = turned.transpose() * inverse;
        let [a, b, d] = [m.x_axis, m.y_axis, m.z_axis];
        let sign = if a.dot(b.cross(d)) < 0.0 { -1.0 } else { 1.0 };
        let cofactor = DMat3::from_cols(b.cross(d) * sign, d.cross(a) * sign, a.cross(b) * sign);
        let [p, q] = [a.truncate(), d.truncate()];
        let (half, off) = (0.5 * (p.dot(p) - q.dot(q)), p.dot(q));
        let across = (0.5 * (p.dot(p) + q.dot(q)) + (half * half + off * off).sqrt()).sqrt();
        let finite = m.is_finite() && t.is_finite() && cofactor.is_finite() && view.is_finite();
        finite.then_some(Sight {
            lens,
            m,
            t,
            inverse,
            back: (inverse * t).to_array(),
            cofactor,
            view: [rho.max(least).max(f64::MIN_POSITIVE), view.y],
            bend: if lens.pinhole { 1.0 } else { 0.0 },
            across,
            turn: libm::hypot(m.x_axis.z, m.z_axis.z),
            per_pixel: 1.0 / lens.scale,
        })
    }

    /// A point in camera coordinates.
    #[inline(always)]
    pub fn camera(&self, p: DVec3) -> DVec3 {
        self.m * p + self.t
    }

    /// A point in the image.
    #[inline(always)]
    pub fn image(&self, p: DVec3) -> Point {
        self.lens.point(self.camera(p))
    }

    /// Camera coordinates of a direction per depth, in the image: `x / depth` and
    /// `y / depth`, or `x` and `y` for a parallel projection.
    #[inline(always)]
    pub fn slopes(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.lens.cx) * self.per_pixel, (self.lens.cy - y) * self.per_pixel]
    }

    /// The lines of sight through positions in the image; the lens must be that of
    /// `PINHOLE`.
    #[inline(always)]
    pub fn lines<const PINHOLE: bool>(&self, [x, y]: [&Row; 2]) -> Lines {
        let mut lines = Lines::default();
        let [p, q, r] = self.inverse.to_cols_array_2d();
        let Lines { origin, way } = &mut lines;
        *(if PINHOLE { &mut *origin } else { &mut *way }) = self.shared::<PINHOLE>();
        for i in 0..LANES {
            let [a, b] = self.slopes([x[i], y[i]]);
            let x = p[0] * a + q[0] * b;
            let y = p[1] * a + q[1] * b;
            let z = p[2] * a + q[2] * b;
            if PINHOLE {
                (way[0][i], way[1][i], way[2][i]) = (x - r[0], y - r[1], z - r[2]);
            } else {
                let back = &self.back;
                (origin[0][i], origin[1][i], origin[2][i]) =
                    (x - back[0], y - back[1], z - back[2]);
            }
        }
        lines
    }

    /// The part that all lines of sight share: the origin from a pinhole, or else the way.
    #[inline(always)]
    pub fn shared<const PINHOLE: bool>(&self) -> [Row; 3] {
        let [x, y, z] = match PINHOLE {
            true => [self.view[0], self.view[1], 0.0],
            false => (-self.inverse.z_axis).to_array(),
        };
        [[x; LANES], [y; LANES], [z; LANES]]
    }

    /// The lines of sight through positions in the image, as they meet the surface.
    #[inline(always)]
    pub fn rays(&self, at: [&Row; 2]) -> Rays {
        match self.lens.pinhole {
            true => Rays::of(&self.lines::<true>(at)),
            false => Rays::of(&self.lines::<false>(at)),
        }
    }

    /// The columns and rows, from the first to one past the last, outside of which a
    /// surface does not show.
    pub fn window(&self, surface: &Revolution, camera: &Camera) -> [[usize; 2]; 2] {
        let sides = [camera.width, camera.height].map(|n| n as usize);
        let rings = surface.rings();
        let most = rings.iter().fold(0.0f64, |most, ring| most.max(ring.r));
        let ends = rings.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], ring| {
            [a.min(ring.y), b.max(ring.y)]
        });
        let mut reach = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for corner in 0..8u32 {
            let sign = |bit: u32| if corner & bit == 0 { -most } else { most };
            let y = if corner & 4 == 0 { ends[0] } else { ends[1] };
            let at = self.camera(DVec3::new(sign(1), y, sign(2)));
            // Also if it is not a number.
            if !at.z.is_finite() || -at.z <= Camera::NEAR {
                return sides.map(|side| [0, side]);
            }
            let p = self.lens.point(at);
            for (reach, v) in reach.iter_mut().zip([p.x, p.y]) {
                *reach = [reach[0].min(v), reach[1].max(v)];
            }
        }
        let mut out = sides.map(|side| [0, side]);
        for (out, reach) in out.iter_mut().zip(reach) {
            // Numbers that do not fit are clamped, and NaN is 0.
            let [from, to] = [reach[0].floor() as usize, reach[1].ceil().max(0.0) as usize + 1];
            *out = [from.min(out[1]), to.min(out[1])];
        }
        out
    }

    /// The depths between which a ring lies.
    pub fn depths(&self, ring: &Ring) -> DepthRange {
        let (middle, reach) = (-(self.t.z + self.m.y_axis.z * ring.y), ring.r * self.turn);
        DepthRange { near: middle - reach, far: middle + reach }
    }

    /// The depths between which a surface lies.
    pub fn range(&self, surface: &Revolution) -> DepthRange {
        let all = surface.rings().iter().map(|ring| self.depths(ring));
        all.fold(DepthRange::EMPTY, |a, b| a.and(&b))
    }

    /// A bound on the radius of a ring in the image, in pixels.
    pub fn radius(&self, ring: &Ring) -> f64 {
        if !self.lens.pinhole {
            return ring.r * self.across * self.lens.scale;
        }
        let near = self.depths(ring).near.max(Camera::NEAR);
        // Away from the camera's axis, motion along it also shows.
        let middle = self.t + self.m.y_axis * ring.y;
        let slant = libm::hypot(middle.x, middle.y) / near;
        ring.r * (self.across + slant * self.turn) * self.lens.scale / near
    }
}

/// The inverse of a matrix, if it exists and is finite.
fn finite_inverse(m: DMat3) -> Option<DMat3> {
    let d = m.determinant();
    (d != 0.0 && d.is_finite()).then(|| m.inverse()).filter(DMat3::is_finite)
}
