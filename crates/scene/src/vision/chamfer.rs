//! The paper's stochastic comparator: the distance of the rendered contours from the
//! observed ones, scored by a normal density. It is a likelihood without a sampler.
//! Lengths are percent of the image diagonal, so a score does not depend on resolution.
//! In clutter, some wrong object often lies closer to the observed edges than the true
//! one; use [`ContourRatio`](super::contour_ratio::ContourRatio) for photographs.
//! Invariant: scores are finite and continuous in positions, and one-sided scores are
//! exactly independent of the order of the elements.

mod gradient;
mod reverse;
mod stationary;

use self::reverse::Reverse;
use self::stationary::Stationary;
use super::elements::{CHANNELS, Edges, PER_RADIAN, channels_of, turn_between};
use super::elements::{ComparatorError, Element, check};
use super::pictures::contour_map::ContourMap;
use crate::contours::{ContourChange, ContourSlice};
use pcadlang_numerics::num::LN_SQRT_2PI;
use pcadlang_numerics::num::simd::vectorised;
use pcadlang_numerics::platform::threads::side_by_side;
use std::sync::Arc;

pub use self::reverse::{MOST_OBSERVED, Scratch};

/// How distances become a score.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// One normal density at the mean distance, as the paper states it.
    #[default]
    Mean,
    /// One normal density for every percent of the diagonal of contour length, each at
    /// its own distance.
    Sum,
}

/// Options of [`Chamfer`]. The default is the paper's comparator.
#[derive(Debug, Clone, PartialEq)]
pub struct ChamferOptions {
    /// Standard deviation of the distance, in percent of the diagonal, above 0. Default
    /// 0.4.
    pub sigma: f64,
    /// The mean distance, or a sum of scores. Default mean.
    pub mode: Mode,
    /// Also measures from the observed contours to the rendered ones: the distance is the
    /// mean of both directions' means (`Sum`: both directions' scores are added). Of more
    /// than 512 observed points, an even selection is used. This assumes that the picture
    /// shows nothing but the object: in clutter it prefers objects that lie near all of
    /// the clutter. Default off.
    pub symmetric: bool,
    /// Upper bound at which distances are truncated, in percent of the diagonal, above 0.
    /// Default none.
    pub truncate: Option<f64>,
    /// Cost of a difference in orientation, in percent of the diagonal per radian, at
    /// least 0. Default none.
    pub oriented: Option<f64>,
}

impl ChamferOptions {
    /// The defaults.
    pub const USUAL: ChamferOptions = ChamferOptions {
        sigma: 0.4,
        mode: Mode::Mean,
        symmetric: false,
        truncate: None,
        oriented: None,
    };
}

impl Default for ChamferOptions {
    fn default() -> Self {
        ChamferOptions::USUAL
    }
}

/// The distance used when nothing is in view: the whole diagonal, in percent.
pub const NOTHING: f64 = 100.0;

/// Observed contours, prepared for comparison with many rendered ones.
#[derive(Debug, Clone)]
pub struct Chamfer {
    options: ChamferOptions,
    grid: Edges,
    /// One distance field, or one per orientation channel.
    fields: Vec<Vec<f32>>,
    reverse: Option<Reverse>,
    /// Percent of the diagonal per pixel of the frame.
    percent: f64,
}

/// Sums over one direction, in fixed-point steps of 2^-32: exact, so terms can be
/// subtracted again.
#[derive(Debug, Clone, Copy, Default)]
struct Steps {
    length: i64,
    first: i64,
    second: i64,
}

/// Fixed-point steps per unit.
const FIXED: f64 = (1u64 << 32) as f64;

impl Steps {
    #[inline(always)]
    fn add(&mut self, length: f64, distance: f64, sign: i64) {
        let add = |sum: &mut i64, x: f64| *sum = sum.saturating_add(sign * (x * FIXED) as i64);
        add(&mut self.length, length);
        add(&mut self.first, length * distance);
        add(&mut self.second, length * distance * distance);
    }

    fn sums(&self) -> ChamferSums {
        let [length, first, second] =
            [self.length, self.first, self.second].map(|sum| sum as f64 / FIXED);
        ChamferSums { length, first, second }
    }
}

