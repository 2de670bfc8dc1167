//! The best symmetric outline about any of a few axes near those of the frame.

use super::colours::Known;
use super::frame::Frame;
use super::outline::{Outline, Prices, SLOPES, STEEPEST, Strip, Table};
use super::window::Window;
use crate::vision::candidates::area::Area;
use crate::vision::candidates::pixels::Pixels;
use crate::vision::detect::gradient::smoothed;
use crate::vision::hint::polygon;
use pcadlang_numerics::num::simd::vectorised;
use pcadlang_numerics::platform::threads::map_side_by_side;

/// Cells along the longer side of the frame.
const CELLS: f64 = 72.0;
/// Angles of axes from that of the frame, radians, and offsets as a part of its shorter side.
const ANGLES: [f64; 11] =
    [-0.698, -0.559, -0.419, -0.279, -0.14, 0.0, 0.14, 0.279, 0.419, 0.559, 0.698];
const OFFSETS: [f64; 5] = [-0.12, -0.06, 0.0, 0.06, 0.12];
/// The same for an axis that was pointed out, and its offsets as a part of its length.
const NEAR_ANGLES: [f64; 5] = [-0.06, -0.03, 0.0, 0.03, 0.06];
const NEAR_OFFSETS: [f64; 5] = [-0.03, -0.015, 0.0, 0.015, 0.03];

/// Number of times that colours are learned, and of axes that are kept after the first time.
const ESTIMATES: usize = 3;
const KEPT: usize = 12;

/// Weights of the log odds of a pixel's colour and of those of its position.
const COLOUR: f32 = 0.04;
const POSITION: f32 = 0.05;
/// What a pixel gains that is beyond the frame: at its sides, and farther out than a multiple
/// of its size; nats.
const BESIDE: f32 = -0.15;
const BEYOND: f32 = -1.5;
const FAR: f32 = 1.06;
/// What was pointed out gains or loses, nats per pixel.
const POINTED: f32 = 20.0;
/// The gain of an edge, nats per cell: its strength as a part of itself and of what is usual
/// around it, less what that is beside outlines, times a weight.
const EDGE: f32 = 2.0;
const USUAL: f32 = 0.53;
/// The prices of slopes.
const PRICES: Prices = Prices { slope: 0.05, change: 0.3, most: 1.5 };
/// The price of a distance between a side of the frame and the outline, as a part of its
/// longer side, and the distance beyond which it does not grow.
const GAP: f64 = 40.0;
const MOST_GAP: f64 = 0.3;

/// A symmetric outline in a window.
pub struct Symmetric {
    /// What it gains, nats.
    pub score: f64,
    /// Its axis and extent.
    pub frame: Frame,
    /// Corners of a polygon.
    corners: Vec<[f64; 2]>,
}

/// What is seen about a direction of axes.
struct Turned {
    frame: Frame,
    strip: Strip,
}

/// Returns outlines, the best first.
pub fn outlines(window: &Window, known: &Known) -> Vec<Symmetric> {
    let frame = window.frame;
    let cell = 2.0 * frame.half[0].max(frame.half[1]) / CELLS;
    let rows = (1.5 * CELLS) as usize + 8;
    let local = local(window);
    let (angles, offsets): (&[f64], Vec<f64>) = if frame.axis {
        (&NEAR_ANGLES, NEAR_OFFSETS.iter().map(|o| 2.0 * o * frame.half[1] / cell).collect())
    } else {
        let shorter = 2.0 * frame.half[0].min(frame.half[1]);
        (&ANGLES, OFFSETS.iter().map(|o| o * shorter / cell).collect())
    };
    let turned = map_side_by_side(angles, |angle| {
        let turned = Frame { lean: frame.lean + angle, ..frame };
        Turned { frame: turned, strip: edges(window, &local, &turned, cell, rows) }
    });
    let mut axes: Vec<(usize, f64)> =
        (0..turned.len()).flat_map(|a| offsets.iter().map(move |o| (a, *o))).collect();
    let widest = (0.62 * libm::hypot(2.0 * frame.half[0], 2.0 * frame.half[1]) / cell) as usize;
    let mut on: Option<Vec<bool>> = None;
    let mut found: Vec<Symmetric> = Vec::new();
    for _ in 0..ESTIMATES {
        let gains = gains(known, &known.colours(&known.belief(on.as_deref())));
        let mut used: Vec<usize> = axes.iter().map(|(a, _)| *a).collect();
        used.sort_unstable();
        used.dedup();
        let scored = map_side_by_side(&used, |a| {
            let Turned { frame: turned, strip } = &turned[*a];
            let (inside, mut table) =
                (inside(window, &gains, turned, cell, rows), Table::default());
            let about = |offset: f64| {
                let column = (0.5 * rows as f64 + offset).round() as usize;
                let outline = strip.outline(&inside, column, widest, &PRICES, &mut table)?;
                let found = Symmetric::new(&outline, column, turned, &frame, cell, rows);
                Some((found, (*a, offset)))
            };
            let own = axes.iter().filter(|(b, _)| b == a).map(|(_, offset)| *offset);
            own.filter_map(about).collect::<Vec<_>>()
        });
        let mut scored: Vec<(Symmetric, (usize, f64))> = scored.into_iter().flatten().collect();
        scored.sort_by(|a, b| b.0.score.total_cmp(&a.0.score));
        scored.truncate(KEPT);
        axes = scored.iter().map(|(_, axis)| *axis).collect();
        found = scored.into_iter().map(|(s, _)| s).collect();
        on = found.first().and_then(|s| s.area(window)).map(|area| area.pixels.bools());
    }
    found
}

