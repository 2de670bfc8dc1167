//! Which pixels a triangle covers, exactly, and its nearness there.
//!
//! Corners are rounded to 1/1024 of a pixel and edges worked out in integers, so triangles that share an edge neither overlap nor
//! leave gaps, at any size: a pixel belongs to a triangle when its centre is inside, centres on an edge go to the triangle to the
//! right of or below it (the top-left rule). Nearness comes from the corners as they were. Small triangles, nearly all of a fine
//! mesh, are filled eight pixels at a time, others by runs: the same pixels and the same numbers.

use super::project::Point;

/// Units of a rounded position in a pixel, as a power of two.
const BITS: u32 = 10;
const UNIT: i64 = 1 << BITS;
/// Positions are kept inside this, in units.
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
    /// The corners in units, clockwise as seen in the image.
    corners: [[i64; 2]; 3],
    columns: [usize; 2],
    rows: [usize; 2],
    small: bool,
}

impl Point {
    /// The nearest position in units.
    #[inline(always)]
    fn units(&self) -> [i64; 2] {
        let [x, y] = self.place;
        let far = |at: i32| at == i32::MIN || at == i32::MAX;
        if far(x) || far(y) { [rounded(self.x), rounded(self.y)] } else { [i64::from(x), i64::from(y)] }
    }
}

/// The same where it does not fit into 32 bits.
fn rounded(v: f64) -> i64 {
    let v = v * UNIT as f64;
    let half = if v < 0.0 { -0.5 } else { 0.5 };
    ((v + half) as i64).clamp(-FARTHEST, FARTHEST)
}

/// The first pixel whose centre is not before a position in units, and the first whose centre is beyond another one, both from 0
/// to `side`.
#[inline(always)]
fn between(least: i64, most: i64, side: u32) -> [usize; 2] {
    let inside = |pixel: i64| pixel.clamp(0, i64::from(side)) as usize;
    [inside((least + (UNIT / 2 - 1)) >> BITS), inside((most + UNIT / 2) >> BITS)]
}

/// A position in units that fits into 32 bits, or the nearest that does: then it may be farther out.
#[inline(always)]
pub(super) fn place(v: f64) -> i32 {
    let v = v * UNIT as f64;
    let half = if v < 0.0 { -0.5 } else { 0.5 };
    (v + half) as i32
}

/// Whether the centre of a pixel of an image that is `side` pixels long may lie between three places. None lies beyond the border,
/// nor within less than a pixel that has none.
#[inline(always)]
fn may_hold_centre(a: i32, b: i32, c: i32, side: u32) -> bool {
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    // Neither end can overflow: what is farthest out is moved inward.
    let first = (least.clamp(i32::MIN / 2, i32::MAX / 2) + (UNIT as i32 / 2 - 1)) >> BITS;
    let past = (most.clamp(i32::MIN / 2, i32::MAX / 2) + UNIT as i32 / 2) >> BITS;
    first.max(0) < past.min(side as i32)
}

/// The centre of a pixel in units.
#[inline(always)]
fn centre(pixel: usize) -> i64 {
    ((pixel as i64) << BITS) + UNIT / 2
}

