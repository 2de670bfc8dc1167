//! Distances from the observed points to the contours that stay, kept while some of their
//! pieces appear and vanish. Only points whose nearest piece has vanished are searched
//! again, and pieces are measured only from points to which they may be the nearest.
//!
//! Invariant: distances are those of [`Reverse::each`], bit for bit. The least of several
//! distances does not depend on the order in which they are compared, and nothing that
//! could be nearer is left out.

use super::super::elements::Edge;
use super::reverse::{Piece, Reverse, pieces_of};
use crate::contours::ContourSlice;

/// The number of pieces that a cell holds on average, and the greatest number of cells
/// along a side.
const PER_CELL: f32 = 4.0;
const MOST_CELLS: f32 = 128.0;

/// In pixels: half a pixel by which a piece may lie outside of the border's cells, and much
/// more than the rounding of a distance.
const MARGIN: f32 = 0.75;

/// The distance of a point whose nearest piece has vanished.
const LOST: f32 = -1.0;

/// The pieces that stay, and the distances to them. Belongs to one comparator.
#[derive(Debug, Clone, Default)]
pub(super) struct Stationary {
    cells: Cells,
    points: Points,
    /// For each observed point, the distance to the nearest piece.
    least: Vec<f32>,
    /// Scratch memory: points to search again, and distances with what moves.
    lost: Vec<u32>,
    now: Vec<f32>,
}

impl Stationary {
    /// Starts from all pieces without those that move.
    pub fn begin(
        &mut self,
        reverse: &Reverse,
        whole: &ContourSlice<'_>,
        moving: &ContourSlice<'_>,
        turn: f32,
    ) {
        let Stationary { cells, points, least, .. } = self;
        cells.clear(whole.width, whole.height, whole.len());
        let mut half = 0.0f32;
        for piece in pieces_of(whole, turn) {
            cells.add(&piece);
            half = half.max(piece.edge.half);
        }
        pieces_of(moving, turn).for_each(|piece| cells.remove(&piece));
        least.clear();
        least.extend(reverse.points().iter().map(|p| cells.nearest(p, turn, half + MARGIN)));
        points.begin(cells, reverse.points(), least, half);
    }

    /// Follows a change of the pieces that stay.
    pub fn follow(
        &mut self,
        reverse: &Reverse,
        [removed, added]: [ContourSlice<'_>; 2],
        turn: f32,
    ) {
        let Stationary { cells, points, least, lost, .. } = self;
        lost.clear();
        for piece in pieces_of(&removed, turn) {
            cells.remove(&piece);
            points.measure(&piece, cells, reverse, turn, least, |point, distance, least| {
                if distance <= *least {
                    *least = LOST;
                    lost.push(point);
                }
            });
        }
        for piece in pieces_of(&added, turn) {
            cells.add(&piece);
            if piece.edge.half > points.half {
                points.begin(cells, reverse.points(), least, piece.edge.half);
            }
            points.measure(&piece, cells, reverse, turn, least, nearer);
        }
        for point in lost.iter().map(|point| *point as usize) {
            if let (Some(p), Some(least)) = (reverse.points().get(point), least.get_mut(point)) {
                *least = cells.nearest(p, turn, points.half + MARGIN);
                points.reach(cells, point, p, *least);
            }
        }
        if points.listed > 2 * points.first + 1024 {
            points.begin(cells, reverse.points(), least, points.half);
        }
    }

    /// For each observed point, the distance to the nearest of the pieces that stay and of
    /// those that move.
    pub fn with_moving(
        &mut self,
        reverse: &Reverse,
        moving: &ContourSlice<'_>,
        turn: f32,
    ) -> &[f32] {
        let Stationary { cells, points, least, now, .. } = self;
        now.clone_from(least);
        for piece in pieces_of(moving, turn) {
            if piece.edge.half > points.half {
                points.begin(cells, reverse.points(), least, piece.edge.half);
            }
            points.measure(&piece, cells, reverse, turn, now, nearer);
        }
        now
    }
}

#[inline(always)]
fn nearer(_: u32, distance: f32, least: &mut f32) {
    if distance < *least {
        *least = distance;
    }
}

/// The observed points to which a piece may be the nearest, by the cell of the piece.
#[derive(Debug, Clone, Default)]
struct Points {
    cells: Vec<Vec<u32>>,
    /// For each point, the distance at least up to which it is listed in all cells.
    listed_to: Vec<f32>,
    /// Half the length of the longest piece.
    half: f32,
    /// The number of entries, now and at the beginning.
    listed: usize,
    first: usize,
}

impl Points {
    /// Lists all points, given the distances to their nearest pieces.
    fn begin(&mut self, cells: &Cells, points: &[Piece], least: &[f32], half: f32) {
        self.cells.iter_mut().for_each(Vec::clear);
        self.cells.resize(cells.across * cells.down, Vec::new());
        self.listed_to.clear();
        self.listed_to.resize(points.len(), f32::NEG_INFINITY);
        (self.half, self.listed) = (half, 0);
        for (point, (p, least)) in points.iter().zip(least).enumerate() {
            self.reach(cells, point, p, *least);
        }
        self.first = self.listed;
    }

