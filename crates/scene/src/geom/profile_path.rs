//! Profiles, and the strips of a vessel's outer and inner wall that they make.
//!
//! Works in the half plane (r, y). Generic in the number type, so that a tape can give
//! derivatives. Invariant: neighbouring points differ by more than the tolerance, so that
//! no triangle collapses in single precision, and each strip starts where the previous
//! one ends.

use super::mesh::SMALLEST;
use super::real::Real;
use super::revolve::Strip;

/// The cosine of 40 degrees: profiles that meet at a smaller angle join smoothly.
const SMOOTH_COS: f64 = 0.766_044_443_118_978;
/// The tangent of 20 degrees: an end at the axis is a smooth dome if its slope there is
/// at most this (the surface then bends by less than 40 degrees across the axis), and a
/// tip otherwise.
const DOME_SLOPE: f64 = 0.363_970_234_266_202;
/// Radii below this fraction of the size count as on the axis, and are drawn with this
/// radius.
const TIP: f64 = 1e-6;
/// The minimum inner radius, as a fraction of the outer radius.
const LEAST_BORE: f64 = 0.02;
/// The maximum height of the floor, as a fraction of the height.
const MOST_FILLED: f64 = 0.95;

/// A profile: radii at heights, from bottom to top, in scene units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// Heights, non-decreasing.
    pub y: Vec<f64>,
    /// Radii, non-negative.
    pub r: Vec<f64>,
}

/// The wall of a vessel. A number converts to a wall and floor of that thickness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wall<T = f64> {
    /// The thickness of the wall, in scene units; 0 for a solid body.
    pub thickness: T,
    /// The height of the floor above the lower end, in scene units; at least the
    /// thickness of the wall. The contents of a vessel raise it.
    pub floor: T,
}

impl From<f64> for Wall {
    fn from(thickness: f64) -> Wall {
        Wall { thickness, floor: 0.0 }
    }
}

/// Tolerances for merging points, in proportion to the size of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    tip: f64,
    r: f64,
    y: f64,
}

impl Tolerance {
    /// Returns the tolerances for checked profiles; `None` if they have no extent.
    pub fn of(parts: &[Profile]) -> Option<Tolerance> {
        let widest = parts.iter().flat_map(|p| &p.r).fold(0.0, |a: f64, r| a.max(*r));
        let (bottom, top) = (*parts.first()?.y.first()?, *parts.last()?.y.last()?);
        let size = widest.max(top - bottom);
        // Heights can be far from 0, where single precision is coarser.
        let y = 1e-6 * size + 2.0 * f64::from(f32::EPSILON) * bottom.abs().max(top.abs());
        (size > SMALLEST).then_some(Tolerance { tip: TIP * size, r: 1e-6 * size, y })
    }

    /// True if a radius counts as on the axis; radii have been raised to `tip` at least.
    pub fn is_tip(&self, r: f64) -> bool {
        r <= self.tip
    }

    fn near<T: Real>(&self, a: (T, T), b: (T, T)) -> bool {
        let (a, b) = (values(a), values(b));
        (a.0 - b.0).abs() <= self.r && (a.1 - b.1).abs() <= self.y
    }
}

fn values<T: Real>(p: (T, T)) -> (f64, f64) {
    (p.0.value(), p.1.value())
}

/// The outer wall.
pub(super) struct OuterPath<T> {
    /// The lowest point.
    pub first: (T, T),
    /// The highest point.
    pub last: (T, T),
    /// The strips, including rings at steps; empty if the wall is a single circle.
    pub strips: Vec<Strip<T>>,
}

impl<T: Real> OuterPath<T> {
    /// Stacks checked profiles; steps get the part number `ring`. `number` is called with
    /// each radius and height in turn.
    pub fn new(
        parts: &[Profile],
        tolerance: &Tolerance,
        ring: u16,
        mut number: impl FnMut(f64) -> T,
    ) -> Option<OuterPath<T>> {
        let count = parts.iter().map(|p| p.r.len()).sum();
        let mut points: Vec<(T, T)> = Vec::with_capacity(count);
        let mut labels: Vec<u16> = Vec::with_capacity(count);
        for (i, p) in parts.iter().enumerate() {
            for (k, (r, y)) in p.r.iter().zip(&p.y).enumerate() {
                let (r, y) = (number(*r), number(*y));
                let q = (if r.value() < tolerance.tip { r.constant(tolerance.tip) } else { r }, y);
                match points.last() {
                    Some(end) if tolerance.near(*end, q) => {}
                    Some(_) => {
                        points.push(q);
                        labels.push(if k == 0 { ring } else { i as u16 });
                    }
                    None => points.push(q),
                }
            }
        }
        let is_cut = |k: usize| {
            let at_ring = labels[k] == ring || labels[k - 1] == ring;
            at_ring
                || labels[k] != labels[k - 1] && !is_smooth(points[k - 1], points[k], points[k + 1])
        };
        let mut strips = Vec::new();
        let mut start = 0;
        for k in 1..=labels.len() {
            if k == labels.len() || is_cut(k) {
                let piece = Strip {
                    points: points[start..=k].to_vec(),
                    parts: labels[start..k].to_vec(),
                    blend: false,
                };
                strips.push(piece);
                start = k;
            }
        }
        Some(OuterPath { first: *points.first()?, last: *points.last()?, strips })
    }
}

