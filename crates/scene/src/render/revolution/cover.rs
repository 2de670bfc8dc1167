//! At which pixels of each row each span may show, so that only those are tested.
//!
//! A span's picture is the convex hull of its two circles. A line of sight enters through
//! its side unless it passes through the disc of the circle at the end of the camera's
//! side, and leaves through its side unless it passes through the other one. So what shows
//! of a wall is narrow in each row. Invariant: the surface is beyond the near plane; pixels
//! that show a span are among those listed for it.

use super::lanes::{LANES, Row, mask};
use super::rays::Shape;
use super::samples::row;
use super::sight::Sight;
use super::silhouettes::Facing;
use crate::geom::{Revolution, Ring};
use crate::render::Camera;
use crate::render::pixels::project::{Lens, ratios};
use glam::DVec3;

/// Positions in the image are accurate to this, in pixels.
const MARGIN: f64 = 1e-3;
/// A disc seen less than this high, in pixels, counts as seen edge-on.
const EDGE_ON: f64 = 0.01;

/// Where the outside or the inside of a span may show.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub shape: Shape,
    /// Its rows, from the first to one past the last.
    pub rows: [usize; 2],
    /// Where its columns begin in `Cover::columns`.
    first: usize,
    /// No part of it is nearer than this.
    pub beyond: f64,
}

/// Where the spans of a surface may show.
#[derive(Debug, Default)]
pub(super) struct Cover {
    /// Outsides first, which hide most of the insides.
    pub patches: Vec<Patch>,
    /// For each row of each patch.
    columns: Vec<[u32; 4]>,
    hoops: Vec<Hoop>,
    /// The left and the right end of each circle in each row of the picture.
    chords: [Vec<f64>; 2],
}

impl Cover {
    /// Replaces all by a surface's spans.
    #[inline(always)]
    pub fn set(&mut self, surface: &Revolution, sight: &Sight, camera: &Camera) {
        self.patches.clear();
        self.columns.clear();
        self.hoops.clear();
        let height = camera.height as usize;
        let stride = height + LANES;
        for (list, none) in self.chords.iter_mut().zip([f64::INFINITY, f64::NEG_INFINITY]) {
            list.clear();
            list.resize(surface.rings().len() * stride, none);
        }
        for (i, ring) in surface.rings().iter().enumerate() {
            let hoop = Hoop::new(ring, sight, i * stride);
            let [top, bottom] = rows(hoop.extent, height);
            let mut at = top;
            while at < bottom {
                let chord = match sight.lens.pinhole {
                    true => hoop.chord::<true>(&sight.lens, at),
                    false => hoop.chord::<false>(&sight.lens, at),
                };
                for (list, ends) in self.chords.iter_mut().zip(chord) {
                    let place = list.get_mut(hoop.first + at..).and_then(|l| l.first_chunk_mut());
                    if let Some(place) = place {
                        *place = ends;
                    }
                }
                at += LANES;
            }
            self.hoops.push(hoop);
        }
        let Cover { patches, columns, hoops, chords } = self;
        let mut lists = Lists { patches, columns, chords };
        for far in [false, true] {
            for (number, span) in (0..).zip(surface.spans()) {
                let Some(ends) = surface.ends(span) else { continue };
                let Some([a, b]) =
                    hoops.get(span.ring..span.ring + 2).and_then(|h| h.first_chunk())
                else {
                    continue;
                };
                let shape = Shape::new(ends, number);
                match shape {
                    Shape::Level(_) if far => {}
                    Shape::Level(_) => {
                        let (outer, inner) = if ends[0].r > ends[1].r { (a, b) } else { (b, a) };
                        lists.add(shape, camera, &Outline::disc(outer, inner), 0.0);
                    }
                    // Where the path goes down, a body that encloses itself shows the inside.
                    Shape::Cone(_) if surface.encloses() && far != (ends[1].y < ends[0].y) => {}
                    Shape::Cone(_) => {
                        let (outline, beyond) = Outline::wall(ends, [a, b], sight, far);
                        lists.add(shape, camera, &outline, beyond);
                    }
                }
            }
        }
    }

    /// The columns of a patch in one of its rows: from the first to one past the last
    /// number, without those from the second to the third.
    #[inline(always)]
    pub fn columns(&self, patch: &Patch, row: usize) -> [usize; 4] {
        let at = (patch.first + row).checked_sub(patch.rows[0]);
        let columns = at.and_then(|at| self.columns.get(at)).copied();
        let [from, left, right, past] = columns.unwrap_or_default();
        [from as usize, left as usize, right as usize, past as usize]
    }
}

/// Where patches are listed.
struct Lists<'a> {
    patches: &'a mut Vec<Patch>,
    columns: &'a mut Vec<[u32; 4]>,
    chords: &'a [Vec<f64>; 2],
}

