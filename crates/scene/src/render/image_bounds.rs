//! The bounding box of a solid in the picture.

use super::pixels::project::ratios;
use super::{Camera, Projection, View};
use crate::geom::{PlacedRevolution, Ring};
use glam::DVec3;

/// Left, top, right and bottom.
type Bounds = [f64; 4];

/// Of a solid that extends behind the camera.
const EVERYWHERE: Bounds = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY];
/// Of a solid without vertices.
const NOWHERE: Bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];

impl View {
    /// The left, top, right and bottom of all vertices, or of the rings of a surface of
    /// revolution, as fractions of the picture's sides. Infinite if the solid extends behind
    /// the camera, or has no vertices.
    pub fn image_bounds(&self) -> [f64; 4] {
        *self.bounds.get_or_init(|| self.find_bounds())
    }

    fn find_bounds(&self) -> Bounds {
        let camera = self.camera();
        let found = match self.solid().revolution() {
            Some(r) => around(r.surface.rings().iter().map(|ring| ring_box(r, ring, camera))),
            None => around(self.solid().vertices().map(|v| {
                let (x, y, depth) = camera.project(v);
                (!depth.is_nan() && depth > Camera::NEAR).then_some([x, y, x, y])
            })),
        };
        let Some([left, top, right, bottom]) = found else { return EVERYWHERE };
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        [left / width, top / height, right / width, bottom / height]
    }
}

/// The box around some boxes; `None` if one is.
fn around(mut boxes: impl Iterator<Item = Option<Bounds>>) -> Option<Bounds> {
    boxes.try_fold(NOWHERE, |a, b| {
        let b = b?;
        Some([a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
    })
}

/// The box of a ring in pixels; `None` if it reaches behind the camera.
fn ring_box(r: &PlacedRevolution, ring: &Ring, camera: &Camera) -> Option<Bounds> {
    let matrix = r.affine.0.matrix3;
    let centre = r.affine.point(DVec3::new(0.0, ring.y, 0.0)) - camera.eye;
    let (u, v) = (matrix.x_axis * ring.r, matrix.z_axis * ring.r);
    // Along each axis of the camera: the centre, and the factors of cosine and sine.
    let along = |axis: DVec3| [centre.dot(axis), u.dot(axis), v.dot(axis)];
    let [x, y, depth] = [camera.right, camera.up, camera.forward].map(along);
    let nearest = depth[0] - (depth[1] * depth[1] + depth[2] * depth[2]).sqrt();
    if nearest.is_nan() || nearest <= Camera::NEAR {
        return None;
    }
    let ([left, right], [low, high], scale, cx, cy) = match camera.projection {
        Projection::Pinhole { focal_px, cx, cy } => {
            (ratios(&x, &depth), ratios(&y, &depth), focal_px, cx, cy)
        }
        Projection::Orthographic { units_per_pixel, cx, cy } => {
            let ends =
                |a: &[f64; 3]| [-1.0, 1.0].map(|s| a[0] + s * (a[1] * a[1] + a[2] * a[2]).sqrt());
            (ends(&x), ends(&y), 1.0 / units_per_pixel, cx, cy)
        }
    };
    Some([cx + scale * left, cy - scale * high, cx + scale * right, cy - scale * low])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Affine, Caps, Profile, Solid, lathe};

    #[test]
    fn bounds_of_round_surfaces_are_those_of_fine_meshes() {
        let profile = [Profile { y: vec![-1.0, 0.2, 0.9], r: vec![0.4, 0.8, 0.0] }];
        let mut parallel = Camera::default_for(96, 64);
        parallel.projection =
            Projection::Orthographic { units_per_pixel: 0.04, cx: 47.0, cy: 33.0 };
        for camera in [Camera::default_for(96, 64), parallel] {
            for (turn, scale) in [(0.0, [1.0; 3]), (0.9, [1.0, 1.4, -0.7])] {
                let by = Affine::new(
                    DVec3::new(0.6, -0.3, 1.0),
                    DVec3::new(turn, 0.4, 0.7),
                    scale.into(),
                );
                let fine =
                    Solid::new(lathe(&profile, 1024, 0.0, Caps::Both).unwrap().into()).placed(by);
                let round = Solid::exact_lathe(&profile, 96, 0.0, Caps::Both).unwrap().placed(by);
                let (a, b) = (fine.bounds().unwrap(), round.bounds().unwrap());
                assert!((a.min - b.min).abs().max_element() < 1e-4, "{a:?} {b:?}");
                assert!((a.max - b.max).abs().max_element() < 1e-4, "{a:?} {b:?}");
                let bounds = |solid: &Solid| View::new(solid.clone(), camera).image_bounds();
                for (a, b) in bounds(&fine).iter().zip(bounds(&round)) {
                    assert!((a - b).abs() < 1e-4, "{a} {b}");
                }
            }
        }
        let round = Solid::exact_lathe(&profile, 96, 0.0, Caps::Both).unwrap();
        let near = Affine::new(DVec3::new(0.0, 0.0, 7.8), DVec3::ZERO, DVec3::ONE);
        let view = View::new(round.placed(near), Camera::default_for(64, 64));
        assert_eq!(view.image_bounds(), EVERYWHERE);
    }
}
