//! Drawing the nearness of triangles.
//!
//! [`crate::render::pixels::coverage`] decides which pixels a triangle covers, from rounded corners;
//! nearness is computed from the unrounded ones. Drawing eight pixels at a time and
//! drawing by runs give the same numbers.

use crate::render::pixels::area::Area;
use crate::render::pixels::coverage::Coverage;
use crate::render::pixels::pixel_bitmap::PixelBitmap;
use crate::render::pixels::place::Point;
use crate::render::pixels::place::{Extent, Place};
use crate::render::pixels::simd_raster::{LANES, all_bits};
use glam::Vec4;
use pulp::bytemuck::cast;
use wide::{f32x8, i32x8};

/// A run of pixels in one row, over which nearness is linear.
pub(in crate::render) struct Run {
    pub row: usize,
    pub from: usize,
    pub to: usize,
    nearness: f32,
    step: f32,
    /// The column at which `nearness` is given.
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

/// Clamps. Comparisons that NaN fails are one instruction each, unlike `max` and `min`.
#[inline(always)]
fn within(q: f32, [lo, hi]: [f32; 2]) -> f32 {
    let q = if q > lo { q } else { lo };
    if q < hi { q } else { hi }
}

/// Nearness over a triangle, linear in the image.
pub(in crate::render) struct Plane {
    /// The value at the first column, in the row of the first corner.
    first: f64,
    /// Its change per row, and the first corner's y.
    by_row: f64,
    corner: f64,
    /// Its change per column.
    step: f32,
    /// The first column.
    origin: usize,
    /// Least and greatest nearness of the corners.
    limits: [f32; 2],
}

impl Plane {
    /// Starts at a column; `None` for a triangle without area.
    #[inline(always)]
    pub fn new(points: &[Point; 3], column: usize) -> Option<Plane> {
        if is_flat(points) {
            return None;
        }
        let [a, b, c] = points;
        let inverse = 1.0 / area(points);
        let (qb, qc) = (b.nearness - a.nearness, c.nearness - a.nearness);
        let dx = (qb * (c.y - a.y) - qc * (b.y - a.y)) * inverse;
        let dy = (qc * (b.x - a.x) - qb * (c.x - a.x)) * inverse;
        let first = a.nearness + dx * (column as f64 + 0.5 - a.x);
        let [p, q, r] = points.each_ref().map(|p| p.nearness as f32);
        let (lo, hi) = (if p < q { p } else { q }, if p > q { p } else { q });
        let limits = [if lo < r { lo } else { r }, if hi > r { hi } else { r }];
        Some(Plane { first, by_row: dy, corner: a.y, step: dx as f32, origin: column, limits })
    }

    /// Nearness at the first column of a row.
    #[inline(always)]
    fn row(&self, row: usize) -> f32 {
        (self.first + self.by_row * (row as f64 + 0.5 - self.corner)) as f32
    }

    /// Writes the lanes that are inside the triangle and nearer than the buffer. The
    /// lanes begin at column `from` of `row`, which is index `at` of the buffer. Returns
    /// the lanes that were written, as all bits set.
    #[inline(always)]
    pub fn keep(
        &self,
        buffer: &mut [f32],
        at: usize,
        row: usize,
        from: usize,
        outside: i32x8,
    ) -> f32x8 {
        let Some(pixels) = buffer.get_mut(at..).and_then(|b| b.first_chunk_mut::<LANES>()) else {
            return f32x8::ZERO;
        };
        let there = f32x8::new(*pixels);
        let offset = (from as i32 - self.origin as i32) as f32;
        let along = (f32x8::new(std::array::from_fn(|i| i as f32)) + offset) * self.step;
        let [lo, hi] = self.limits.map(f32x8::splat);
        let q = (along + self.row(row)).fast_max(lo).fast_min(hi);
        let nearer = q.simd_gt(there) & !all_bits(outside);
        *pixels = nearer.bitselect(q, there).to_array();
        nearer
    }
}

/// Writes a face into the lanes set in `nearer`, which begin at index `at` of a buffer.
#[inline(always)]
pub(in crate::render) fn put_face(faces: &mut [u32], at: usize, face: u32, nearer: f32x8) {
    let Some(pixels) = faces.get_mut(at..).and_then(|b| b.first_chunk_mut::<LANES>()) else {
        return;
    };
    let nearer: [u32; LANES] = cast(nearer);
    for (pixel, nearer) in pixels.iter_mut().zip(nearer) {
        *pixel = (*pixel & !nearer) | (face & nearer);
    }
}

/// True if a triangle has no area.
#[inline(always)]
fn is_flat(points: &[Point; 3]) -> bool {
    let area = area(points);
    area == 0.0 || !area.is_finite()
}

/// Twice the area in pixels; negative when counter-clockwise as seen in the image.
#[inline(always)]
pub(in crate::render) fn area([a, b, c]: &[Point; 3]) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// A triangle that is ready to be drawn.
pub(in crate::render) struct Triangle {
    pub points: [Point; 3],
    coverage: Coverage,
    plane: Plane,
}

impl Triangle {
    /// As [`Triangle::new`], in an image of some [`size`](crate::render::pixels::place::size).
    #[inline(always)]
    pub fn within(
        points: [Point; 3],
        places: [Place; 3],
        size: Vec4,
        back: f64,
    ) -> Option<Triangle> {
        let extent = Extent::around(places, size);
        if extent.is_empty() { None } else { Triangle::new(points, places, extent, back) }
    }

    /// `None` if it covers nothing, or has the orientation `back` as in
    /// [`Coverage::new`].
    #[inline(always)]
    pub fn new(
        points: [Point; 3],
        places: [Place; 3],
        extent: Extent,
        back: f64,
    ) -> Option<Triangle> {
        Triangle::covering(Coverage::new(places, || points, extent, back)?, points)
    }

