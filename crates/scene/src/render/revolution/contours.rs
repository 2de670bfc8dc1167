//! The visible contours of a surface of revolution.

use super::chords::{Chords, Face, reach};
use super::rays::{LANES, Row, Spans};
use super::samples::{LAST, Samples};
use super::sight::Sight;
use super::silhouettes::is_speck;
use crate::contours::Contours;
use crate::geom::{Affine, Revolution};
use crate::render::Camera;
use crate::render::lines::extraction::{LONGEST, clip};
use crate::render::lines::visibility::{BESIDE, SILHOUETTE_SLACK, TOLERANCE};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::beyond_near;
use crate::render::simd::vectorised;
use glam::DVec3;
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

/// Surfaces beyond this depth (scene units) are not drawn, as meshes.
const HUGE: f64 = 1e9;

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
        let out = Contours::with_room(camera, self.found);
        if !(range.far > Camera::NEAR && range.far < HUGE) {
            return out;
        }
        let whole = range.near > Camera::NEAR;
        let extent = range.far - range.near.max(Camera::NEAR);
        let Scratch { samples, spans, found } = self;
        let out = vectorised(
            #[inline(always)]
            move || {
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
                let mut drawer =
                    Drawer { surface, sight, samples, spans, open, whole, extent, size, out };
                drawer.silhouettes();
                drawer.rims();
                drawer.out
            },
        );
        *found = out.len();
        out
    }
}

struct Drawer<'a> {
    surface: &'a Revolution,
    sight: &'a Sight,
    samples: &'a Samples,
    spans: &'a Spans,
    /// Whether there are visible boundaries, so that the inside may be visible.
    open: bool,
    /// Whether all of the surface is beyond the near plane.
    whole: bool,
    /// The depth range of the surface.
    extent: f64,
    size: [f64; 2],
    out: Contours,
}

/// Pieces to be tested for visibility: middle, depth, unit tangent, and how much nearer
/// their own surface may reach on either side.
#[derive(Clone, Copy, Default)]
struct Pieces {
    at: [Row; 2],
    depth: Row,
    tangent: [Row; 2],
    slack: [Row; 2],
    there: [bool; LANES],
}

