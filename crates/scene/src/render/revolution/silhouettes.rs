//! Curves on a surface of revolution as samples: smooth silhouettes and sharp circles.
//!
//! The facing of a ring, `normal . (view - bend * point)`, is A cos(angle) + B. Between
//! two rings A and B are interpolated, as facing is within the faces of a mesh, so the
//! silhouette is cos(angle) = -B(t) / A(t). Samples are about a pixel apart, and closer
//! where the image of a curve bends.

use super::samples::{Circle, LAST, Sample, Samples};
use super::sight::Sight;
use crate::geom::{Revolution, Ring};
use crate::render::Camera;

/// The distance between samples, in pixels.
const STEP: f64 = 1.2;
/// The maximum distance of a curve from the chords between its samples, in pixels.
const STRAY: f64 = 0.02;
/// The maximum number of chords of half a circle.
const MOST: f64 = 1024.0;
/// The maximum number of chords of a silhouette within a span.
const MOST_OF_SPAN: f64 = 256.0;
/// Chords of what reaches behind the near plane, whose size in the image is unknown.
const NEARBY: f64 = 256.0;

/// The facing of a ring: `a cos(angle) + b`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facing {
    pub a: f64,
    pub b: f64,
}

impl Facing {
    #[inline(always)]
    pub fn new(ring: &Ring, sight: &Sight) -> Facing {
        let [x, y] = sight.view;
        Facing {
            a: ring.nr * x,
            b: ring.ny * (y - sight.bend * ring.y) - sight.bend * ring.nr * ring.r,
        }
    }

    #[inline(always)]
    fn mixed(&self, other: &Facing, t: f64) -> Facing {
        Facing { a: self.a + (other.a - self.a) * t, b: self.b + (other.b - self.b) * t }
    }

    /// Cosine and sine of the angle at which the facing is 0.
    #[inline(always)]
    pub fn edge(&self) -> [f64; 2] {
        let c = -self.b / self.a;
        let c = if c > -1.0 { c } else { -1.0 };
        let c = if c < 1.0 { c } else { 1.0 };
        [c, ((1.0 - c) * (1.0 + c)).sqrt()]
    }
}

/// A span with the facing of its two rings.
#[derive(Clone, Copy)]
struct Piece<'a> {
    rings: [&'a Ring; 2],
    facing: [Facing; 2],
}

impl Piece<'_> {
    /// The sample at a fraction of the span and an angle.
    #[inline(always)]
    fn sample(&self, t: f64, [c, s]: [f64; 2]) -> Sample {
        let [a, b] = self.rings;
        Sample {
            c,
            s,
            r: a.r + (b.r - a.r) * t,
            y: a.y + (b.y - a.y) * t,
            nr: a.nr + (b.nr - a.nr) * t,
            ny: a.ny + (b.ny - a.ny) * t,
        }
    }

    /// The sample of the silhouette at a fraction of the span.
    #[inline(always)]
    fn at(&self, t: f64) -> Sample {
        self.sample(t, self.facing[0].mixed(&self.facing[1], t).edge())
    }

    /// The fraction of the span at which its silhouette has an angle.
    fn share(&self, c: f64) -> f64 {
        let [f, g] = self.facing.map(|f| f.a * c + f.b);
        f / (f - g)
    }
}

/// A part of a span's silhouette: fractions of the span, cosines and sines.
#[derive(Clone, Copy)]
struct Stretch {
    shares: [f64; 2],
    angles: [[f64; 2]; 2],
}

impl Samples {
    /// Adds the silhouettes of all spans; `whole` if the surface is beyond the near plane.
    #[inline(always)]
    pub fn add_silhouettes(&mut self, surface: &Revolution, sight: &Sight, whole: bool) {
        for (i, span) in surface.spans().iter().enumerate() {
            let Some(rings) = surface.ends(span) else { continue };
            let facing = rings.map(|ring| Facing::new(ring, sight));
            let piece = Piece { rings, facing };
            let [f, g] = facing;
            // Facing at the side of the camera and opposite to it.
            let (near, far) = ([f.b + f.a, g.b + g.a], [f.b - f.a, g.b - g.a]);
            let same = |v: [f64; 2]| (v[0] < 0.0) == (v[1] < 0.0);
            if same(near) && same(far) {
                if (near[0] < 0.0) != (far[0] < 0.0) {
                    let all = Stretch { shares: [0.0, 1.0], angles: [f.edge(), g.edge()] };
                    self.trace(i, &piece, all, sight, whole);
                }
                continue;
            }
            self.add_parts(i, &piece, [near, far], sight, whole);
        }
        self.silhouettes = self.count;
    }

