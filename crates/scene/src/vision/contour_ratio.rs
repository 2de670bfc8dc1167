//! Contours as a log-likelihood ratio: how much better each rendered piece explains the
//! observed edges near it than the background density of edges around it does. This is
//! the default contour score for photographs. It is a pseudo-likelihood, because
//! neighbouring pieces are not independent (hence the weight), and it has no sampler.
//! Everything except the match capacity is tabulated when the comparator is prepared, so
//! an evaluation only reads a table. Invariant: scores are finite, continuous in
//! positions and orientations, and exactly independent of the order of the elements.
//!
//! For a piece at distance d (percent of the diagonal) from the nearest observed edge of
//! similar orientation, `s = ln((0.75 f(d) + 0.25 b(d)) / b(d))`, where f is a
//! half-normal density and b the density of that distance over the points of a window
//! around the piece. A piece far from every edge scores ln 0.25; one in dense texture
//! about 0.

mod background;
mod places;

use self::background::scores;
use self::places::{AT_A_TIME, Places};
use super::elements::{CHANNELS, Edge, Edges, channels_of, turn_between};
use super::elements::{ComparatorError, PER_RADIAN, check};
use super::pictures::contour_map::ContourMap;
use crate::contours::{ContourChange, ContourSlice};
use pcadlang_numerics::num::simd::vectorised;
use pcadlang_numerics::platform::threads::side_by_side;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Options of [`ContourRatio`]. Lengths are percent of the image
/// diagonal. The defaults were chosen on ten pictures of 256 x 256 pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourRatioOptions {
    /// Fraction of pieces that have a matching observed edge, above 0 and below 1.
    /// Default 0.75.
    pub foreground: f64,
    /// Standard deviation of the half-normal distance of those pieces, above 0. Default
    /// 0.4.
    pub sd: f64,
    /// Distances from this value on count as "no edge nearby", above 0. Default 3.3.
    pub truncate: f64,
    /// Side of the window around a piece from which the background density is estimated,
    /// as a fraction of the picture's sides, above 0 and at most 2. Default 0.25.
    pub window: f64,
    /// Length of rendered contour that observed edges match at full score, as a multiple
    /// of their own length, above 0. Default 2.
    pub credit: f64,
    /// Power to which the likelihood ratio of a `unit` of contour is raised, at least 0.
    /// Default 0.5.
    pub weight: f64,
    /// Length of contour that counts as one observation, above 0. Default 0.5524: two
    /// pixels of a 256 x 256 picture.
    pub unit: f64,
    /// Length of contour in view (percent of the diagonal, above 0) below which a penalty
    /// applies, linear in the missing length. Default 10.
    pub least: f64,
    /// The penalty with nothing in view, as the length of contour far from every edge
    /// that has the same score; at least 0. Default 1000: ten diagonals.
    pub nothing: f64,
}

impl ContourRatioOptions {
    /// The defaults.
    pub const USUAL: ContourRatioOptions = ContourRatioOptions {
        foreground: 0.75,
        sd: 0.4,
        truncate: 3.3,
        window: 0.25,
        credit: 2.0,
        weight: 0.5,
        unit: 200.0 / (256.0 * std::f64::consts::SQRT_2),
        least: 10.0,
        nothing: 1000.0,
    };
}

impl Default for ContourRatioOptions {
    fn default() -> Self {
        ContourRatioOptions::USUAL
    }
}

impl ContourRatioOptions {
    pub(super) fn check(&self) -> Result<(), ComparatorError> {
        check(
            "foreground",
            "above 0 and below 1",
            self.foreground,
            self.foreground > 0.0 && self.foreground < 1.0,
        )?;
        check("sd", "above 0", self.sd, self.sd > 0.0)?;
        check("truncate", "above 0", self.truncate, self.truncate > 0.0)?;
        check(
            "window",
            "above 0 and at most 2",
            self.window,
            self.window > 0.0 && self.window <= 2.0,
        )?;
        check("credit", "above 0", self.credit, self.credit > 0.0)?;
        check("weight", "at least 0", self.weight, self.weight >= 0.0)?;
        check("unit", "above 0", self.unit, self.unit > 0.0)?;
        check("least", "above 0", self.least, self.least > 0.0)?;
        check("nothing", "at least 0", self.nothing, self.nothing >= 0.0)
    }
}

