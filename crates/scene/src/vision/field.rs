//! Distance to the observed contours as a grid of samples, in percent of the picture's
//! diagonal. The grid has at least [`FIELD_SIDE`] samples on its longer side for any
//! frame, so that coarse and fine frames read the same distances. It is neither a
//! detector nor a likelihood. Invariant: every sample is finite, within 0..=100, and
//! interpolation is continuous.

use super::elements::{ComparatorError, check_size, diagonal};
use super::pictures::contour_map::ContourMap;

/// Minimum number of samples on the longer side of a field. At 256, the error of bilinear
/// interpolation of |d| is at most 0.1 % of the diagonal.
pub const FIELD_SIDE: u32 = 256;

/// Number of orientation channels, `PI / 8` apart.
pub(super) const CHANNELS: usize = 8;

/// Channels per radian.
pub(super) const PER_RADIAN: f32 = CHANNELS as f32 / std::f32::consts::PI;

/// An observed contour point as a short straight piece, in grid units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    /// Position of the middle.
    pub x: f32,
    /// Position of the middle.
    pub y: f32,
    /// Unit tangent.
    pub tx: f32,
    /// Unit tangent.
    pub ty: f32,
    /// Half the length along the tangent.
    pub half: f32,
    /// Orientation in channels, 0..8.
    pub turn: f32,
}

impl Edge {
    /// Distance from a point to the piece, in grid units.
    #[inline(always)]
    pub fn distance(&self, x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - self.x, y - self.y);
        let along = dx * self.tx + dy * self.ty;
        // A clamp, written so that it vectorises.
        let along = if along < -self.half { -self.half } else { along };
        let along = if along > self.half { self.half } else { along };
        let (ex, ey) = (dx - along * self.tx, dy - along * self.ty);
        (ex * ex + ey * ey).sqrt()
    }
}

/// The observed contours in a grid's units.
#[derive(Debug, Clone)]
pub(super) struct Edges {
    /// Grid width.
    pub width: u32,
    /// Grid height.
    pub height: u32,
    /// Grid units per pixel of the frame, horizontally.
    pub sx: f32,
    /// Grid units per pixel of the frame, vertically.
    pub sy: f32,
    /// Percent of the diagonal per grid unit.
    pub percent: f32,
    /// The points, in the order of the map, without those that are not finite or outside
    /// the picture.
    pub edges: Vec<Edge>,
}

impl Edges {
    /// Resamples a map for a frame of `width` x `height`.
    pub fn new(map: &ContourMap, width: u32, height: u32) -> Result<Self, ComparatorError> {
        check_size(width, height)?;
        let n = map.x.len();
        if [map.y.len(), map.tx.len(), map.ty.len(), map.strength.len()].iter().any(|&m| m != n) {
            return Err(ComparatorError::Map);
        }
        let longer = width.max(height);
        let scale =
            if longer < FIELD_SIDE { f64::from(FIELD_SIDE) / f64::from(longer) } else { 1.0 };
        let side = |n: u32| ((f64::from(n) * scale).round() as u32).max(1);
        let (gw, gh) = (side(width), side(height));
        let mx = gw as f32 / map.width.max(1) as f32;
        let my = gh as f32 / map.height.max(1) as f32;
        let mut edges = Vec::with_capacity(n);
        for i in 0..n {
            let (x, y) = (map.x[i] * mx, map.y[i] * my);
            let (ux, uy) = (map.tx[i] * mx, map.ty[i] * my);
            let norm = (ux * ux + uy * uy).sqrt();
            let inside = x >= 0.0 && y >= 0.0 && x <= gw as f32 && y <= gh as f32;
            if !inside || !norm.is_finite() || norm <= 0.0 {
                continue;
            }
            let (tx, ty) = (ux / norm, uy / norm);
            // A pixel of the map is as long as the line that crosses it: 1 along an axis,
            // sqrt 2 along a diagonal.
            let half = 0.5 * norm / map.tx[i].abs().max(map.ty[i].abs());
            edges.push(Edge { x, y, tx, ty, half, turn: channel(tx, ty) });
        }
        let percent = (100.0 / diagonal(gw, gh)) as f32;
        Ok(Edges {
            width: gw,
            height: gh,
            sx: gw as f32 / width as f32,
            sy: gh as f32 / height as f32,
            percent,
            edges,
        })
    }

    /// Returns the grid samples around a point of the frame.
    #[inline(always)]
    pub fn corners(&self, x: f32, y: f32) -> Corners {
        let (w, h) = (self.width as usize, self.height as usize);
        let gx = (x * self.sx - 0.5).clamp(0.0, (w - 1) as f32);
        let gy = (y * self.sy - 0.5).clamp(0.0, (h - 1) as f32);
        // Via a 32-bit integer, which takes one instruction.
        let whole = |v: f32| v as i32 as usize;
        let (x0, y0) = (whole(gx).min(w.saturating_sub(2)), whole(gy).min(h.saturating_sub(2)));
        let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
        Corners {
            at: [y0 * w + x0, y0 * w + x1, y1 * w + x0, y1 * w + x1],
            fx: gx - x0 as f32,
            fy: gy - y0 as f32,
        }
    }
}

/// The four samples around a point and the fractions between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    /// Indices: top left, top right, bottom left, bottom right.
    pub at: [usize; 4],
    /// Fraction to the right.
    pub fx: f32,
    /// Fraction down.
    pub fy: f32,
}

impl Corners {
    /// The bilinear weights.
    #[inline]
    pub fn weights(&self) -> [f32; 4] {
        let (fx, fy) = (self.fx, self.fy);
        [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy]
    }

    /// Returns the interpolated value, and its derivatives per grid unit.
    #[inline(always)]
    pub fn read(&self, field: &[f32]) -> (f32, f32, f32) {
        let [a, b, c, d] = self.at.map(|i| field[i]);
        let (fx, fy) = (self.fx, self.fy);
        let (top, bottom) = (a + fx * (b - a), c + fx * (d - c));
        (top + fy * (bottom - top), (1.0 - fy) * (b - a) + fy * (d - c), bottom - top)
    }
}

/// Returns the orientation of a tangent in channels: the angle modulo PI, times 8 / PI,
/// within 0..8.
pub(super) fn channel(tx: f32, ty: f32) -> f32 {
    let k = libm::atan2f(ty, tx) * PER_RADIAN;
    let k = if k < 0.0 { k + CHANNELS as f32 } else { k };
    if k >= CHANNELS as f32 { k - CHANNELS as f32 } else { k }
}

/// Returns the smaller difference of two orientations in channels, 0..=4.
#[inline(always)]
pub(super) fn turn_between(a: f32, b: f32) -> f32 {
    let d = (a - b).abs();
    let other = CHANNELS as f32 - d;
    if other < d { other } else { d }
}

/// Returns the two channels next to a tangent's orientation and the weight of the second.
#[inline]
pub(super) fn channels_of(tx: f32, ty: f32) -> (usize, usize, f32) {
    let k = channel(tx, ty);
    let low = (k as usize).min(CHANNELS - 1);
    (low, (low + 1) % CHANNELS, k - low as f32)
}
