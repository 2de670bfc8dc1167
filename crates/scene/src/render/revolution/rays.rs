//! Lines of sight against the surface: whether something lies before a depth.
//!
//! Along a line of sight, the squared distance from the axis is a quadratic function of
//! depth, and the squared radius of a cone at the line's height another; whether their
//! difference has a root in an interval is decided without a square root.

use super::lanes::{LANES, Mask, Row, any, mask};
use super::sight::Rays;
use crate::geom::{Revolution, Ring};
use crate::render::Camera;

/// A span that is not level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// Heights of the lower and the upper end.
    ends: [f64; 2],
    /// The squared radius of a cylinder around it.
    around: f64,
    /// Radius at height 0 of the cone, and its change per height.
    radius: f64,
    slope: f64,
    /// The number of the span.
    span: u64,
}

/// A level span: height and least and greatest squared radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    y: f64,
    square: [f64; 2],
    /// The number of the span.
    span: u64,
}

/// The shape of a span.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Cone(Cone),
    Level(Level),
}

impl Shape {
    /// The span of a number between two rings.
    #[inline(always)]
    pub fn new([a, b]: [&Ring; 2], span: u64) -> Shape {
        if a.y == b.y {
            let (least, most) = (a.r.min(b.r), a.r.max(b.r));
            return Shape::Level(Level { y: a.y, square: [least * least, most * most], span });
        }
        let slope = (b.r - a.r) / (b.y - a.y);
        let radius = a.r - slope * a.y;
        let ends = if a.y < b.y { [a.y, b.y] } else { [b.y, a.y] };
        Shape::Cone(Cone { ends, around: around(a.r.max(b.r)), radius, slope, span })
    }
}

/// The squared radius of a cylinder around circles of at most this radius.
#[inline(always)]
fn around(radius: f64) -> f64 {
    radius * radius * (1.0 + 1e-9)
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
        self.around = around(most);
        for (span, ends) in (0u64..).zip(surface.spans().iter().map(|s| surface.ends(s))) {
            let Some(ends) = ends else { continue };
            match Shape::new(ends, span) {
                Shape::Cone(cone) => self.cones.push(cone),
                Shape::Level(level) => self.levels.push(level),
            }
        }
    }

    /// True if each line of sight meets a span between two depths.
    #[inline(always)]
    pub fn meets(&self, rays: &Rays, [from, to]: [&Row; 2]) -> Mask {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        let Inside { near, far, per, low, high } = self.inside(rays, [from, to]);
        let least = nearest_to_axis(rays, &near, &far);
        let mut met = [0; LANES];
        for level in self.levels.iter().filter(|level| level.y >= low && level.y <= high) {
            for i in 0..LANES {
                let depth = (level.y - at[i]) * per[i];
                let square = c[i] + depth * (2.0 * b[i] + a[i] * depth);
                let between = (depth > near[i]) & (depth < far[i]);
                let on = (square >= level.square[0]) & (square <= level.square[1]);
                met[i] |= mask(between & on);
            }
        }
        let mut open = [0; LANES];
        for i in 0..LANES {
            open[i] = mask(near[i] < far[i]);
        }
        for cone in &self.cones {
            let [from, to] = cone.ends;
            if !cone.between(low, high) | (cone.around < least) {
                continue;
            }
            let mut left = [0; LANES];
            for i in 0..LANES {
                left[i] = open[i] & !met[i];
            }
            if !any(&left) {
                break;
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
                met[i] |= mask((s != t) & (apart | between)) & open[i];
            }
        }
        met
    }
}

/// The least squared distance from the axis of parts of lines of sight.
#[inline(always)]
fn nearest_to_axis(rays: &Rays, near: &Row, far: &Row) -> f64 {
    let [c, b, a] = &rays.square;
    let mut squares = [0.0; LANES];
    for i in 0..LANES {
        let depth = clamp(-b[i] / a[i], near[i], far[i]);
        let square = c[i] + depth * (2.0 * b[i] + a[i] * depth);
        squares[i] = if near[i] < far[i] { square } else { f64::INFINITY };
    }
    squares.iter().fold(f64::INFINITY, |least, square| least.min(*square)) * (1.0 - 1e-9)
}

/// The parts of lines of sight inside of a cylinder around the surface, as depths, the
/// reciprocal of how fast each climbs, and the heights between which all of them lie.
struct Inside {
    near: Row,
    far: Row,
    per: Row,
    low: f64,
    high: f64,
}

