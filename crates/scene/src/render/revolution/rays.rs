//! Lines of sight against the surface: whether something lies before a depth.
//!
//! Along a line of sight, the squared distance from the axis is a quadratic function of
//! depth, and the squared radius of a cone at the line's height another; whether their
//! difference has a root in an interval is decided without a square root.

use super::lanes::{LANES, Mask, Row, mask};
use super::sight::Rays;
use crate::geom::Revolution;

/// A span that is not level.
#[derive(Clone, Copy, Debug)]
struct Cone {
    /// Heights of the lower and the upper end.
    ends: [f64; 2],
    /// Radius at height 0 of the cone, and its change per height.
    radius: f64,
    slope: f64,
    /// The number of the span.
    span: u64,
}

/// A level span: height and least and greatest squared radius.
#[derive(Clone, Copy, Debug)]
struct Level {
    y: f64,
    square: [f64; 2],
    /// The number of the span.
    span: u64,
}

/// The spans of a surface.
#[derive(Debug, Default)]
pub(super) struct Spans {
    /// By the height of their lower end.
    cones: Vec<Cone>,
    /// The same by the height of their upper end, from the top.
    downwards: Vec<Cone>,
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
        for (span, ends) in (0u64..).zip(surface.spans().iter().map(|s| surface.ends(s))) {
            let Some([a, b]) = ends else { continue };
            if a.y == b.y {
                let (least, most) = (a.r.min(b.r), a.r.max(b.r));
                let square = [least * least, most * most];
                self.levels.push(Level { y: a.y, square, span });
            } else {
                let slope = (b.r - a.r) / (b.y - a.y);
                let radius = a.r - slope * a.y;
                let ends = if a.y < b.y { [a.y, b.y] } else { [b.y, a.y] };
                self.cones.push(Cone { ends, radius, slope, span });
            }
        }
        self.downwards.clone_from(&self.cones);
        let by = |end: usize| {
            move |a: &Cone, b: &Cone| a.ends[end].total_cmp(&b.ends[end]).then(a.span.cmp(&b.span))
        };
        self.cones.sort_unstable_by(by(0));
        self.downwards.sort_unstable_by(|a, b| by(1)(b, a));
    }

    /// Whether each line of sight meets a span between two depths.
    #[inline(always)]
    pub fn meets(&self, rays: &Rays, [from, to]: [&Row; 2]) -> Mask {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        let Inside { near, far, per, low, high } = self.inside(rays, [from, to]);
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
        for cone in &self.cones {
            let [from, to] = cone.ends;
            if !cone.between(low, high) {
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
                met[i] |= mask(some & (apart | between));
            }
        }
        met
    }
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

impl Cone {
    /// Whether a part of it lies between two heights.
    #[inline(always)]
    fn between(&self, low: f64, high: f64) -> bool {
        let [least, most] = self.ends;
        (least <= high) & (most >= low)
    }
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

    /// What each line of sight meets first beyond a depth.
    #[inline(always)]
    pub fn nearest(&self, rays: &Rays, from: f64) -> Seen {
        let Rays { square: [c, b, a], height: [at, climb] } = rays;
        let Inside { near, far, per, low, high } =
            self.inside(rays, [&[from; LANES], &[f64::INFINITY; LANES]]);
        let (mut depth, mut span) = ([f64::INFINITY; LANES], [0; LANES]);
        for level in self.levels.iter().filter(|level| level.y >= low && level.y <= high) {
            for i in 0..LANES {
                let d = (level.y - at[i]) * per[i];
                let square = c[i] + d * (2.0 * b[i] + a[i] * d);
                let on = (square >= level.square[0]) & (square <= level.square[1]);
                let first = on & (d >= near[i]) & (d <= far[i]) & (d < depth[i]);
                depth[i] = if first { d } else { depth[i] };
                span[i] = if first { level.span } else { span[i] };
            }
        }
        // In the order in which lines that climb reach them, or those that descend; lines that
        // differ need all.
        let (up, down) =
            climb.iter().fold((true, true), |(up, down), c| (up & (*c > 0.0), down & (*c < 0.0)));
        let (cones, entry) = if down { (&self.downwards, 1) } else { (&self.cones, 0) };
        for cone in cones.iter().filter(|cone| cone.between(low, high)) {
            if up | down {
                let mut open = false;
                for i in 0..LANES {
                    let reached = (cone.ends[entry] - at[i]) * per[i];
                    open |= (near[i] <= far[i]) & (depth[i] > reached);
                }
                if !open {
                    break;
                }
            }
            let (middle, half) =
                (0.5 * (cone.ends[0] + cone.ends[1]), 0.5 * (cone.ends[1] - cone.ends[0]).abs());
            // A little more, so that no line passes between two cones.
            let half = half * (1.0 + 1e-9) + 1e-12 * middle.abs();
            for i in 0..LANES {
                let (g, k) = (cone.radius + cone.slope * at[i], cone.slope * climb[i]);
                let (c0, b1, a2) = (c[i] - g * g, b[i] - g * k, a[i] - k * k);
                let inside = b1 * b1 - a2 * c0;
                let root = (if inside > 0.0 { inside } else { 0.0 }).sqrt();
                // Without cancellation: Press et al. 2007, section 5.6.
                let q = -(b1 + if b1 < 0.0 { -root } else { root });
                let (s, t) = (q / a2, c0 / q);
                for d in [s, t] {
                    let height = at[i] + climb[i] * d - middle;
                    let on = (inside >= 0.0) & (height >= -half) & (height <= half);
                    let first = on & (d >= from) & (d < depth[i]);
                    depth[i] = if first { d } else { depth[i] };
                    span[i] = if first { cone.span } else { span[i] };
                }
            }
        }
        for i in 0..LANES {
            depth[i] = if near[i] <= far[i] { depth[i] } else { f64::INFINITY };
        }
        Seen { depth, span }
    }
}

/// What lines of sight meet first.
pub(super) struct Seen {
    /// Infinite where there is nothing.
    pub depth: Row,
    /// The number of the span.
    pub span: [u64; LANES],
}

#[inline(always)]
fn clamp(v: f64, least: f64, most: f64) -> f64 {
    let v = if v > least { v } else { least };
    if v < most { v } else { most }
}
