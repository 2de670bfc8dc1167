//! How a silhouette moves with the surface: derivatives of sums over the pixels that a
//! solid covers, with respect to its vertices.
//!
//! Where the outline moves outwards, the sum gains the values beside it, in proportion to
//! the outline's length times its motion. Pixels are either in or out, so the sum is a
//! step function; these are the slopes of the sum with its steps smoothed out. The
//! outline is taken from the contours: where a coarse mesh covers pixels beyond its
//! smooth silhouette, that part of it is missed.

use crate::geom::ByVertex;
use crate::render::View;
use crate::render::derivatives::vjp::vjp_some;
use glam::DVec3;

/// Distance from a piece at which to test for the background, in pixels.
const BESIDE: f64 = 1.2;
/// Number of positions along a piece at which a value of its pixels is read.
const PARTS: i32 = 4;

impl View {
    /// The derivatives of the sum of `gain` over the pixels that show the solid, in the
    /// picture whose longer side has `size` pixels, with respect to each vertex of the
    /// solid's meshes in turn, in world coordinates. `gain` has a number for each pixel,
    /// row by row.
    pub fn vjp_mask(&self, size: u32, gain: &[f64]) -> Vec<DVec3> {
        self.vjp_outline(size, |picture, [x, y, ..], _| {
            picture.between(gain, f64::from(x), f64::from(y))
        })
    }

    /// The same of the sum of the fraction of each pixel that shows the solid, [`View::fractions`],
    /// times the pixel's `gain`. The sum is not a step function.
    /// It has the vertices at the outline.
    pub fn vjp_fractions(&self, size: u32, gain: impl Fn(usize) -> f64) -> ByVertex {
        let camera = self.camera().scaled_to(size);
        if let Some(by_vertex) = self.covered(size).vjp(self.solid(), &camera, &gain) {
            return by_vertex;
        }
        let by_vertex = self.vjp_outline(size, |picture, piece, length| {
            let [x, y, tx, ty] = piece.map(f64::from);
            // A piece may run through several pixels.
            let part = |k: i32| {
                let along = f64::from(length) * f64::from(2 * k + 1 - PARTS) / f64::from(2 * PARTS);
                gain(picture.at(x + along * tx, y + along * ty))
            };
            (0..PARTS).map(part).sum::<f64>() / f64::from(PARTS)
        });
        (0..).zip(by_vertex).filter(|(_, by)| *by != DVec3::ZERO).collect()
    }

    /// The same where a motion of the outline by a pixel gains `gain` for each pixel of its
    /// length, along a piece: its middle and tangent, and its length.
    fn vjp_outline(
        &self,
        size: u32,
        gain: impl Fn(&DepthImage<'_>, [f32; 4], f32) -> f64,
    ) -> Vec<DVec3> {
        let frame = self.depth(size);
        let camera = self.camera().scaled_to(size);
        let picture =
            DepthImage { width: camera.width, height: camera.height, depth: &frame.depth };
        vjp_some(self.solid(), &camera, &frame.depth, |piece| {
            let at = [piece.x, piece.y, piece.tx, piece.ty];
            let [nx, ny] = picture.outward(at)?;
            let by = f64::from(piece.length) * gain(&picture, at, piece.length);
            Some([by * nx, by * ny])
        })
    }
}

/// A depth image.
struct DepthImage<'a> {
    width: u32,
    height: u32,
    depth: &'a [f32],
}

