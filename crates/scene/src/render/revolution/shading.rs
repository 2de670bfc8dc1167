//! Parts and normals of what lines of sight meet, eight pixels at a time.

use super::lanes::{LANES, Row, mask};
use super::rays::Seen;
use super::sight::{Lines, Sight};
use crate::geom::{Revolution, Ring};
use glam::Vec3;

/// How the normal changes over a span.
#[derive(Clone, Copy, Debug)]
struct Slope {
    /// The share of the span from its first ring on, by radius and height: `at[0] +
    /// at[1] radius + at[2] height`.
    at: [f64; 3],
    /// The normal's components away from and along the axis at the first ring, and their
    /// changes over the span.
    away: [f32; 2],
    along: [f32; 2],
    part: u16,
}

impl Slope {
    const NONE: Slope = Slope { at: [0.0; 3], away: [0.0; 2], along: [0.0; 2], part: u16::MAX };

    fn new([a, b]: [&Ring; 2], part: u16) -> Slope {
        // The share along the longer side is the more accurate one.
        let (dr, dy) = (b.r - a.r, b.y - a.y);
        let at = match dr.abs() > dy.abs() {
            true => [-a.r / dr, 1.0 / dr, 0.0],
            false => [-a.y / dy, 0.0, 1.0 / dy],
        };
        let change = |from: f64, to: f64| [from as f32, (to - from) as f32];
        Slope { at, away: change(a.nr, b.nr), along: change(a.ny, b.ny), part }
    }
}

/// The spans of a surface.
#[derive(Debug, Default)]
pub(super) struct Shading {
    slopes: Vec<Slope>,
    /// The sight's map of normals, scaled to avoid overflow.
    turn: [[f32; 3]; 3],
}

/// Parts and unit normals, as in a frame.
pub(super) struct Shown {
    pub part: [u16; LANES],
    pub normal: [[f32; 3]; LANES],
}

impl Shading {
    /// Replaces all by a surface's spans.
    pub fn set(&mut self, surface: &Revolution, sight: &Sight) {
        self.slopes.clear();
        self.slopes.extend(surface.spans().iter().map(|span| {
            surface.ends(span).map_or(Slope::NONE, |ends| Slope::new(ends, span.part))
        }));
        let columns = sight.cofactor.to_cols_array_2d();
        let most = columns.as_flattened().iter().fold(0.0f64, |most, v| most.max(v.abs()));
        self.turn = columns.map(|column| column.map(|v| (v / most) as f32));
    }

    /// The parts and normals of what is met at pixels of a row; `u16::MAX` and 0 where that
    /// is nothing.
    #[inline(always)]
    pub fn shown<const PINHOLE: bool>(&self, sight: &Sight, at: &[Row; 2], seen: &Seen) -> Shown {
        let (mut share, mut away, mut along) =
            ([[0.0f64; LANES]; 3], [[0.0f32; LANES]; 2], [[0.0f32; LANES]; 2]);
        let mut part = [u16::MAX; LANES];
        for i in 0..LANES {
            let slope = self.slopes.get(seen.span[i] as usize).unwrap_or(&Slope::NONE);
            (share[0][i], share[1][i], share[2][i]) = (slope.at[0], slope.at[1], slope.at[2]);
            (away[0][i], away[1][i]) = (slope.away[0], slope.away[1]);
            (along[0][i], along[1][i]) = (slope.along[0], slope.along[1]);
            part[i] = if seen.depth[i] < f64::INFINITY { slope.part } else { u16::MAX };
        }
        let Lines { origin: [ox, oy, oz], way: [u, v, w] } = sight.lines::<PINHOLE>(at.each_ref());
        let (mut cosine, mut sine, mut t) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        for i in 0..LANES {
            let d = seen.depth[i];
            let (x, y, z) = (ox[i] + d * u[i], oy[i] + d * v[i], oz[i] + d * w[i]);
            let r = (x * x + z * z).sqrt();
            let per = if r > 0.0 { 1.0 / r } else { 0.0 };
            (cosine[i], sine[i]) = ((x * per) as f32, (z * per) as f32);
            t[i] = (share[0][i] + share[1][i] * r + share[2][i] * y) as f32;
        }
        // To the eye, in the camera's coordinates.
        let (mut right, mut up) = ([0.0f32; LANES], [0.0f32; LANES]);
        if PINHOLE {
            for i in 0..LANES {
                let [x, y] = sight.slopes([at[0][i], at[1][i]]);
                (right[i], up[i]) = (-x as f32, -y as f32);
            }
        }
        let [a, b, c] = &self.turn;
        let (mut x, mut y, mut z) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        let mut wrong = 0;
        for i in 0..LANES {
            let radial = away[0][i] + away[1][i] * t[i];
            let q = along[0][i] + along[1][i] * t[i];
            let (p, r) = (radial * cosine[i], radial * sine[i]);
            let nx = a[0] * p + b[0] * q + c[0] * r;
            let ny = a[1] * p + b[1] * q + c[1] * r;
            let nz = a[2] * p + b[2] * q + c[2] * r;
            let square = nx * nx + ny * ny + nz * nz;
            let per = (1.0 / square.sqrt()).copysign(nx * right[i] + ny * up[i] + nz);
            (x[i], y[i], z[i]) = (nx * per, ny * per, nz * per);
            wrong |= mask(!(square > 1e-30)) & mask(seen.depth[i] < f64::INFINITY);
        }
        let mut normal = [[0.0; 3]; LANES];
        for i in 0..LANES {
            let there = seen.depth[i] < f64::INFINITY;
            normal[i][0] = if there { x[i] } else { 0.0 };
            normal[i][1] = if there { y[i] } else { 0.0 };
            normal[i][2] = if there { z[i] } else { 0.0 };
        }
        if wrong != 0 {
            facing(&mut normal, &right, &up);
        }
        Shown { part, normal }
    }
}

/// Where a normal has no direction, it faces the camera.
#[inline(never)]
fn facing(normal: &mut [[f32; 3]; LANES], right: &[f32; LANES], up: &[f32; LANES]) {
    for (i, normal) in normal.iter_mut().enumerate() {
        if !Vec3::from_array(*normal).is_normalized() && *normal != [0.0; 3] {
            *normal = Vec3::new(right[i], up[i], 1.0).normalize().to_array();
        }
    }
}
