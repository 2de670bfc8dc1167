//! The visible pieces of the curves on a surface of revolution.
//!
//! Nearly all chords are a single piece in the image; the others are clipped and divided.
//! Invariant: pieces are finite, inside the image and at most 1.5 pixels long.

use super::chords::{Chords, Face, reach};
use super::lanes::{LANES, Mask, Row, any, mask, reversed};
use super::rays::Spans;
use super::samples::{LAST, Samples};
use super::sight::Sight;
use crate::contours::Contours;
use crate::geom::Revolution;
use crate::render::Camera;
use crate::render::lines::extraction::clip;
use crate::render::lines::visibility::{BESIDE, LONGEST, SILHOUETTE_SLACK, TOLERANCE};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::beyond_near;
use crate::render::simd::vectorised;
use glam::DVec3;

/// Draws the contours of a surface from samples of its curves.
pub(super) struct Drawer<'a> {
    pub surface: &'a Revolution,
    pub sight: &'a Sight,
    pub samples: &'a Samples,
    pub spans: &'a Spans,
    /// True if there are visible boundaries, so that the inside may be visible.
    pub open: bool,
    /// True if all of the surface is beyond the near plane.
    pub whole: bool,
    /// The depth range of the surface.
    pub extent: f64,
    /// Pixels across and down.
    pub size: [f64; 2],
    /// The number of pieces in `out`, whose lists are longer.
    pub count: usize,
    pub out: &'a mut Contours,
}

/// Pieces to be tested for visibility: middle, depth, unit tangent, and how much nearer
/// their own surface may reach on either side.
#[derive(Clone, Copy, Default)]
struct Pieces {
    at: [Row; 2],
    depth: Row,
    tangent: [Row; 2],
    slack: [Row; 2],
    there: Mask,
}

