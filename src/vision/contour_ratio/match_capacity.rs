//! How often observed edges pay: edges in one small cell of the picture and of like
//! orientation form a group, whose positive scores are scaled down once the contour that
//! claims them is longer than `match_capacity` times the edges themselves. It scores nothing.
//! Invariant: exact integer sums per group, so the order of the claims has no influence,
//! and every share is a continuous function of the claims.
//!
//! Groups, and not single edge pixels, because a piece of contour at a coarse resolution
//! is longer than an edge pixel.

use super::super::field::{CHANNELS, Edges};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Where nothing pays.
pub(super) const NO_GROUP: u32 = u32::MAX;

/// Cells along the picture's longer side.
const CELLS: f32 = 64.0;

/// Steps per percent of contour and per unit of score.
const FIXED: f64 = (1u64 << 32) as f64;

/// The groups of observed edges.
#[derive(Debug, Clone)]
pub(super) struct MatchCapacity {
    /// Group of every edge.
    group: Vec<u32>,
    /// The length each group pays for, in percent of the diagonal.
    limit: Vec<f64>,
}

impl MatchCapacity {
    /// Groups edges; a cell is no smaller than a pixel of the frame (`pixel`, in grid
    /// units).
    pub fn new(grid: &Edges, pixel: f32, match_capacity: f64) -> Self {
        let side = (grid.width.max(grid.height) as f32 / CELLS).max(pixel);
        let mut numbers: FxHashMap<(u32, u32, u32), u32> = FxHashMap::default();
        let mut limit: Vec<f64> = Vec::new();
        // Numbers are given in the order of the edges; the map is only looked up.
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

    /// The group of an edge.
    pub fn group(&self, edge: u32) -> u32 {
        self.group.get(edge as usize).copied().unwrap_or(NO_GROUP)
    }

    /// The number of groups.
    pub fn groups(&self) -> usize {
        self.limit.len()
    }
}

/// What a group was asked for, and what it paid when that was settled last.
#[derive(Debug, Clone, Copy, Default)]
struct Assignment {
    length: i64,
    score: i64,
    matched: i64,
    /// Whether it was ever asked, and whether so since it was settled.
    known: bool,
    open: bool,
}

/// A state to come back to.
pub(super) struct Savepoint {
    known: usize,
    matched: i64,
    total: i64,
    length: i64,
}

/// The claims of some contour, of which pieces may come and go. Reused from evaluation to
/// evaluation.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    assignments: Vec<Assignment>,
    /// Groups that were ever asked.
    known: Vec<u32>,
    /// Groups asked since the last settlement.
    open: Vec<u32>,
    matched: i64,
    /// Length times score of what no group pays for, and length.
    pub(super) total: i64,
    pub(super) length: i64,
    /// Claims as they were at the mark, and whether there is one.
    log: Vec<(u32, Assignment)>,
    marked: bool,
    /// The contours whose claims these are, if they have a name.
    pub(super) of: Option<Arc<()>>,
}

impl Scratch {
    /// Makes room for `groups`, all unclaimed.
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

    /// Adds a claim (`sign` 1) or takes it back (-1): a length of contour in percent and
    /// the score (length times log ratio) it would bring.
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

    /// Marks a settled state to come back to.
    pub(super) fn savepoint(&mut self) -> Savepoint {
        self.marked = true;
        Savepoint {
            known: self.known.len(),
            matched: self.matched,
            total: self.total,
            length: self.length,
        }
    }

    /// Goes back to a mark, once all is settled.
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

    /// What a group pays for one more unit of length that would bring `score` for each.
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

    /// The scores paid. Each group's is rounded to the fixed point before they are added.
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
