//! Chords of curves in the image, several at a time: which way the object lies, which
//! sides of a chord may be seen, and how near the surface beside it comes.
//!
//! The rules are those of the contours of meshes (`lines/extraction.rs`).

use super::lanes::{LANES, Mask, Row, mask};
use super::samples::{Samples, row, rows};
use super::sight::Sight;
use crate::geom::{Revolution, Rim};
use crate::render::Camera;
use crate::render::lines::visibility::EDGE_SLACK;

/// Chords on one side of the plane of symmetry. Pairs are image axes, triples x, y,
/// nearness.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Chords {
    pub from: [Row; 3],
    pub to: [Row; 3],
    pub length: Row,
    /// Unit tangent, with the object on its right.
    pub tangent: [Row; 2],
    /// True if it may be visible.
    pub there: Mask,
    /// How much nearer than the chord its own surface reaches, on the outward and on the
    /// other side, in scene units.
    pub slack: [Row; 2],
}

impl Chords {
    /// Sets the ends to consecutive samples, on a side: 0 for positive z, 1 for negative.
    #[inline(always)]
    pub fn load(&mut self, samples: &Samples, first: usize, side: usize) {
        let images = &samples.images[side.min(1)];
        (self.from, self.to) = (rows(images, first), rows(images, first + 1));
    }

    /// Measures lengths and tangents of the first `count` chords.
    #[inline(always)]
    pub fn measure(&mut self, count: usize) {
        for i in 0..LANES {
            let (dx, dy) = (self.to[0][i] - self.from[0][i], self.to[1][i] - self.from[1][i]);
            let length = (dx * dx + dy * dy).sqrt();
            let per = 1.0 / length;
            self.length[i] = length;
            (self.tangent[0][i], self.tangent[1][i]) = (dx * per, dy * per);
            self.there[i] = mask((i < count) & (length > 1e-9) & (length < f64::INFINITY));
        }
    }

    /// Turns tangents around where the factor is -1.
    #[inline(always)]
    pub fn turn(&mut self, way: &Row) {
        for i in 0..LANES {
            self.tangent[0][i] *= way[i];
            self.tangent[1][i] *= way[i];
        }
    }

    /// True if the chords of silhouettes have the object on the right of their tangents (1)
    /// or on the left (-1).
    #[inline(always)]
    pub fn way(&self, sight: &Sight, samples: &Samples, first: usize, side: usize) -> Row {
        let [nx, ny, nz] = rows(&samples.normals, first);
        let [a, b, c] = sight.cofactor.to_cols_array_2d();
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let mut way = [1.0; LANES];
        for i in 0..LANES {
            let (p, q, r) = (nx[i], ny[i], sign * nz[i]);
            let x = p * a[0] + q * b[0] + r * c[0];
            let y = p * a[1] + q * b[1] + r * c[1];
            // Outward in the image is (x, -y), and to the left of the tangent.
            let left = x * self.tangent[1][i] + y * self.tangent[0][i];
            way[i] = if left < 0.0 { -1.0 } else { 1.0 };
        }
        way
    }

    /// As [`Chords::way`] for the chords of a rim. Drops those whose spans all face away,
    /// and finds the slack. `first` is the number of the first chord's sample.
    #[inline(always)]
    pub fn rim_way(
        &mut self,
        faces: &[Option<Face>; 2],
        sight: &Sight,
        samples: &Samples,
        first: usize,
        side: usize,
        (open, extent): (bool, f64),
    ) -> Row {
        let (c, d) = (row(&samples.normals[0], first), row(&samples.normals[0], first + 1));
        let s = row(&samples.normals[2], first);
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let [ax, ay, az] = sight.m.to_cols_array_2d();
        let lens = sight.lens;
        let pinhole = if lens.pinhole { 1.0 } else { 0.0 };
        let (mut front, mut balance) = ([0; LANES], [0.0; LANES]);
        self.slack = [[0.0; LANES]; 2];
        for face in faces.iter().flatten() {
            for i in 0..LANES {
                let facing = face.a * (0.5 * (c[i] + d[i])) + face.b > 0.0;
                front[i] |= mask(facing);
                // The motion in the image from the rim across the span.
                let (p, q, r) = (face.dr * c[i], face.dy, sign * face.dr * s[i]);
                let dx = p * ax[0] + q * ay[0] + r * az[0];
                let dy = p * ax[1] + q * ay[1] + r * az[1];
                let dz = p * ax[2] + q * ay[2] + r * az[2];
                let [x, y, nearness] = [self.from[0][i], self.from[1][i], self.from[2][i]];
                let [a, b] = sight.slopes([x, y]);
                let (a, b) = (a * pinhole, b * pinhole);
                let k = if lens.pinhole { lens.scale * nearness } else { lens.scale };
                let (du, dv) = (k * (dx + a * dz), -k * (dy + b * dz));
                let (tx, ty) = (self.tangent[0][i], self.tangent[1][i]);
                let (away, along) = (du * ty - dv * tx, du * tx + dv * ty);
                let shown = facing | open;
                let toward = if away < 0.0 { -1.0 } else { 1.0 };
                balance[i] -= if shown { toward } else { 0.0 };
                // Depth per nearness, and the other way around.
                let square = if lens.pinhole { nearness * nearness } else { 1.0 };
                let steep = (self.to[2][i] - nearness) / self.length[i];
                let nearer = 2.0 * (dz * square - steep * along) / (away.abs() * square);
                let most = EDGE_SLACK * extent;
                let nearer = if nearer < most { nearer } else { most };
                let counts = shown & (away.abs() > 1e-3) & (nearer > 0.0);
                let nearer = if counts { nearer } else { 0.0 };
                let [left, right] = [self.slack[0][i], self.slack[1][i]];
                let (l, r) = if away < 0.0 { (0.0, nearer) } else { (nearer, 0.0) };
                self.slack[0][i] = if l > left { l } else { left };
                self.slack[1][i] = if r > right { r } else { right };
            }
        }
        let mut way = [1.0; LANES];
        for i in 0..LANES {
            self.there[i] &= front[i] | mask(open);
            let turned = balance[i] < 0.0;
            way[i] = if turned { -1.0 } else { 1.0 };
            let [left, right] = [self.slack[0][i], self.slack[1][i]];
            self.slack[0][i] = if turned { right } else { left };
            self.slack[1][i] = if turned { left } else { right };
        }
        way
    }
}

