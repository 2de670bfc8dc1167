//! Lines of sight against the surface: whether something lies before a depth.
//!
//! Along a line of sight, the squared distance from the axis is a quadratic function of
//! depth, and the squared radius of a cone at the line's height another; whether their
//! difference has a root in an interval is decided without a square root.

use super::sight::Rays;
use crate::geom::Revolution;

/// Lines of sight tested at a time.
pub(super) const LANES: usize = 8;

/// A number for each line.
pub(super) type Row = [f64; LANES];

/// A span that is not level.
#[derive(Clone, Copy, Debug)]
struct Cone {
    /// Heights of the two ends.
    ends: [f64; 2],
    /// Radius at height 0 of the cone, and its change per height.
    radius: f64,
    slope: f64,
}

/// A level span: height and least and greatest squared radius.
#[derive(Clone, Copy, Debug)]
struct Level {
    y: f64,
    square: [f64; 2],
}

/// The spans of a surface.
#[derive(Debug, Default)]
pub(super) struct Spans {
    cones: Vec<Cone>,
    levels: Vec<Level>,
    /// The squared radius of a cylinder around the surface.
    around: f64,
}

impl Spans {
    /// Replaces the spans by those of a surface.
    #[inline(always)]
    pub fn set(&mut self, surface: &Revolution) {
        self.cones.clear();
        self.levels.clear();
        let most =
            surface.rings().iter().fold(0.0f64, |m, ring| if ring.r > m { ring.r } else { m });
        self.around = most * most * (1.0 + 1e-9);
        for span in surface.spans() {
            let Some([a, b]) = surface.ends(span) else { continue };
            if a.y == b.y {
                let (least, most) = (a.r.min(b.r), a.r.max(b.r));
                self.levels.push(Level { y: a.y, square: [least * least, most * most] });
            } else {
                let slope = (b.r - a.r) / (b.y - a.y);
                self.cones.push(Cone { ends: [a.y, b.y], radius: a.r - slope * a.y, slope });
            }
        }
    }

    /// Whether each line of sight meets a span between two depths.
    #[inline(always)]
    pub fn meets(&self, rays: &Rays, [from, to]: [&Row; 2]) -> [bool; LANES] {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        let (mut near, mut far, mut per) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..LANES {
            // Where the line is inside of the cylinder.
            let root = (b[i] * b[i] - a[i] * (c[i] - self.around)).max(0.0).sqrt();
            let way = 1.0 / a[i];
            let (enters, leaves) = ((-b[i] - root) * way, (root - b[i]) * way);
            near[i] = if enters > from[i] { enters } else { from[i] };
            far[i] = if leaves < to[i] { leaves } else { to[i] };
            per[i] = 1.0 / climb[i];
        }
        for i in 0..LANES {
            let (u, v) = (at[i] + climb[i] * near[i], at[i] + climb[i] * far[i]);
            let some = near[i] < far[i];
            let (least, most) = if u < v { (u, v) } else { (v, u) };
            low = if some & (least < low) { least } else { low };
            high = if some & (most > high) { most } else { high };
        }
        // All bits set where the line meets something.
        let mut met = [0u64; LANES];
        for level in self.levels.iter().filter(|level| level.y >= low && level.y <= high) {
            for i in 0..LANES {
                let depth = (level.y - at[i]) * per[i];
                let square = c[i] + depth * (2.0 * b[i] + a[i] * depth);
                let between = (depth > near[i]) & (depth < far[i]);
                let on = (square >= level.square[0]) & (square <= level.square[1]);
                met[i] |= if between & on { u64::MAX } else { 0 };
            }
        }
        for cone in &self.cones {
            let [from, to] = cone.ends;
            if !((from <= high || to <= high) && (from >= low || to >= low)) {
                continue;
            }
            for i in 0..LANES {
                let s = clamp((from - at[i]) * per[i], near[i], far[i]);
                let t = clamp((to - at[i]) * per[i], near[i], far[i]);
                let (g, k) = (cone.radius + cone.slope * at[i], cone.slope * climb[i]);
                // The difference of the squares is c0 + 2 b1 depth + a2 depth^2.
                let (c0, b1, a2) = (c[i] - g * g, b[i] - g * k, a[i] - k * k);
                let (u, v) = (b1 + a2 * s, b1 + a2 * t);
                let (e, f) = (c0 + s * (b1 + u), c0 + t * (b1 + v));
                // A change of sign, or an extremum in between on the other side of 0.
                let apart = e * f < 0.0;
                let between = (u * v < 0.0) & (e * a2 > 0.0) & (c0 * a2 < b1 * b1);
                let some = (near[i] < far[i]) & (s != t);
                met[i] |= if some & (apart | between) { u64::MAX } else { 0 };
            }
        }
        met.map(|met| met != 0)
    }
}

#[inline(always)]
fn clamp(v: f64, least: f64, most: f64) -> f64 {
    let v = if v > least { v } else { least };
    if v < most { v } else { most }
}
