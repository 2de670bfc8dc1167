//! Lines of sight against the surface: whether something lies before a depth.
//!
//! Along a line of sight, the squared distance from the axis is a quadratic function of
//! depth, and the squared radius of a cone at the line's height another; whether their
//! difference has a root in an interval is decided without a square root.

use super::sight::Ray;
use crate::geom::Revolution;

/// Spans tested at a time.
const LANES: usize = 8;

type Row = [f64; LANES];

/// Spans that are not level, [`LANES`] at a time.
#[derive(Clone, Copy, Debug, Default)]
struct Cones {
    /// Heights of the two ends.
    ends: [Row; 2],
    /// Radius at height 0 of the cone, and its change per height.
    radius: [Row; 2],
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
    cones: Vec<Cones>,
    levels: Vec<Level>,
}

impl Spans {
    /// Replaces the spans by those of a surface.
    pub fn set(&mut self, surface: &Revolution) {
        self.cones.clear();
        self.levels.clear();
        let mut lane = LANES;
        for [a, b] in surface.spans().iter().filter_map(|s| surface.ends(s)) {
            if a.y == b.y {
                let (least, most) = (a.r.min(b.r), a.r.max(b.r));
                self.levels.push(Level { y: a.y, square: [least * least, most * most] });
                continue;
            }
            if lane == LANES {
                // Spans without extent, which nothing meets.
                self.cones.push(Cones::default());
                lane = 0;
            }
            let Some(cones) = self.cones.last_mut() else { continue };
            let slope = (b.r - a.r) / (b.y - a.y);
            (cones.ends[0][lane], cones.ends[1][lane]) = (a.y, b.y);
            (cones.radius[0][lane], cones.radius[1][lane]) = (a.r - slope * a.y, slope);
            lane += 1;
        }
    }

    /// Whether a line of sight meets a span between two depths.
    #[inline(always)]
    pub fn meets(&self, ray: &Ray, [from, to]: [f64; 2]) -> bool {
        if from >= to {
            return false;
        }
        let Ray { square: [c, b, a], height: [at, climb] } = *ray;
        let per = 1.0 / climb;
        for level in &self.levels {
            let depth = (level.y - at) * per;
            let square = c + depth * (2.0 * b + a * depth);
            if depth > from && depth < to && square >= level.square[0] && square <= level.square[1]
            {
                return true;
            }
        }
        for cones in &self.cones {
            let mut met = [false; LANES];
            for (i, met) in met.iter_mut().enumerate() {
                let clamp = |v: f64| {
                    let v = if v > from { v } else { from };
                    if v < to { v } else { to }
                };
                let s = clamp((cones.ends[0][i] - at) * per);
                let t = clamp((cones.ends[1][i] - at) * per);
                let (slope, radius) = (cones.radius[1][i], cones.radius[0][i]);
                let (g, k) = (radius + slope * at, slope * climb);
                // The difference of the squares is c0 + 2 b1 depth + a2 depth^2.
                let (c0, b1, a2) = (c - g * g, b - g * k, a - k * k);
                let value = |d: f64| c0 + d * (2.0 * b1 + a2 * d);
                let (e, f) = (value(s), value(t));
                let (u, v) = (b1 + a2 * s, b1 + a2 * t);
                let between = (u * v < 0.0) & (e * a2 > 0.0) & (c0 * a2 < b1 * b1);
                *met = (s != t) & ((e * f < 0.0) | between);
            }
            if met.iter().fold(false, |any, met| any | met) {
                return true;
            }
        }
        false
    }
}