    /// `None` if it has no area.
    #[inline(always)]
    fn covering(coverage: Coverage, points: [Point; 3]) -> Option<Triangle> {
        let plane = Plane::new(&points, coverage.columns[0])?;
        Some(Triangle { points, coverage, plane })
    }

    /// Calls `draw` for every row's run of pixels.
    pub fn runs(&self, mut draw: impl FnMut(&Run)) {
        let Plane { step, origin, limits, .. } = self.plane;
        self.coverage.runs(&self.points, |row, from, to| {
            draw(&Run { row, from, to, nearness: self.plane.row(row), step, origin, limits });
        });
    }

    /// Merges the triangle into the rows of an area, keeping the nearer value. With a set
    /// of marked pixels, only these are sure to be drawn, and the area must be the whole
    /// image.
    pub fn keep(&self, buffer: &mut [f32], area: &Area, bitmap: Option<&PixelBitmap>) {
        match bitmap {
            Some(bitmap) => self.fill_some(buffer, area.right - area.left, bitmap),
            None => self.fill(buffer, [area.left, area.right], area.top),
        }
    }

    /// As [`Triangle::keep`], in a buffer of columns `left..right` and rows from `top`
    /// on.
    #[inline(never)]
    pub fn fill(&self, buffer: &mut [f32], [left, right]: [usize; 2], top: usize) {
        let width = right - left;
        self.runs(|run| {
            let (from, to) = (run.from.max(left), run.to.min(right));
            if run.row < top || from >= to {
                return;
            }
            let start = (run.row - top) * width;
            let Some(pixels) = buffer.get_mut(start + from - left..start + to - left) else {
                return;
            };
            for (column, pixel) in (from..).zip(pixels) {
                let q = run.nearness(column);
                *pixel = if q > *pixel { q } else { *pixel };
            }
        });
    }

    /// As [`Triangle::fill`] in an area, and writes the face where the triangle is
    /// nearer.
    #[inline(never)]
    pub fn fill_faces(&self, buffer: &mut [f32], (faces, face): (&mut [u32], u32), area: &Area) {
        let width = area.right - area.left;
        self.runs(|run| {
            let (from, to) = (run.from.max(area.left), run.to.min(area.right));
            if run.row < area.top || from >= to {
                return;
            }
            let start = (run.row - area.top) * width;
            let range = start + from - area.left..start + to - area.left;
            let (Some(pixels), Some(faces)) = (buffer.get_mut(range.clone()), faces.get_mut(range))
            else {
                return;
            };
            for ((column, pixel), seen) in (from..).zip(pixels).zip(faces) {
                let q = run.nearness(column);
                if q > *pixel {
                    (*pixel, *seen) = (q, face);
                }
            }
        });
    }

    /// As [`Triangle::fill`] for a whole image of `width` columns, but pixels that are
    /// not marked may be skipped.
    #[inline(never)]
    fn fill_some(&self, buffer: &mut [f32], width: usize, bitmap: &PixelBitmap) {
        self.runs(|run| {
            for from in (run.from..run.to).step_by(64) {
                for i in bits(bitmap.window(run.row * width + from, (run.to - from).min(64))) {
                    if let Some(pixel) = buffer.get_mut(run.row * width + from + i) {
                        let q = run.nearness(from + i);
                        *pixel = if q > *pixel { q } else { *pixel };
                    }
                }
            }
        });
    }
}

/// The indices of the bits that are set.
#[inline(always)]
pub(in crate::render) fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let i = word.trailing_zeros();
        word &= word.wrapping_sub(1);
        (i < 64).then_some(i as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Camera;
    use crate::render::pixels::place::{place, size};
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
            let square = [
                at(-far, -far),
                at(16.0 + far, -far),
                at(16.0 + far, 16.0 + far),
                at(-far, 16.0 + far),
            ];
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

    /// Filled whole, in part of the picture, and at marked pixels.
    #[test]
    fn triangles_are_filled_as_by_their_runs() {
        let mut random = Uniform(3);
        let (width, height) = (40, 30);
        let mut bitmap = PixelBitmap::default();
        bitmap.clear(&Camera::default_for(width, height));
        (0..width * height).step_by(3).for_each(|pixel| bitmap.set(pixel));
        bitmap.finish();
        let mut drawn = 0;
        for round in 0..1000 {
            let points = random.corners([1.5, 7.0, 15.0, 30.0][round % 4], round % 3 == 0);
            let Some(triangle) = triangle(points, width, height) else { continue };
            let (width, height) = (width as usize, height as usize);
            let [mut whole, mut by_runs, mut some] = [(); 3].map(|()| vec![0.5f32; width * height]);
            triangle.fill(&mut whole, [0, width], 0);
            triangle.runs(|run| {
                for column in run.from..run.to {
                    let pixel = &mut by_runs[run.row * width + column];
                    *pixel = pixel.max(run.nearness(column));
                    drawn += 1;
                }
            });
            assert_eq!(whole, by_runs, "round {round}");
            let [left, top] = [triangle.coverage.columns[0], triangle.coverage.rows[0]];
            let mut part = vec![0.5f32; (width - left) * (height - top)];
            triangle.fill(&mut part, [left, width], top);
            for (row, own) in part.chunks(width - left).enumerate() {
                assert_eq!(
                    own,
                    &by_runs[(top + row) * width + left..(top + row + 1) * width],
                    "round {round}"
                );
            }
            triangle.fill_some(&mut some, width, &bitmap);
            let third = |list: &[f32]| list.iter().step_by(3).copied().collect::<Vec<_>>();
            assert_eq!(third(&some), third(&by_runs), "round {round}");
        }
        assert!(drawn > 7_000, "{drawn}");
    }
}
