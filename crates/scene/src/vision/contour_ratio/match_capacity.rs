//! How much rendered contour observed edges can match. Edges in one small cell of the
//! picture and of similar orientation form a group; the positive scores matched to a
//! group are scaled down once the contour assigned to it is longer than `match_capacity`
//! times the group's edges. The log ratios themselves are computed elsewhere. Invariant:
//! sums per group are exact integers, so the order of assignments does not matter, and
//! every matched score is a continuous function of the assigned lengths and scores.
//!
//! Edges are grouped, and not limited one by one, because a piece of contour at a coarse
//! resolution is longer than an edge pixel.

use super::super::elements::{CHANNELS, Edges};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Marks a cell that is not matched to any group.
pub(super) const NO_GROUP: u32 = u32::MAX;

/// Cells along the picture's longer side.
const CELLS: f32 = 64.0;

/// Fixed-point steps per percent of contour and per unit of score.
const FIXED: f64 = (1u64 << 32) as f64;

/// The groups of observed edges.
#[derive(Debug, Clone)]
pub(super) struct MatchCapacity {
    /// Group of every edge.
    group: Vec<u32>,
    /// The length of contour each group can match at full score, in percent of the
    /// diagonal.
    limit: Vec<f64>,
}

impl MatchCapacity {
    /// Groups edges into cells of at least one pixel of the frame (`pixel`, in grid
    /// units).
    pub fn new(grid: &Edges, pixel: f32, match_capacity: f64) -> Self {
        let side = (grid.width.max(grid.height) as f32 / CELLS).max(pixel);
        let mut numbers: FxHashMap<(u32, u32, u32), u32> = FxHashMap::default();
        let mut limit: Vec<f64> = Vec::new();
        // Groups are numbered in the order of the edges; the map is never iterated over.
        let group = grid
            .edges
            .iter()
            .map(|e| {
                let turn = (e.turn * 0.5).round() as u32 % (CHANNELS as u32 / 2);
                let key = ((e.x / side) as u32, (e.y / side) as u32, turn);
                let id = *numbers.entry(key).or_insert(limit.len() as u32);
                if id as usize == limit.len() {
                    limit.push(0.0);
                }
                limit[id as usize] += match_capacity * f64::from(2.0 * e.half * grid.percent);
                id
            })
            .collect();
        MatchCapacity { group, limit }
    }

    /// Returns the group of an edge.
    pub fn group(&self, edge: u32) -> u32 {
        self.group.get(edge as usize).copied().unwrap_or(NO_GROUP)
    }

    /// Returns the number of groups.
    pub fn groups(&self) -> usize {
        self.limit.len()
    }
}

/// The contour assigned to a group, and its matched score when last updated.
#[derive(Debug, Clone, Copy, Default)]
struct Assignment {
    length: i64,
    score: i64,
    matched: i64,
    /// Whether anything was ever assigned, and whether anything was since the last update
    /// of `matched`.
    known: bool,
    open: bool,
}

/// A state to return to.
pub(super) struct Savepoint {
    known: usize,
    matched: i64,
    total: i64,
    length: i64,
}

/// The assignments of some contours, to which pieces can be added and from which they can
/// be removed. Reused between evaluations.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    assignments: Vec<Assignment>,
    /// Groups that were ever assigned to.
    known: Vec<u32>,
    /// Groups assigned to since the last update of `matched`.
    open: Vec<u32>,
    matched: i64,
    /// Sum of length times score of unmatched contour, and total length of contour.
    pub(super) total: i64,
    pub(super) length: i64,
    /// Assignments as they were at the savepoint, and whether there is a savepoint.
    log: Vec<(u32, Assignment)>,
    marked: bool,
    /// Identifies the assigned contours, if known.
    pub(super) of: Option<Arc<()>>,
}

impl Scratch {
    /// Makes room for `groups`, all without assignments.
    pub(super) fn begin(&mut self, groups: usize) {
        for id in self.known.drain(..) {
            if let Some(assign) = self.assignments.get_mut(id as usize) {
                *assign = Assignment::default();
            }
        }
        if self.assignments.len() < groups {
            self.assignments.resize(groups, Assignment::default());
        }
        self.open.clear();
        (self.matched, self.total, self.length, self.of) = (0, 0, 0, None);
    }

    /// Adds (`sign` 1) or removes (-1) an assignment: a length of contour in percent and
    /// its unscaled score (length times log ratio).
    #[inline]
    pub(super) fn assign(&mut self, group: u32, length: f64, score: f64, sign: i64) {
        if let Some(assign) = self.assignments.get_mut(group as usize) {
            if !assign.open {
                if self.marked {
                    self.log.push((group, *assign));
                }
                assign.open = true;
                self.open.push(group);
                if !assign.known {
                    assign.known = true;
                    self.known.push(group);
                }
            }
            assign.length = assign.length.saturating_add(sign * ((length * FIXED) as i64).max(1));
            assign.score = assign.score.saturating_add(sign * (score * FIXED) as i64);
        }
    }

    /// Records the state to return to. All matches must have been scored before.
    pub(super) fn savepoint(&mut self) -> Savepoint {
        self.marked = true;
        Savepoint {
            known: self.known.len(),
            matched: self.matched,
            total: self.total,
            length: self.length,
        }
    }

    /// Returns to a savepoint. All matches must have been scored before.
    pub(super) fn restore(&mut self, savepoint: Savepoint) {
        for (group, before) in self.log.drain(..) {
            if let Some(assign) = self.assignments.get_mut(group as usize) {
                *assign = before;
            }
        }
        self.known.truncate(savepoint.known);
        self.marked = false;
        (self.matched, self.total, self.length) =
            (savepoint.matched, savepoint.total, savepoint.length);
    }

    /// Returns the derivative of a group's matched score with respect to the length of a
    /// piece with the given score per unit length.
    pub(super) fn slope(&self, capacity: &MatchCapacity, group: u32, score: f64) -> f64 {
        let (Some(assign), Some(&limit)) =
            (self.assignments.get(group as usize), capacity.limit.get(group as usize))
        else {
            return 0.0;
        };
        let length = assign.length as f64 / FIXED;
        if length > limit {
            limit / length * (score - assign.score as f64 / FIXED / length)
        } else {
            score
        }
    }

    /// Returns the total matched score. Each group's score is rounded to fixed point
    /// before they are added.
    pub(super) fn score_matches(&mut self, capacity: &MatchCapacity) -> f64 {
        for id in self.open.drain(..) {
            let (Some(assign), Some(&limit)) =
                (self.assignments.get_mut(id as usize), capacity.limit.get(id as usize))
            else {
                continue;
            };
            let limit = limit * FIXED;
            let matched = if assign.length as f64 > limit {
                (assign.score as f64 * (limit / assign.length as f64)) as i64
            } else {
                assign.score
            };
            self.matched = self.matched.saturating_add(matched - assign.matched);
            (assign.matched, assign.open) = (matched, false);
        }
        self.matched as f64 / FIXED
    }
}
