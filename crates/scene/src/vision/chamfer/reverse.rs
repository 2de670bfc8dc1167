//! Exact and continuous distances from the observed contours to the rendered ones, by
//! means of buckets of elements. An evaluation fills a scratch and visits the observed
//! points; it does not render. Invariant: the result does not depend on the order of the
//! elements, and every candidate that could be the nearest is examined.

use super::super::elements::{Edge, Edges, channel, turn_between};
use crate::contours::ContourSlice;

/// Number of buckets along the longer side.
const BUCKETS: f32 = 12.0;

/// Maximum number of observed points that are measured. Of more points, every n-th in the
/// order of the buckets stands for its neighbours.
pub const MOST_OBSERVED: usize = 512;

/// Memory reused between evaluations.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    pieces: Vec<Piece>,
    sorted: Vec<Piece>,
    /// The start of each bucket in `sorted`, and finally the length of `sorted`.
    start: Vec<u32>,
    filled: Vec<Filled>,
    near: Vec<(f32, u32)>,
}

/// A non-empty bucket.
#[derive(Debug, Clone, Copy)]
struct Filled {
    bucket: u32,
    across: u16,
    down: u16,
    /// The lowest cost of a piece in it.
    cost: f32,
}

/// A piece of contour and its cost, in pixels, besides the distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub edge: Edge,
    cost: f32,
    /// The index of the element, for rendered pieces.
    pub index: u32,
}

impl Piece {
    /// The distance from an observed point, in pixels, with the costs of the piece and of
    /// the difference in orientation.
    #[inline(always)]
    pub fn away(&self, point: &Piece, turn: f32) -> f32 {
        let turned =
            if turn > 0.0 { turn * turn_between(self.edge.turn, point.edge.turn) } else { 0.0 };
        self.edge.distance(point.edge.x, point.edge.y) + turned + self.cost
    }
}

/// The pieces that are in view. An element partly in view costs up to a diagonal more, so
/// that elements do not appear suddenly.
#[inline(always)]
pub(super) fn pieces_of(elements: &ContourSlice<'_>, turn: f32) -> impl Iterator<Item = Piece> {
    let diagonal = elements.diagonal() as f32;
    elements.in_view().map(move |e| {
        let turn = if turn > 0.0 { channel(e.tx, e.ty) } else { 0.0 };
        let edge = Edge { x: e.x, y: e.y, tx: e.tx, ty: e.ty, half: 0.5 * e.length, turn };
        Piece { edge, cost: (1.0 - e.weight) * diagonal, index: e.index as u32 }
    })
}

/// The observed points sorted by bucket, in pixels of the frame.
#[derive(Debug, Clone)]
pub(super) struct Reverse {
    points: Vec<Piece>,
    /// Number of observed points that each point stands for.
    stands_for: f32,
    start: Vec<u32>,
    across: usize,
    down: usize,
    /// Side of a bucket in pixels.
    side: f32,
    /// Minimum and maximum distance in pixels between points of two buckets, by the
    /// number of rows and columns that separate the buckets.
    gaps: Vec<(f32, f32)>,
}

impl Reverse {
    /// Converts the observed points to pixels of the frame and sorts them.
    pub fn new(grid: &Edges, width: u32, height: u32) -> Self {
        let side = (width.max(height) as f32 / BUCKETS).max(1.0);
        let across = ((width as f32 / side).ceil() as usize).max(1);
        let down = ((height as f32 / side).ceil() as usize).max(1);
        let norm = |u: usize, v: usize| ((u * u + v * v) as f32).sqrt() * side;
        let gap = |v: usize, u: usize| {
            (norm(u.saturating_sub(1), v.saturating_sub(1)), norm(u + 1, v + 1))
        };
        let gaps = (0..down).flat_map(|v| (0..across).map(move |u| gap(v, u))).collect();
        let mut r = Reverse {
            points: Vec::new(),
            stands_for: 1.0,
            start: Vec::new(),
            across,
            down,
            side,
            gaps,
        };
        let (mut start, mut sorted) = (Vec::new(), Vec::new());
        let points: Vec<Piece> = grid
            .edges
            .iter()
            .map(|e| {
                let (tx, ty) = (e.tx / grid.sx, e.ty / grid.sy);
                let norm = (tx * tx + ty * ty).sqrt();
                let (x, y) = (e.x / grid.sx, e.y / grid.sy);
                let edge =
                    Edge { x, y, tx: tx / norm, ty: ty / norm, half: e.half * norm, turn: e.turn };
                Piece { edge, cost: 0.0, index: 0 }
            })
            .collect();
        r.sort(&points, &mut start, &mut sorted);
        if sorted.len() > MOST_OBSERVED {
            r.stands_for = sorted.len() as f32 / MOST_OBSERVED as f32;
            let few: Vec<Piece> =
                (0..MOST_OBSERVED).map(|i| sorted[i * sorted.len() / MOST_OBSERVED]).collect();
            r.sort(&few, &mut start, &mut sorted);
        }
        r.start = start;
        r.points = sorted;
        r
    }