/// The sums of the contours that do not move, kept between evaluations in which some
/// contours appear or disappear. A tally belongs to one comparator.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    steps: Steps,
    /// Of the other direction, if symmetric.
    back: Stationary,
    of: Option<Arc<()>>,
}

/// Sums over one direction.
#[derive(Debug, Clone, Copy, Default)]
struct ChamferSums {
    /// Contour length in percent.
    length: f64,
    /// Length times distance.
    first: f64,
    /// Length times squared distance.
    second: f64,
}

impl ChamferSums {
    #[inline(always)]
    fn add(&mut self, length: f64, distance: f64) {
        self.length += length;
        self.first += length * distance;
        self.second += length * distance * distance;
    }

    fn mean(&self) -> f64 {
        if self.length > 0.0 { (self.first / self.length).min(NOTHING) } else { NOTHING }
    }
}

/// The input to the sums of one direction, for a device that computes them.
#[derive(Debug, Clone, Copy)]
pub struct DistanceField<'a> {
    /// Distances in percent of the diagonal, row by row; one field, or one for each of as
    /// many orientations of the tangent, from 0 to PI.
    pub channels: &'a [Vec<f32>],
    /// Samples of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel of the frame, across and down.
    pub scale: [f32; 2],
    /// Percent of the diagonal per pixel of the frame.
    pub percent: f64,
    /// Upper bound of distances, in percent.
    pub truncate: Option<f64>,
}

impl Chamfer {
    /// Prepares the observed contours for frames of `width` x `height` pixels. A map
    /// without contours is at the largest distance from everything.
    ///
    /// # Errors
    /// A side outside 1 to 16384 pixels, an option out of its range, or a map whose lists
    /// differ in length.
    pub fn prepare(
        map: &ContourMap,
        width: u32,
        height: u32,
        options: &ChamferOptions,
    ) -> Result<Self, ComparatorError> {
        check("sigma", "above 0", options.sigma, options.sigma > 0.0)?;
        let truncate = options.truncate.unwrap_or(1.0);
        check("truncate", "above 0", truncate, truncate > 0.0)?;
        let turn = options.oriented.unwrap_or(0.0);
        check("oriented", "at least 0", turn, turn >= 0.0)?;
        let grid = Edges::new(map, width, height)?;
        let fields = fields(&grid, options.oriented);
        let reverse = options.symmetric.then(|| Reverse::new(&grid, width, height));
        let percent = 100.0 / super::elements::diagonal(width, height);
        Ok(Chamfer { options: options.clone(), grid, fields, reverse, percent })
    }

    /// The options it was prepared with.
    pub fn options(&self) -> &ChamferOptions {
        &self.options
    }

    /// Returns the distance in percent of the diagonal: the length-weighted mean over the
    /// elements of the distance to the observed contours, averaged with that of the other
    /// direction if symmetric. With nothing in view it is 100.
    pub fn distance(&self, elements: &ContourSlice<'_>) -> f64 {
        self.distance_with(elements, &mut Scratch::default())
    }

    /// [`Chamfer::distance`] without allocation once the scratch has grown.
    pub fn distance_with(&self, elements: &ContourSlice<'_>, scratch: &mut Scratch) -> f64 {
        self.mean(self.forward(elements), self.back(elements, scratch))
    }

    /// Returns the log-likelihood. `Mean`: log normal(distance; 0, sigma). `Sum`: the sum
    /// of that of every element's distance times its length in percent of the diagonal;
    /// with nothing in view, that of a diagonal's length of contour at distance 100.
    pub fn log_likelihood(&self, elements: &ContourSlice<'_>) -> f64 {
        self.log_likelihood_with(elements, &mut Scratch::default())
    }

    /// [`Chamfer::log_likelihood`] without allocation once the scratch has grown.
    pub fn log_likelihood_with(&self, elements: &ContourSlice<'_>, scratch: &mut Scratch) -> f64 {
        self.score(self.forward(elements), self.back(elements, scratch))
    }

