//! How exact contours and depth move with the placement and the path of a surface of
//! revolution.
//!
//! A piece moves with the two samples at its ends. A sample moves with its point of the
//! surface; on a silhouette it also slides, so that the facing there stays 0: by the
//! least motion over the surface or, at the end of a smooth strip, along that end. Where
//! contours pass behind others, the ends of what is visible are held fixed.

use super::drawer::Source;
use super::frame::each_seen;
use super::samples::LAST;
use super::sight::Sight;
use crate::contours::Contours;
use crate::geom::{Affine, Revolution, Ring, outer};
use crate::render::{Camera, Frame};
use glam::{DMat3, DVec3};

/// Derivatives with respect to a placed surface of revolution.
#[derive(Clone, Debug, PartialEq)]
pub struct RevolutionGradient {
    /// With respect to the linear part of the placement.
    pub linear: DMat3,
    /// With respect to its translation.
    pub shift: DVec3,
    /// With respect to the radius and the height of each ring.
    pub rings: Vec<(f64, f64)>,
}

impl RevolutionGradient {
    fn zero(surface: &Revolution) -> RevolutionGradient {
        let rings = vec![(0.0, 0.0); surface.rings().len()];
        RevolutionGradient { linear: DMat3::ZERO, shift: DVec3::ZERO, rings }
    }
}

impl Frame {
    /// The vector-Jacobian product of the depth of [`Frame::of_revolution`] for the same
    /// surface, placement and camera, given derivatives with respect to the depth at each
    /// pixel, row by row. Pixels that do not show the surface are ignored, and which span
    /// others show is held fixed.
    pub fn vjp_revolution(
        surface: &Revolution,
        affine: &Affine,
        camera: &Camera,
        by_depth: &[f64],
    ) -> RevolutionGradient {
        let mut out = RevolutionGradient::zero(surface);
        let Some(sight) = Sight::new(camera, affine) else { return out };
        let mut back = Back::new(surface, &sight, camera, affine, &mut out);
        let turn = sight.m.inverse().transpose();
        each_seen(surface, &sight, camera, |pixel, depth, span| {
            let by = by_depth.get(pixel).copied().unwrap_or(0.0);
            let found = surface.spans().get(span);
            let Some((span, [a, b])) = found.and_then(|s| Some((s, surface.ends(s)?))) else {
                return;
            };
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let (origin, way) = sight.line([f64::from(x) + 0.5, f64::from(y) + 0.5]);
            let p = origin + way * depth;
            let r = libm::hypot(p.x, p.z);
            let (c, s) = if r > 0.0 { (p.x / r, p.z / r) } else { (1.0, 0.0) };
            // Where the surface moves by v, depth grows by v . normal / (way . normal).
            let (dr, dy) = (b.r - a.r, b.y - a.y);
            let normal = DVec3::new(dy * c, -dr, dy * s);
            let g = normal * (by / normal.dot(way));
            if by == 0.0 || !g.is_finite() {
                return;
            }
            back.place(p, turn * g);
            back.on_span(span.ring, share([a, b], r, p.y), [c, s], g);
        });
        out
    }
}

impl Contours {
    /// The vector-Jacobian product of [`Contours::of_revolution`] for the same surface,
    /// placement and camera: from the derivatives of a function with respect to each
    /// piece's x, y, length (pixels) and angle (radians, from right to down). Pieces
    /// beyond the end of `by_piece` count as 0. Pieces that appear or disappear, and the
    /// ends of contours that pass behind others, are not accounted for.
    pub fn vjp_revolution(
        surface: &Revolution,
        affine: &Affine,
        camera: &Camera,
        by_piece: &[[f64; 4]],
    ) -> RevolutionGradient {
        let mut out = RevolutionGradient::zero(surface);
        let Some(sight) = Sight::new(camera, affine) else { return out };
        let mut back = Back::new(surface, &sight, camera, affine, &mut out);
        Contours::sources(surface, &sight, camera, |samples, sources| {
            let mut by_sample = vec![[[0.0; 2]; 2]; samples.count];
            for (source, by) in sources.iter().zip(by_piece) {
                let (i, side) = (source.sample, source.side);
                let [a, b] = [i, i + 1].map(|i| samples.images[side].each_ref().map(|l| l[i]));
                let Some(ends) = by_ends([a[0], a[1]], [b[0], b[1]], source, by) else { continue };
                for (at, ends) in (i..).zip(ends) {
                    let place = &mut by_sample[at][side];
                    *place = [place[0] + ends[0], place[1] + ends[1]];
                }
            }
            for (i, sides) in by_sample.iter().enumerate() {
                // The last sample of a curve lies on the span of the one before it.
                let span = match samples.spans[i] {
                    LAST => i.checked_sub(1).map_or(LAST, |i| samples.spans[i]),
                    span => span,
                };
                let rim = samples.circles.iter().find(|c| (c.first..c.past).contains(&i));
                for (side, by) in sides.iter().enumerate().filter(|(_, by)| **by != [0.0; 2]) {
                    let sign = if side == 0 { 1.0 } else { -1.0 };
                    let [x, y, z] = samples.points.each_ref().map(|list| list[i]);
                    let p = DVec3::new(x, y, sign * z);
                    let g = back.point(p, *by);
                    match rim.and_then(|c| surface.rims().get(c.rim)) {
                        Some(rim) => back.on_rim(rim.ring, p, g),
                        None => back.on_silhouette(span, p, g),
                    }
                }
            }
        });
        back.rotate_normals();
        out
    }
}