impl Lists<'_> {
    #[inline(always)]
    fn add(&mut self, shape: Shape, camera: &Camera, outline: &Outline, beyond: f64) {
        let [a, b] = &outline.hull;
        let extent = [a.extent[0].min(b.extent[0]), a.extent[1].max(b.extent[1])];
        let rows = rows(extent, camera.height as usize);
        let first = self.columns.len();
        let [left, right] = self.chords;
        let mut at = rows[0];
        while at < rows[1] {
            let [mut from, mut past] = [row(left, a.first + at), row(right, a.first + at)];
            let other = [row(left, b.first + at), row(right, b.first + at)];
            let mut hole = [[f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]];
            if let Some(hoop) = outline.without {
                hole = [row(left, hoop.first + at), row(right, hoop.first + at)];
            }
            for i in 0..LANES {
                from[i] = least(from[i], other[0][i]);
                past[i] = most(past[i], other[1][i]);
            }
            for [p, q] in &outline.edges {
                let (per, top) = (1.0 / (q[1] - p[1]), at as f64);
                for i in 0..LANES {
                    let y = top + (i as f64 + 0.5);
                    // Shares of the edge in a little more than the row.
                    let (s, t) = ((y - MARGIN - p[1]) * per, (y + MARGIN - p[1]) * per);
                    let crosses = (least(s, t) <= 1.0) & (most(s, t) >= 0.0);
                    let s = p[0] + (q[0] - p[0]) * least(most(s, 0.0), 1.0);
                    let t = p[0] + (q[0] - p[0]) * least(most(t, 0.0), 1.0);
                    from[i] = if crosses { least(from[i], least(s, t)) } else { from[i] };
                    past[i] = if crosses { most(past[i], most(s, t)) } else { past[i] };
                }
            }
            let width = f64::from(camera.width);
            let mut columns = [[0; 4]; LANES];
            for i in 0..LANES {
                let (from, past) = (from[i] - MARGIN, past[i] + MARGIN);
                let (left, right) =
                    (most(hole[0][i] + MARGIN, from), least(hole[1][i] - MARGIN, past));
                let open = left < right;
                columns[i][0] = column(from, width);
                columns[i][1] = column(if open { left } else { past }, width);
                columns[i][2] = column(if open { right } else { past }, width);
                columns[i][3] = column(past, width);
            }
            let count = (rows[1] - at).min(LANES);
            self.columns.extend_from_slice(columns.get(..count).unwrap_or(&[]));
            at += LANES;
        }
        if rows[0] < rows[1] {
            self.patches.push(Patch { shape, rows, first, beyond });
        }
    }
}

/// The region that contains the picture of a span: the convex hull of two circles, without the disc
/// of a third.
struct Outline<'a> {
    hull: [&'a Hoop; 2],
    /// Lines between the two circles.
    edges: [[[f64; 2]; 2]; 2],
    without: Option<&'a Hoop>,
}

impl<'a> Outline<'a> {
    /// Of a level span.
    #[inline(always)]
    fn disc(outer: &'a Hoop, inner: &'a Hoop) -> Outline<'a> {
        Outline { hull: [outer; 2], edges: [[[f64::NAN; 2]; 2]; 2], without: inner.open() }
    }

    /// Of the outside of a cone, or of its inside, which is farther; and a depth that no
    /// part of that is nearer than.
    #[inline(always)]
    fn wall(ends: [&Ring; 2], hull: [&'a Hoop; 2], sight: &Sight, far: bool) -> (Outline<'a>, f64) {
        let [a, b] = ends;
        // The flat normal is that of the whole cone.
        let flat = Ring { nr: b.y - a.y, ny: a.r - b.r, ..*a };
        let [c, s] = Facing::new(&flat, sight).edge();
        let edges = [s, -s].map(|s| {
            hull.map(|hoop| {
                let p = sight.lens.point(hoop.middle + hoop.across * c + hoop.aside * s);
                [p.x, p.y]
            })
        });
        // The circle at the side of the camera, if that is not between them.
        let [low, high] = if a.y < b.y { [0, 1] } else { [1, 0] };
        let eye = sight.view[1];
        let side = match sight.lens.pinhole {
            true if eye > ends[high].y => Some(high),
            true if eye < ends[low].y => Some(low),
            false if eye > 0.0 => Some(high),
            false if eye < 0.0 => Some(low),
            _ => None,
        };
        let without = side.and_then(|side| hull[if far { 1 - side } else { side }].open());
        let nearest = hull.map(|hoop| {
            let reach = (hoop.across.z * c).max(-hoop.across.z) + hoop.aside.z.abs();
            -hoop.middle.z - reach
        });
        let beyond = if far { nearest[0].min(nearest[1]) } else { 0.0 };
        (Outline { hull, edges, without }, beyond)
    }
}