    /// Returns the [`Chamfer::log_likelihood`] after a change of the contours, bit for
    /// bit. If the tally holds the state before the change, only the changes are counted;
    /// otherwise `whole` must give all contours.
    pub fn log_likelihood_after<'a>(
        &self,
        step: &ContourChange,
        whole: impl FnOnce() -> ContourSlice<'a>,
        tally: &mut Tally,
        scratch: &mut Scratch,
    ) -> f64 {
        if step.all_move() {
            return self.log_likelihood_with(&step.moving.slice(), scratch);
        }
        if !step.leads_to(tally.of.as_ref()) {
            if step.follows(tally.of.as_ref()) {
                self.count(&step.removed.slice(), -1, &mut tally.steps);
                self.count(&step.added.slice(), 1, &mut tally.steps);
                if let Some(reverse) = &self.reverse {
                    let changes = [&step.removed, &step.added].map(|c| c.slice());
                    tally.back.follow(reverse, changes, self.turn());
                }
            } else {
                let (whole, moving) = (whole(), step.moving.slice());
                tally.steps = Steps::default();
                self.count(&whole, 1, &mut tally.steps);
                self.count(&moving, -1, &mut tally.steps);
                if let Some(reverse) = &self.reverse {
                    tally.back.begin(reverse, &whole, &moving, self.turn());
                }
            }
            tally.of = Some(step.to.clone());
        }
        let (mut steps, moving) = (tally.steps, step.moving.slice());
        self.count(&moving, 1, &mut steps);
        let back = self.reverse.as_ref().map(|reverse| {
            let mut sums = ChamferSums::default();
            let distances = tally.back.with_moving(reverse, &moving, self.turn());
            for (point, distance) in reverse.points().iter().zip(distances) {
                self.add_back(&mut sums, reverse.length(point), *distance);
            }
            sums
        });
        self.score(steps.sums(), back)
    }

    /// The fields of distances to the observed contours; `None` if the distance is
    /// symmetric, for which they are not enough.
    pub fn distance_field(&self) -> Option<DistanceField<'_>> {
        self.reverse.is_none().then_some(DistanceField {
            channels: &self.fields,
            width: self.grid.width,
            height: self.grid.height,
            scale: [self.grid.sx, self.grid.sy],
            percent: self.percent,
            truncate: self.options.truncate,
        })
    }

    /// The [`Chamfer::log_likelihood`] of contours given by their sums, unless symmetric:
    /// length in percent of the diagonal, length times distance, and length times squared
    /// distance.
    pub fn log_likelihood_of(&self, [length, first, second]: [f64; 3]) -> f64 {
        self.score(ChamferSums { length, first, second }, None)
    }

    fn mean(&self, forward: ChamferSums, back: Option<ChamferSums>) -> f64 {
        match back {
            None => forward.mean(),
            Some(back) => 0.5 * (forward.mean() + back.mean()),
        }
    }

    fn score(&self, forward: ChamferSums, back: Option<ChamferSums>) -> f64 {
        let sum = |s: ChamferSums| {
            let s = if s.length > 0.0 {
                s
            } else {
                ChamferSums { length: 100.0, first: 0.0, second: 100.0 * NOTHING * NOTHING }
            };
            s.length * self.log_normal(0.0)
                - 0.5 * s.second / (self.options.sigma * self.options.sigma)
        };
        let score = match self.options.mode {
            Mode::Mean => self.log_normal(self.mean(forward, back)),
            Mode::Sum => sum(forward) + back.map_or(0.0, sum),
        };
        score.max(f64::MIN)
    }

    fn log_normal(&self, distance: f64) -> f64 {
        let z = distance / self.options.sigma;
        -0.5 * z * z - libm::log(self.options.sigma) - LN_SQRT_2PI
    }

    #[inline(always)]
    fn cut(&self, distance: f32) -> f64 {
        let d = f64::from(distance);
        self.options.truncate.map_or(d, |t| d.min(t))
    }

    /// Returns the distance at an element, and its derivatives per pixel of the frame and
    /// with respect to the angle of the tangent. Inlined, so that unused derivatives are
    /// not computed.
    #[inline(always)]
    fn read(&self, e: &Element) -> (f32, [f32; 3]) {
        let corners = self.grid.corners(e.x, e.y);
        let (d, dx, dy, turn) = if let [field] = self.fields.as_slice() {
            let (d, dx, dy) = corners.read(field);
            (d, dx, dy, 0.0)
        } else {
            let (low, high, f) = channels_of(e.tx, e.ty);
            let (a, b) = (corners.read(&self.fields[low]), corners.read(&self.fields[high]));
            (
                a.0 + f * (b.0 - a.0),
                a.1 + f * (b.1 - a.1),
                a.2 + f * (b.2 - a.2),
                (b.0 - a.0) * PER_RADIAN,
            )
        };
        (d, [dx * self.grid.sx, dy * self.grid.sy, turn])
    }

    fn forward(&self, elements: &ContourSlice<'_>) -> ChamferSums {
        let mut steps = Steps::default();
        self.count(elements, 1, &mut steps);
        steps.sums()
    }

    /// Adds (`sign` 1) or subtracts (-1) the contributions of elements.
    fn count(&self, elements: &ContourSlice<'_>, sign: i64, steps: &mut Steps) {
        let mut own = *steps;
        *steps = vectorised(
            #[inline(always)]
            || {
                for e in elements.in_view() {
                    own.add(
                        f64::from(e.length * e.weight) * self.percent,
                        self.cut(self.read(&e).0),
                        sign,
                    );
                }
                own
            },
        );
    }

    fn back(&self, elements: &ContourSlice<'_>, scratch: &mut Scratch) -> Option<ChamferSums> {
        let reverse = self.reverse.as_ref()?;
        let mut sums = ChamferSums::default();
        reverse.each(elements, self.turn(), scratch, |length, distance, _| {
            self.add_back(&mut sums, length, distance);
        });
        Some(sums)
    }

    /// Adds an observed point, of a length and at a distance in pixels.
    #[inline(always)]
    fn add_back(&self, sums: &mut ChamferSums, length: f32, distance: f32) {
        let distance = (f64::from(distance) * self.percent).min(NOTHING);
        sums.add(f64::from(length) * self.percent, self.cut(distance as f32));
    }

    /// The cost in pixels of a difference of one orientation channel.
    fn turn(&self) -> f32 {
        (self.options.oriented.unwrap_or(0.0) * std::f64::consts::PI
            / CHANNELS as f64
            / self.percent) as f32
    }
}