/// The shares of a span's two rings at a point of it.
fn share([a, b]: [&Ring; 2], r: f64, y: f64) -> [f64; 2] {
    let (dr, dy) = (b.r - a.r, b.y - a.y);
    let t = if dr.abs() > dy.abs() { (r - a.r) / dr } else { (y - a.y) / dy };
    // Rings are met up to rounding.
    let t = if t < 1e-9 { 0.0 } else { t };
    let t = if t > 1.0 - 1e-9 { 1.0 } else { t };
    [1.0 - t, t]
}

/// Maps the derivatives with respect to a piece to those with respect to the images of the
/// two samples that it lies between.
fn by_ends(
    a: [f64; 2],
    b: [f64; 2],
    source: &Source,
    &[gx, gy, by_length, by_angle]: &[f64; 4],
) -> Option<[[f64; 2]; 2]> {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = libm::hypot(dx, dy);
    if !source.whole || length <= 1e-9 {
        return None;
    }
    let (tx, ty) = (dx / length, dy / length);
    let (stretch, turn) = (by_length * source.share, by_angle / length);
    let along = [stretch * tx - turn * ty, stretch * ty + turn * tx];
    let end = |share: f64, sign: f64| [share * gx + sign * along[0], share * gy + sign * along[1]];
    Some([end(1.0 - source.at, -1.0), end(source.at, 1.0)])
}

/// A silhouette's bends stay on their rings unless the sine of the angle at which it
/// crosses a ring is about this or less.
const STEADY: f64 = 0.02;

/// Derivatives on their way back to the surface.
struct Back<'a> {
    surface: &'a Revolution,
    sight: &'a Sight,
    /// From camera to world directions.
    to_world: DMat3,
    /// From turned to the surface's own coordinates: a rotation about the axis.
    own: DMat3,
    affine: &'a Affine,
    /// With respect to the normal of each ring, away from and along the axis.
    normals: Vec<(f64, f64)>,
    out: &'a mut RevolutionGradient,
}