impl Drawer<'_> {
    #[inline(always)]
    fn silhouettes(&mut self) {
        let mut first = 0;
        while first + 1 < self.samples.silhouettes {
            let count = (self.samples.silhouettes - 1 - first).min(LANES);
            let (mut sides, cut) = self.chords(first, count);
            for (side, chords) in sides.iter_mut().enumerate() {
                chords.orient(self.sight, self.samples, first, side);
            }
            let own = self.samples.spans.get(first..first + count).unwrap_or(&[]);
            for chords in &mut sides {
                let joined = own.iter().map(|span| *span != LAST);
                chords.there.iter_mut().zip(joined).for_each(|(there, joined)| *there &= joined);
            }
            self.finish(first, sides, cut, self.open, true);
            first += LANES;
        }
    }

    #[inline(always)]
    fn rims(&mut self) {
        for circle in &self.samples.circles {
            let Some(rim) = self.surface.rims().get(circle.rim) else { continue };
            let faces = Face::both(self.surface, rim, self.sight);
            let mut first = circle.first;
            while first + 1 < circle.past {
                let (mut sides, cut) = self.chords(first, (circle.past - 1 - first).min(LANES));
                for (side, chords) in sides.iter_mut().enumerate() {
                    let options = (self.open, self.extent);
                    chords.orient_rim(&faces, self.sight, self.samples, first, side, options);
                }
                self.finish(first, sides, cut, true, false);
                first += LANES;
            }
        }
    }

    /// The chords from some samples on both sides, and which of them are not a single
    /// piece on both sides.
    #[inline(always)]
    fn chords(&self, first: usize, count: usize) -> ([Chords; 2], [bool; LANES]) {
        let mut cut = [false; LANES];
        let near = self.side(first, count, 0, &mut cut);
        let far = self.side(first, count, 1, &mut cut);
        ([near, far], cut)
    }

    /// The chords on one side; marks those that are not a single piece.
    #[inline(always)]
    fn side(&self, first: usize, count: usize, side: usize, cut: &mut [bool; LANES]) -> Chords {
        let mut chords = Chords::new(self.samples, first, side);
        let mut behind = [false; LANES];
        if !self.whole {
            self.cut_near(&mut chords, &mut behind, first, count, side);
        }
        chords.measure(count);
        let [width, height] = self.size;
        let Chords { from, to, length, there, .. } = &mut chords;
        for i in 0..LANES {
            there[i] &= !behind[i];
            let starts = (from[0][i] >= 0.0)
                & (from[1][i] >= 0.0)
                & (from[0][i] <= width)
                & (from[1][i] <= height);
            let ends =
                (to[0][i] >= 0.0) & (to[1][i] >= 0.0) & (to[0][i] <= width) & (to[1][i] <= height);
            cut[i] |= !(starts & ends & (length[i] < LONGEST) & there[i]);
        }
        chords
    }

    /// Cuts chords at the near plane.
    #[inline(never)]
    fn cut_near(
        &self,
        chords: &mut Chords,
        behind: &mut [bool; LANES],
        first: usize,
        count: usize,
        side: usize,
    ) {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let point = |i: usize| {
            let [x, y, z] = self.samples.points.each_ref().map(|l| l.get(i).copied());
            self.sight.camera(DVec3::new(
                x.unwrap_or(0.0),
                y.unwrap_or(0.0),
                sign * z.unwrap_or(0.0),
            ))
        };
        for i in 0..count.min(LANES) {
            let Some(ends) = beyond_near([point(first + i), point(first + i + 1)]) else {
                behind[i] = true;
                continue;
            };
            let [a, b] = ends.map(|p| self.sight.lens.point(p));
            [chords.from[0][i], chords.from[1][i], chords.from[2][i]] = [a.x, a.y, a.nearness];
            [chords.to[0][i], chords.to[1][i], chords.to[2][i]] = [b.x, b.y, b.nearness];
        }
    }

    /// Adds the visible pieces of chords on both sides: `both` if both sides of a chord
    /// may be seen, `smooth` for silhouettes.
    #[inline(always)]
    fn finish(
        &mut self,
        first: usize,
        sides: [Chords; 2],
        cut: [bool; LANES],
        both: bool,
        smooth: bool,
    ) {
        let [near, _] = &sides;
        let mut pieces = Pieces { tangent: near.tangent, slack: near.slack, ..Pieces::default() };
        for i in 0..LANES {
            for axis in 0..2 {
                pieces.at[axis][i] = 0.5 * (near.from[axis][i] + near.to[axis][i]);
            }
            pieces.depth[i] = self.sight.lens.depth(0.5 * (near.from[2][i] + near.to[2][i]));
            pieces.there[i] = near.there[i] & sides[1].there[i] & !cut[i];
        }
        let mut visible = self.visible(&pieces, both);
        if smooth {
            self.again(first, near, &pieces, both, &mut visible);
        }
        self.add(&sides, &visible);
        for i in 0..LANES {
            if cut[i] {
                for (side, chords) in sides.iter().enumerate() {
                    if chords.there[i] {
                        self.cut(first, chords, i, side, both, smooth);
                    }
                }
            }
        }
    }

    /// Which pieces are visible.
    #[inline(always)]
    fn visible(&self, pieces: &Pieces, both: bool) -> [bool; LANES] {
        let mut visible = [false; LANES];
        for (side, way) in [(0, BESIDE), (1, -BESIDE)] {
            let open = (0..LANES).any(|i| pieces.there[i] & !visible[i]);
            if !open || (side == 1 && !both) {
                break;
            }
            let (mut beside, mut to) = ([[0.0; LANES]; 2], [0.0; LANES]);
            for i in 0..LANES {
                beside[0][i] = pieces.at[0][i] + way * pieces.tangent[1][i];
                beside[1][i] = pieces.at[1][i] - way * pieces.tangent[0][i];
                let depth = pieces.depth[i];
                let limit = depth - pieces.slack[side][i] - TOLERANCE * self.extent - 1e-6 * depth;
                to[i] = if pieces.there[i] { limit } else { Camera::NEAR };
            }
            let rays = self.sight.rays([&beside[0], &beside[1]]);
            let met = self.spans.meets(&rays, [&[Camera::NEAR; LANES], &to]);
            for i in 0..LANES {
                visible[i] |= pieces.there[i] & !met[i];
            }
        }
        visible
    }

    /// Tests the hidden pieces of silhouettes again, with their slack.
    #[inline(always)]
    fn again(
        &self,
        first: usize,
        chords: &Chords,
        pieces: &Pieces,
        both: bool,
        visible: &mut [bool; LANES],
    ) {
        let mut again = *pieces;
        let mut any = false;
        for i in 0..LANES {
            again.there[i] = pieces.there[i] & !visible[i];
            if again.there[i] {
                let slack = self.slack(first + i, chords, i, 0);
                (again.slack[0][i], again.slack[1][i]) = (slack, slack);
                // Too little to matter.
                again.there[i] = slack > 0.1 * TOLERANCE * self.extent;
                any |= again.there[i];
            }
        }
        if any {
            let more = self.visible(&again, both);
            visible.iter_mut().zip(more).for_each(|(visible, more)| *visible |= more);
        }
    }

    /// How much nearer than a silhouette its own span reaches.
    #[inline(never)]
    fn slack(&self, sample: usize, chords: &Chords, i: usize, side: usize) -> f64 {
        let at = |list: &Vec<f64>| list.get(sample).copied().unwrap_or(0.0);
        let [x, _, z] = self.samples.points.each_ref().map(at);
        let r = libm::hypot(x, z);
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let angle = if r > 0.0 { [x / r, sign * z / r] } else { [1.0, 0.0] };
        let span = self.samples.spans.get(sample).copied().unwrap_or(LAST);
        let ends = [&chords.from, &chords.to].map(|p| [p[0][i], p[1][i], p[2][i]]);
        reach(self.surface, self.sight, span, angle, ends).min(SILHOUETTE_SLACK * self.extent)
    }

    /// Adds the pieces of chords that are single visible pieces, on both sides.
    #[inline(always)]
    fn add(&mut self, sides: &[Chords; 2], visible: &[bool; LANES]) {
        for chords in sides {
            let mut count = 0;
            let mut rows = [[0.0f32; LANES]; 5];
            for i in 0..LANES {
                // Overwritten by the next one unless this one counts.
                let at = count.min(LANES - 1);
                rows[0][at] = (0.5 * (chords.from[0][i] + chords.to[0][i])) as f32;
                rows[1][at] = (0.5 * (chords.from[1][i] + chords.to[1][i])) as f32;
                rows[2][at] = chords.tangent[0][i] as f32;
                rows[3][at] = chords.tangent[1][i] as f32;
                rows[4][at] = chords.length[i] as f32;
                count += usize::from(visible[i]);
            }
            let count = count.min(LANES);
            self.out.x.extend_from_slice(&rows[0][..count]);
            self.out.y.extend_from_slice(&rows[1][..count]);
            self.out.tx.extend_from_slice(&rows[2][..count]);
            self.out.ty.extend_from_slice(&rows[3][..count]);
            self.out.length.extend_from_slice(&rows[4][..count]);
        }
    }

    /// Adds the visible pieces of a chord that is long or leaves the image.
    #[inline(never)]
    fn cut(
        &mut self,
        first: usize,
        chords: &Chords,
        i: usize,
        side: usize,
        both: bool,
        smooth: bool,
    ) {
        let [a, b] =
            [&chords.from, &chords.to].map(|p| Point { x: p[0][i], y: p[1][i], nearness: p[2][i] });
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let inside =
            |p: &Point| p.x >= 0.0 && p.y >= 0.0 && p.x <= self.size[0] && p.y <= self.size[1];
        let part = match inside(&a) && inside(&b) {
            true => Some((0.0, 1.0)),
            false => clip(&a, [dx, dy], self.size),
        };
        let Some((t0, t1)) = part else { return };
        let length = chords.length[i] * (t1 - t0);
        if !(length > 1e-9 && length.is_finite()) {
            return;
        }
        let tangent = chords.tangent.map(|row| row[i]);
        let slack = match smooth {
            true => [self.slack(first + i, chords, i, side); 2],
            false => chords.slack.map(|row| row[i]),
        };
        let count = if length < LONGEST { 1.0 } else { (length + 0.5).floor() };
        let step = (t1 - t0) / count;
        for k in 0..count as usize {
            let t = t0 + step * (k as f64 + 0.5);
            let at = [a.x + dx * t, a.y + dy * t];
            let depth = self.sight.lens.depth(a.nearness + (b.nearness - a.nearness) * t);
            let mut piece = Pieces::default();
            for axis in 0..2 {
                (piece.at[axis][0], piece.tangent[axis][0]) = (at[axis], tangent[axis]);
                piece.slack[axis][0] = slack[axis];
            }
            (piece.depth[0], piece.there[0]) = (depth, depth.is_finite());
            if self.visible(&piece, both)[0] {
                let values = [at[0], at[1], tangent[0], tangent[1], length / count];
                let [x, y, tx, ty, length] = values.map(|v| v as f32);
                self.out.x.push(x);
                self.out.y.push(y);
                self.out.tx.push(tx);
                self.out.ty.push(ty);
                self.out.length.push(length);
            }
        }
    }
}

#[cfg(test)]
#[path = "contours_tests.rs"]
mod tests;
