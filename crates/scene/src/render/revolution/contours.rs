//! The visible contours of a surface of revolution.

use super::rays::Spans;
use super::samples::{Kind, Run, Sample, Samples};
use super::sight::Sight;
use super::silhouettes::is_speck;
use crate::contours::Contours;
use crate::geom::{Affine, Revolution, Rim};
use crate::render::Camera;
use crate::render::lines::extraction::{LONGEST, clip};
use crate::render::lines::visibility::{BESIDE, EDGE_SLACK, SILHOUETTE_SLACK, TOLERANCE};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::beyond_near;
use crate::render::simd::vectorised;
use std::cell::RefCell;

/// Buffers reused from call to call.
#[derive(Default)]
struct Scratch {
    samples: Samples,
    spans: Spans,
    /// The number of visible pieces the last time.
    found: usize,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::new(Scratch::default());
}

impl Contours {
    /// The contours of a placed surface of revolution in a camera's image, computed
    /// without a mesh; none if the placement is not invertible.
    pub fn of_revolution(surface: &Revolution, affine: &Affine, camera: &Camera) -> Contours {
        let Some(sight) = Sight::new(camera, affine) else {
            return Contours::new(camera.width, camera.height);
        };
        SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
            Ok(mut scratch) => scratch.contours(surface, &sight, camera),
            Err(_) => Scratch::default().contours(surface, &sight, camera),
        })
    }
}

impl Scratch {
    fn contours(&mut self, surface: &Revolution, sight: &Sight, camera: &Camera) -> Contours {
        let range = sight.range(surface);
        let mut out = Contours::with_room(camera, self.found);
        if !(range.far > Camera::NEAR && range.far < HUGE) {
            return out;
        }
        let whole = range.near > Camera::NEAR;
        let extent = range.far - range.near.max(Camera::NEAR);
        let Scratch { samples, spans, found } = self;
        vectorised(
            #[inline(always)]
            || {
                samples.clear();
                samples.add_silhouettes(surface, sight, whole);
                samples.add_rims(surface, sight, whole);
                samples.project(sight);
                spans.set(surface);
                let open = surface.rims().iter().any(|rim| {
                    let ring = surface.rings().get(rim.ring);
                    rim.spans.contains(&None) && ring.is_some_and(|r| !is_speck(r, sight, whole))
                });
                let size = [f64::from(camera.width), f64::from(camera.height)];
                let mut drawer = Drawer {
                    surface,
                    sight,
                    samples,
                    spans,
                    open,
                    whole,
                    tolerance: TOLERANCE * extent,
                    most: [SILHOUETTE_SLACK * extent, EDGE_SLACK * extent],
                    size,
                    out: &mut out,
                };
                samples.runs.iter().for_each(|run| drawer.run(run));
            },
        );
        *found = out.len();
        out
    }
}

/// Surfaces beyond this depth (scene units) are not drawn, as in a mesh.
const HUGE: f64 = 1e9;

struct Drawer<'a> {
    surface: &'a Revolution,
    sight: &'a Sight,
    samples: &'a Samples,
    spans: &'a Spans,
    /// Whether there are visible boundaries, so that the inside may be visible.
    open: bool,
    /// Whether all of the surface is beyond the near plane.
    whole: bool,
    /// Depth tolerance of visibility, in scene units.
    tolerance: f64,
    /// Largest slack of silhouettes and of rims.
    most: [f64; 2],
    size: [f64; 2],
    out: &'a mut Contours,
}

/// A chord of a curve: two samples, and the side of the plane of symmetry.
#[derive(Clone, Copy)]
struct Chord<'a> {
    kind: Kind,
    ends: [&'a Sample; 2],
    side: f64,
}

/// How a chord appears: unit tangent in the image, with the object on its right, and which
/// sides are tested.
#[derive(Clone, Copy, Default)]
struct Look {
    tangent: [f64; 2],
    both: bool,
}