    /// Adds the silhouettes of a span that do not run through all of it.
    #[inline(never)]
    fn add_parts(
        &mut self,
        span: usize,
        piece: &Piece<'_>,
        [near, far]: [[f64; 2]; 2],
        sight: &Sight,
        whole: bool,
    ) {
        let root = |v: [f64; 2]| match (v[0] < 0.0) == (v[1] < 0.0) {
            true => 0.0,
            false => v[0] / (v[0] - v[1]),
        };
        let (t, u) = (root(near), root(far));
        let mut cuts = [0.0, t.min(u), t.max(u), 1.0];
        cuts.sort_by(f64::total_cmp);
        for ends in cuts.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            let at = |v: [f64; 2]| v[0] + (v[1] - v[0]) * 0.5 * (from + to);
            if from >= to || (at(near) < 0.0) == (at(far) < 0.0) {
                continue;
            }
            let angle = |share: f64| match share {
                0.0 => piece.facing[0].edge(),
                1.0 => piece.facing[1].edge(),
                _ if share == t => [1.0, 0.0],
                _ => [-1.0, 0.0],
            };
            let stretch = Stretch { shares: [from, to], angles: [angle(from), angle(to)] };
            self.trace(span, piece, stretch, sight, whole);
        }
    }

    /// Adds a stretch of a silhouette.
    #[inline(always)]
    fn trace(
        &mut self,
        span: usize,
        piece: &Piece<'_>,
        Stretch { shares: [from, to], angles: [start, end] }: Stretch,
        sight: &Sight,
        whole: bool,
    ) {
        let (dc, ds) = (end[0] - start[0], end[1] - start[1]);
        let turn = dc * dc + ds * ds;
        let [begin, finish] = [piece.sample(from, start), piece.sample(to, end)];
        // By the fraction of the span, unless the angle depends strongly on it.
        if turn < 1e-6 || (turn < 0.25 && start[1].min(end[1]) > 0.25) {
            let middle = piece.at(0.5 * (from + to));
            let count = chords([&begin, &middle, &finish], sight, whole);
            self.begin(span, &begin, count);
            let step = (to - from) / count;
            for i in 1..count as usize {
                self.push(&piece.at(from + i as f64 * step), span as u32);
            }
            self.push(&finish, LAST);
        } else {
            self.turn(span, piece, [from, to], [start, end], sight, whole);
        }
    }

    /// Adds a stretch of a silhouette by its angle.
    #[inline(never)]
    fn turn(
        &mut self,
        span: usize,
        piece: &Piece<'_>,
        [from, to]: [f64; 2],
        [start, end]: [[f64; 2]; 2],
        sight: &Sight,
        whole: bool,
    ) {
        let [begin, finish] = [piece.sample(from, start), piece.sample(to, end)];
        let angle = |v: [f64; 2]| libm::atan2(v[1], v[0]);
        let angle = angle(end) - angle(start);
        let at = |at: [f64; 2]| {
            let t = piece.share(at[0]).clamp(from, to);
            piece.sample(if t.is_finite() { t } else { from }, at)
        };
        let middle = at(turned(start, 0.5 * angle));
        let count = chords([&begin, &middle, &finish], sight, whole);
        self.begin(span, &begin, count);
        let (step, mut direction) = (turned([1.0, 0.0], angle / count), start);
        for _ in 1..count as usize {
            direction = rotated(direction, step);
            self.push(&at(direction), span as u32);
        }
        self.push(&finish, LAST);
    }

    /// Adds the first sample of a stretch with a number of chords, and makes room for them.
    #[inline(always)]
    fn begin(&mut self, span: usize, begin: &Sample, count: f64) {
        self.reserve(count as usize + 1);
        // Where it continues the stretch before, this sample is there already.
        if let Some(i) = self.count.checked_sub(1) {
            let (p, [x, y, z], [nx, ny, _]) = (begin.point(), &self.points, &self.normals);
            let same = (at(x, i) == p.x) & (at(y, i) == p.y) & (at(z, i) == p.z);
            if same & (at(nx, i) == begin.nr * begin.c) & (at(ny, i) == begin.ny) {
                self.count = i;
            }
        }
        self.push(begin, span as u32);
    }

    /// Adds the sharp circles that are not too small to be seen.
    #[inline(always)]
    pub fn add_rims(&mut self, surface: &Revolution, sight: &Sight, whole: bool) {
        for (i, rim) in surface.rims().iter().enumerate() {
            let Some(ring) = surface.rings().get(rim.ring) else { continue };
            if is_speck(ring, sight, whole) {
                continue;
            }
            let count = if whole { circle_chords(sight.radius(ring)) } else { NEARBY };
            let first = self.count;
            self.reserve(count as usize + 1);
            let step = core::f64::consts::PI / count;
            let step = turned([1.0, 0.0], step);
            let at = |[c, s]: [f64; 2]| Sample { c, s, r: ring.r, y: ring.y, nr: 1.0, ny: 0.0 };
            let mut direction = [1.0, 0.0];
            self.push(&at(direction), 0);
            for _ in 1..count as usize {
                direction = rotated(direction, step);
                self.push(&at(direction), 0);
            }
            self.push(&at([-1.0, 0.0]), LAST);
            self.circles.push(Circle { first, past: self.count, rim: i });
        }
    }
}

