//! Parts and normals of what lines of sight meet, eight pixels at a time.

use super::lanes::{LANES, Row};
use super::rays::FirstHits;
use super::sight::{Lines, Sight};
use crate::geom::{Revolution, Ring};
use glam::DVec3;
use wide::f32x4;

/// How the normal changes over a span.
#[derive(Clone, Copy, Debug)]
struct Slope {
    /// The share of the span from its first ring on is `share[0] + share[1] radius + share[2]
    /// height`. Then the normal's component away from the axis at the first ring.
    share: [f32; 4],
    /// The change of that over the span, the component along the axis, and its change.
    rest: [f32; 4],
    part: u16,
}

impl Slope {
    const NONE: Slope = Slope { share: [0.0; 4], rest: [0.0; 4], part: u16::MAX };

    fn new([a, b]: [&Ring; 2], part: u16) -> Slope {
        // The share along the longer side is the more accurate one.
        let (dr, dy) = (b.r - a.r, b.y - a.y);
        let [t, by_r, by_y] = match dr.abs() > dy.abs() {
            true => [-a.r / dr, 1.0 / dr, 0.0],
            false => [-a.y / dy, 0.0, 1.0 / dy],
        };
        let share = [t, by_r, by_y, a.nr].map(|v| v as f32);
        Slope { share, rest: [b.nr - a.nr, a.ny, b.ny - a.ny, 0.0].map(|v| v as f32), part }
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
    pub normal: [[f32; 3]; LANES],
}

impl Shown {
    pub const NOTHING: Shown = Shown { part: [u16::MAX; LANES], normal: [[0.0; 3]; LANES] };
}

/// Points on the surface: cosine and sine of the angle around the axis, radius and height;
/// and the way of the line of sight.
#[derive(Clone, Copy, Default)]
struct Points {
    cosine: [f32; LANES],
    sine: [f32; LANES],
    radius: [f32; LANES],
    height: [f32; LANES],
    way: [[f32; LANES]; 3],
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

    /// Replaces all by the parts and normals of what lines of sight meet, which is something
    /// for those `there`.
    #[inline(always)]
    pub fn show(
        &self,
        sight: &Sight,
        Lines { origin: [ox, oy, oz], way: [u, v, w] }: &Lines,
        seen: &FirstHits,
        there: u32,
        shown: &mut Shown,
    ) {
        let mut points = Points::default();
        for i in 0..LANES {
            let d = seen.depth[i];
            let (x, y, z) = (ox[i] + d * u[i], oy[i] + d * v[i], oz[i] + d * w[i]);
            let r = (x * x + z * z).sqrt();
            let per = if r > 0.0 { 1.0 / r } else { 0.0 };
            (points.cosine[i], points.sine[i]) = ((x * per) as f32, (z * per) as f32);
            (points.radius[i], points.height[i]) = (r as f32, y as f32);
        }
        for i in 0..LANES {
            points.way[0][i] = u[i] as f32;
            points.way[1][i] = v[i] as f32;
            points.way[2][i] = w[i] as f32;
        }
        let mut slopes = [&Slope::NONE; LANES];
        for i in 0..LANES {
            slopes[i] = self.slopes.get(seen.span[i] as usize).unwrap_or(&Slope::NONE);
            shown.part[i] = slopes[i].part;
        }
        let [a, b, c, d, e, f, g, h] = slopes;
        let first = self.normals([a, b, c, d], &points, 0, &mut shown.normal);
        let last = self.normals([e, f, g, h], &points, 4, &mut shown.normal);
        let odd = there & !(first | last << 4);
        if odd != 0 {
            face(&mut shown.normal, odd, sight, [u, v, w]);
        }
    }

    /// Sets the unit normals of four points in the camera's coordinates, towards the camera, and
    /// returns which of them are known; the others are 0.
    #[inline(always)]
    fn normals(
        &self,
        [a, b, c, d]: [&Slope; 4],
        points: &Points,
        first: usize,
        normal: &mut [[f32; 3]; LANES],
    ) -> u32 {
        let row = |list: &[f32; LANES]| {
            f32x4::new([list[first], list[first + 1], list[first + 2], list[first + 3]])
        };
        let rows = |rows: [&[f32; 4]; 4]| f32x4::transpose(rows.map(|row| f32x4::new(*row)));
        let all = f32x4::splat;
        let [t, by_r, by_y, away] = rows([&a.share, &b.share, &c.share, &d.share]);
        let [change, along, rise, _] = rows([&a.rest, &b.rest, &c.rest, &d.rest]);
        let t = t + by_r * row(&points.radius) + by_y * row(&points.height);
        let (radial, q) = (away + change * t, along + rise * t);
        let (p, r) = (radial * row(&points.cosine), radial * row(&points.sine));
        let [a, b, c] = &self.turn;
        let x = p * all(a[0]) + q * all(b[0]) + r * all(c[0]);
        let y = p * all(a[1]) + q * all(b[1]) + r * all(c[1]);
        let z = p * all(a[2]) + q * all(b[2]) + r * all(c[2]);
        let square = x * x + y * y + z * z;
        let [u, v, w] = [row(&points.way[0]), row(&points.way[1]), row(&points.way[2])];
        let away = p * u + q * v + r * w;
        let some = square.simd_gt(all(TINY));
        let per = (all(-1.0) / square.sqrt()) ^ (away & all(-0.0));
        let unit = [(x * per) & some, (y * per) & some, (z * per) & some, all(0.0)];
        for (place, n) in normal[first..].iter_mut().zip(f32x4::transpose(unit)) {
            let [x, y, z, _] = n.to_array();
            *place = [x, y, z];
        }
        some.to_bitmask()
    }
}

/// Squared lengths below this count as 0.
const TINY: f32 = 1e-30;

/// Turns some normals to the camera, as they have no direction.
#[inline(never)]
fn face(normal: &mut [[f32; 3]; LANES], which: u32, sight: &Sight, [u, v, w]: [&Row; 3]) {
    for (i, normal) in normal.iter_mut().enumerate().filter(|(i, _)| which >> i & 1 != 0) {
        let to_eye = sight.m * -DVec3::new(u[i], v[i], w[i]);
        *normal = to_eye.normalize_or(DVec3::Z).as_vec3().to_array();
    }
}