    /// Counting sort by bucket: `start[b]..start[b + 1]` are the pieces of bucket `b`.
    fn sort(&self, pieces: &[Piece], start: &mut Vec<u32>, sorted: &mut Vec<Piece>) {
        let cells = self.across * self.down;
        start.clear();
        start.resize(cells + 2, 0);
        for p in pieces {
            start[self.bucket(&p.edge) + 2] += 1;
        }
        for b in 2..cells + 2 {
            start[b] += start[b - 1];
        }
        sorted.clear();
        sorted.extend_from_slice(pieces);
        for p in pieces {
            let place = &mut start[self.bucket(&p.edge) + 1];
            sorted[*place as usize] = *p;
            *place += 1;
        }
        start.truncate(cells + 1);
    }

    fn bucket(&self, p: &Edge) -> usize {
        let u = ((p.x / self.side).max(0.0) as usize).min(self.across - 1);
        let v = ((p.y / self.side).max(0.0) as usize).min(self.down - 1);
        v * self.across + u
    }

    /// Calls `f(length, distance, pair)` for every observed point in a fixed order, where
    /// length and distance are in pixels and the pair is the point and the piece nearest
    /// to it. `turn` is the cost in pixels of a difference of one orientation channel. With
    /// nothing in view, distances are infinite.
    pub fn each(
        &self,
        elements: &ContourSlice<'_>,
        turn: f32,
        scratch: &mut Scratch,
        mut f: impl FnMut(f32, f32, Option<[&Piece; 2]>),
    ) {
        let Scratch { pieces, sorted, start, filled, near } = scratch;
        pieces.clear();
        pieces.extend(pieces_of(elements, turn));
        // Pieces extend beyond their bucket by half their length, and by half a pixel at
        // the border.
        let slack = pieces.iter().map(|p| p.edge.half).fold(0.0, f32::max) + 1.0;
        self.sort(pieces, start, sorted);
        filled.clear();
        filled.extend((0..self.across * self.down).filter(|&b| start[b] < start[b + 1]).map(|b| {
            let held = &sorted[start[b] as usize..start[b + 1] as usize];
            let (across, down) = ((b % self.across) as u16, (b / self.across) as u16);
            let cost = held.iter().map(|p| p.cost).fold(f32::INFINITY, f32::min);
            Filled { bucket: b as u32, across, down, cost }
        }));
        for b in 0..self.across * self.down {
            let points = &self.points[self.start[b] as usize..self.start[b + 1] as usize];
            if points.is_empty() {
                continue;
            }
            let (across, down) = ((b % self.across) as u16, (b / self.across) as u16);
            let gap = |c: &Filled| {
                let (u, v) = (c.across.abs_diff(across), c.down.abs_diff(down));
                self.gaps[usize::from(v) * self.across + usize::from(u)]
            };
            let mut bound = f32::INFINITY;
            for c in filled.iter() {
                let most = gap(c).1 + c.cost;
                bound = if most < bound { most } else { bound };
            }
            let reach = bound + 4.0 * turn + 2.0 * slack;
            near.clear();
            near.extend(filled.iter().map(|c| (gap(c).0, c.bucket)).filter(|n| n.0 <= reach));
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for p in points {
                let (mut best, mut nearest) = (f32::INFINITY, None);
                for &(gap, c) in near.iter() {
                    if gap - slack > best {
                        break;
                    }
                    for e in &sorted[start[c as usize] as usize..start[c as usize + 1] as usize] {
                        let distance = e.away(p, turn);
                        if distance < best {
                            (best, nearest) = (distance, Some([p, e]));
                        }
                    }
                }
                f(self.length(p), best, nearest);
            }
        }
    }

    /// The observed points that are measured, in a fixed order.
    pub fn points(&self) -> &[Piece] {
        &self.points
    }

    /// The length in pixels that an observed point stands for.
    pub fn length(&self, point: &Piece) -> f32 {
        2.0 * point.edge.half * self.stands_for
    }
}