impl Drawer<'_> {
    /// Adds the visible pieces of silhouettes.
    #[inline(always)]
    pub fn silhouettes(&mut self) {
        let (samples, sight) = (self.samples, self.sight);
        let (mut sides, mut cut) = ([Chords::default(); 2], [0; LANES]);
        let mut first = 0;
        while first + 1 < samples.silhouettes {
            self.load(&mut sides, &mut cut, first, samples.silhouettes);
            let own = samples.spans.get(first..).and_then(|spans| spans.first_chunk::<LANES>());
            let own = own.unwrap_or(&[LAST; LANES]);
            let [near, far] = &mut sides;
            for i in 0..LANES {
                let joined = mask(own[i] != LAST);
                near.there[i] &= joined;
                far.there[i] &= joined;
            }
            let way = near.way(sight, samples, first, 0);
            near.turn(&way);
            // By symmetry, the other side runs the other way around.
            let back = match self.whole {
                true => reversed(&way),
                false => far.way(sight, samples, first, 1),
            };
            far.turn(&back);
            self.finish(first, &sides, &cut, self.open, true);
            first += LANES;
        }
    }

    /// Adds the visible pieces of sharp circles.
    #[inline(always)]
    pub fn rims(&mut self) {
        let (samples, sight) = (self.samples, self.sight);
        let (mut sides, mut cut) = ([Chords::default(); 2], [0; LANES]);
        for circle in &samples.circles {
            let Some(rim) = self.surface.rims().get(circle.rim) else { continue };
            let faces = Face::both(self.surface, rim, sight);
            let options = (self.open, self.extent);
            let mut first = circle.first;
            while first + 1 < circle.past {
                self.load(&mut sides, &mut cut, first, circle.past);
                let [near, far] = &mut sides;
                let way = near.rim_way(&faces, sight, samples, first, 0, options);
                near.turn(&way);
                let back = if self.whole {
                    far.slack = near.slack;
                    for i in 0..LANES {
                        far.there[i] &= near.there[i];
                    }
                    reversed(&way)
                } else {
                    far.rim_way(&faces, sight, samples, first, 1, options)
                };
                far.turn(&back);
                self.finish(first, &sides, &cut, true, false);
                first += LANES;
            }
        }
    }

    /// Loads the chords from some samples on both sides; `past` is one past the curve's
    /// last sample. Marks those that are not a single piece on both sides.
    #[inline(always)]
    fn load(&self, sides: &mut [Chords; 2], cut: &mut Mask, first: usize, past: usize) {
        *cut = [0; LANES];
        let count = past.saturating_sub(first + 1).min(LANES);
        let [width, height] = self.size;
        for (side, chords) in sides.iter_mut().enumerate() {
            chords.load(self.samples, first, side);
            let mut behind = [0; LANES];
            if !self.whole {
                self.cut_near(chords, &mut behind, first, count, side);
            }
            chords.measure(count);
            let Chords { from, to, length, there, .. } = chords;
            for i in 0..LANES {
                there[i] &= !behind[i];
                let starts = (from[0][i] >= 0.0)
                    & (from[1][i] >= 0.0)
                    & (from[0][i] <= width)
                    & (from[1][i] <= height);
                let ends = (to[0][i] >= 0.0)
                    & (to[1][i] >= 0.0)
                    & (to[0][i] <= width)
                    & (to[1][i] <= height);
                cut[i] |= mask(!(starts & ends & (length[i] < LONGEST))) | !there[i];
            }
        }
    }

    /// Cuts chords at the near plane.
    #[inline(never)]
    fn cut_near(
        &self,
        chords: &mut Chords,
        behind: &mut Mask,
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
                behind[i] = u64::MAX;
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
    fn finish(&mut self, first: usize, sides: &[Chords; 2], cut: &Mask, both: bool, smooth: bool) {
        let [near, far] = sides;
        let lens = self.sight.lens;
        let mut pieces = Pieces { tangent: near.tangent, slack: near.slack, ..Pieces::default() };
        for i in 0..LANES {
            pieces.at[0][i] = 0.5 * (near.from[0][i] + near.to[0][i]);
            pieces.at[1][i] = 0.5 * (near.from[1][i] + near.to[1][i]);
            pieces.depth[i] = lens.depth(0.5 * (near.from[2][i] + near.to[2][i]));
            pieces.there[i] = near.there[i] & far.there[i] & !cut[i];
        }
        if smooth {
            pieces.slack = [[0.0; LANES]; 2];
        }
        if any(&pieces.there) {
            let mut visible = self.visible(&pieces, both);
            if smooth {
                self.again(first, near, &pieces, both, &mut visible);
            }
            if any(&visible) {
                self.add(near, &visible);
                self.add(far, &visible);
            }
        }
        let mut parts = Parts::default();
        for (side, chords) in sides.iter().enumerate() {
            let mut divided = chords.there;
            for i in 0..LANES {
                divided[i] &= cut[i];
            }
            if !any(&divided) {
                continue;
            }
            let slack = if smooth { [self.slack(first, chords, side); 2] } else { chords.slack };
            for i in (0..LANES).filter(|i| divided[*i] != 0) {
                self.cut(&mut parts, i, chords, slack.map(|row| row[i]), both);
            }
        }
        if parts.count > 0 {
            self.add_parts(&mut parts, both);
        }
    }

    /// Which pieces are visible.
    #[inline(always)]
    fn visible(&self, pieces: &Pieces, both: bool) -> Mask {
        let mut visible = self.visible_beside(pieces, &pieces.there, 0, BESIDE);
        if both {
            let mut hidden = [0; LANES];
            for i in 0..LANES {
                hidden[i] = pieces.there[i] & !visible[i];
            }
            if any(&hidden) {
                let more = self.visible_beside(pieces, &hidden, 1, -BESIDE);
                for i in 0..LANES {
                    visible[i] |= more[i];
                }
            }
        }
        visible
    }

    /// Which of some pieces are visible, tested this far outward.
    #[inline(always)]
    fn visible_beside(&self, pieces: &Pieces, there: &Mask, side: usize, way: f64) -> Mask {
        let (mut beside, mut to) = ([[0.0; LANES]; 2], [0.0; LANES]);
        let tolerance = TOLERANCE * self.extent;
        let slack = &pieces.slack[side.min(1)];
        for i in 0..LANES {
            beside[0][i] = pieces.at[0][i] + way * pieces.tangent[1][i];
            beside[1][i] = pieces.at[1][i] - way * pieces.tangent[0][i];
            let depth = pieces.depth[i];
            let limit = depth - slack[i] - tolerance - 1e-6 * depth;
            to[i] = if there[i] != 0 { limit } else { Camera::NEAR };
        }
        let rays = self.sight.rays([&beside[0], &beside[1]]);
        let mut seen = self.spans.meets(&rays, [&[Camera::NEAR; LANES], &to]);
        for i in 0..LANES {
            seen[i] = there[i] & !seen[i];
        }
        seen
    }

    /// Tests the hidden pieces of silhouettes again, with their slack.
    #[inline(always)]
    fn again(
        &self,
        first: usize,
        chords: &Chords,
        pieces: &Pieces,
        both: bool,
        visible: &mut Mask,
    ) {
        let mut hidden = [0; LANES];
        for i in 0..LANES {
            hidden[i] = pieces.there[i] & !visible[i];
        }
        if !any(&hidden) {
            return;
        }
        let slack = self.slack(first, chords, 0);
        let mut again = Pieces { slack: [slack; 2], there: hidden, ..*pieces };
        for i in 0..LANES {
            // Others are too little to matter.
            again.there[i] &= mask(slack[i] > 0.1 * TOLERANCE * self.extent);
        }
        if any(&again.there) {
            let more = self.visible(&again, both);
            for i in 0..LANES {
                visible[i] |= more[i];
            }
        }
    }

    /// How much nearer than silhouettes from a sample on their own spans reach.
    #[inline(always)]
    fn slack(&self, first: usize, chords: &Chords, side: usize) -> Row {
        let most = SILHOUETTE_SLACK * self.extent;
        reach(self.surface, self.sight, self.samples, first, chords, side).map(|r| r.min(most))
    }

    /// Adds chords that are single visible pieces.
    #[inline(always)]
    fn add(&mut self, chords: &Chords, visible: &Mask) {
        let (mut x, mut y, mut tx, mut ty, mut length) =
            ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            x[i] = (0.5 * (chords.from[0][i] + chords.to[0][i])) as f32;
            y[i] = (0.5 * (chords.from[1][i] + chords.to[1][i])) as f32;
            (tx[i], ty[i]) = (chords.tangent[0][i] as f32, chords.tangent[1][i] as f32);
            length[i] = chords.length[i] as f32;
        }
        if *visible == [u64::MAX; LANES] {
            return self.write([&x, &y, &tx, &ty, &length], LANES);
        }
        let mut count = 0;
        for i in 0..LANES {
            if visible[i] != 0 {
                let at = count.min(i);
                (x[at], y[at], tx[at], ty[at], length[at]) = (x[i], y[i], tx[i], ty[i], length[i]);
                count += 1;
            }
        }
        self.write([&x, &y, &tx, &ty, &length], count);
    }

    /// Adds the first `count` of some pieces.
    #[inline(always)]
    fn write(&mut self, rows: [&[f32; LANES]; 5], count: usize) {
        if self.out.x.len() < self.count + LANES {
            self.grow();
        }
        let at = self.count;
        let Contours { x, y, tx, ty, length, .. } = &mut *self.out;
        put(x, at, rows[0]);
        put(y, at, rows[1]);
        put(tx, at, rows[2]);
        put(ty, at, rows[3]);
        put(length, at, rows[4]);
        self.count += count;
    }

    #[inline(never)]
    fn grow(&mut self) {
        let needed = 2 * self.count + 2 * self.samples.count + LANES;
        let Contours { x, y, tx, ty, length, .. } = &mut *self.out;
        [x, y, tx, ty, length].into_iter().for_each(|list| list.resize(needed, 0.0));
    }

    /// The pieces found.
    pub fn pieces(self, camera: &Camera) -> Contours {
        let Contours { x, y, tx, ty, length, .. } = &*self.out;
        let [x, y, tx, ty, length] =
            [x, y, tx, ty, length].map(|list| list.get(..self.count).unwrap_or(list).to_vec());
        Contours { x, y, tx, ty, length, width: camera.width, height: camera.height }
    }

    /// Divides a chord that is long or leaves the image, and adds the visible pieces once there
    /// are enough to test.
    #[inline(never)]
    fn cut(&mut self, parts: &mut Parts, i: usize, chords: &Chords, slack: [f64; 2], both: bool) {
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
        let count = if length < LONGEST { 1.0 } else { (length + 0.5).floor() };
        let step = (t1 - t0) / count;
        for k in 0..count as usize {
            let t = t0 + step * (k as f64 + 0.5);
            let at = [a.x + dx * t, a.y + dy * t];
            let depth = self.sight.lens.depth(a.nearness + (b.nearness - a.nearness) * t);
            parts.add(at, tangent, slack, depth, length / count);
            if parts.count == LANES {
                self.add_parts(parts, both);
            }
        }
    }

    /// Adds the visible ones of some pieces, and forgets all.
    fn add_parts(&mut self, parts: &mut Parts, both: bool) {
        let visible = vectorised(
            #[inline(always)]
            || self.visible(&parts.pieces, both),
        );
        let Pieces { at, tangent, .. } = &parts.pieces;
        for (i, visible) in visible.iter().enumerate() {
            if *visible != 0 {
                let values = [at[0][i], at[1][i], tangent[0][i], tangent[1][i], parts.length[i]];
                let rows = values.map(|v| [v as f32; LANES]);
                self.write(rows.each_ref(), 1);
            }
        }
        *parts = Parts::default();
    }
}

/// Pieces of divided chords.
#[derive(Default)]
struct Parts {
    pieces: Pieces,
    length: Row,
    count: usize,
}

impl Parts {
    /// Adds a piece, for which there is room.
    fn add(&mut self, at: [f64; 2], tangent: [f64; 2], slack: [f64; 2], depth: f64, length: f64) {
        let (i, pieces) = (self.count % LANES, &mut self.pieces);
        for axis in 0..2 {
            (pieces.at[axis][i], pieces.tangent[axis][i]) = (at[axis], tangent[axis]);
            pieces.slack[axis][i] = slack[axis];
        }
        (pieces.depth[i], pieces.there[i]) = (depth, mask(depth.is_finite()));
        self.length[i] = length;
        self.count += 1;
    }
}

#[inline(always)]
fn put(list: &mut [f32], at: usize, row: &[f32; LANES]) {
    if let Some(place) = list.get_mut(at..).and_then(|list| list.first_chunk_mut()) {
        *place = *row;
    }
}