/// A direction as cosine and sine, turned by an angle.
fn turned(at: [f64; 2], angle: f64) -> [f64; 2] {
    rotated(at, [libm::cos(angle), libm::sin(angle)])
}

/// A direction turned by that of another.
#[inline(always)]
fn rotated([c, s]: [f64; 2], [dc, ds]: [f64; 2]) -> [f64; 2] {
    [c * dc - s * ds, s * dc + c * ds]
}

/// Sharp circles are left out if the width plus height of their image is less than this,
/// in pixels, as in a mesh.
const SPECK: f64 = 0.1;

/// True if a circle is too small to be seen.
pub(super) fn is_speck(ring: &Ring, sight: &Sight, whole: bool) -> bool {
    // A circle that shows with radius r is at least 2 r wide and high together.
    whole && 2.0 * sight.radius(ring) < SPECK
}

/// The number of chords of half a circle of this radius, in pixels.
fn circle_chords(radius: f64) -> f64 {
    // The distance of a chord of n from its arc is radius (pi / n)^2 / 8 at most.
    let bend = core::f64::consts::PI * (radius / (8.0 * STRAY)).sqrt();
    let count = (core::f64::consts::PI / STEP * radius).max(bend).ceil();
    if count > 2.0 { count.min(MOST) } else { 2.0 }
}

/// The number of chords between the ends of a curve, of which the middle is given too.
#[inline(always)]
fn chords(curve: [&Sample; 3], sight: &Sight, whole: bool) -> f64 {
    if !whole {
        let ends = curve.map(|p| -sight.camera(p.point()).z);
        if ends.iter().any(|depth| *depth < 2.0 * Camera::NEAR) {
            return 64.0;
        }
    }
    let [a, b, c] = curve;
    let (a, b, c) = (sight.image(a.point()), sight.image(b.point()), sight.image(c.point()));
    let long = length(b.x - a.x, b.y - a.y) + length(c.x - b.x, c.y - b.y);
    let bend = length(a.x - 2.0 * b.x + c.x, a.y - 2.0 * b.y + c.y);
    // The second difference falls with the square of the number of chords.
    let count = (long / STEP).max((bend / (2.0 * STRAY)).sqrt()).ceil();
    if count > 1.0 { count.min(MOST_OF_SPAN) } else { 1.0 }
}

#[inline(always)]
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

#[inline(always)]
fn at(list: &[f64], i: usize) -> f64 {
    list.get(i).copied().unwrap_or(f64::NAN)
}
