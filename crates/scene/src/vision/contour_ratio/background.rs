//! The log ratio at every sample of the grid, for one orientation channel at a time: how
//! the distance to the nearest edge is distributed around that sample, and how much
//! likelier its own distance is if the piece has a matching edge. Invariant: every
//! density is positive and integrates to 1 together with the mass beyond the truncation,
//! so every score is finite.
//!
//! Distances are counted per tile, tiles are summed to windows centred on tiles, and
//! densities are interpolated linearly between window centres and between bin centres.

use super::super::elements::Edges;
use super::ContourRatioOptions;
use pcadlang_numerics::num::simd::vectorised;
use pcadlang_numerics::num::wide::{exp, ln};
use std::f64::consts::PI;

/// Number of bins of the distance, up to the truncation.
const BINS: usize = 24;

/// Number of tiles along the longer side of the picture.
const TILES: usize = 32;

/// Weight of the whole picture's distribution in the distribution of a window.
const PRIOR: f64 = 0.05;

/// A distribution of distances: the masses of the bins. The remainder to 1 lies beyond
/// the truncation.
type Masses = [f32; BINS];

/// Returns the score at every sample, given the distances in percent of the diagonal.
pub(super) fn scores(grid: &Edges, distance: &[f32], options: &ContourRatioOptions) -> Vec<f32> {
    let w = grid.width as usize;
    let mut windows = Windows::new(w, grid.height as usize, distance, options);
    let bin = options.truncate / BINS as f64;
    let ratio = Ratio::new(options);
    let mut out = vec![libm::log(1.0 - options.foreground) as f32; distance.len()];
    // The samples of a row that are near an edge, packed.
    let (mut places, mut near, mut density) =
        (Vec::with_capacity(w), Vec::with_capacity(w), Vec::with_capacity(w));
    let mut scores = Vec::with_capacity(w);
    for (y, (distance, out)) in distance.chunks_exact(w).zip(out.chunks_exact_mut(w)).enumerate() {
        places.clear();
        near.clear();
        density.clear();
        windows.enter(y as f32);
        for (x, &d) in distance.iter().enumerate() {
            let d = f64::from(d);
            if d < options.truncate {
                places.push(x as u32);
                near.push(d);
                density.push(f64::from(windows.mass(x, (d / bin) as f32)) / bin);
            }
        }
        ratio.scores(&near, &density, &mut scores);
        for (&x, &score) in places.iter().zip(&scores).filter(|(_, s)| s.is_finite()) {
            out[x as usize] = score;
        }
    }
    out
}

/// A bin's mass in the four windows around a sample (top left, top right, bottom left,
/// bottom right), and the differences to the next bin.
type Quad = [[f32; 4]; 2];

/// The distributions of the windows.
struct Windows {
    down: usize,
    /// Side of a tile in grid units.
    side: f32,
    masses: Vec<Masses>,
    /// For every column the window to its left, and the fraction of the way to the next.
    columns: Vec<(u32, f32)>,
    /// The current row's fraction of the way from the window row above to the one below.
    below: f32,
    /// The window row above the current row, and the quads between it and the next.
    above: usize,
    quads: Vec<[Quad; BINS]>,
}