    /// Lists a point in the cells of all pieces that may be as near as `least`.
    fn reach(&mut self, cells: &Cells, point: usize, p: &Piece, least: f32) {
        let Some(known) = self.listed_to.get_mut(point).filter(|known| **known < least) else {
            return;
        };
        let around = |least: f32| {
            let reach = least + self.half + MARGIN;
            let (x, y) = (p.edge.x, p.edge.y);
            [cells.place(x - reach, y - reach), cells.place(x + reach, y + reach)]
        };
        let ([from, to], before) = (around(least), *known);
        let listed = (before > f32::NEG_INFINITY).then(|| around(before));
        let is_listed = |u: usize, v: usize| {
            listed.is_some_and(|[from, to]| {
                (from[0]..=to[0]).contains(&u) && (from[1]..=to[1]).contains(&v)
            })
        };
        for v in from[1]..=to[1] {
            for u in from[0]..=to[0] {
                if !is_listed(u, v)
                    && let Some(cell) = self.cells.get_mut(v * cells.across + u)
                {
                    cell.push(point as u32);
                    self.listed += 1;
                }
            }
        }
        *known = least;
    }

    /// Measures a piece from all points from which it may be as near as `least`. Calls
    /// `f(point, distance, least of the point)`.
    #[inline(always)]
    fn measure(
        &self,
        piece: &Piece,
        cells: &Cells,
        reverse: &Reverse,
        turn: f32,
        least: &mut [f32],
        mut f: impl FnMut(u32, f32, &mut f32),
    ) {
        let slack = piece.edge.half + MARGIN;
        for point in self.cells.get(cells.index(&piece.edge)).into_iter().flatten() {
            let at = *point as usize;
            let (Some(p), Some(least)) = (reverse.points().get(at), least.get_mut(at)) else {
                continue;
            };
            let limit = *least + slack;
            if (p.edge.x - piece.edge.x).abs() <= limit && (p.edge.y - piece.edge.y).abs() <= limit
            {
                f(*point, piece.away(p, turn), least);
            }
        }
    }
}

/// Pieces by the square cell of the picture that contains their middle.
#[derive(Debug, Clone, Default)]
struct Cells {
    cells: Vec<Vec<Piece>>,
    across: usize,
    down: usize,
    /// Side of a cell in pixels.
    side: f32,
}

impl Cells {
    /// Removes all pieces, and makes cells for about as many as `count`.
    fn clear(&mut self, width: u32, height: u32, count: usize) {
        let (w, h) = (width as f32, height as f32);
        let side = (w * h * PER_CELL / count.max(1) as f32).sqrt();
        self.side = side.max(w.max(h) / MOST_CELLS).max(1.0);
        let cells = |v: f32| ((v / self.side).ceil() as usize).max(1);
        (self.across, self.down) = (cells(w), cells(h));
        self.cells.iter_mut().for_each(Vec::clear);
        self.cells.resize(self.across * self.down, Vec::new());
    }

    /// The column and row of the cell of a position; of the nearest one if it is outside.
    fn place(&self, x: f32, y: f32) -> [usize; 2] {
        let index = |v: f32, count: usize| ((v / self.side).max(0.0) as usize).min(count - 1);
        [index(x, self.across), index(y, self.down)]
    }

    /// The index of the cell of a piece.
    fn index(&self, edge: &Edge) -> usize {
        let [u, v] = self.place(edge.x, edge.y);
        v * self.across + u
    }

    fn cell(&mut self, piece: &Piece) -> Option<&mut Vec<Piece>> {
        let index = self.index(&piece.edge);
        self.cells.get_mut(index)
    }

    fn add(&mut self, piece: &Piece) {
        if let Some(cell) = self.cell(piece) {
            cell.push(*piece);
        }
    }

    fn remove(&mut self, piece: &Piece) {
        if let Some(cell) = self.cell(piece)
            && let Some(at) = cell.iter().position(|other| other.edge == piece.edge)
        {
            cell.swap_remove(at);
        }
    }

    /// The distance from a point to the nearest piece, where no piece reaches farther than
    /// `slack` out of its cell; infinite if there are no pieces.
    fn nearest(&self, p: &Piece, turn: f32, slack: f32) -> f32 {
        let (x, y) = (p.edge.x, p.edge.y);
        let [u, v] = self.place(x, y);
        // From the point to the nearest side of its own cell.
        let inside = |at: f32, cell: usize| {
            let from = at - cell as f32 * self.side;
            from.min(self.side - from)
        };
        let own = inside(x, u).min(inside(y, v));
        let mut least = self.nearest_in(u, v, p, turn, f32::INFINITY);
        // Rings of cells around it, the nearest ones first.
        for ring in 1..self.across.max(self.down) {
            if (ring - 1) as f32 * self.side + own - slack > least {
                break;
            }
            let columns = u.saturating_sub(ring)..(u + ring + 1).min(self.across);
            let sides = [u.checked_sub(ring), Some(u + ring).filter(|u| *u < self.across)];
            for row in v.saturating_sub(ring)..(v + ring + 1).min(self.down) {
                if row + ring == v || row == v + ring {
                    for column in columns.clone() {
                        least = self.nearest_in(column, row, p, turn, least);
                    }
                } else {
                    for column in sides.into_iter().flatten() {
                        least = self.nearest_in(column, row, p, turn, least);
                    }
                }
            }
        }
        least
    }

    /// The least of a number and the distances from a point to the pieces in a cell.
    #[inline]
    fn nearest_in(&self, u: usize, v: usize, p: &Piece, turn: f32, mut least: f32) -> f32 {
        for piece in self.cells.get(v * self.across + u).into_iter().flatten() {
            nearer(0, piece.away(p, turn), &mut least);
        }
        least
    }
}