/// A sample of the grid, for one orientation channel.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Log ratio of a piece here.
    score: f32,
    /// The group of observed edges that it is matched to, if the score is above 0.
    group: u32,
}

impl Cell {
    const NOTHING: Cell = Cell { score: 0.0, group: NO_GROUP };
}

/// Observed contours, prepared for scoring many rendered ones.
#[derive(Debug, Clone)]
pub struct ContourRatio {
    options: ContourRatioOptions,
    grid: Edges,
    /// The cells of one orientation channel after another, each laid out like the grid.
    cells: Vec<Cell>,
    capacity: MatchCapacity,
    /// Percent of the diagonal per pixel of the frame.
    percent: f64,
}

/// Fixed-point steps per unit, for exact sums.
const FIXED: f64 = (1u64 << 32) as f64;

/// The greatest length of a piece that counts, in percent of the diagonal. No picture shows a
/// longer one.
const LONGEST: f64 = 1e3;

/// Rounds to fixed point what one piece of at most [`LONGEST`] gives.
#[inline(always)]
fn fixed(v: f64) -> i64 {
    // In a sum with 1.5 * 2^52 the unit is the last bit.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (v * FIXED + SHIFT).to_bits() as i64 - SHIFT.to_bits() as i64
}

impl ContourRatio {
    /// Prepares the observed contours for frames of `width` x `height` pixels. With no
    /// observed contours every piece scores ln(1 - foreground).
    ///
    /// # Errors
    /// A side outside 1 to 16384 pixels, an option out of its range, or a map whose lists
    /// differ in length.
    pub fn prepare(
        map: &ContourMap,
        width: u32,
        height: u32,
        options: &ContourRatioOptions,
    ) -> Result<Self, ComparatorError> {
        options.check()?;
        let grid = Edges::new(map, width, height)?;
        let samples = grid.width as usize * grid.height as usize;
        let frame_pixel = grid.sx.max(grid.sy);
        let capacity = MatchCapacity::new(&grid, frame_pixel, options.credit);
        let none = Cell { score: libm::log(1.0 - options.foreground) as f32, group: NO_GROUP };
        let mut cells = vec![none; samples * CHANNELS];
        side_by_side(cells.chunks_exact_mut(samples), |k, out| {
            // A channel holds the edges within one channel's width, so both channels next
            // to an element's orientation contain an edge of that orientation.
            let near = |e: &Edge| turn_between(e.turn, k as f32) <= 1.0;
            let Some(nearest) = grid.nearest_within(options.truncate, near) else { return };
            let scores = scores(&grid, &nearest.distance, options);
            for ((cell, score), &edge) in out.iter_mut().zip(scores).zip(&nearest.edge) {
                *cell = Cell {
                    score,
                    group: if score > 0.0 { capacity.group(edge) } else { NO_GROUP },
                };
            }
        });
        let percent = 100.0 / super::elements::diagonal(width, height);
        Ok(ContourRatio { options: options.clone(), grid, cells, capacity, percent })
    }

    /// The options it was prepared with.
    pub fn options(&self) -> &ContourRatioOptions {
        &self.options
    }

    /// Returns the weighted log-likelihood ratio: above 0 if the rendered contours
    /// explain the observed ones better than chance. With nothing in view it is that of
    /// `nothing` percent of contour without a nearby edge (-1254.9 with the defaults),
    /// which is below any ordinary contour; with at least `least` percent of contour in
    /// view there is no penalty.
    pub fn log_likelihood(&self, elements: &ContourSlice<'_>) -> f64 {
        self.log_likelihood_with(elements, &mut Scratch::default())
    }

    /// [`ContourRatio::log_likelihood`] without allocation once the scratch has grown.
    pub fn log_likelihood_with(&self, elements: &ContourSlice<'_>, scratch: &mut Scratch) -> f64 {
        scratch.begin(self.capacity.groups());
        self.count(elements, 1.0, scratch);
        self.score(scratch)
    }