impl Windows {
    fn new(w: usize, h: usize, distance: &[f32], options: &ContourRatioOptions) -> Self {
        let side = w.max(h).div_ceil(TILES).max(1);
        let (across, down) = (w.div_ceil(side), h.div_ceil(side));
        let mut counts = vec![[0u32; BINS + 1]; across * down];
        let per_bin = BINS as f64 / options.truncate;
        for (y, row) in distance.chunks_exact(w).enumerate() {
            let tiles = &mut counts[y / side * across..][..across];
            for (tile, row) in tiles.iter_mut().zip(row.chunks(side)) {
                row.iter()
                    .for_each(|&d| tile[((f64::from(d) * per_bin) as u32 as usize).min(BINS)] += 1);
            }
        }
        let mut all = [0u64; BINS + 1];
        for tile in &counts {
            all.iter_mut().zip(tile).for_each(|(a, &n)| *a += u64::from(n));
        }
        // One extra count per bin, so that no density is 0.
        let total = all.iter().sum::<u64>() as f64 + (BINS + 1) as f64;
        let reach_x = (0.5 * options.window * w as f64 / side as f64).max(0.5);
        let reach_y = (0.5 * options.window * h as f64 / side as f64).max(0.5);
        let counts: Vec<[f64; BINS + 1]> =
            counts.into_iter().map(|tile| tile.map(f64::from)).collect();
        let mut masses = Vec::with_capacity(across * down);
        for ty in 0..down {
            for tx in 0..across {
                let mut sum = [0.0f64; BINS + 1];
                vectorised(
                    #[inline(always)]
                    || {
                        for (v, wy) in overlap(ty, reach_y, down) {
                            for (u, wx) in overlap(tx, reach_x, across) {
                                let weight = wx * wy;
                                sum.iter_mut()
                                    .zip(&counts[v * across + u])
                                    .for_each(|(s, &n)| *s += weight * n);
                            }
                        }
                    },
                );
                let count: f64 = sum.iter().sum();
                masses.push(std::array::from_fn(|b| {
                    let own = if count > 0.0 { sum[b] / count } else { 0.0 };
                    ((1.0 - PRIOR) * own + PRIOR * (all[b] as f64 + 1.0) / total) as f32
                }));
            }
        }
        let side = side as f32;
        let column = |x: usize| {
            let (left, _, fraction) = between((x as f32 + 0.5) / side - 0.5, across);
            (left as u32, fraction)
        };
        let quads = vec![[[[0.0; 4]; 2]; BINS]; across];
        Windows {
            down,
            side,
            masses,
            columns: (0..w).map(column).collect(),
            below: 0.0,
            above: usize::MAX,
            quads,
        }
    }

    /// Moves to a row of the grid.
    fn enter(&mut self, y: f32) {
        let (v0, v1, below) = between((y + 0.5) / self.side - 0.5, self.down);
        self.below = below;
        if self.above == v0 {
            return;
        }
        self.above = v0;
        let across = self.quads.len();
        for (u, bins) in self.quads.iter_mut().enumerate() {
            let next = (u + 1).min(across - 1);
            let four = [v0 * across + u, v0 * across + next, v1 * across + u, v1 * across + next];
            for (b, quad) in bins.iter_mut().enumerate() {
                let at = four.map(|t| self.masses[t][b]);
                let next = four.map(|t| self.masses[t][(b + 1).min(BINS - 1)]);
                *quad = [at, std::array::from_fn(|i| next[i] - at[i])];
            }
        }
    }

    /// Returns the mass per bin at a column of the current row and a distance in bins.
    #[inline]
    fn mass(&self, x: usize, bins: f32) -> f32 {
        let (left, fu) = self.columns[x];
        let (bin, _, fb) = between(bins - 0.5, BINS);
        let [at, more] = &self.quads[left as usize][bin];
        let [a, b, c, d] = std::array::from_fn(|i| at[i] + fb * more[i]);
        let (top, bottom) = (a + fu * (b - a), c + fu * (d - c));
        top + self.below * (bottom - top)
    }
}

/// The tiles within `reach` tiles of the centre of tile `at`, each with its covered
/// fraction.
fn overlap(at: usize, reach: f64, n: usize) -> impl Iterator<Item = (usize, f64)> {
    let (low, high) = (at as f64 + 0.5 - reach, at as f64 + 0.5 + reach);
    let first = low.max(0.0) as usize;
    let last = (high.ceil() as usize).min(n);
    (first..last).map(move |t| (t, (high.min(t as f64 + 1.0) - low.max(t as f64)).max(0.0)))
}

/// The two of `n` samples next to a position, clamped to the ends, and the fraction
/// between them.
#[inline]
fn between(position: f32, n: usize) -> (usize, usize, f32) {
    let p = position.clamp(0.0, (n - 1) as f32);
    let low = p as u32 as usize;
    (low, (low + 1).min(n - 1), p - low as f32)
}

/// Error bound of the fast path relative to one plus the score's magnitude; many times
/// the actual error.
const DOUBT: f64 = 1e-12;

/// The parameters of the score other than distance and density.
pub(super) struct Ratio {
    foreground: f64,
    sd: f64,
    /// Density of the half-normal distance at 0.
    norm: f64,
}

impl Ratio {
    pub fn new(options: &ContourRatioOptions) -> Self {
        let norm = 2.0 / (libm::sqrt(2.0 * PI) * options.sd);
        Ratio { foreground: options.foreground, sd: options.sd, norm }
    }

