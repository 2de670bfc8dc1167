//! The log ratio at every place of the grid: how the distance to the nearest edge is distributed round that place, and how
//! much likelier an edge of one's own makes the distance found. For one orientation channel at a time. Invariant: every
//! density is positive and integrates to 1 with the mass at the truncation, so every score is finite.
//!
//! Counts are taken over tiles, tiles are added up to windows centred on tiles, and densities between window centres and
//! between bin centres are interpolated linearly.

use super::super::field::Edges;
use super::ContourRatioOptions;

/// Bins of the distance, up to the truncation.
const BINS: usize = 24;

/// Tiles along the longer side of the picture.
const TILES: usize = 32;

/// What the whole picture's distribution counts for in a window's, as a share of the window.
const PRIOR: f64 = 0.05;

/// A distribution of distances: the bins' masses. What is missing to 1 lies beyond the truncation.
type Masses = [f32; BINS];

/// The score at every place, from the distances in percent of the diagonal.
pub(super) fn scores(grid: &Edges, distance: &[f32], options: &ContourRatioOptions) -> Vec<f32> {
    let (w, h) = (grid.width as usize, grid.height as usize);
    let windows = Windows::new(w, h, distance, options);
    let bin = options.truncate / BINS as f64;
    let floor = libm::log(1.0 - options.foreground) as f32;
    let norm = 2.0 / (libm::sqrt(2.0 * std::f64::consts::PI) * options.sd);
    let mut out = Vec::with_capacity(w * h);
    for (i, &d) in distance.iter().enumerate() {
        let d = f64::from(d);
        if d >= options.truncate {
            out.push(floor);
            continue;
        }
        let density = f64::from(windows.mass((i % w) as f32, (i / w) as f32, (d / bin) as f32)) / bin;
        let z = d / options.sd;
        let own = norm * libm::exp(-0.5 * z * z);
        let score = libm::log(options.foreground * own / density + 1.0 - options.foreground);
        out.push(if score.is_finite() { score as f32 } else { floor });
    }
    out
}

/// The windows' distributions.
struct Windows {
    across: usize,
    down: usize,
    /// Side of a tile in grid units.
    side: f32,
    masses: Vec<Masses>,
}

impl Windows {
    fn new(w: usize, h: usize, distance: &[f32], options: &ContourRatioOptions) -> Self {
        let side = w.max(h).div_ceil(TILES).max(1);
        let (across, down) = (w.div_ceil(side), h.div_ceil(side));
        let mut counts = vec![[0u32; BINS + 1]; across * down];
        let per_bin = BINS as f64 / options.truncate;
        for (i, &d) in distance.iter().enumerate() {
            let bin = ((f64::from(d) * per_bin) as usize).min(BINS);
            counts[(i / w / side) * across + (i % w) / side][bin] += 1;
        }
        let mut all = [0u64; BINS + 1];
        for tile in &counts {
            all.iter_mut().zip(tile).for_each(|(a, &n)| *a += u64::from(n));
        }
        // A little of everything, so that no density is 0.
        let total = all.iter().sum::<u64>() as f64 + (BINS + 1) as f64;
        let reach_x = (0.5 * options.window * w as f64 / side as f64).max(0.5);
        let reach_y = (0.5 * options.window * h as f64 / side as f64).max(0.5);
        let mut masses = Vec::with_capacity(across * down);
        for ty in 0..down {
            for tx in 0..across {
                let mut sum = [0.0f64; BINS + 1];
                for (v, wy) in overlap(ty, reach_y, down) {
                    for (u, wx) in overlap(tx, reach_x, across) {
                        sum.iter_mut().zip(&counts[v * across + u]).for_each(|(s, &n)| *s += wx * wy * f64::from(n));
                    }
                }
                let count: f64 = sum.iter().sum();
                masses.push(std::array::from_fn(|b| {
                    let own = if count > 0.0 { sum[b] / count } else { 0.0 };
                    ((1.0 - PRIOR) * own + PRIOR * (all[b] as f64 + 1.0) / total) as f32
                }));
            }
        }
        Windows { across, down, side: side as f32, masses }
    }

    /// The mass per bin at a place of the grid and a distance in bins.
    fn mass(&self, x: f32, y: f32, bins: f32) -> f32 {
        let (u0, u1, fu) = between((x + 0.5) / self.side - 0.5, self.across);
        let (v0, v1, fv) = between((y + 0.5) / self.side - 0.5, self.down);
        let (b0, b1, fb) = between(bins - 0.5, BINS);
        let at = |v: usize, u: usize| {
            let m = &self.masses[v * self.across + u];
            m[b0] + fb * (m[b1] - m[b0])
        };
        let top = at(v0, u0) + fu * (at(v0, u1) - at(v0, u0));
        let bottom = at(v1, u0) + fu * (at(v1, u1) - at(v1, u0));
        top + fv * (bottom - top)
    }
}

/// The tiles within `reach` tiles of the middle of tile `at`, each with the part of it that is covered.
fn overlap(at: usize, reach: f64, n: usize) -> impl Iterator<Item = (usize, f64)> {
    let (low, high) = (at as f64 + 0.5 - reach, at as f64 + 0.5 + reach);
    let first = low.max(0.0) as usize;
    let last = (high.ceil() as usize).min(n);
    (first..last).map(move |t| (t, (high.min(t as f64 + 1.0) - low.max(t as f64)).max(0.0)))
}

/// The two of `n` samples next to a position, clamped, and the fraction between them.
fn between(position: f32, n: usize) -> (usize, usize, f32) {
    let p = position.clamp(0.0, (n - 1) as f32);
    let low = p as usize;
    (low, (low + 1).min(n - 1), p - low as f32)
}
