//! The fraction of every pixel that a solid covers.
//!
//! Pixels are sampled in rows of 64, a word for each, so a triangle's row of samples is set a
//! word at a time. Triangles that share an edge find the same place for it in each row, so no
//! sample is lost between them. What hides what does not matter.

use crate::geom::{Mesh, Solid};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Placement, Projected, Vertices, project};
use crate::render::pixels::raster::{back_of, cut_triangles};
use crate::render::simd::vectorised;
use crate::render::{Camera, Frame};
use std::ops::Range;
use std::sync::Arc;

/// Samples in a row of a pixel, and rows of them.
pub(in crate::render) const COLUMNS: usize = u64::BITS as usize;
pub(in crate::render) const ROWS: usize = 4;

/// Columns and rows of finer pixels in one, where there are no samples.
const FINER: u32 = 8;
/// The most pixels of a finer picture, and the most words of samples.
const MOST: usize = 1 << 22;

/// The coverage of each pixel by a solid.
pub(in crate::render) struct Fractions {
    /// The fraction of every pixel, 0 to 1, row by row.
    pub values: Arc<[f32]>,
    /// `None` if the values are from a finer picture.
    pub samples: Option<Samples>,
    pub projected: Projected,
}

impl Fractions {
    /// Those of the meshes of a solid, unless the picture is too large.
    pub fn of(solid: &Solid, camera: &Camera) -> Option<Fractions> {
        if camera.pixels().saturating_mul(ROWS) > MOST {
            return None;
        }
        let mut projected = Projected::default();
        project(solid, camera, &mut projected);
        let mut samples = Samples::none(camera.width as usize, camera.height as usize);
        // Of triangles that the near plane cuts, those that cover no pixel are left out; so in
        // much smaller pixels.
        let finer = camera.finer(COLUMNS as u32);
        for (i, item) in solid.instances().iter().enumerate() {
            let (mesh, vertices) = (&item.mesh, projected.mesh(i));
            let placement = Placement::new(camera, &item.affine);
            match vertices.whole {
                _ if vertices.outside(camera) => {}
                true => samples.add_mesh(mesh, &vertices, back_of(mesh, &placement, true)),
                false => cut_triangles(mesh, &placement, &finer, &vertices, |triangle, _, _| {
                    let smaller = |v: f64| v / COLUMNS as f64;
                    let points = triangle.points.each_ref();
                    samples.add(&points.map(|p| Point { x: smaller(p.x), y: smaller(p.y), ..*p }));
                }),
            }
        }
        let values = samples.fractions().into();
        Some(Fractions { values, samples: Some(samples), projected })
    }

    /// Those in a finer picture, drawn by `draw`: for what has no mesh, and for pictures so
    /// large that samples would take too much memory.
    pub fn by_pixels(camera: &Camera, draw: impl FnOnce(&Camera) -> Frame) -> Fractions {
        let side = camera.width.max(camera.height);
        let fits = |by: &u32| {
            let pixels = camera.pixels().saturating_mul((by * by) as usize);
            side.saturating_mul(*by) <= Camera::MAX_SIDE && pixels <= MOST
        };
        let by = (1..=FINER).rev().find(fits).unwrap_or(1);
        let frame = draw(&camera.finer(by));
        let (width, by) = (camera.width as usize, by as usize);
        let mut counts = vec![0u32; camera.pixels()];
        for (at, _) in frame.mask().enumerate().filter(|(_, shown)| *shown) {
            let (i, j) = (at % (width * by), at / (width * by));
            if let Some(count) = counts.get_mut(j / by * width + i / by) {
                *count += 1;
            }
        }
        let values = counts.into_iter().map(|count| count as f32 / (by * by) as f32).collect();
        Fractions { values, samples: None, projected: Projected::default() }
    }
}

/// Which samples are covered: a word for each pixel, in each row of samples.
pub(in crate::render) struct Samples {
    /// In pixels.
    pub width: usize,
    /// Of samples.
    pub rows: usize,
    pub words: Vec<u64>,
}

