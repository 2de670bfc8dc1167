//! From profiles to the strips of a vessel's outer and inner wall.
//!
//! Works in the half plane (r, y), knows nothing of triangles. Generic in its numbers, so
//! that a tape gives derivatives. Invariant: neighbouring points differ by more than the
//! tolerance, so that no triangle collapses in single precision, and each strip begins
//! where the one before ends.

use super::lathe::{Profile, SMALLEST, Wall};
use super::real::Real;
use super::revolve::Strip;

/// Profiles that meet within this angle go on smoothly: the cosine of 40 degrees.
const SMOOTH_COS: f64 = 0.766_044_443_118_978;
/// An end at the axis is a smooth dome if its slope there is at most this (the surface
/// then turns by less than 40 degrees across the axis), else a tip: the tangent of 20
/// degrees.
const DOME_SLOPE: f64 = 0.363_970_234_266_202;
/// Radii below this share of the size count as at the axis and are drawn as if they were
/// it.
const TIP: f64 = 1e-6;
/// An inner wall keeps at least this share of the outer radius.
const LEAST_BORE: f64 = 0.02;
/// The share of the height that a floor reaches at most.
const MOST_FILLED: f64 = 0.95;

/// How near points may come, from the size of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    tip: f64,
    r: f64,
    y: f64,
}

impl Tolerance {
    /// For checked profiles; `None` if they have no extent.
    pub fn of(parts: &[Profile]) -> Option<Tolerance> {
        let widest = parts.iter().flat_map(|p| &p.r).fold(0.0, |a: f64, r| a.max(*r));
        let (bottom, top) = (*parts.first()?.y.first()?, *parts.last()?.y.last()?);
        let size = widest.max(top - bottom);
        // Heights may lie far from 0, where single precision is coarser.
        let y = 1e-6 * size + 2.0 * f64::from(f32::EPSILON) * bottom.abs().max(top.abs());
        (size > SMALLEST).then_some(Tolerance { tip: TIP * size, r: 1e-6 * size, y })
    }

    /// Whether a radius, not below the least one, is at the axis.
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
    /// Its lowest point.
    pub first: (T, T),
    /// Its highest.
    pub last: (T, T),
    /// Its strips, rings at steps included; none if it is a single circle.
    pub strips: Vec<Strip<T>>,
}

impl<T: Real> OuterPath<T> {
    /// Stacks checked profiles; steps get the part number `ring`. `number` is asked for
    /// each radius and height in turn.
    pub fn new(
        parts: &[Profile],
        tolerance: &Tolerance,
        ring: u16,
        mut number: impl FnMut(f64) -> T,
    ) -> Option<OuterPath<T>> {
        let mut points: Vec<(T, T)> = Vec::new();
        let mut labels: Vec<u16> = Vec::new();
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

/// Whether the path a, b, c turns by less than a crease does.
fn is_smooth<T: Real>(a: (T, T), b: (T, T), c: (T, T)) -> bool {
    let (a, b, c) = (values(a), values(b), values(c));
    let (u, v) = ((b.0 - a.0, b.1 - a.1), (c.0 - b.0, c.1 - b.1));
    let dot = u.0 * v.0 + u.1 * v.1;
    dot >= SMOOTH_COS * libm::hypot(u.0, u.1) * libm::hypot(v.0, v.1)
}

/// Whether a path that ends at the axis arrives there nearly at a right angle.
fn is_dome<T: Real>(tip: (T, T), next: (T, T)) -> bool {
    let (tip, next) = (values(tip), values(next));
    (next.1 - tip.1).abs() <= DOME_SLOPE * (next.0 - tip.0).abs()
}

impl<T: Real> Strip<T> {
    /// Closes the lower end, which is at the axis: a dome by a pole; a tip, which has no
    /// normal of its own, by a disc that is returned and goes before the strip.
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

    /// Closes the upper end likewise; the disc goes after the strip.
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

/// The height of the floor inside: what it is raised to, or as the wall is thick.
pub(super) fn floor_height<T: Real>(bottom: T, top: T, wall: Wall<T>) -> T {
    let share = |s: f64| (top - bottom) * top.constant(s);
    let least = |a: T, b: T| if a.value() < b.value() { a } else { b };
    let (thick, raised) =
        (least(wall.thickness, share(0.5)), least(wall.floor, share(MOST_FILLED)));
    bottom + if thick.value() < raised.value() { raised } else { thick }
}

/// The inner wall from the rim, inside `last`, down to a height: its strips, its first
/// and its last point. It has creases where the outer wall has them.
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
        let mut points = vec![at];
        for (r, y) in s.points.iter().rev().skip(1) {
            if above.1.value() <= down_to.value() {
                break;
            }
            let q = if y.value() < down_to.value() {
                // The last piece ends at the floor.
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
