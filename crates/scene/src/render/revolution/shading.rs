//! Parts and normals of what lines of sight meet, eight pixels at a time.

use super::lanes::{LANES, Row};
use super::rays::Seen;
use super::sight::{Lines, Sight};
use crate::geom::{Revolution, Ring};
use glam::Vec3;
use wide::f32x8;

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

/// Parts and unit normals, as in a frame: `u16::MAX` and 0 where nothing is met.
pub(super) struct Shown {
    pub part: [u16; LANES],
    pub normal: [[f32; LANES]; 3],
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

    /// The parts and normals of what lines of sight meet, which is something for those
    /// `there`.
    #[inline(always)]
    pub fn shown<const PINHOLE: bool>(
        &self,
        sight: &Sight,
        Lines { origin: [ox, oy, oz], way: [u, v, w] }: &Lines,
        at: &[Row; 2],
        seen: &Seen,
        there: u32,
    ) -> Shown {
        let (mut share, mut away, mut along) =
            ([[0.0f64; LANES]; 3], [[0.0f32; LANES]; 2], [[0.0f32; LANES]; 2]);
        let mut part = [u16::MAX; LANES];
        for i in 0..LANES {
            let slope = self.slopes.get(seen.span[i] as usize).unwrap_or(&Slope::NONE);
            (share[0][i], share[1][i], share[2][i]) = (slope.at[0], slope.at[1], slope.at[2]);
            (away[0][i], away[1][i]) = (slope.away[0], slope.away[1]);
            (along[0][i], along[1][i]) = (slope.along[0], slope.along[1]);
            part[i] = slope.part;
        }
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
        let normal = self.normals([away, along], [cosine, sine, t], [right, up], there);
        Shown { part, normal }
    }

    /// Unit normals in the camera's coordinates, towards the eye; 0 where nothing is met.
    #[inline(always)]
    fn normals(
        &self,
        [away, along]: [[[f32; LANES]; 2]; 2],
        [cosine, sine, t]: [[f32; LANES]; 3],
        to_eye: [[f32; LANES]; 2],
        there: u32,
    ) -> [[f32; LANES]; 3] {
        let (row, all) = (f32x8::from, f32x8::splat);
        let [a, b, c] = self.turn;
        let t = row(t);
        let radial = row(away[0]) + row(away[1]) * t;
        let q = row(along[0]) + row(along[1]) * t;
        let (p, r) = (radial * row(cosine), radial * row(sine));
        let x = p * all(a[0]) + q * all(b[0]) + r * all(c[0]);
        let y = p * all(a[1]) + q * all(b[1]) + r * all(c[1]);
        let z = p * all(a[2]) + q * all(b[2]) + r * all(c[2]);
        let square = x * x + y * y + z * z;
        let facing = x * row(to_eye[0]) + y * row(to_eye[1]) + z;
        let some = square.simd_gt(all(TINY));
        let per = (all(1.0) / square.sqrt()) ^ (facing & all(-0.0));
        let mut normal =
            [(x * per & some).to_array(), (y * per & some).to_array(), (z * per & some).to_array()];
        let odd = there & !some.to_bitmask();
        if odd != 0 {
            face(&mut normal, odd, &to_eye);
        }
        normal
    }
}

/// Squared lengths below this count as 0.
const TINY: f32 = 1e-30;

/// Turns some normals to the eye, as they have no direction.
#[inline(never)]
fn face(normal: &mut [[f32; LANES]; 3], which: u32, [right, up]: &[[f32; LANES]; 2]) {
    for i in (0..LANES).filter(|i| which >> i & 1 != 0) {
        let n = Vec3::new(right[i], up[i], 1.0).normalize();
        [normal[0][i], normal[1][i], normal[2][i]] = n.to_array();
    }
}
