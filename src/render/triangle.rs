//! Which pixels a triangle covers, exactly, and its nearness there.
//!
//! Corners are rounded to 1/1024 of a pixel and edges worked out in integers, so triangles that share an edge neither overlap nor
//! leave gaps, at any size: a pixel belongs to a triangle when its centre is inside, centres on an edge go to the triangle to the
//! right of or below it (the top-left rule). Nearness comes from the corners as they were. Small triangles, nearly all of a fine
//! mesh, are filled eight pixels at a time, others by runs: the same pixels and the same numbers.

use super::crossing::{Crossing, Int};
use super::marks::Marks;
use super::place::{BITS, Extent, Place, UNIT, is_near};
use super::project::Point;
use glam::{Vec4, Vec4Swizzles};
use pulp::bytemuck::cast;
use wide::{f32x8, i32x8};

/// Corners are kept inside this, in units.
const FARTHEST: i64 = 1 << 60;
/// The longest side of a small triangle's rectangle, in pixels; its edges fit into 32 bits.
const SMALL: usize = 16;
/// Pixels filled at a time.
const LANES: usize = 8;

/// A run of pixels in one row; nearness changes linearly from pixel to pixel.
pub(super) struct Run {
    pub row: usize,
    pub from: usize,
    pub to: usize,
    nearness: f32,
    step: f32,
    /// The column that `nearness` is at.
    origin: usize,
    limits: [f32; 2],
}

impl Run {
    /// Nearness at the centre of a column.
    #[inline(always)]
    pub fn nearness(&self, column: usize) -> f32 {
        within(self.nearness + self.step * (column as i32 - self.origin as i32) as f32, self.limits)
    }
}

/// Comparisons that NaN fails are one instruction each, which `max` and `min` are not.
#[inline(always)]
fn within(q: f32, [lo, hi]: [f32; 2]) -> f32 {
    let q = if q > lo { q } else { lo };
    if q < hi { q } else { hi }
}

/// One triangle, ready to be drawn.
pub(super) struct Triangle {
    pub points: [Point; 3],
    /// Twice the area in pixels; negative when counter-clockwise as seen in the image.
    pub area: f64,
    /// Least and greatest nearness of the corners.
    limits: [f32; 2],
    places: [Place; 3],
    /// Whether they lie clockwise as seen in the image.
    clockwise: bool,
    columns: [usize; 2],
    rows: [usize; 2],
    small: bool,
}

/// The centre of a pixel in units.
#[inline(always)]
fn centre(pixel: usize) -> i32 {
    (pixel as i32) << BITS
}

/// A corner in units, also where its place cannot hold it.
fn units(place: Place, point: &Point) -> [i64; 2] {
    let [x, y, ..] = place.to_array();
    if is_near(place) {
        return [x, y].map(|v| (v * UNIT as f32) as i64);
    }
    // In single precision, which is all that is kept of most points.
    [point.x, point.y].map(|v| {
        let v = (f64::from(v as f32) - 0.5) * f64::from(UNIT);
        ((v + if v < 0.0 { -0.5 } else { 0.5 }) as i64).clamp(-FARTHEST, FARTHEST)
    })
}

/// Which way round near places lie in the image: above 0 clockwise, below counter-clockwise, 0 without area.
#[inline(always)]
fn turn([a, b, c]: [Place; 3]) -> f64 {
    // Differences of places are exact in single precision, their products in double precision.
    let (b, c) = ((b - a).to_array().map(f64::from), (c - a).to_array().map(f64::from));
    b[0] * c[1] - b[1] * c[0]
}

/// The same for places of which some are not near.
#[inline(never)]
fn far_turn(places: &[Place; 3], points: &[Point; 3]) -> f64 {
    let [a, b, c] = std::array::from_fn(|i| units(places[i], &points[i]).map(i128::from));
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum() as f64
}

/// Whether corners are known to turn that way, as [`Triangle::new`] has it.
#[inline(always)]
pub(super) fn is_turned(places: [Place; 3], back: f64) -> bool {
    let [a, b, c] = places;
    is_near(a.min(b).min(c)) & (turn(places) * back > 0.0)
}

impl Triangle {
    /// As [`Triangle::new`], in an image of some [`size`](super::place::size).
    #[inline(always)]
    pub fn within(points: [Point; 3], places: [Place; 3], size: Vec4, back: f64) -> Option<Triangle> {
        let extent = Extent::around(places, size);
        if extent.is_empty() { None } else { Triangle::new(points, places, extent, back) }
    }

