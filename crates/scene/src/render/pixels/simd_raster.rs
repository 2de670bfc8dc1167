//! The pixels of small triangles, which are nearly all of a fine mesh: many triangles are
//! set up at a time, and eight pixels of a row are tested at a time.
//!
//! Gives the same pixels as [`crate::render::pixels::coverage`]: the edge functions are the same, in
//! 32-bit integers.

use crate::render::pixels::place::{Extent, Place, UNIT};
use pulp::bytemuck::cast;
use wide::{f32x8, i32x8};

/// Pixels tested at a time.
pub(in crate::render) const LANES: usize = 8;
/// Triangles set up at a time.
const MOST: usize = 64;
/// Triangles narrower and lower than this, in pixels, are small.
const SMALL: f32 = 16.0;

/// Triangles with their edge functions, which are not negative inside. Reused from batch
/// to batch.
pub(in crate::render) struct Batch {
    count: usize,
    faces: [u32; MOST],
    extents: [Extent; MOST],
    /// The coordinates x and y of each corner in turn, in pixels relative to the first
    /// lane of the first row.
    corners: [[f32; MOST]; 6],
    /// Each edge function's value there, its change per column, its change per row.
    edges: [[[i32; MOST]; 3]; 3],
    kinds: [Kind; MOST],
}

/// How a triangle is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub(in crate::render) enum Kind {
    /// Not at all: it shows a back face that need not be drawn, or has no area.
    Nothing = 0,
    /// By lanes.
    Small = 1,
    /// By runs, because it is too large for lanes.
    Large = 2,
}

impl Default for Batch {
    fn default() -> Batch {
        let kinds = [Kind::Nothing; MOST];
        let extents = [Extent::default(); MOST];
        Batch {
            count: 0,
            faces: [0; MOST],
            extents,
            corners: [[0.0; MOST]; 6],
            edges: [[[0; MOST]; 3]; 3],
            kinds,
        }
    }
}

/// The column of a triangle's first lane in a buffer that ends at column `right`.
#[inline(always)]
fn start(extent: &Extent, right: usize) -> usize {
    extent.ends()[0][0].min(right - LANES)
}