impl Symmetric {
    fn new(
        outline: &Outline,
        column: usize,
        turned: &Frame,
        frame: &Frame,
        cell: f64,
        rows: usize,
    ) -> Symmetric {
        let middle = 0.5 * rows as f64;
        let at = |across: f64, row: f64| [cell * (across - middle), cell * (row - middle)];
        // Half-widths are those at the centres of rows.
        let side = |sign: f64| {
            outline.widths.iter().enumerate().map(move |(i, w)| {
                let across = column as f64 + 0.5 + sign * *w as f64;
                turned.outside(at(across, (outline.first + i) as f64 + 0.5))
            })
        };
        let corners: Vec<[f64; 2]> = side(1.0).chain(side(-1.0).rev()).collect();
        // How far the outline is from the sides of the frame.
        let mut gaps = 0.0;
        for c in 0..2 {
            let places = || corners.iter().map(|at| frame.within(*at)[c]);
            let least = places().fold(f64::INFINITY, f64::min);
            let most = places().fold(f64::NEG_INFINITY, f64::max);
            for gap in [least + frame.half[c], most - frame.half[c]] {
                gaps += (gap.abs() / (cell * CELLS)).min(MOST_GAP);
            }
        }
        let widest = outline.widths.iter().max().map_or(0, |w| *w) as f64 + 0.5;
        let half = [cell * widest, 0.5 * cell * outline.widths.len() as f64];
        let centre = turned.outside([
            cell * (column as f64 + 0.5 - middle),
            cell * (outline.first as f64 + 0.5 * outline.widths.len() as f64 - middle),
        ]);
        let score = f64::from(outline.score) - GAP * gaps;
        Symmetric { score, frame: Frame { centre, half, ..*turned }, corners }
    }

    /// Returns its pixels in the window.
    pub fn area(&self, window: &Window) -> Option<Area> {
        let (w, h) = (window.picture.width, window.picture.height);
        let mask = polygon(&self.corners, w as u32, h as u32)?;
        Area::of(Pixels::new(w, h, |p| mask.data()[p]))
    }
}

/// Returns what each pixel gains inside an outline, nats.
fn gains(known: &Known, colours: &[f32]) -> Vec<f32> {
    (0..colours.len())
        .map(|p| {
            let odds = COLOUR * colours[p] + POSITION * known.prior[p];
            let odds = match known.out[p] {
                ..1.0 => odds,
                ..FAR => odds.min(0.0) + BESIDE,
                _ => BEYOND,
            };
            odds + POINTED * known.pointed[p]
        })
        .collect()
}

/// Returns the mean strength of edges around each pixel.
fn local(window: &Window) -> Vec<f32> {
    let picture = &window.picture;
    let strength: Vec<f32> =
        picture.gradient.tensor.iter().map(|t| (t[0] + t[2]).max(0.0).sqrt()).collect();
    let mean = strength.iter().sum::<f32>() / strength.len() as f32;
    let (w, h) = (picture.width as u32, picture.height as u32);
    let side = 2.0 * window.frame.half[0].max(window.frame.half[1]);
    let near = smoothed(w, h, &strength, side as f32 / 6.0);
    near.iter().map(|near| 0.5 * near + 0.5 * mean + 0.3).collect()
}

/// The position in the window of each cell of a square of `rows` by `rows` cells, row by row.
fn cells(frame: &Frame, cell: f64, rows: usize) -> impl Iterator<Item = [f64; 2]> + '_ {
    let place = move |i: usize| cell * (i as f64 + 0.5 - 0.5 * rows as f64);
    (0..rows * rows).map(move |p| frame.outside([place(p % rows), place(p / rows)]))
}