    /// `None` when it covers nothing. With `back`, also when it turns that way: clockwise in the image if above 0, the other way if
    /// below.
    #[inline(always)]
    pub fn new(points: [Point; 3], places: [Place; 3], extent: Extent, back: f64) -> Option<Triangle> {
        let [a, b, c] = places;
        let least = a.min(b).min(c);
        // Greatest coordinates less the least ones.
        let wide = -(least + least.zwxy());
        let small = wide.x < SMALL as f32 && wide.y < SMALL as f32;
        let turn = if is_near(least) { turn(places) } else { far_turn(&places, &points) };
        if turn == 0.0 || turn * back > 0.0 {
            return None;
        }
        let [p, q, r] = &points;
        let area = (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
        if area == 0.0 || !area.is_finite() {
            return None;
        }
        let [p, q, r] = points.each_ref().map(|p| p.nearness as f32);
        let (lo, hi) = (if p < q { p } else { q }, if p > q { p } else { q });
        let limits = [if lo < r { lo } else { r }, if hi > r { hi } else { r }];
        let [columns, rows] = extent.ends();
        Some(Triangle { points, limits, area, places, clockwise: turn > 0.0, columns, rows, small })
    }

    /// Nearness at the first column by row, and its change from column to column.
    #[inline(always)]
    fn plane(&self) -> (impl Fn(usize) -> f32 + use<>, f32) {
        let [a, b, c] = self.points;
        let inverse = 1.0 / self.area;
        let (qb, qc) = (b.nearness - a.nearness, c.nearness - a.nearness);
        let dx = (qb * (c.y - a.y) - qc * (b.y - a.y)) * inverse;
        let dy = (qc * (b.x - a.x) - qb * (c.x - a.x)) * inverse;
        let first = a.nearness + dx * (self.columns[0] as f64 + 0.5 - a.x);
        (move |row: usize| (first + dy * (row as f64 + 0.5 - a.y)) as f32, dx as f32)
    }

    /// Edges as functions that are not negative inside: value at a pixel's centre, change by column, change by row.
    #[inline(always)]
    fn edges<N: Int>(&self, corners: [[N; 2]; 3], [x, y]: [N; 2]) -> [[N; 3]; 3] {
        let (zero, one, unit) = (N::from(0), N::from(1), N::from(UNIT));
        // Counter-clockwise, every edge runs the other way. No branches: they could not be foretold.
        let way = N::from(2 * i32::from(self.clockwise) - 1);
        std::array::from_fn(|i| {
            let (p, q) = (corners[i], corners[(i + 1) % 3]);
            let (dx, dy) = ((q[0] - p[0]) * way, (q[1] - p[1]) * way);
            // Left and top edges have the centres on them.
            let has = (dy < zero) | ((dy == zero) & (dx > zero));
            let at = dx * (y - p[1]) - dy * (x - p[0]) + N::from(i32::from(has)) - one;
            [at, (zero - dy) * unit, dx * unit]
        })
    }

    /// The edges of a small triangle at a pixel's centre in its first row: relative to that, everything fits.
    #[inline(always)]
    fn small_edges(&self, column: usize) -> [[i32; 3]; 3] {
        // The lowest bits of a sum with this are the nearest whole number, also below zero.
        const LOW_BITS: f32 = 12_582_912.0;
        let start = Vec4::new(column as i32 as f32, self.rows[0] as i32 as f32, 0.0, 0.0);
        let corners = self.places.map(|place| {
            let [x, y, ..] = ((place - start) * UNIT as f32 + LOW_BITS).to_array().map(|v| v.to_bits() as i32);
            [x - LOW_BITS.to_bits() as i32, y - LOW_BITS.to_bits() as i32]
        });
        self.edges(corners, [0, 0])
    }

    /// Calls `draw` for every row's run of pixels.
    pub fn runs(&self, draw: impl FnMut(&Run)) {
        // Products of two differences must fit.
        let corners: [[i64; 2]; 3] = std::array::from_fn(|i| units(self.places[i], &self.points[i]));
        let near = corners.as_flattened().iter().all(|v| v.abs() < 1 << 29);
        if near { self.runs_in(corners, draw) } else { self.runs_in(corners.map(|p| p.map(i128::from)), draw) }
    }

    fn runs_in<N: Int>(&self, corners: [[N; 2]; 3], mut draw: impl FnMut(&Run)) {
        let (row_nearness, step) = self.plane();
        let Triangle { columns: [first, past], rows, .. } = *self;
        let start = [centre(first), centre(rows[0])].map(N::from);
        let mut edges = self.edges(corners, start).map(Crossing::new);
        for row in rows[0]..rows[1] {
            let (mut from, mut to) = (N::from(0), N::from((past - first) as i32));
            for edge in &mut edges {
                edge.narrow(&mut from, &mut to);
            }
            if from < to {
                let [from, to] = [from, to].map(|at| first + at.index());
                draw(&Run { row, from, to, nearness: row_nearness(row), step, origin: first, limits: self.limits });
            }
        }
    }

    /// Keeps the nearer of the triangle and what is there, in a buffer of some columns from `left` on and rows from `top` on.
    #[inline(always)]
    pub fn fill(&self, buffer: &mut [f32], [left, right]: [usize; 2], top: usize) {
        let width = right - left;
        let Triangle { columns: [first, past], rows, small, .. } = *self;
        if small && first >= left && past <= right && rows[0] >= top && width >= LANES {
            let plane = self.plane();
            // A second time for what is beyond the lanes.
            self.fill_lanes(buffer, left, width, top, first.min(right - LANES), &plane);
            if past - first > LANES {
                self.fill_lanes(buffer, left, width, top, (first + LANES).min(right - LANES), &plane);
            }
            return;
        }
        self.fill_runs(buffer, [left, right], top);
    }

    /// As [`Triangle::fill`]; out of the way of small triangles.
    #[inline(never)]
    fn fill_runs(&self, buffer: &mut [f32], [left, right]: [usize; 2], top: usize) {
        let width = right - left;
        self.runs(|run| {
            let (from, to) = (run.from.max(left), run.to.min(right));
            if run.row < top || from >= to {
                return;
            }
            let start = (run.row - top) * width;
            let Some(pixels) = buffer.get_mut(start + from - left..start + to - left) else { return };
            for (column, pixel) in (from..).zip(pixels) {
                let q = run.nearness(column);
                *pixel = if q > *pixel { q } else { *pixel };
            }
        });
    }

    /// The columns from one on, as many as there are lanes.
    #[inline(always)]
    fn fill_lanes(
        &self,
        buffer: &mut [f32],
        left: usize,
        width: usize,
        top: usize,
        from: usize,
        (row_nearness, step): &(impl Fn(usize) -> f32, f32),
    ) {
        let Triangle { columns: [first, _], rows, .. } = *self;
        let edges = self.small_edges(from);
        let mut lanes = edges.map(|[at, c, _]| {
            let four = i32x8::new([0, c, 2 * c, 3 * c, 4 * c, 5 * c, 6 * c, 7 * c]);
            four + at
        });
        let by_row = edges.map(|[_, _, by_row]| i32x8::splat(by_row));
        let offset = from as i32 - first as i32;
        let along = (f32x8::new(std::array::from_fn(|i| i as f32)) + offset as f32) * step;
        let [lo, hi] = self.limits.map(f32x8::splat);
        let mut at = (rows[0] - top) * width + from - left;
        for row in rows[0]..rows[1] {
            let Some(pixels) = buffer.get_mut(at..).and_then(|b| b.first_chunk_mut::<LANES>()) else { return };
            let there = f32x8::new(*pixels);
            let q = (along + row_nearness(row)).fast_max(lo).fast_min(hi);
            // Negative where one edge is.
            let outside: f32x8 = cast((lanes[0] | lanes[1] | lanes[2]) >> 31);
            *pixels = (q.simd_gt(there) & !outside).bitselect(q, there).to_array();
            lanes = [lanes[0] + by_row[0], lanes[1] + by_row[1], lanes[2] + by_row[2]];
            at += width;
        }
    }

    /// As [`Triangle::fill`] for a whole image of some columns, but pixels that are not marked need not be drawn.
    #[inline(always)]
    pub fn fill_some(&self, buffer: &mut [f32], width: usize, marks: &Marks) {
        if self.small {
            self.fill(buffer, [0, width], 0);
        } else {
            self.fill_some_runs(buffer, width, marks);
        }
    }

    #[inline(never)]
    fn fill_some_runs(&self, buffer: &mut [f32], width: usize, marks: &Marks) {
        self.runs(|run| {
            for from in (run.from..run.to).step_by(64) {
                for i in bits(marks.window(run.row * width + from, (run.to - from).min(64))) {
                    if let Some(pixel) = buffer.get_mut(run.row * width + from + i) {
                        let q = run.nearness(from + i);
                        *pixel = if q > *pixel { q } else { *pixel };
                    }
                }
            }
        });
    }
}

/// The places of the bits that are set.
#[inline(always)]
pub(super) fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let i = word.trailing_zeros();
        word &= word.wrapping_sub(1);
        (i < 64).then_some(i as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::super::place::{place, size};
    use super::*;
    use crate::render::Camera;
    use crate::render::testing::Uniform;

    fn at(x: f64, y: f64) -> Point {
        Point { x, y, nearness: 1.0 }
    }

    fn triangle(points: [Point; 3], width: u32, height: u32) -> Option<Triangle> {
        let places = points.map(|p| place(p.x, p.y));
        Triangle::within(points, places, size(width, height), 0.0)
    }

    fn cover(triangles: &[[Point; 3]], side: u32) -> Vec<u32> {
        let mut count = vec![0; (side * side) as usize];
        for t in triangles {
            if let Some(t) = triangle(*t, side, side) {
                t.runs(|run| {
                    for x in run.from..run.to {
                        count[run.row * side as usize + x] += 1;
                    }
                });
            }
        }
        count
    }

    #[test]
    fn a_fan_of_triangles_covers_each_pixel_once() {
        let mut random = Uniform(7);
        for round in 0..200 {
            // Corners on quarter pixels every other time: centres lie exactly on edges.
            let mut place = |scale: f64| {
                let v = random.next() * scale;
                if round % 2 == 0 { (v * 2.0).round() / 2.0 } else { v }
            };
            let middle = at(4.0 + place(8.0), 4.0 + place(8.0));
            let far = if round % 3 == 0 { 1e6 } else { 0.0 };
            let square = [at(-far, -far), at(16.0 + far, -far), at(16.0 + far, 16.0 + far), at(-far, 16.0 + far)];
            let fan: Vec<_> = (0..4).map(|i| [square[i], square[(i + 1) % 4], middle]).collect();
            assert!(cover(&fan, 16).iter().all(|&n| n == 1), "round {round}");
        }
    }

    #[test]
    fn only_centres_inside_count() {
        let count = cover(&[[at(0.5, 0.5), at(3.5, 0.5), at(0.5, 3.5)]], 5);
        let mut wanted = vec![0; 25];
        for (x, y) in [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (0, 2)] {
            wanted[y * 5 + x] = 1;
        }
        assert_eq!(count, wanted);
    }

    /// Filled by lanes, by runs, and in part of the picture.
    #[test]
    fn small_triangles_are_filled_as_by_runs() {
        let mut random = Uniform(3);
        let (width, height) = (40, 30);
        let mut marks = Marks::default();
        marks.clear(&Camera::default_for(width, height));
        (0..width * height).step_by(3).for_each(|pixel| marks.set(pixel));
        let mut drawn = 0;
        for round in 0..3000 {
            let size = [1.5, 7.0, 15.0, 30.0][round % 4];
            let corner = [random.between(-2.0, 42.0), random.between(-2.0, 32.0)];
            let mut point = || {
                let mut v = corner.map(|at| at + size * (random.next() - 0.5));
                if round % 3 == 0 {
                    v = v.map(|v| (v * 2.0).round() / 2.0);
                }
                Point { x: v[0], y: v[1], nearness: 0.3 + random.next() }
            };
            let Some(triangle) = triangle([point(), point(), point()], width, height) else { continue };
            let (width, height) = (width as usize, height as usize);
            let mut by_lanes = vec![0.5f32; width * height];
            let mut by_runs = by_lanes.clone();
            triangle.fill(&mut by_lanes, [0, width], 0);
            triangle.runs(|run| {
                for column in run.from..run.to {
                    let pixel = &mut by_runs[run.row * width + column];
                    *pixel = pixel.max(run.nearness(column));
                    drawn += 1;
                }
            });
            assert_eq!(by_lanes, by_runs, "round {round}");
            let mut some = vec![0.5f32; width * height];
            triangle.fill_some(&mut some, width, &marks);
            let third = |list: &[f32]| list.iter().step_by(3).copied().collect::<Vec<_>>();
            assert_eq!(third(&some), third(&by_runs), "round {round}");
            let [left, top] = [triangle.columns[0], triangle.rows[0]];
            let mut part = vec![0.5f32; (width - left) * (height - top)];
            triangle.fill(&mut part, [left, width], top);
            for (row, own) in part.chunks(width - left).enumerate() {
                assert_eq!(own, &by_runs[(top + row) * width + left..(top + row + 1) * width], "round {round}");
            }
        }
        assert!(drawn > 20_000, "{drawn}");
    }
}