/// An edge from its upper to its lower end, in samples: whole numbers are their places.
#[derive(Clone, Copy)]
pub(in crate::render) struct Edge {
    pub from: [f64; 2],
    pub to: [f64; 2],
    /// Of x by y.
    pub slope: f64,
}

impl Edge {
    #[inline(always)]
    pub fn new(from: [f64; 2], to: [f64; 2]) -> Edge {
        Edge { from, to, slope: (to[0] - from[0]) / (to[1] - from[1]) }
    }

    /// The rows that it crosses, of that many.
    #[inline(always)]
    pub fn rows(&self, most: usize) -> Range<usize> {
        first(self.from[1], most)..first(self.to[1], most)
    }

    /// Where it crosses a row.
    #[inline(always)]
    pub fn at(&self, row: usize) -> f64 {
        self.from[0] + (row as f64 - self.from[1]) * self.slope
    }
}

/// The first whole number from `v` on, at least 0 and at most `most`; 0 for NaN.
#[inline(always)]
pub(in crate::render) fn first(v: f64, most: usize) -> usize {
    (v.ceil().max(0.0) as usize).min(most)
}

/// A position in the picture, in samples.
#[inline(always)]
pub(in crate::render) fn in_samples(p: &Point) -> [f64; 2] {
    [p.x * COLUMNS as f64 - 0.5, p.y * ROWS as f64 - 0.5]
}

/// True if a triangle has the orientation `back`, as in [`back_of`].
#[inline(always)]
pub(in crate::render) fn is_back([a, b, c]: &[Point; 3], back: f64) -> bool {
    ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)) * back > 0.0
}

impl Samples {
    fn none(width: usize, height: usize) -> Samples {
        Samples { width, rows: height * ROWS, words: vec![0; width * height * ROWS] }
    }

    /// Adds the triangles of a mesh that is beyond the near plane, save those with the
    /// orientation `back`.
    fn add_mesh(&mut self, mesh: &Mesh, vertices: &Vertices<'_>, back: f64) {
        vectorised(
            #[inline(always)]
            || {
                for corners in &mesh.topology.triangles {
                    let points = corners.map(|v| vertices.point(v));
                    if !is_back(&points, back) {
                        self.add(&points);
                    }
                }
            },
        );
    }

    /// Adds a triangle in the picture.
    #[inline(always)]
    fn add(&mut self, points: &[Point; 3]) {
        let [mut a, mut b, mut c] = points.each_ref().map(in_samples);
        if a[1] > b[1] {
            std::mem::swap(&mut a, &mut b);
        }
        if b[1] > c[1] {
            std::mem::swap(&mut b, &mut c);
        }
        if a[1] > b[1] {
            std::mem::swap(&mut a, &mut b);
        }
        let long = Edge::new(a, c);
        for short in [Edge::new(a, b), Edge::new(b, c)] {
            for row in short.rows(self.rows) {
                let (x, y) = (long.at(row), short.at(row));
                self.add_between(row, if x < y { [x, y] } else { [y, x] });
            }
        }
    }

    /// Adds the samples of a row between two places.
    #[inline(always)]
    fn add_between(&mut self, row: usize, ends: [f64; 2]) {
        let [left, right] = ends.map(|x| first(x, self.width * COLUMNS));
        if left >= right {
            return;
        }
        let start = row * self.width;
        let ends = start + left / COLUMNS..=start + (right - 1) / COLUMNS;
        let head = u64::MAX << (left % COLUMNS);
        let tail = u64::MAX >> (COLUMNS - 1 - (right - 1) % COLUMNS);
        match self.words.get_mut(ends) {
            None | Some([]) => {}
            Some([only]) => *only |= head & tail,
            Some([first, between @ .., last]) => {
                *first |= head;
                between.fill(u64::MAX);
                *last |= tail;
            }
        }
    }

    /// True if a sample is covered.
    #[inline(always)]
    pub fn has(&self, row: usize, column: usize) -> bool {
        let word = self.words.get(row * self.width + column / COLUMNS);
        word.is_some_and(|word| word >> (column % COLUMNS) & 1 == 1)
    }