/// A circle in camera coordinates: `middle + cosine * across + sine * aside`.
#[derive(Clone, Copy, Debug)]
struct Hoop {
    middle: DVec3,
    across: DVec3,
    aside: DVec3,
    /// Its least and greatest y in the image.
    extent: [f64; 2],
    /// Where its chords begin in `Cover::chords`.
    first: usize,
}

impl Hoop {
    #[inline(always)]
    fn new(ring: &Ring, sight: &Sight, first: usize) -> Hoop {
        let middle = sight.camera(DVec3::new(0.0, ring.y, 0.0));
        let (across, aside) = (sight.m.x_axis * ring.r, sight.m.z_axis * ring.r);
        let y = [middle.y, across.y, aside.y];
        let [low, high] = match sight.lens.pinhole {
            true => ratios(&y, &[-middle.z, -across.z, -aside.z]),
            false => {
                let reach = libm::hypot(y[1], y[2]);
                [y[0] - reach, y[0] + reach]
            }
        };
        let Lens { scale, cy, .. } = sight.lens;
        Hoop { middle, across, aside, extent: [cy - scale * high, cy - scale * low], first }
    }

    /// Itself, unless its disc is seen edge-on.
    #[inline(always)]
    fn open(&self) -> Option<&Hoop> {
        (self.extent[1] - self.extent[0] > EDGE_ON).then_some(self)
    }

    /// The left and the right end of its picture in rows from one on.
    #[inline(always)]
    fn chord<const PINHOLE: bool>(&self, lens: &Lens, first: usize) -> [Row; 2] {
        let Hoop { middle, across, aside, .. } = self;
        let (mut u, mut v, mut q) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (mut root, mut some) = ([0.0; LANES], [0; LANES]);
        let top = first as f64;
        for i in 0..LANES {
            // A point p of the circle is in this row if p.y + slope * p.z is 0, where p.z is
            // -1 for a parallel projection: p + u cosine + v sine = 0.
            let slope = (lens.cy - (top + (i as f64 + 0.5))) / lens.scale;
            let (a, b, c) = match PINHOLE {
                true => (
                    middle.y + slope * middle.z,
                    across.y + slope * across.z,
                    aside.y + slope * aside.z,
                ),
                false => (middle.y - slope, across.y, aside.y),
            };
            let per = 1.0 / (b * b + c * c).sqrt();
            (u[i], v[i], q[i]) = (b * per, c * per, -a * per);
            let square = 1.0 - q[i] * q[i];
            root[i] = most(square, 0.0).sqrt();
            some[i] = mask(square >= -1e-9);
        }
        let (mut c, mut s) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        for i in 0..LANES {
            (c[0][i], s[0][i]) = (q[i] * u[i] - root[i] * v[i], q[i] * v[i] + root[i] * u[i]);
            (c[1][i], s[1][i]) = (q[i] * u[i] + root[i] * v[i], q[i] * v[i] - root[i] * u[i]);
        }
        let a = self.columns::<PINHOLE>(lens, &c[0], &s[0]);
        let b = self.columns::<PINHOLE>(lens, &c[1], &s[1]);
        let (mut left, mut right) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            left[i] = if some[i] != 0 { least(a[i], b[i]) } else { f64::INFINITY };
            right[i] = if some[i] != 0 { most(a[i], b[i]) } else { f64::NEG_INFINITY };
        }
        [left, right]
    }

    /// The x in the image of points at some cosines and sines.
    #[inline(always)]
    fn columns<const PINHOLE: bool>(&self, lens: &Lens, c: &Row, s: &Row) -> Row {
        let Hoop { middle, across, aside, .. } = self;
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            let x = middle.x + across.x * c[i] + aside.x * s[i];
            let depth = -(middle.z + across.z * c[i] + aside.z * s[i]);
            out[i] = lens.cx + lens.scale * (if PINHOLE { x / depth } else { x });
        }
        out
    }
}

/// The rows, from the first to one past the last, with centres between two positions.
#[inline(always)]
fn rows([top, bottom]: [f64; 2], height: usize) -> [usize; 2] {
    let side = height as f64;
    [top - MARGIN, bottom + MARGIN].map(|y| column(y, side) as usize)
}

/// The number of columns with centres to the left of a position.
#[inline(always)]
fn column(x: f64, width: f64) -> u32 {
    /// Adding this to a number leaves the nearest integer in the lowest bits of the sum.
    const LOW_BITS: f64 = 4_503_599_627_370_496.0;
    (least(most(x, 0.0), width) + LOW_BITS).to_bits() as u32
}

/// The lesser of two numbers, or the second one.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers, or the second one.
#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