impl Spans {
    #[inline(always)]
    fn inside(&self, rays: &Rays, [from, to]: [&Row; 2]) -> Inside {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        let zero = [0.0; LANES];
        let (mut near, mut far, mut per) = (zero, zero, zero);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..LANES {
            let inside = b[i] * b[i] - a[i] * (c[i] - self.around);
            let root = (if inside > 0.0 { inside } else { 0.0 }).sqrt();
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
        Inside { near, far, per, low, high }
    }

    /// The first hit of each line of sight beyond the near plane.
    #[inline(always)]
    pub fn nearest(&self, rays: &Rays) -> FirstHits {
        let Inside { near, far, low, high, .. } =
            self.inside(rays, [&[Camera::NEAR; LANES], &[f64::INFINITY; LANES]]);
        let mut seen = FirstHits::NOTHING;
        for level in self.levels.iter().filter(|level| level.y >= low && level.y <= high) {
            level.first(rays, &mut seen);
        }
        for cone in self.cones.iter().filter(|cone| cone.between(low, high)) {
            cone.first(rays, &mut seen);
        }
        for i in 0..LANES {
            let inside = near[i] <= far[i];
            seen.depth[i] = if inside { seen.depth[i] } else { f64::INFINITY };
            seen.span[i] = if inside { seen.span[i] } else { u64::MAX };
        }
        seen
    }
}

/// The first hits of lines of sight.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstHits {
    /// Infinite where there is nothing.
    pub depth: Row,
    /// The number of the span; that of no span where there is nothing.
    pub span: [u64; LANES],
}

impl FirstHits {
    pub const NOTHING: FirstHits =
        FirstHits { depth: [f64::INFINITY; LANES], span: [u64::MAX; LANES] };

    /// Notes a span where it is beyond the near plane and nearer than what was seen.
    #[inline(always)]
    fn note(&mut self, i: usize, on: bool, depth: f64, span: u64) {
        let first = on & (depth >= Camera::NEAR) & (depth < self.depth[i]);
        self.depth[i] = if first { depth } else { self.depth[i] };
        self.span[i] = if first { span } else { self.span[i] };
    }
}

impl Level {
    /// Notes where lines of sight meet it before what they have met.
    #[inline(always)]
    pub fn first(&self, rays: &Rays, seen: &mut FirstHits) {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        for i in 0..LANES {
            let d = (self.y - at[i]) * (1.0 / climb[i]);
            let square = c[i] + d * (2.0 * b[i] + a[i] * d);
            let on = (square >= self.square[0]) & (square <= self.square[1]);
            seen.note(i, on, d, self.span);
        }
    }
}

impl Cone {
    /// True if a part of it lies between two heights.
    #[inline(always)]
    fn between(&self, low: f64, high: f64) -> bool {
        let [least, most] = self.ends;
        (least <= high) & (most >= low)
    }

    /// Notes where lines of sight meet it before what they have met.
    #[inline(always)]
    pub fn first(&self, rays: &Rays, seen: &mut FirstHits) {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        let (middle, half) =
            (0.5 * (self.ends[0] + self.ends[1]), 0.5 * (self.ends[1] - self.ends[0]).abs());
        // A little more, so that no line passes between two cones.
        let half = half * (1.0 + 1e-9) + 1e-12 * middle.abs();
        let (mut s, mut t) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let (g, k) = (self.radius + self.slope * at[i], self.slope * climb[i]);
            let (c0, b1, a2) = (c[i] - g * g, b[i] - g * k, a[i] - k * k);
            let inside = b1 * b1 - a2 * c0;
            // Without cancellation: Press et al. 2007, section 5.6. Not a number where the
            // line misses the cone.
            let q = -(b1 + inside.sqrt().copysign(b1));
            (s[i], t[i]) = (q / a2, c0 / q);
        }
        for i in 0..LANES {
            let height = at[i] + climb[i] * s[i] - middle;
            seen.note(i, height.abs() <= half, s[i], self.span);
        }
        for i in 0..LANES {
            let height = at[i] + climb[i] * t[i] - middle;
            seen.note(i, height.abs() <= half, t[i], self.span);
        }
    }
}

#[inline(always)]
fn clamp(v: f64, least: f64, most: f64) -> f64 {
    let v = if v > least { v } else { least };
    if v < most { v } else { most }
}