impl DepthImage<'_> {
    /// The direction towards the background, if a piece at this position with this tangent
    /// is part of the outline.
    fn outward(&self, piece: [f32; 4]) -> Option<[f64; 2]> {
        let [x, y, tx, ty] = piece.map(f64::from);
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let shown = |sign: f64| {
            let (u, v) = (x + sign * BESIDE * ty, y - sign * BESIDE * tx);
            let inside = u >= 0.0 && v >= 0.0 && u < width && v < height;
            inside.then(|| {
                let at = v as usize * self.width as usize + u as usize;
                self.depth.get(at).is_some_and(|d| d.is_finite())
            })
        };
        match (shown(1.0)?, shown(-1.0)?) {
            (false, true) => Some([ty, -tx]),
            (true, false) => Some([-ty, tx]),
            _ => None,
        }
    }

    /// The pixel at a position, or the nearest one.
    fn at(&self, x: f64, y: f64) -> usize {
        let (w, h) = (self.width as usize, self.height as usize);
        let (i, j) = ((x.max(0.0) as usize).min(w - 1), (y.max(0.0) as usize).min(h - 1));
        j * w + i
    }

    /// The value interpolated bilinearly between pixel centres.
    fn between(&self, values: &[f64], x: f64, y: f64) -> f64 {
        let (w, h) = (self.width as usize, self.height as usize);
        let (u, v) = ((x - 0.5).clamp(0.0, (w - 1) as f64), (y - 0.5).clamp(0.0, (h - 1) as f64));
        let (u0, v0) = (u as usize, v as usize);
        let at = |u: usize, v: usize| {
            values.get(v.min(h - 1) * w + u.min(w - 1)).copied().unwrap_or(0.0)
        };
        let (fu, fv) = (u - u0 as f64, v - v0 as f64);
        let row = |v: usize| at(u0, v) + fu * (at(u0 + 1, v) - at(u0, v));
        row(v0) + fv * (row(v0 + 1) - row(v0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Affine, Solid};
    use crate::render::Camera;
    use crate::render::testing::{cuboid, sphere};
    use glam::Vec3;

    #[test]
    fn gains_are_read_bilinearly_up_to_the_border() {
        let picture = |width, height| DepthImage { width, height, depth: &[] };
        let gain = [1.0, 2.0, 4.0, 3.0, 5.0, 9.0];
        for (x, y, expected) in [
            (0.5, 0.5, 1.0),
            (2.5, 0.5, 4.0),
            (1.5, 1.5, 5.0),
            (1.0, 0.5, 1.5),
            (0.5, 1.0, 2.0),
            (1.0, 1.0, 2.75),
            (2.25, 0.75, 4.625),
            (0.0, 0.0, 1.0),
            (3.0, 2.0, 9.0),
            (0.0, 2.0, 3.0),
        ] {
            assert_eq!(picture(3, 2).between(&gain, x, y), expected, "{x} {y}");
        }
        assert_eq!(picture(2, 1).between(&[1.0, 2.0], 1.0, 0.9), 1.5);
        assert_eq!(picture(1, 2).between(&[1.0, 2.0], 0.1, 1.0), 1.5);
    }

    /// Checks derivatives of a sum over a picture of `size` pixels, with respect to vertices,
    /// against differences over `step` of five numbers that place the solid, up to 3 % of
    /// what is added up and `chance`.
    fn check_slopes(
        solid: &Solid,
        size: u32,
        sum: impl Fn(&View) -> f64,
        vjp: impl Fn(&View) -> Vec<DVec3>,
        (step, chance): (f64, f64),
    ) {
        let at = |p: &[f64; 5]| {
            let turn = DVec3::new(0.4 + p[2], 0.5 + p[3], 0.2);
            let by = Affine::new(DVec3::new(p[0], p[1], 0.0), turn, DVec3::splat(1.0 + p[4]));
            View::new(solid.placed(by), Camera::default_for(size, size))
        };
        let here = [0.05, -0.1, 0.0, 0.0, 0.0];
        let found = vjp(&at(&here));
        let vertices = |p: &[f64; 5]| at(p).solid().vertices().collect::<Vec<_>>();
        for k in 0..5 {
            let moved = |h: f64| {
                let mut p = here;
                p[k] += h;
                p
            };
            let way = vertices(&moved(1e-6))
                .into_iter()
                .zip(vertices(&moved(-1e-6)))
                .map(|(a, b)| (a - b) / 2e-6);
            let terms: Vec<f64> = found.iter().zip(way).map(|(g, d)| g.dot(d)).collect();
            let (along, gross) =
                (terms.iter().sum::<f64>(), terms.iter().map(|t| t.abs()).sum::<f64>());
            let slope = (sum(&at(&moved(step))) - sum(&at(&moved(-step)))) / (2.0 * step);
            assert!(
                (along - slope).abs() < 0.03 * gross + chance,
                "number {k}: {along} {slope} of {gross}"
            );
        }
    }

    #[test]
    fn sums_over_silhouettes_change_as_predicted() {
        const SIZE: u32 = 192;
        // A smooth gain, and pictures coarse enough that a difference over some pixels
        // gives the slope.
        let gain: Vec<f64> = (0..SIZE * SIZE)
            .map(|i| {
                let (x, y) = (f64::from(i % SIZE), f64::from(i / SIZE));
                1.0 + 0.01 * x + 0.005 * y + 0.5 * libm::sin(x / 30.0)
            })
            .collect();
        let sum = |view: &View| {
            let frame = view.depth(SIZE);
            frame.mask().zip(&gain).map(|(m, g)| if m { *g } else { 0.0 }).sum::<f64>()
        };
        let block = cuboid(Vec3::new(1.4, 1.0, 0.8));
        for solid in [sphere(64, 32), block] {
            // Gains on one side mostly cancel losses on the other. Pixels are either
            // in or out: of the outline's 300, about 20 more or fewer are covered by
            // chance, each worth about 1 to 3, over a difference of 0.08.
            check_slopes(&solid, SIZE, sum, |view| view.vjp_mask(SIZE, &gain), (0.04, 400.0));
        }
    }

    #[test]
    fn sums_of_fractions_have_these_slopes() {
        const SIZE: u32 = 40;
        // As of a mask: gains within it, losses elsewhere.
        let gain: Vec<f64> = (0..SIZE * SIZE)
            .map(|i| {
                let (x, y) = (f64::from(i % SIZE), f64::from(i / SIZE));
                let within = (x - 21.0).abs() < 7.0 && (y - 20.0).abs() < 9.0;
                if within { 0.5 } else { -0.6 }
            })
            .collect();
        let sum = |view: &View| {
            let fractions = view.fractions(SIZE);
            fractions.iter().zip(&gain).map(|(f, g)| f64::from(*f) * g).sum::<f64>()
        };
        let block = cuboid(Vec3::new(1.4, 1.0, 0.8));
        for solid in [sphere(96, 48), block] {
            // The outline moves by about 0.03 pixels: 8 steps of the fractions.
            let vjp = |view: &View| {
                let mut all = vec![DVec3::ZERO; view.solid().vertex_count()];
                let some = view.vjp_fractions(SIZE, |pixel| gain[pixel]);
                some.into_iter().for_each(|(v, by)| all[v as usize] += by);
                all
            };
            check_slopes(&solid, SIZE, sum, vjp, (0.003, 3.0));
        }
    }

    /// The same sum by the general way: contours first, then the pieces of all of them.
    #[test]
    fn only_pieces_of_the_outline_count() {
        let place = |x: f64, turn: f64| {
            Affine::new(DVec3::new(x, 0.1, -0.3), DVec3::new(turn, 0.4, 0.2), DVec3::ONE)
        };
        let solid = Solid::group(&[
            sphere(20, 12).placed(place(0.9, 0.0)),
            cuboid(Vec3::new(0.8, 1.1, 0.6)).placed(place(0.2, -0.7)),
            sphere(20, 12).placed(place(900.0, 0.0)),
        ]);
        let view = View::new(solid, Camera::default_for(96, 80));
        let gain: Vec<f64> = (0..96 * 80).map(|i| 0.1 * f64::from(i % 37) - 1.0).collect();
        let (frame, contours, camera) = (view.depth(96), view.contours(96), view.camera());
        let picture = DepthImage { width: 96, height: 80, depth: &frame.depth };
        let mut counted = 0;
        let by: Vec<[f64; 4]> = (0..contours.len())
            .map(|i| {
                let [x, y] = [contours.x[i], contours.y[i]];
                let Some([nx, ny]) = picture.outward([x, y, contours.tx[i], contours.ty[i]]) else {
                    return [0.0; 4];
                };
                counted += 1;
                let at = picture.between(&gain, f64::from(x), f64::from(y));
                let by = f64::from(contours.length[i]) * at;
                [by * nx, by * ny, 0.0, 0.0]
            })
            .collect();
        assert!(counted > 100 && counted < contours.len());
        assert_eq!(view.vjp_mask(96, &gain), contours.vjp_fixed(view.solid(), camera, &by));
    }
}