impl<'a> Back<'a> {
    fn new(
        surface: &'a Revolution,
        sight: &'a Sight,
        camera: &Camera,
        affine: &'a Affine,
        out: &'a mut RevolutionGradient,
    ) -> Back<'a> {
        let to_world = DMat3::from_cols(camera.right, camera.up, -camera.forward);
        let own = affine.0.matrix3.inverse() * to_world * sight.m;
        let normals = vec![(0.0, 0.0); surface.rings().len()];
        Back { surface, sight, to_world, own, affine, normals, out }
    }

    /// Adds what a point, in turned coordinates, gives to the placement, from derivatives
    /// with respect to it in camera coordinates.
    fn place(&mut self, p: DVec3, g: DVec3) {
        let world = self.to_world * g;
        self.out.linear += outer(world, self.own * p);
        self.out.shift += world;
    }

    /// Adds what a point of a span gives to its two rings.
    fn on_span(&mut self, first: usize, shares: [f64; 2], [c, s]: [f64; 2], g: DVec3) {
        for (k, share) in shares.into_iter().enumerate() {
            if let Some(place) = self.out.rings.get_mut(first + k) {
                place.0 += share * (g.x * c + g.z * s);
                place.1 += share * g.y;
            }
        }
    }

    /// Adds what a point, in turned coordinates, gives to the placement, from derivatives
    /// with respect to its image. Returns those with respect to the point.
    fn point(&mut self, p: DVec3, [gu, gv]: [f64; 2]) -> DVec3 {
        let (at, lens) = (self.sight.camera(p), self.sight.lens);
        let g = if lens.pinhole {
            let k = lens.scale / -at.z;
            DVec3::new(gu * k, -gv * k, (gu * at.x - gv * at.y) * k / -at.z)
        } else {
            DVec3::new(gu, -gv, 0.0) * lens.scale
        };
        let g = if g.is_finite() { g } else { DVec3::ZERO };
        self.place(p, g);
        self.sight.m.transpose() * g
    }

    fn on_rim(&mut self, ring: usize, p: DVec3, g: DVec3) {
        let Some(place) = self.out.rings.get_mut(ring) else { return };
        let r = libm::hypot(p.x, p.z);
        if r > 0.0 {
            place.0 += (g.x * p.x + g.z * p.z) / r;
        }
        place.1 += g.y;
    }

    fn on_silhouette(&mut self, span: u32, p: DVec3, g: DVec3) {
        let surface = self.surface;
        let Some(span) = surface.spans().get(span as usize) else { return };
        let Some([a, b]) = surface.ends(span) else { return };
        let r = libm::hypot(p.x, p.z);
        let (c, s) = if r > 0.0 { (p.x / r, p.z / r) } else { (1.0, 0.0) };
        let shares = share([a, b], r, p.y);
        let t = shares[1];
        self.on_span(span.ring, shares, [c, s], g);
        let by_facing = self.slide([a, b], span.ring, [t, c, s], g);
        if by_facing.is_finite() && by_facing != 0.0 {
            self.facing([a, b], span.ring, shares, [c, s], by_facing);
        }
    }

    /// The derivative with respect to the facing at a silhouette, which slides as that
    /// changes.
    fn slide(&self, [a, b]: [&Ring; 2], first: usize, [t, c, s]: [f64; 3], g: DVec3) -> f64 {
        let [x, y] = self.sight.view;
        let bend = self.sight.bend;
        let (dr, dy) = (b.r - a.r, b.y - a.y);
        let one = |ring: &Ring| ring.nr * (c * x - bend * ring.r) + ring.ny * (y - bend * ring.y);
        let r = a.r + dr * t;
        let long = libm::hypot(dr, dy);
        // Per unit of length around the axis and along the path.
        let around = -(a.nr + (b.nr - a.nr) * t) * s * x / r;
        let along = (one(b) - one(a)) / long;
        let (to_side, to_end) = (DVec3::new(-s, 0.0, c), DVec3::new(dr * c, dy, dr * s) / long);
        // The silhouette bends at rings, and its bends stay on them; unless it runs along
        // one there, so that they move fast.
        let ends = [t == 0.0 && self.is_end(first), t == 1.0 && self.is_end(first + 1)];
        let steady = around.abs() > STEADY * along.abs();
        if ends.contains(&true) || ((t == 0.0 || t == 1.0) && steady) {
            return -g.dot(to_side) / around;
        }
        -(g.dot(to_side) * around + g.dot(to_end) * along) / (around * around + along * along)
    }

    /// Whether a ring is an end of a smooth strip.
    fn is_end(&self, ring: usize) -> bool {
        self.neighbours(ring).contains(&ring)
    }

    /// The rings before and after a ring in its strip, or the ring itself at an end.
    fn neighbours(&self, ring: usize) -> [usize; 2] {
        let starts = |r: usize| self.surface.spans().binary_search_by_key(&r, |s| s.ring).is_ok();
        let before = ring.checked_sub(1).filter(|r| starts(*r)).unwrap_or(ring);
        [before, if starts(ring) { ring + 1 } else { ring }]
    }

    /// Adds what the facing at a point of a span gives to the placement and to the rings.
    fn facing(
        &mut self,
        rings: [&Ring; 2],
        first: usize,
        shares: [f64; 2],
        [c, s]: [f64; 2],
        by: f64,
    ) {
        let ([x, y], bend) = (self.sight.view, self.sight.bend);
        let mut normal = DVec3::ZERO;
        for (k, (ring, share)) in rings.into_iter().zip(shares).enumerate() {
            normal += DVec3::new(ring.nr * c, ring.ny, ring.nr * s) * share;
            let by = by * share;
            if let Some(place) = self.out.rings.get_mut(first + k) {
                place.0 -= by * bend * ring.nr;
                place.1 -= by * bend * ring.ny;
            }
            if let Some(place) = self.normals.get_mut(first + k) {
                place.0 += by * (c * x - bend * ring.r);
                place.1 += by * (y - bend * ring.y);
            }
        }
        // The camera as the surface sees it moves against the placement.
        let by_view = self.own * (normal * by);
        let view = self.own * DVec3::new(x, y, 0.0);
        let by = -(self.affine.0.matrix3.inverse().transpose() * by_view);
        self.out.linear += outer(by, view);
        if bend > 0.0 {
            self.out.shift += by;
        }
    }

    /// Passes the derivatives with respect to normals on to the rings beside them.
    fn rotate_normals(&mut self) {
        for i in 0..self.normals.len() {
            let (gr, gy) = self.normals[i];
            let Some(ring) = self.surface.rings().get(i) else { continue };
            // The normal of a pole does not change.
            if (gr, gy) == (0.0, 0.0) || ring.r == 0.0 {
                continue;
            }
            let [before, after] = self.neighbours(i);
            let [p, q] = [before, after].map(|i| self.surface.rings()[i]);
            let length = libm::hypot(q.r - p.r, q.y - p.y);
            let along = gr * ring.nr + gy * ring.ny;
            let (gr, gy) = ((gr - along * ring.nr) / length, (gy - along * ring.ny) / length);
            if !(gr.is_finite() && gy.is_finite()) {
                continue;
            }
            // The normal is (dy, -dr) over its length.
            for (at, sign) in [(before, -1.0), (after, 1.0)] {
                self.out.rings[at].0 -= sign * gy;
                self.out.rings[at].1 += sign * gr;
            }
        }
    }
}

#[cfg(test)]
#[path = "derivative_tests.rs"]
mod tests;