    /// Returns the [`ContourRatio::log_likelihood`] after a change of the contours, bit
    /// for bit. If the scratch holds the state before the change, only the changes are
    /// counted; otherwise `whole` must give all contours. A scratch belongs to one
    /// comparator.
    pub fn log_likelihood_after<'a>(
        &self,
        step: &ContourChange,
        whole: impl FnOnce() -> ContourSlice<'a>,
        scratch: &mut Scratch,
    ) -> f64 {
        if step.all_move() {
            return self.log_likelihood_with(&step.moving.slice(), scratch);
        }
        if !step.leads_to(scratch.of.as_ref()) {
            if step.follows(scratch.of.as_ref()) {
                self.count(&step.removed.slice(), -1.0, scratch);
                self.count(&step.added.slice(), 1.0, scratch);
            } else {
                scratch.begin(self.capacity.groups());
                self.count(&whole(), 1.0, scratch);
                self.count(&step.moving.slice(), -1.0, scratch);
            }
            scratch.of = Some(step.to.clone());
        }
        scratch.score_matches(&self.capacity);
        let before = scratch.savepoint();
        self.count(&step.moving.slice(), 1.0, scratch);
        let score = self.score(scratch);
        scratch.restore(before);
        score
    }

    /// Adds (`sign` 1) or subtracts (-1) the contributions of elements.
    fn count(&self, elements: &ContourSlice<'_>, sign: f64, scratch: &mut Scratch) {
        vectorised(
            #[inline(always)]
            || {
                let mut places = Places::default();
                let mut first = 0;
                while first < elements.len() {
                    places.set(&self.grid, elements, first);
                    self.count_placed(&places, sign, scratch);
                    first += AT_A_TIME;
                }
            },
        );
    }

    #[inline(always)]
    fn count_placed(&self, places: &Places, sign: f64, scratch: &mut Scratch) {
        let samples = self.grid.width as usize * self.grid.height as usize;
        let [right, below] = self.grid.steps();
        // Integer sums are exact: a sum of individually rounded terms does not depend on
        // their order. A term is what one element gives to a group, or to none.
        let (mut total, mut length) = (scratch.total, scratch.length);
        for i in 0..AT_A_TIME {
            if places.length[i] <= 0.0 {
                continue;
            }
            let weight = sign * (f64::from(places.length[i]) * self.percent).min(LONGEST);
            length = length.saturating_add(fixed(weight));
            let low = places.channel[i] as usize;
            let high = if low + 1 < CHANNELS { low + 1 } else { 0 };
            let mut cells = [Cell::NOTHING; 8];
            for (cells, k) in cells.chunks_exact_mut(4).zip([low, high]) {
                let first = k * samples + places.first[i] as usize;
                let around = [first, first + right, first + below, first + below + right];
                for (cell, at) in cells.iter_mut().zip(around) {
                    *cell = self.cells.get(at).copied().unwrap_or(Cell::NOTHING);
                }
            }
            let group = cells[0].group;
            let other = cells.iter().fold(0, |other, c| other | (c.group ^ group));
            let shares = places.shares(i);
            // Nearly everywhere they are of one group.
            let unmatched = if other != 0 {
                scratch.share(&cells, &shares, weight)
            } else {
                let score = cells.iter().zip(&shares).fold(0.0, |sum, (c, s)| sum + c.score * s);
                let score = fixed(weight * f64::from(score));
                if group == NO_GROUP {
                    score
                } else {
                    scratch.assign(group, [fixed(weight), score]);
                    0
                }
            };
            total = total.saturating_add(unmatched);
        }
        (scratch.total, scratch.length) = (total, length);
    }

    /// Returns the score of the elements counted so far.
    fn score(&self, scratch: &mut Scratch) -> f64 {
        let evidence = scratch.total as f64 / FIXED + scratch.score_matches(&self.capacity);
        let length = scratch.length as f64 / FIXED;
        let missing = (1.0 - length / self.options.least).max(0.0);
        let penalty = missing * self.options.nothing * libm::log(1.0 - self.options.foreground);
        let score = (evidence + penalty) * self.options.weight / self.options.unit;
        score.clamp(f64::MIN, f64::MAX)
    }
}