impl Triangle {
    /// `None` when no pixel centre of a `width` x `height` image can be inside.
    #[inline(always)]
    pub fn new(points: [Point; 3], width: u32, height: u32) -> Option<Triangle> {
        let [p, q, r] = &points;
        if !may_hold_centre(p.place[0], q.place[0], r.place[0], width)
            || !may_hold_centre(p.place[1], q.place[1], r.place[1], height)
        {
            return None;
        }
        let [a, b, c] = points.each_ref().map(Point::units);
        let least = |i: usize| a[i].min(b[i]).min(c[i]);
        let most = |i: usize| a[i].max(b[i]).max(c[i]);
        let (x, y) = ([least(0), most(0)], [least(1), most(1)]);
        let (columns, rows) = (between(x[0], x[1], width), between(y[0], y[1], height));
        if columns[0] >= columns[1] || rows[0] >= rows[1] {
            return None;
        }
        let small = x[1] - x[0] < SMALL as i64 * UNIT && y[1] - y[0] < SMALL as i64 * UNIT;
        let clockwise = if small {
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum()
        } else {
            let [a, b, c] = [a, b, c].map(|p| p.map(i128::from));
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum() as i64
        };
        let area = (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
        if clockwise == 0 || area == 0.0 || !area.is_finite() {
            return None;
        }
        let lo = p.nearness.min(q.nearness).min(r.nearness) as f32;
        let hi = p.nearness.max(q.nearness).max(r.nearness) as f32;
        let corners = if clockwise > 0 { [a, b, c] } else { [a, c, b] };
        Some(Triangle { points, limits: [lo, hi], area, corners, columns, rows, small })
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
    fn edges<N: Copy + From<i32> + std::ops::Sub<Output = N> + std::ops::Mul<Output = N> + PartialOrd>(
        corners: [[N; 2]; 3],
        [x, y]: [N; 2],
    ) -> [[N; 3]; 3] {
        let (zero, one, unit) = (N::from(0), N::from(1), N::from(UNIT as i32));
        std::array::from_fn(|i| {
            let (p, q) = (corners[i], corners[(i + 1) % 3]);
            let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
            // Left and top edges have the centres on them.
            let has = dy < zero || (dy == zero && dx > zero);
            let at = dx * (y - p[1]) - dy * (x - p[0]) - if has { zero } else { one };
            [at, (zero - dy) * unit, dx * unit]
        })
    }

    /// Calls `draw` for every row's run of pixels.
    #[inline]
    pub fn runs(&self, mut draw: impl FnMut(&Run)) {
        let (row_nearness, step) = self.plane();
        let [first, past] = self.columns;
        let start = [centre(first), centre(self.rows[0])].map(i128::from);
        let mut edges = Triangle::edges(self.corners.map(|p| p.map(i128::from)), start);
        for row in self.rows[0]..self.rows[1] {
            let (mut from, mut to) = (first as i128, past as i128);
            for [at, by_column, by_row] in &mut edges {
                match (*by_column).signum() {
                    1 => from = from.max(first as i128 - quotient(*at, *by_column)),
                    -1 => to = to.min(first as i128 + quotient(*at, -*by_column) + 1),
                    _ if *at < 0 => to = from,
                    _ => {}
                }
                *at += *by_row;
            }
            if from < to {
                let (nearness, limits) = (row_nearness(row), self.limits);
                draw(&Run { row, from: from as usize, to: to as usize, nearness, step, origin: first, limits });
            }
        }
    }

    /// Keeps the nearer of the triangle and what is there, in a buffer of some columns from `left` on and rows from `top` on.
    #[inline(always)]
    pub fn fill(&self, buffer: &mut [f32], [left, right]: [usize; 2], top: usize) {
        let width = right - left;
        let inside = self.columns[0] >= left && self.columns[1] <= right && self.rows[0] >= top;
        let count = self.columns[1] - self.columns[0];
        if self.small && inside && width >= LANES {
            // A second time for what is beyond the lanes.
            let mut from = self.columns[0];
            self.fill_lanes(buffer, left, width, top, from.min(right - LANES));
            if count > LANES {
                from += LANES;
                self.fill_lanes(buffer, left, width, top, from.min(right - LANES));
            }
            return;
        }
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
    fn fill_lanes(&self, buffer: &mut [f32], left: usize, width: usize, top: usize, from: usize) {
        let (row_nearness, step) = self.plane();
        let start = [centre(from), centre(self.rows[0])];
        // Relative to the first pixel everything fits.
        let corners = self.corners.map(|p| [(p[0] - start[0]) as i32, (p[1] - start[1]) as i32]);
        let edges = Triangle::edges(corners, [0, 0]);
        let mut lanes: [[i32; LANES]; 3] =
            edges.map(|[at, by_column, _]| std::array::from_fn(|i| at + by_column * i as i32));
        let offset = from as i32 - self.columns[0] as i32;
        let along: [f32; LANES] = std::array::from_fn(|i| step * (offset + i as i32) as f32);
        let mut at = (self.rows[0] - top) * width + from - left;
        for row in self.rows[0]..self.rows[1] {
            let Some(pixels) = buffer.get_mut(at..).and_then(|b| b.first_chunk_mut::<LANES>()) else { return };
            let nearness = row_nearness(row);
            for i in 0..LANES {
                let q = within(nearness + along[i], self.limits);
                let covered = (lanes[0][i] | lanes[1][i] | lanes[2][i]) >= 0;
                pixels[i] = if covered & (q > pixels[i]) { q } else { pixels[i] };
            }
            for (lanes, [_, _, by_row]) in lanes.iter_mut().zip(&edges) {
                lanes.iter_mut().for_each(|e| *e += by_row);
            }
            at += width;
        }
    }
}

/// The quotient, rounded down.
#[inline]
fn quotient(a: i128, b: i128) -> i128 {
    match (i64::try_from(a), i64::try_from(b)) {
        (Ok(a), Ok(b)) => i128::from(a.div_euclid(b)),
        _ => a.div_euclid(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> Point {
        Point { place: [place(x), place(y)], x, y, nearness: 1.0, depth: 1.0 }
    }

    fn cover(triangles: &[[Point; 3]], side: u32) -> Vec<u32> {
        let mut count = vec![0; (side * side) as usize];
        for t in triangles {
            if let Some(t) = Triangle::new(*t, side, side) {
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
        let mut state = 7u64;
        let mut unit = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for round in 0..200 {
            // Corners on quarter pixels every other time: centres lie exactly on edges.
            let mut place = |scale: f64| {
                let v = unit() * scale;
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
        let mut state = 3u64;
        let mut unit = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let (width, height) = (40, 30);
        let mut drawn = 0;
        for round in 0..3000 {
            let size = [1.5, 7.0, 15.0, 30.0][round % 4];
            let corner = [unit() * 44.0 - 2.0, unit() * 34.0 - 2.0];
            let mut point = || {
                let mut v = [corner[0] + size * (unit() - 0.5), corner[1] + size * (unit() - 0.5)];
                if round % 3 == 0 {
                    v = v.map(|v| (v * 2.0).round() / 2.0);
                }
                Point { place: v.map(place), x: v[0], y: v[1], nearness: 0.3 + unit(), depth: 1.0 }
            };
            let Some(triangle) = Triangle::new([point(), point(), point()], width, height) else { continue };
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