impl Drawer<'_> {
    #[inline(always)]
    fn run(&mut self, run: &Run) {
        for i in run.first..run.past.saturating_sub(1) {
            self.chord(run.kind, i);
        }
    }

    /// Adds the visible pieces of a chord, on both sides.
    #[inline(always)]
    fn chord(&mut self, kind: Kind, i: usize) {
        let samples = self.samples;
        let (Some(a), Some(b)) = (samples.list.get(i), samples.list.get(i + 1)) else { return };
        let chords = [1.0, -1.0].map(|side| Chord { kind, ends: [a, b], side });
        if !self.whole {
            return chords.iter().for_each(|chord| self.cut(chord));
        }
        let ends = [0, 1].map(|side| [samples.image(side, i), samples.image(side, i + 1)]);
        let lengths = ends.map(|[a, b]| {
            let (dx, dy) = (b.x - a.x, b.y - a.y);
            (dx * dx + dy * dy).sqrt()
        });
        let inside = ends.iter().flatten().all(|p| self.inside(p));
        if !(inside && lengths.iter().all(|l| *l < LONGEST && *l > 1e-9)) {
            return chords.iter().for_each(|chord| self.cut(chord));
        }
        let looks = [0, 1].map(|k| self.look(&chords[k], &ends[k], lengths[k]));
        let [Some(first), Some(second)] = looks else { return };
        if self.visible(&chords[0], &ends[0], 0.5, lengths[0], &first) {
            self.push(&ends[0], lengths[0], &first);
            self.push(&ends[1], lengths[1], &second);
        }
    }

    #[inline(always)]
    fn push(&mut self, [a, b]: &[Point; 2], length: f64, look: &Look) {
        let [tx, ty] = look.tangent;
        self.add([0.5 * (a.x + b.x), 0.5 * (a.y + b.y)], [tx, ty], length);
    }

    #[inline(always)]
    fn add(&mut self, [x, y]: [f64; 2], [tx, ty]: [f64; 2], length: f64) {
        self.out.x.push(x as f32);
        self.out.y.push(y as f32);
        self.out.tx.push(tx as f32);
        self.out.ty.push(ty as f32);
        self.out.length.push(length as f32);
    }

    #[inline(always)]
    fn inside(&self, p: &Point) -> bool {
        p.x >= 0.0 && p.y >= 0.0 && p.x <= self.size[0] && p.y <= self.size[1]
    }

    /// The tangent of a chord and the sides to be tested; `None` if it never shows.
    #[inline(always)]
    fn look(&self, chord: &Chord<'_>, [a, b]: &[Point; 2], length: f64) -> Option<Look> {
        let (tx, ty) = ((b.x - a.x) / length, (b.y - a.y) / length);
        match chord.kind {
            Kind::Silhouette(_) => {
                let n = self.sight.cofactor * chord.ends[0].normal(chord.side);
                // Outward in the image is (n.x, -n.y).
                let way = if n.x * ty + n.y * tx < 0.0 { -1.0 } else { 1.0 };
                Some(Look { tangent: [way * tx, way * ty], both: self.open })
            }
            Kind::Rim(rim) => {
                let rim = self.surface.rims().get(rim)?;
                let (mut any_front, mut side) = (false, 0.0f64);
                for (k, span) in rim.spans.iter().enumerate() {
                    let Some(front) = span.and_then(|s| self.front(s, k, chord)) else { continue };
                    any_front |= front;
                    if front || self.open {
                        let [du, dv, _] = self.across(rim, k, chord, a);
                        side -= (du * ty - dv * tx).signum();
                    }
                }
                let way = if side < 0.0 { -1.0 } else { 1.0 };
                (any_front || self.open)
                    .then_some(Look { tangent: [way * tx, way * ty], both: true })
            }
        }
    }

    /// Whether the span on one side of a rim faces the camera.
    #[inline(always)]
    fn front(&self, span: usize, _: usize, chord: &Chord<'_>) -> Option<bool> {
        let [a, b] = self.surface.ends(self.surface.spans().get(span)?)?;
        let (nr, ny) = (b.y - a.y, a.r - b.r);
        let c = 0.5 * (chord.ends[0].c + chord.ends[1].c);
        let [x, y] = self.sight.view;
        Some(nr * (c * x - self.sight.bend * a.r) + ny * (y - self.sight.bend * a.y) > 0.0)
    }

    /// The image of the way from a rim across the span on one side of it, per span: to the
    /// right, down, nearness. The point in the image is given.
    #[inline(always)]
    fn across(&self, rim: &Rim, k: usize, chord: &Chord<'_>, at: &Point) -> [f64; 3] {
        let span = rim.spans[k].and_then(|s| self.surface.spans().get(s));
        let Some([a, b]) = span.and_then(|s| self.surface.ends(s)) else { return [0.0; 3] };
        let way = if k == 0 { -1.0 } else { 1.0 };
        let (dr, dy) = (way * (b.r - a.r), way * (b.y - a.y));
        let p = chord.ends[0];
        self.motion([dr * p.c, dy, chord.side * dr * p.s], at)
    }

    /// The motion in the image of a point that moves on the surface.
    #[inline(always)]
    fn motion(&self, [x, y, z]: [f64; 3], at: &Point) -> [f64; 3] {
        let m = &self.sight.m;
        let d = m.x_axis * x + m.y_axis * y + m.z_axis * z;
        let lens = &self.sight.lens;
        if lens.pinhole {
            let [a, b] = self.sight.slopes([at.x, at.y]);
            let k = lens.scale * at.nearness;
            [k * (d.x + a * d.z), -k * (d.y + b * d.z), d.z * at.nearness * at.nearness]
        } else {
            [lens.scale * d.x, -lens.scale * d.y, d.z]
        }
    }

    /// Whether a piece of a chord is visible: its position along the chord's image is
    /// given.
    #[inline(always)]
    fn visible(
        &self,
        chord: &Chord<'_>,
        ends: &[Point; 2],
        at: f64,
        length: f64,
        look: &Look,
    ) -> bool {
        let [a, b] = ends;
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let middle = [a.x + dx * at, a.y + dy * at];
        let depth = self.sight.lens.depth(a.nearness + (b.nearness - a.nearness) * at);
        let [tx, ty] = look.tangent;
        let outward = [ty, -tx];
        let limit = depth - self.tolerance - 1e-6 * depth;
        let free = |way: f64, slack: f64| {
            let beside = [0, 1].map(|axis| middle[axis] + way * BESIDE * outward[axis]);
            let ray = self.sight.ray(beside);
            !self.spans.meets(&ray, [Camera::NEAR, limit - slack])
        };
        if free(1.0, 0.0) || (look.both && free(-1.0, 0.0)) {
            return true;
        }
        let slack = self.slack(chord, ends, length, look);
        (slack[0] > 0.0 && free(1.0, slack[0]))
            || (look.both && slack[1] > 0.0 && free(-1.0, slack[1]))
    }

    /// How much nearer than a chord the surface beside it reaches, on the outward and on
    /// the other side, in scene units.
    #[inline(never)]
    fn slack(&self, chord: &Chord<'_>, [a, b]: &[Point; 2], length: f64, look: &Look) -> [f64; 2] {
        let (ux, uy) = ((b.x - a.x) / length, (b.y - a.y) / length);
        let steep = (b.nearness - a.nearness) / length;
        let in_depth = |nearness: f64| {
            let pinhole = self.sight.lens.pinhole;
            if pinhole { nearness / (a.nearness * a.nearness) } else { nearness }.max(0.0)
        };
        match chord.kind {
            Kind::Silhouette(span) => {
                if length < 0.02 {
                    return [0.0; 2];
                }
                let ends = self.surface.spans().get(span).and_then(|s| self.surface.ends(s));
                let ahead = ends.into_iter().flatten().map(|ring| {
                    let at = Sample { r: ring.r, y: ring.y, ..*chord.ends[0] };
                    let p = self.sight.image(at.point(chord.side));
                    if !(p.nearness > 0.0 || !self.sight.lens.pinhole) {
                        return 0.0;
                    }
                    p.nearness - a.nearness - steep * ((p.x - a.x) * ux + (p.y - a.y) * uy)
                });
                let slack = in_depth(ahead.fold(0.0, f64::max)).min(self.most[0]);
                [slack; 2]
            }
            Kind::Rim(rim) => {
                let Some(rim) = self.surface.rims().get(rim) else { return [0.0; 2] };
                let [tx, ty] = look.tangent;
                let mut slack = [0.0f64; 2];
                for (k, span) in rim.spans.iter().enumerate() {
                    let Some(front) = span.and_then(|s| self.front(s, k, chord)) else { continue };
                    if !(front || self.open) {
                        continue;
                    }
                    let [du, dv, dn] = self.across(rim, k, chord, a);
                    let away = du * ty - dv * tx;
                    if away.abs() > 1e-3 {
                        let per_pixel = (dn - steep * (du * ux + dv * uy)) / away.abs();
                        let i = usize::from(away < 0.0);
                        slack[i] = slack[i].max(in_depth(2.0 * per_pixel)).min(self.most[1]);
                    }
                }
                slack
            }
        }
    }

    /// Adds the visible pieces of a chord that is long, leaves the image or crosses the
    /// near plane.
    #[inline(never)]
    fn cut(&mut self, chord: &Chord<'_>) {
        let ends = chord.ends.map(|p| self.sight.camera(p.point(chord.side)));
        let Some(ends) = beyond_near(ends) else { return };
        let [a, b] = ends.map(|p| self.sight.lens.point(p));
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let all = (dx * dx + dy * dy).sqrt();
        if !(all > 1e-9 && all.is_finite()) {
            return;
        }
        let part = match self.inside(&a) && self.inside(&b) {
            true => Some((0.0, 1.0)),
            false => clip(&a, [dx, dy], self.size),
        };
        let Some((t0, t1)) = part else { return };
        let length = all * (t1 - t0);
        if !(length > 1e-9 && length.is_finite()) {
            return;
        }
        let Some(look) = self.look(chord, &[a, b], all) else { return };
        let pieces = if length < LONGEST { 1.0 } else { (length + 0.5).floor() };
        let step = (t1 - t0) / pieces;
        for i in 0..pieces as usize {
            let t = t0 + step * (i as f64 + 0.5);
            if self.visible(chord, &[a, b], t, all, &look) {
                self.add([a.x + dx * t, a.y + dy * t], look.tangent, length / pieces);
            }
        }
    }
}

#[cfg(test)]
#[path = "contours_tests.rs"]
mod tests;