impl Batch {
    /// Calls `draw` for the triangles of a list that may cover pixels: the batch, the
    /// index in it, the face, its extent and how to draw it. `right` is the column past
    /// the last one of the buffer, at least [`LANES`]; `back` as in
    /// [`Coverage::new`](crate::render::pixels::coverage::Coverage::new).
    #[inline(always)]
    pub fn each(
        &mut self,
        mut list: impl Iterator<Item = (u32, Extent)>,
        places: impl Fn(u32) -> Option<[Place; 3]>,
        right: usize,
        back: i32,
        mut draw: impl FnMut(&Batch, usize, u32, &Extent, Kind),
    ) {
        let mut more = true;
        while more {
            self.count = 0;
            more = false;
            for (face, extent) in list.by_ref().take(MOST) {
                more = true;
                if let Some(places) = places(face) {
                    self.add(face, extent, places, right);
                }
            }
            self.solve(back);
            for i in 0..self.count.min(MOST) {
                if self.kinds[i] != Kind::Nothing {
                    draw(self, i, self.faces[i], &self.extents[i], self.kinds[i]);
                }
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, face: u32, extent: Extent, places: [Place; 3], right: usize) {
        let i = self.count;
        if i >= MOST {
            return;
        }
        let [[_, _], [top, _]] = extent.ends();
        let origin = Place::new(start(&extent, right) as i32 as f32, top as i32 as f32, 0.0, 0.0);
        for (corner, place) in places.into_iter().enumerate() {
            // Exact: both are multiples of the same unit, and the difference is not
            // larger.
            let [x, y, ..] = (place - origin).to_array();
            (self.corners[2 * corner][i], self.corners[2 * corner + 1][i]) = (x, y);
        }
        (self.faces[i], self.extents[i]) = (face, extent);
        self.count = i + 1;
    }

    /// Computes the edge functions of all triangles.
    #[inline(always)]
    fn solve(&mut self, back: i32) {
        // Adding this to a number, also to a negative one, leaves the nearest integer in
        // the lowest bits of the sum.
        const LOW_BITS: f32 = 12_582_912.0;
        let Batch { corners: [ax, ay, bx, by, cx, cy], edges, kinds, .. } = self;
        let whole = |v: f32| {
            ((v * UNIT as f32 + LOW_BITS).to_bits() as i32).wrapping_sub(LOW_BITS.to_bits() as i32)
        };
        for i in 0..MOST {
            let (x, y) = ([ax[i], bx[i], cx[i]], [ay[i], by[i], cy[i]]);
            let span = |v: [f32; 3]| v[0].max(v[1]).max(v[2]) - v[0].min(v[1]).min(v[2]);
            let small = (span(x) < SMALL) & (span(y) < SMALL);
            let (x, y) = (x.map(whole), y.map(whole));
            let cross = |p: i32, q: i32| {
                (x[p as usize].wrapping_sub(x[0])).wrapping_mul(y[q as usize].wrapping_sub(y[0]))
            };
            let turn = cross(1, 2).wrapping_sub(cross(2, 1));
            // A counter-clockwise triangle's edges run the other way.
            let way = if turn > 0 { 1 } else { -1 };
            for (e, [at, by_column, by_row]) in edges.iter_mut().enumerate() {
                let next = (e + 1) % 3;
                let dx = x[next].wrapping_sub(x[e]).wrapping_mul(way);
                let dy = y[next].wrapping_sub(y[e]).wrapping_mul(way);
                // Centres on left and top edges count as inside.
                let has = (dy < 0) | ((dy == 0) & (dx > 0));
                at[i] = dy
                    .wrapping_mul(x[e])
                    .wrapping_sub(dx.wrapping_mul(y[e]))
                    .wrapping_add(i32::from(has) - 1);
                by_column[i] = dy.wrapping_mul(-UNIT);
                by_row[i] = dx.wrapping_mul(UNIT);
            }
            let drawn = (turn != 0) & (way * back <= 0);
            kinds[i] = match (small, drawn) {
                (false, _) => Kind::Large,
                (true, false) => Kind::Nothing,
                (true, true) => Kind::Small,
            };
        }
    }

    /// Calls `draw` for each row of a small triangle, once or twice: row, column of the
    /// first lane, and lanes with the sign bit set outside of the triangle.
    #[inline(always)]
    pub fn rows(
        &self,
        i: usize,
        extent: &Extent,
        right: usize,
        mut draw: impl FnMut(usize, usize, i32x8),
    ) {
        let [[first, past], [top, bottom]] = extent.ends();
        let begin = start(extent, right);
        let mut at = self.edges.each_ref().map(|[at, by_column, _]| {
            i32x8::splat(by_column[i]) * i32x8::new([0, 1, 2, 3, 4, 5, 6, 7]) + i32x8::splat(at[i])
        });
        let mut from = begin;
        loop {
            let by_row = self.edges.each_ref().map(|[_, _, by_row]| i32x8::splat(by_row[i]));
            let mut lanes = at;
            for row in top..bottom {
                draw(row, from, lanes[0] | lanes[1] | lanes[2]);
                lanes = [lanes[0] + by_row[0], lanes[1] + by_row[1], lanes[2] + by_row[2]];
            }
            // A second pass for columns beyond the first lanes.
            if from != begin || past - first <= LANES {
                return;
            }
            from = (first + LANES).min(right - LANES);
            let further = (from - begin) as i32;
            for (at, [_, by_column, _]) in at.iter_mut().zip(&self.edges) {
                *at += i32x8::splat(by_column[i].wrapping_mul(further));
            }
            if from == begin {
                return;
            }
        }
    }
}

/// Sets all bits of the lanes whose sign bit is set, and clears the others.
#[inline(always)]
pub(in crate::render) fn all_bits(signs: i32x8) -> f32x8 {
    cast(signs >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::pixels::place::{place, size};
    use crate::render::pixels::triangle::{Plane, Triangle};
    use crate::render::simd::portable;
    use crate::render::testing::Uniform;

    /// The same pixels and numbers as by runs, over several batches, with and without
    /// back faces.
    #[test]
    fn lanes_draw_what_runs_draw() {
        let mut random = Uniform(17);
        let (width, height) = (40usize, 30usize);
        let image = size(width as u32, height as u32);
        let (mut drawn, mut kinds) = (0, [0; 3]);
        for round in 0..60 {
            let side = [1.5, 6.0, 15.0, 24.0][round % 4];
            let corners: Vec<_> = (0..150).map(|_| random.corners(side, round % 3 == 0)).collect();
            let places: Vec<_> =
                corners.iter().map(|points| points.map(|p| place(p.x, p.y))).collect();
            let extents = places.iter().map(|places| Extent::around(*places, image));
            let list: Vec<(u32, Extent)> =
                (0..).zip(extents).filter(|(_, extent)| !extent.is_empty()).collect();
            for back in [-1, 0, 1] {
                let mut by_runs = vec![0.5f32; width * height];
                for (face, extent) in &list {
                    let (points, places) = (corners[*face as usize], places[*face as usize]);
                    if let Some(triangle) = Triangle::new(points, places, *extent, f64::from(back))
                    {
                        triangle.fill(&mut by_runs, [0, width], 0);
                    }
                }
                let mut by_lanes = vec![0.5f32; width * height];
                let draw = |batch: &Batch, i: usize, face: u32, extent: &Extent, kind: Kind| {
                    let points = corners[face as usize];
                    kinds[kind as usize] += 1;
                    if kind == Kind::Large {
                        let triangle =
                            Triangle::new(points, places[face as usize], *extent, f64::from(back));
                        return triangle.iter().for_each(|t| t.fill(&mut by_lanes, [0, width], 0));
                    }
                    let plane = Plane::new(&points, extent.ends()[0][0]).unwrap();
                    batch.rows(i, extent, width, |row, from, outside| {
                        drawn += outside.to_bitmask().count_zeros();
                        plane.keep(&mut by_lanes, row * width + from, row, from, outside);
                    });
                };
                let places = |face: u32| Some(places[face as usize]);
                portable(|| Batch::default().each(list.iter().copied(), places, width, back, draw));
                assert!(by_lanes == by_runs, "round {round}, back {back}");
            }
        }
        assert!(drawn > 50_000 && kinds[Kind::Nothing as usize] == 0, "{drawn} {kinds:?}");
        assert!(kinds[1] > 10_000 && kinds[2] > 1_000, "{kinds:?}");
    }
}