/// True if the path a, b, c bends by less than the crease angle.
fn is_smooth<T: Real>(a: (T, T), b: (T, T), c: (T, T)) -> bool {
    let (a, b, c) = (values(a), values(b), values(c));
    let (u, v) = ((b.0 - a.0, b.1 - a.1), (c.0 - b.0, c.1 - b.1));
    let dot = u.0 * v.0 + u.1 * v.1;
    dot >= SMOOTH_COS * libm::hypot(u.0, u.1) * libm::hypot(v.0, v.1)
}

/// True if a path that ends at the axis is nearly perpendicular to it there.
fn is_dome<T: Real>(tip: (T, T), next: (T, T)) -> bool {
    let (tip, next) = (values(tip), values(next));
    (next.1 - tip.1).abs() <= DOME_SLOPE * (next.0 - tip.0).abs()
}

impl<T: Real> Strip<T> {
    /// Closes the lower end, which is at the axis. A dome gets a pole. A tip has no
    /// well-defined normal and gets a disc, which is returned and goes before the strip.
    pub fn close_start(&mut self) -> Option<Strip<T>> {
        let tip = self.points[0];
        if is_dome(tip, self.points[1]) {
            self.points[0].0 = tip.0.constant(0.0);
            return None;
        }
        self.blend = true;
        Some(Strip {
            points: vec![(tip.0.constant(0.0), tip.1), tip],
            parts: vec![self.parts[0]],
            blend: false,
        })
    }

    /// Closes the upper end in the same way; the disc goes after the strip.
    pub fn close_end(&mut self) -> Option<Strip<T>> {
        let k = self.points.len() - 1;
        let tip = self.points[k];
        if is_dome(tip, self.points[k - 1]) {
            self.points[k].0 = tip.0.constant(0.0);
            return None;
        }
        Some(Strip {
            points: vec![tip, (tip.0.constant(0.0), tip.1)],
            parts: vec![self.parts[k - 1]],
            blend: true,
        })
    }
}

/// Returns the height of the floor inside: the raised height or the wall's thickness,
/// whichever is higher.
pub(super) fn floor_height<T: Real>(bottom: T, top: T, wall: Wall<T>) -> T {
    let share = |s: f64| (top - bottom) * top.constant(s);
    let least = |a: T, b: T| if a.value() < b.value() { a } else { b };
    let (thick, raised) =
        (least(wall.thickness, share(0.5)), least(wall.floor, share(MOST_FILLED)));
    bottom + if thick.value() < raised.value() { raised } else { thick }
}

/// Returns the inner wall from the rim, inside `last`, down to a height: its strips, and
/// its first and last point. It has creases where the outer wall has them.
pub(super) fn inner_wall<T: Real>(
    outer: &[Strip<T>],
    last: (T, T),
    thickness: T,
    down_to: T,
    tolerance: &Tolerance,
    part: u16,
) -> (Vec<Strip<T>>, [(T, T); 2]) {
    let bore = |r: T| {
        let (thin, least) = (r - thickness, r * r.constant(LEAST_BORE));
        if thin.value() > least.value() { thin } else { least }
    };
    let start = (bore(last.0), last.1);
    let (mut at, mut above) = (start, last);
    let mut walls = Vec::new();
    for s in outer.iter().rev() {
        let mut points = Vec::with_capacity(s.points.len());
        points.push(at);
        for (r, y) in s.points.iter().rev().skip(1) {
            if above.1.value() <= down_to.value() {
                break;
            }
            let q = if y.value() < down_to.value() {
                // The last segment ends at the floor.
                let t = (down_to - *y).over(above.1 - *y);
                (bore(*r + t * (above.0 - *r)), down_to)
            } else {
                (bore(*r), *y)
            };
            above = (*r, *y);
            if !tolerance.near(at, q) {
                points.push(q);
                at = q;
            }
        }
        if points.len() > 1 {
            walls.push(Strip { parts: vec![part; points.len() - 1], points, blend: false });
        }
    }
    (walls, [start, at])
}
