//! Which pixels a triangle covers, exactly.
//!
//! Corners are rounded to 1/1024 of a pixel and edge functions evaluated in integers, so
//! triangles that share an edge neither overlap nor leave gaps, at any size: a pixel
//! belongs to a triangle if its centre is inside, and centres on an edge go to the
//! triangle to the right of or below it (the top-left rule). This module handles any
//! triangle, by runs; [`crate::render::pixels::simd_raster`] handles small ones of meshes that the near
//! plane does not cut.

use crate::render::lines::crossing::{Crossing, Int};
use crate::render::pixels::place::Point;
use crate::render::pixels::place::{BITS, Extent, Place, UNIT, is_near};

/// Corner coordinates are clamped to this, in units.
const FARTHEST: i64 = 1 << 60;
/// The pixels that a triangle covers.
pub(in crate::render) struct Coverage {
    places: [Place; 3],
    /// True if the corners are clockwise as seen in the image.
    clockwise: bool,
    /// Columns and rows, each from the first to one past the last.
    pub columns: [usize; 2],
    pub rows: [usize; 2],
}

/// The centre of a pixel in units.
#[inline(always)]
fn centre(pixel: usize) -> i32 {
    (pixel as i32) << BITS
}

/// A corner in units, even if its rounded position was clamped.
#[inline(always)]
fn units(place: Place, point: &Point) -> [i64; 2] {
    let [x, y, ..] = place.to_array();
    if is_near(place) {
        return [x, y].map(|v| (v * UNIT as f32) as i64);
    }
    // In single precision, in which most points are stored.
    [point.x, point.y].map(|v| {
        let v = (f64::from(v as f32) - 0.5) * f64::from(UNIT);
        ((v + if v < 0.0 { -0.5 } else { 0.5 }) as i64).clamp(-FARTHEST, FARTHEST)
    })
}

/// True if products of two differences of coordinates fit into 64 bits.
#[inline(always)]
fn is_small(corners: &[[i64; 2]; 3]) -> bool {
    corners.as_flattened().iter().all(|v| v.abs() < 1 << 29)
}

/// Orientation of near positions in the image: positive for clockwise, negative for
/// counter-clockwise, 0 without area.
#[inline(always)]
fn turn([a, b, c]: [Place; 3]) -> f64 {
    // Differences of places are exact in single precision, their products in double
    // precision.
    let (b, c) = ((b - a).to_array().map(f64::from), (c - a).to_array().map(f64::from));
    b[0] * c[1] - b[1] * c[0]
}

/// The same for positions of which some were clamped.
#[inline(never)]
fn far_turn(places: &[Place; 3], points: &[Point; 3]) -> f64 {
    let [a, b, c] = std::array::from_fn(|i| units(places[i], &points[i]).map(i128::from));
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum() as f64
}

/// True if corners are known to have the orientation `back`, as in [`Coverage::new`].
#[inline(always)]
pub(in crate::render) fn is_turned(places: [Place; 3], back: f64) -> bool {
    let [a, b, c] = places;
    is_near(a.min(b).min(c)) & (turn(places) * back > 0.0)
}

impl Coverage {
    /// `None` for a triangle without area, or with the orientation `back`: clockwise in
    /// the image if positive, counter-clockwise if negative, neither if 0. The unrounded
    /// corners, `points`, are used only if a rounded one was clamped.
    #[inline(always)]
    pub fn new(
        places: [Place; 3],
        points: impl Fn() -> [Point; 3],
        extent: Extent,
        back: f64,
    ) -> Option<Coverage> {
        let [a, b, c] = places;
        let least = a.min(b).min(c);
        let turn = if is_near(least) { turn(places) } else { far_turn(&places, &points()) };
        if turn == 0.0 || turn * back > 0.0 {
            return None;
        }
        let [columns, rows] = extent.ends();
        Some(Coverage { places, clockwise: turn > 0.0, columns, rows })
    }

    /// Edge functions, which are not negative inside: value at a pixel's centre, change
    /// per column, change per row.
    #[inline(always)]
    fn edges<N: Int>(&self, corners: [[N; 2]; 3], [x, y]: [N; 2]) -> [[N; 3]; 3] {
        let (zero, one, unit) = (N::from(0), N::from(1), N::from(UNIT));
        // A counter-clockwise triangle's edges run the other way. Branch-free, since a
        // branch would be unpredictable.
        let way = N::from(2 * i32::from(self.clockwise) - 1);
        let edge = |p: [N; 2], q: [N; 2]| {
            let (dx, dy) = ((q[0] - p[0]) * way, (q[1] - p[1]) * way);
            // Centres on left and top edges count as inside.
            let has = (dy < zero) | ((dy == zero) & (dx > zero));
            let at = dx * (y - p[1]) - dy * (x - p[0]) + N::from(i32::from(has)) - one;
            [at, (zero - dy) * unit, dx * unit]
        };
        let [a, b, c] = corners;
        [edge(a, b), edge(b, c), edge(c, a)]
    }

    /// The corners in units.
    #[inline(always)]
    fn corners(&self, points: &[Point; 3]) -> [[i64; 2]; 3] {
        let ([p, q, r], [a, b, c]) = (points, self.places);
        [units(a, p), units(b, q), units(c, r)]
    }

    /// Calls `draw` for every row's run of pixels: row, first column, one past the last
    /// column.
    pub fn runs(&self, points: &[Point; 3], draw: impl FnMut(usize, usize, usize)) {
        let corners = self.corners(points);
        if is_small(&corners) {
            self.runs_in(corners, draw)
        } else {
            self.runs_in(corners.map(|p| p.map(i128::from)), draw)
        }
    }

    fn runs_in<N: Int>(&self, corners: [[N; 2]; 3], mut draw: impl FnMut(usize, usize, usize)) {
        let Coverage { columns: [first, past], rows, .. } = *self;
        let start = [centre(first), centre(rows[0])].map(N::from);
        let mut edges = self.edges(corners, start).map(Crossing::new);
        for row in rows[0]..rows[1] {
            let (mut from, mut to) = (N::from(0), N::from((past - first) as i32));
            for edge in &mut edges {
                edge.narrow(&mut from, &mut to);
            }
            if from < to {
                draw(row, first + from.index(), first + to.index());
            }
        }
    }
}