/// Returns values between those of the four pixels around a position; `beyond` outside the
/// window.
fn between<const N: usize>(
    window: &Window,
    [x, y]: [f64; 2],
    beyond: [f32; N],
    value: impl Fn(usize) -> [f32; N],
) -> [f32; N] {
    let (w, h) = (window.picture.width, window.picture.height);
    let (x, y) = (x - 0.5, y - 0.5);
    if !(x >= 0.0 && y >= 0.0 && x < (w - 1) as f64 && y < (h - 1) as f64) {
        return beyond;
    }
    let (i, j) = (x as usize, y as usize);
    let (u, v) = ((x - i as f64) as f32, (y - j as f64) as f32);
    let p = j * w + i;
    let [a, b, c, d] = [value(p), value(p + 1), value(p + w), value(p + w + 1)];
    std::array::from_fn(|k| {
        (1.0 - v) * ((1.0 - u) * a[k] + u * b[k]) + v * ((1.0 - u) * c[k] + u * d[k])
    })
}

/// Returns what an edge of a strength gains where the mean strength is `mean`.
#[inline(always)]
fn edge_gain(strength: f32, mean: f32) -> f32 {
    EDGE * (strength / (strength + mean) - USUAL)
}

/// Prepares the edges of a window about an axis.
fn edges(window: &Window, local: &[f32], frame: &Frame, cell: f64, rows: usize) -> Strip {
    let tensor = &window.picture.gradient.tensor;
    let value = |p: usize| [tensor[p][0], tensor[p][1], tensor[p][2], local[p]];
    let [c, s] = frame.across().map(|v| v as f32);
    let n = rows * rows;
    let [mut along, mut both, mut across, mut mean] = [(); 4].map(|_| vec![0.0f32; n]);
    for (p, at) in cells(frame, cell, rows).enumerate() {
        let [xx, xy, yy, m] = between(window, at, [0.0, 0.0, 0.0, 5.0], value);
        across[p] = c * c * xx + 2.0 * c * s * xy + s * s * yy;
        along[p] = s * s * xx - 2.0 * c * s * xy + c * c * yy;
        both[p] = c * s * (yy - xx) + (c * c - s * s) * xy;
        mean[p] = m;
    }
    let mut sides = vec![0.0f32; SLOPES * n];
    // Its first and last ones twice.
    let mut edge = vec![0.0f32; n + 2];
    for m in 0..SLOPES {
        let slope = m as f32 - STEEPEST as f32;
        let length = (1.0 + slope * slope).sqrt();
        vectorised(
            #[inline(always)]
            || {
                let tensor = across.iter().zip(&both).zip(&along);
                for (edge, ((across, both), along)) in edge[1..=n].iter_mut().zip(tensor) {
                    let square = across - 2.0 * slope * both + slope * slope * along;
                    *edge = square.max(0.0).sqrt() / length;
                }
                (edge[0], edge[n + 1]) = (edge[1], edge[n]);
                let near = edge[..n].iter().zip(&edge[1..=n]).zip(&edge[2..]);
                let gains = sides[m * n..(m + 1) * n].iter_mut();
                for ((gain, mean), ((a, b), c)) in gains.zip(&mean).zip(near) {
                    *gain = edge_gain(b.max(*a).max(*c), *mean) * length;
                }
            },
        );
    }
    let mut ends = vec![0.0f32; rows * (rows + 1)];
    for t in 0..rows {
        let mut sum = 0.0;
        for d in 0..rows {
            let near = t.saturating_sub(1)..(t + 2).min(rows);
            let square = near.map(|t| along[t * rows + d]).fold(0.0, f32::max);
            let e = square.sqrt();
            sum += edge_gain(e, mean[t * rows + d]);
            ends[t * (rows + 1) + d + 1] = sum;
        }
    }
    Strip { rows, columns: rows, ends, sides }
}

/// Returns sums of what the cells of a strip gain inside an outline.
fn inside(window: &Window, gains: &[f32], turned: &Frame, cell: f64, rows: usize) -> Vec<f32> {
    let mut sums = vec![0.0; rows * (rows + 1)];
    let mut sum = 0.0;
    for (p, at) in cells(turned, cell, rows).enumerate() {
        let (t, d) = (p / rows, p % rows);
        if d == 0 {
            sum = 0.0;
        }
        sum += between(window, at, [BEYOND], |p| [gains[p]])[0];
        sums[t * (rows + 1) + d + 1] = sum;
    }
    sums
}
