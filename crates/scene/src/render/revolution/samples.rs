//! Points along curves on a surface of revolution, and their images on both sides of the
//! plane of symmetry.

use super::lanes::{LANES, Row};
use super::sight::Sight;
use glam::DVec3;

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
    /// The point on the side of positive z.
    #[inline(always)]
    pub fn point(&self) -> DVec3 {
        DVec3::new(self.r * self.c, self.y, self.r * self.s)
    }
}

/// Marks the last sample of a curve.
pub(super) const LAST: u32 = u32::MAX;

/// A sharp circle: its samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circle {
    pub first: usize,
    pub past: usize,
    /// The number of the rim.
    pub rim: usize,
}

/// Curves and their images: first silhouettes, then sharp circles. Lists are padded, so
/// that [`LANES`] entries can be read from any sample on and from the next one.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// The number of samples, and of those of silhouettes.
    pub count: usize,
    pub silhouettes: usize,
    /// Points on the side of positive z.
    pub points: [Vec<f64>; 3],
    /// Normals there, of silhouettes; cosine, 0 and sine for circles.
    pub normals: [Vec<f64>; 3],
    /// The span of the silhouette from each sample to the next, or [`LAST`].
    pub spans: Vec<u32>,
    pub circles: Vec<Circle>,
    /// The images on the side of positive and of negative z: x, y, nearness.
    pub images: [[Vec<f64>; 3]; 2],
}

/// Entries beyond the last one.
const PADDING: usize = 2 * LANES + 1;

impl Samples {
    pub fn clear(&mut self) {
        (self.count, self.silhouettes) = (0, 0);
        self.circles.clear();
    }

    /// Makes room for more samples.
    #[inline(always)]
    pub fn reserve(&mut self, more: usize) {
        let needed = self.count + more + PADDING;
        if self.spans.len() < needed {
            self.grow(2 * needed);
        }
    }

    #[inline(never)]
    fn grow(&mut self, length: usize) {
        let lists = [&mut self.points, &mut self.normals].into_iter().chain(&mut self.images);
        lists.flatten().for_each(|list| list.resize(length, 0.0));
        self.spans.resize(length, LAST);
    }

    /// Adds a sample, for which there is room.
    #[inline(always)]
    pub fn push(&mut self, p: &Sample, span: u32) {
        let i = self.count;
        let [x, y, z] = &mut self.points;
        set(x, i, p.r * p.c);
        set(y, i, p.y);
        set(z, i, p.r * p.s);
        let [x, y, z] = &mut self.normals;
        set(x, i, p.nr * p.c);
        set(y, i, p.ny);
        set(z, i, p.nr * p.s);
        if let Some(place) = self.spans.get_mut(i) {
            *place = span;
        }
        self.count += 1;
    }

    /// Projects all samples, as if they were beyond the near plane.
    #[inline(always)]
    pub fn project(&mut self, sight: &Sight) {
        self.reserve(0);
        if sight.lens.pinhole { self.images::<true>(sight) } else { self.images::<false>(sight) }
    }

    #[inline(always)]
    fn images<const PINHOLE: bool>(&mut self, sight: &Sight) {
        let (t, lens) = (sight.t.to_array(), sight.lens);
        let [ax, ay, az] = sight.m.to_cols_array_2d();
        let mut first = 0;
        while first < self.count {
            let [px, py, pz] = rows(&self.points, first);
            for (lists, side) in self.images.iter_mut().zip([1.0, -1.0]) {
                let [mut x, mut y, mut nearness] = [[0.0; LANES]; 3];
                for i in 0..LANES {
                    let (p, q, r) = (px[i], py[i], side * pz[i]);
                    let u = t[0] + p * ax[0] + q * ay[0] + r * az[0];
                    let v = t[1] + p * ax[1] + q * ay[1] + r * az[1];
                    let w = t[2] + p * ax[2] + q * ay[2] + r * az[2];
                    let near = if PINHOLE { 1.0 / -w } else { w };
                    let k = if PINHOLE { lens.scale * near } else { lens.scale };
                    (x[i], y[i], nearness[i]) = (lens.cx + k * u, lens.cy - k * v, near);
                }
                for (list, values) in lists.iter_mut().zip([x, y, nearness]) {
                    if let Some(place) = list.get_mut(first..).and_then(|l| l.first_chunk_mut()) {
                        *place = values;
                    }
                }
            }
            first += LANES;
        }
    }
}

/// Entries of a list from one on.
#[inline(always)]
pub(super) fn row(list: &[f64], first: usize) -> Row {
    list.get(first..).and_then(|list| list.first_chunk()).copied().unwrap_or([0.0; LANES])
}

/// Entries of three lists from one on.
#[inline(always)]
pub(super) fn rows(lists: &[Vec<f64>; 3], first: usize) -> [Row; 3] {
    let [x, y, z] = lists;
    [row(x, first), row(y, first), row(z, first)]
}

#[inline(always)]
fn set(list: &mut [f64], i: usize, v: f64) {
    if let Some(place) = list.get_mut(i) {
        *place = v;
    }
}