/// Computes the distance fields: a single one, or one per channel with the minimum over
/// all edges of distance plus orientation cost.
fn fields(grid: &Edges, oriented: Option<f64>) -> Vec<Vec<f32>> {
    let samples = grid.width as usize * grid.height as usize;
    let Some(cost) = oriented else {
        return vec![
            grid.nearest(|_| true).map_or_else(|| vec![NOTHING as f32; samples], |n| n.distance),
        ];
    };
    let per_channel = (cost * std::f64::consts::PI / CHANNELS as f64) as f32;
    // Distance and orientation of the nearest edges of every channel that has edges.
    let mut nearest: [Option<(Vec<f32>, Vec<f32>)>; CHANNELS] = Default::default();
    side_by_side(&mut nearest, |k, out| {
        let found = grid.nearest(|e| e.turn.round() as usize % CHANNELS == k);
        *out = found
            .map(|n| (n.distance, n.edge.iter().map(|&id| grid.edges[id as usize].turn).collect()));
    });
    let mut fields = vec![vec![NOTHING as f32; samples]; CHANNELS];
    side_by_side(&mut fields, |j, field| {
        // In pieces that stay in the cache for all channels.
        for (n, field) in field.chunks_mut(PIECE).enumerate() {
            for (distance, turns) in nearest.iter().flatten() {
                let of = n * PIECE..n * PIECE + field.len();
                let edges = distance[of.clone()].iter().zip(&turns[of]);
                vectorised(
                    #[inline(always)]
                    || {
                        for (least, (&d, &turn)) in field.iter_mut().zip(edges) {
                            let cost = d + per_channel * turn_between(turn, j as f32);
                            *least = if cost < *least { cost } else { *least };
                        }
                    },
                );
            }
        }
    });
    fields
}

/// Samples per piece.
const PIECE: usize = 2048;

#[cfg(test)]
mod tests;
