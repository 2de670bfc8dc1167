//! Points along curves on a surface of revolution, and their images on both sides of the
//! plane of symmetry.

use super::sight::Sight;
use crate::render::pixels::place::Point;
use glam::DVec3;

/// Points projected at a time.
const LANES: usize = 16;

/// A point of a curve on the surface: cosine and (non-negative) sine of its angle from the
/// camera's side, radius, height, and normal away from and along the axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    pub c: f64,
    pub s: f64,
    pub r: f64,
    pub y: f64,
    pub nr: f64,
    pub ny: f64,
}

impl Sample {
    /// The point on one side of the plane of symmetry; `side` is 1 or -1.
    #[inline(always)]
    pub fn point(&self, side: f64) -> DVec3 {
        DVec3::new(self.r * self.c, self.y, side * self.r * self.s)
    }

    /// The normal there.
    #[inline(always)]
    pub fn normal(&self, side: f64) -> DVec3 {
        DVec3::new(self.nr * self.c, self.ny, side * self.nr * self.s)
    }
}

/// What a curve is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A smooth silhouette inside a span.
    Silhouette(usize),
    /// A sharp circle.
    Rim(usize),
}

/// A curve: consecutive samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub first: usize,
    pub past: usize,
    pub kind: Kind,
}

/// Curves and their images.
#[derive(Debug, Default)]
pub(super) struct Samples {
    pub list: Vec<Sample>,
    pub runs: Vec<Run>,
    /// The images on the side of positive and of negative z: x, y, nearness. Longer than
    /// the list.
    pub images: [[Vec<f64>; 3]; 2],
}

impl Samples {
    pub fn clear(&mut self) {
        self.list.clear();
        self.runs.clear();
    }

    /// Projects all samples, which are beyond the near plane.
    #[inline(always)]
    pub fn project(&mut self, sight: &Sight) {
        let needed = self.list.len().next_multiple_of(LANES);
        for row in self.images.iter_mut().flatten() {
            row.resize(needed.max(row.len()), 0.0);
        }
        if sight.lens.pinhole { self.images::<true>(sight) } else { self.images::<false>(sight) }
    }

    #[inline(always)]
    fn images<const PINHOLE: bool>(&mut self, sight: &Sight) {
        let (m, t, lens) = (sight.m, sight.t, sight.lens);
        for (n, samples) in self.list.chunks(LANES).enumerate() {
            let [mut px, mut py, mut pz] = [[0.0; LANES]; 3];
            for (i, p) in samples.iter().enumerate() {
                (px[i], py[i], pz[i]) = (p.r * p.c, p.y, p.r * p.s);
            }
            for (rows, side) in self.images.iter_mut().zip([1.0, -1.0]) {
                let of = n * LANES;
                let [x, y, nearness] = rows;
                let (Some(x), Some(y), Some(nearness)) = (
                    x.get_mut(of..).and_then(|r| r.first_chunk_mut::<LANES>()),
                    y.get_mut(of..).and_then(|r| r.first_chunk_mut::<LANES>()),
                    nearness.get_mut(of..).and_then(|r| r.first_chunk_mut::<LANES>()),
                ) else {
                    continue;
                };
                for i in 0..LANES {
                    let row = |r: usize| {
                        t[r] + px[i] * m.x_axis[r]
                            + py[i] * m.y_axis[r]
                            + side * pz[i] * m.z_axis[r]
                    };
                    let depth = -row(2);
                    let near = if PINHOLE { 1.0 / depth } else { -depth };
                    let k = if PINHOLE { lens.scale * near } else { lens.scale };
                    (x[i], y[i], nearness[i]) = (lens.cx + k * row(0), lens.cy - k * row(1), near);
                }
            }
        }
    }

    /// The image of a sample on a side, 0 or 1.
    #[inline(always)]
    pub fn image(&self, side: usize, i: usize) -> Point {
        let [x, y, nearness] = &self.images[side];
        Point { x: x[i], y: y[i], nearness: nearness[i] }
    }
}