impl ContourRatio {
    /// Computes the derivatives of [`ContourRatio::log_likelihood`] with respect to each
    /// element's x, y, length (pixels) and angle (radians, from right to down) into
    /// `out`.
    pub fn gradient(
        &self,
        elements: &ContourSlice<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<[f64; 4]>,
    ) {
        out.clear();
        out.resize(elements.len(), [0.0; 4]);
        // Fills in every group's assignments.
        self.log_likelihood_with(elements, scratch);
        let samples = self.grid.width as usize * self.grid.height as usize;
        let factor = self.options.weight / self.options.unit;
        let length: f64 = elements
            .in_view()
            .map(|e| (f64::from(e.length * e.weight) * self.percent).min(LONGEST))
            .sum();
        // With too little contour in view, each unit of length reduces the penalty.
        let missing = if length < self.options.least {
            -self.options.nothing * libm::log(1.0 - self.options.foreground) / self.options.least
        } else {
            0.0
        };
        for e in elements.in_view() {
            let Some(place) = out.get_mut(e.index) else { continue };
            let (low, high, f) = channels_of(e.tx, e.ty);
            let corners = self.grid.corners(e.x, e.y);
            // The score per unit length in each channel, and its derivatives over the
            // grid.
            let read = |k: usize| {
                let [a, b, c, d] = corners.at.map(|at| match self.cells.get(k * samples + at) {
                    Some(cell) if cell.group == NO_GROUP => f64::from(cell.score),
                    Some(cell) => scratch.slope(&self.capacity, cell.group, f64::from(cell.score)),
                    None => 0.0,
                });
                let (fx, fy) = (f64::from(corners.fx), f64::from(corners.fy));
                let (top, bottom) = (a + fx * (b - a), c + fx * (d - c));
                [top + fy * (bottom - top), (1.0 - fy) * (b - a) + fy * (d - c), bottom - top]
            };
            let (a, b, f) = (read(low), read(high), f64::from(f));
            let [value, dx, dy] = [0, 1, 2].map(|i| a[i] + f * (b[i] - a[i]));
            let (by_length, weight) = (factor * (value + missing), f64::from(e.weight));
            let by = factor * f64::from(e.length) * weight * self.percent;
            let border =
                elements.view_slope(&e).map(|s| s * by_length * f64::from(e.length) * self.percent);
            *place = [
                by * dx * f64::from(self.grid.sx) + border[0],
                by * dy * f64::from(self.grid.sy) + border[1],
                by_length * weight * self.percent,
                by * (b[0] - a[0]) * f64::from(PER_RADIAN),
            ];
            place.iter_mut().filter(|g| !g.is_finite()).for_each(|g| *g = 0.0);
        }
    }
}

/// Marks a cell that is not matched to any group.
pub(super) const NO_GROUP: u32 = u32::MAX;

/// Cells along the picture's longer side.
const CELLS: f32 = 64.0;

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
    /// True if anything was ever assigned, and whether anything was since the last update
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

    /// Adds an assignment: a length of contour in percent and its unscaled score (length times
    /// log ratio), both in fixed point.
    #[inline(always)]
    pub(super) fn assign(&mut self, group: u32, [length, score]: [i64; 2]) {
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
            assign.length = assign.length.saturating_add(length);
            assign.score = assign.score.saturating_add(score);
        }
    }

    /// Assigns a length of contour to the groups of the cells around it, by their shares.
    /// Returns the score of what belongs to no group.
    #[inline(always)]
    fn share(&mut self, cells: &[Cell; 8], shares: &[f32; 8], whole: f64) -> i64 {
        let (mut lengths, mut scores) = ([0; 8], [0; 8]);
        for i in 0..8 {
            let length = whole * f64::from(shares[i]);
            lengths[i] = fixed(length);
            scores[i] = fixed(length * f64::from(cells[i].score));
        }
        // Neighbouring samples mostly belong to one group.
        let (mut unmatched, mut group, mut given) = (0, NO_GROUP, [0; 2]);
        for i in 0..8 {
            if cells[i].group != group {
                self.assign(group, given);
                (group, given) = (cells[i].group, [0; 2]);
            }
            if group == NO_GROUP {
                unmatched += scores[i];
            } else {
                given = [given[0] + lengths[i], given[1] + scores[i]];
            }
        }
        self.assign(group, given);
        unmatched
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

#[cfg(test)]
mod tests;