    fn fractions(&self) -> Vec<f32> {
        let width = self.width.max(1);
        let mut out = Vec::with_capacity(self.words.len() / ROWS);
        for rows in self.words.chunks(width * ROWS) {
            let count = |i: usize| -> u32 {
                rows.iter().skip(i).step_by(width).map(|word| word.count_ones()).sum()
            };
            out.extend((0..width).map(|i| count(i) as f32 / (COLUMNS * ROWS) as f32));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Affine;
    use crate::render::testing::{cuboid, sphere};
    use crate::render::{Channels, View};
    use glam::{DVec3, Vec3};
    use proptest::prelude::*;

    /// Fractions from a picture with `by` times as many pixels in both directions.
    fn by_pixels(solid: &Solid, camera: &Camera, by: u32) -> Vec<f64> {
        let finer = camera.finer(by);
        let frame = Frame::render(solid, &finer, Channels::Depth);
        let mask: Vec<bool> = frame.mask().collect();
        let (width, by) = (camera.width as usize, by as usize);
        let count = |p: usize| {
            let (i, j) = (p % width * by, p / width * by);
            let row = |j: usize| (i..i + by).filter(|i| mask[j * width * by + i]).count();
            (j..j + by).map(row).sum::<usize>() as f64 / (by * by) as f64
        };
        (0..camera.pixels()).map(count).collect()
    }

    #[test]
    fn triangles_that_share_edges_lose_no_sample_between_them() {
        let mut samples = Samples::none(7, 5);
        let point = |x: f64, y: f64| Point { x, y, nearness: 1.0 };
        let middle = point(3.137, 2.211);
        let around = [(-1.0, -2.0), (3.3, -2.5), (9.0, -1.0), (8.0, 6.5), (2.1, 7.0), (-3.0, 5.5)];
        let around = around.map(|(x, y)| point(x, y));
        for i in 0..6 {
            samples.add(&[around[i], middle, around[(i + 1) % 6]]);
        }
        assert!(samples.fractions().iter().all(|f| *f == 1.0));
        let mut nothing = Samples::none(7, 5);
        nothing.add(&[point(f64::NAN, 1.0), point(2.0, 2.0), point(1.0, 4.0)]);
        nothing.add(&[point(1.0, 1.0), point(2.0, 1.0), point(5.0, 1.0)]);
        nothing.add(&[point(1e300, 1.0), point(1e300, 3.0), point(2e300, 2.0)]);
        assert!(nothing.fractions().iter().all(|f| *f == 0.0));
    }

    #[test]
    fn large_pictures_take_bounded_memory() {
        let camera = Camera::default_for(1200, 1200);
        assert!(Fractions::of(&sphere(24, 12), &camera).is_none());
        let view = View::new(sphere(24, 12), camera);
        let mask: Vec<f32> = view.depth(1200).mask().map(|m| f32::from(u8::from(m))).collect();
        assert_eq!(view.fractions(1200)[..], mask[..]);
        assert!(view.vjp_fractions(1200, &vec![1.0; 1200 * 1200]).iter().any(|g| g.x != 0.0));
    }

    proptest! {
        #[test]
        fn fractions_are_those_of_a_finer_picture(
            place in prop::array::uniform3(-1.2f64..1.2),
            turn in prop::array::uniform3(-3.0f64..3.0),
            distance in prop_oneof![Just(0.0), Just(6.9), Just(7.6)],
        ) {
            let camera = Camera::default_for(20, 15);
            let by = Affine::new(
                DVec3::from(place) + distance * DVec3::Z, DVec3::from(turn), DVec3::ONE);
            for solid in [sphere(24, 12), cuboid(Vec3::new(1.4, 1.0, 0.8))] {
                let solid = solid.placed(by);
                let own = View::new(solid.clone(), camera).fractions(20);
                let finer = by_pixels(&solid, &camera, 32);
                let far = own.iter().zip(&finer).map(|(a, b)| (f64::from(*a) - b).abs());
                let worst = far.fold(0.0, f64::max);
                // Rows of samples are a quarter of a pixel high. Along a straight edge all differences
                // may have one sign, so those of whole pictures have no lower bound.
                prop_assert!(worst <= 0.13, "{worst}");
            }
        }
    }
}