/// A span beside a rim: its facing, and the way across it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// It faces the camera where `a cos(angle) + b` is positive.
    a: f64,
    b: f64,
    /// The way from the rim, away from the axis and along it.
    dr: f64,
    dy: f64,
}

impl Face {
    /// The spans beside a rim.
    pub fn both(surface: &Revolution, rim: &Rim, sight: &Sight) -> [Option<Face>; 2] {
        let [before, after] = rim.spans;
        [(before, -1.0), (after, 1.0)].map(|(span, way)| {
            let [p, q] = surface.ends(surface.spans().get(span?)?)?;
            let (nr, ny) = (q.y - p.y, p.r - q.r);
            let [x, y] = sight.view;
            let b = ny * (y - sight.bend * p.y) - nr * sight.bend * p.r;
            Some(Face { a: nr * x, b, dr: way * (q.r - p.r), dy: way * (q.y - p.y) })
        })
    }
}

/// How much nearer than the starts of silhouettes' chords from a sample on the spans that they
/// lie in reach, in scene units.
#[inline(always)]
pub(super) fn reach(
    surface: &Revolution,
    sight: &Sight,
    samples: &Samples,
    first: usize,
    Chords { from, to, .. }: &Chords,
    side: usize,
) -> Row {
    // Radius and height of both rings of each span.
    let (mut rings, mut there) = ([[[0.0; LANES]; 2]; 2], [0; LANES]);
    let spans = samples.spans.get(first..).unwrap_or(&[]);
    for (i, span) in spans.iter().take(LANES).enumerate() {
        let ends = surface.spans().get(*span as usize).and_then(|s| surface.ends(s));
        for (ring, [r, y]) in ends.into_iter().flatten().zip(&mut rings) {
            (r[i], y[i], there[i]) = (ring.r, ring.y, u64::MAX);
        }
    }
    let [x, _, z] = rows(&samples.points, first);
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let [ax, ay, az] = sight.m.to_cols_array_2d();
    let (t, lens) = (sight.t.to_array(), sight.lens);
    let mut most = [0.0; LANES];
    for [radius, height] in &rings {
        for i in 0..LANES {
            let r = (x[i] * x[i] + z[i] * z[i]).sqrt();
            let (c, s) = if r > 0.0 { (x[i] / r, sign * z[i] / r) } else { (1.0, 0.0) };
            let (p, q, r) = (radius[i] * c, height[i], radius[i] * s);
            let u = p * ax[0] + q * ay[0] + r * az[0] + t[0];
            let v = p * ax[1] + q * ay[1] + r * az[1] + t[1];
            let w = p * ax[2] + q * ay[2] + r * az[2] + t[2];
            there[i] &= mask(-w >= Camera::NEAR);
            let nearness = if lens.pinhole { 1.0 / -w } else { w };
            let k = if lens.pinhole { lens.scale * nearness } else { lens.scale };
            let (u, v) = (lens.cx + k * u - from[0][i], lens.cy - k * v - from[1][i]);
            let (dx, dy) = (to[0][i] - from[0][i], to[1][i] - from[1][i]);
            let square = dx * dx + dy * dy;
            there[i] &= mask(square >= 0.02 * 0.02);
            let steep = (to[2][i] - from[2][i]) / square;
            let reach = nearness - from[2][i] - steep * (u * dx + v * dy);
            most[i] = if reach > most[i] { reach } else { most[i] };
        }
    }
    for i in 0..LANES {
        let per = if lens.pinhole { from[2][i] * from[2][i] } else { 1.0 };
        most[i] = if there[i] != 0 { most[i] / per } else { 0.0 };
    }
    most
}