    /// Returns the score at a distance for a given background density.
    fn plain(&self, distance: f64, density: f64) -> f32 {
        let z = distance / self.sd;
        let own = self.norm * libm::exp(-0.5 * z * z);
        libm::log(self.foreground * own / density + 1.0 - self.foreground) as f32
    }

    /// Computes the scores of pairs of distance and density into `out`.
    pub fn scores(&self, distance: &[f64], density: &[f64], out: &mut Vec<f32>) {
        out.clear();
        out.resize(distance.len().min(density.len()), f32::NAN);
        vectorised(
            #[inline(always)]
            || {
                for ((out, &distance), &density) in out.iter_mut().zip(distance).zip(density) {
                    let z = distance / self.sd;
                    let own = self.norm * exp(-0.5 * z * z);
                    let score = ln(self.foreground * own / density + 1.0 - self.foreground);
                    let doubt = DOUBT * (1.0 + score.abs());
                    let (low, high) = ((score - doubt) as f32, (score + doubt) as f32);
                    *out = if low == high { low } else { f32::NAN };
                }
            },
        );
        for (i, out) in out.iter_mut().enumerate().filter(|(_, s)| !s.is_finite()) {
            *out = self.plain(distance[i], density[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_reach_equally_far_to_both_sides() {
        let parts = |at: usize, reach: f64| overlap(at, reach, 6).collect::<Vec<_>>();
        assert_eq!(parts(3, 1.0), [(2, 0.5), (3, 1.0), (4, 0.5)]);
        assert_eq!(parts(2, 1.75), [(0, 0.25), (1, 1.0), (2, 1.0), (3, 1.0), (4, 0.25)]);
        assert_eq!(parts(2, 0.5), [(2, 1.0)]);
        // Cut off at the border.
        assert_eq!(parts(0, 1.0), [(0, 1.0), (1, 0.5)]);
        assert_eq!(parts(5, 1.0), [(4, 0.5), (5, 1.0)]);
    }

    #[test]
    fn positions_lie_between_two_samples_or_at_the_first_or_last() {
        assert_eq!(between(2.25, 5), (2, 3, 0.25));
        assert_eq!(between(0.5, 5), (0, 1, 0.5));
        assert_eq!(between(3.75, 5), (3, 4, 0.75));
        assert_eq!(between(-1.0, 5), (0, 1, 0.0));
        assert_eq!(between(9.0, 5), (4, 4, 0.0));
        assert_eq!(between(0.3, 1), (0, 0, 0.0));
    }
}

#[cfg(test)]
mod ratio_tests {
    use super::*;

    #[test]
    fn quick_functions_are_right_to_thirteen_digits() {
        for i in 0..200_000 {
            let x = -f64::from(i) * 3.45e-3;
            assert!((exp(x) / libm::exp(x) - 1.0).abs() < 1e-13, "exp {x}");
            let y = libm::exp(f64::from(i - 100_000) * 6.5e-3);
            let expected = libm::log(y);
            assert!((ln(y) - expected).abs() < 1e-14 * (1.0 + expected.abs()), "ln {y}");
        }
        assert!(exp(-1e300) < 1e-300 && ln(1.0) == 0.0 && exp(-0.0) == 1.0);
    }

    #[test]
    fn scores_are_those_of_the_plain_way() {
        for (foreground, sd) in [(0.75, 0.4), (1e-6, 1e-3), (1.0 - 1e-9, 50.0)] {
            let ratio = Ratio::new(&ContourRatioOptions {
                foreground,
                sd,
                ..ContourRatioOptions::default()
            });
            let distance: Vec<f64> =
                (0..40_000).map(|i| f64::from(i * 7919 % 40_000) * 1e-4).collect();
            let density: Vec<f64> = (0..40_000).map(|i| 1e-4 + f64::from(i % 997) * 2e-3).collect();
            let mut scores = Vec::new();
            ratio.scores(&distance, &density, &mut scores);
            for (i, s) in scores.iter().enumerate() {
                assert_eq!(
                    s.to_bits(),
                    ratio.plain(distance[i], density[i]).to_bits(),
                    "{} {}",
                    distance[i],
                    density[i]
                );
            }
        }
    }
}
