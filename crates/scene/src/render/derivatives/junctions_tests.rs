//! Ends of contours behind others, against finite differences of drawn contours.

use crate::geom::{Affine, Solid};
use crate::render::testing::{along, cuboid, sphere, weighted};
use crate::render::{Camera, Contours, Projection};
use glam::{DVec3, Vec3};

/// Slopes of a weighted length of contour with respect to translations and a rotation of
/// the nearer of two solids and a translation of the farther: by differences over some
/// pixels, by the derivatives, and by the derivatives with fixed pieces.
fn slopes(near: &Solid, far: &Solid, camera: &Camera) -> Vec<[f64; 3]> {
    let at = |p: [f64; 4]| {
        let nearer = Affine::new(
            DVec3::new(0.8 + p[0], 0.1 + p[1], 0.6),
            DVec3::new(0.0, 0.0, 0.3 + p[2]),
            DVec3::ONE,
        );
        let farther = Affine::new(DVec3::new(-0.2 + p[3], 0.0, -0.6), DVec3::ZERO, DVec3::ONE);
        Solid::group(&[far.placed(farther), near.placed(nearer)])
    };
    let here = at([0.0; 4]);
    let contours = Contours::of(&here, camera);
    let by = weighted(&contours).1;
    let [moving, fixed] =
        [contours.vjp(&here, camera, &by), contours.vjp_fixed(&here, camera, &by)];
    let one = |k: usize| {
        let moved = |h: f64| at(std::array::from_fn(|i| if i == k { h } else { 0.0 }));
        // Pieces come and go one by one, which averages out over many steps.
        let steps: Vec<f64> = (1..=20).map(|i| 0.006 * f64::from(i)).collect();
        let sum = |h: f64| weighted(&Contours::of(&moved(h), camera)).0;
        let rise: f64 = steps.iter().map(|h| h * (sum(*h) - sum(-h))).sum();
        let slope = rise / steps.iter().map(|h| 2.0 * h * h).sum::<f64>();
        let (before, after) = (moved(-1e-5), moved(1e-5));
        [slope, along(&moving, &before, &after, 2e-5), along(&fixed, &before, &after, 2e-5)]
    };
    (0..4).map(one).collect()
}

#[test]
fn what_moves_in_front_hides_and_reveals() {
    let mut parallel = Camera::default_for(192, 192);
    parallel.projection = Projection::Orthographic { units_per_pixel: 0.02, cx: 96.0, cy: 96.0 };
    for camera in [Camera::default_for(192, 192), parallel] {
        let plate = cuboid(Vec3::new(0.5, 0.7, 0.05));
        for (near, far) in
            [(&plate, cuboid(Vec3::new(0.9, 0.3, 0.1))), (&sphere(48, 24), sphere(48, 24))]
        {
            let all = slopes(near, &far, &camera);
            let missed = |i: usize| all.iter().map(|s| (s[i] - s[0]).abs()).fold(0.0, f64::max);
            let most = all.iter().map(|s| s[0].abs()).fold(0.0, f64::max);
            assert!(missed(1) < 0.1 * most && missed(2) > 0.4 * most, "{all:?}");
        }
    }
}

#[test]
fn a_plate_before_a_bar_hides_as_much_as_it_moves() {
    // Contours of a bar along x, with a rotated plate over its end: the crossing of the
    // plate's edge with a line along x moves with the plate along x, and by tan of the
    // rotation when the plate moves along y.
    let mut camera = Camera::default_for(192, 192);
    camera.projection = Projection::Orthographic { units_per_pixel: 0.02, cx: 96.0, cy: 96.0 };
    let (bar, plate) = (cuboid(Vec3::new(0.9, 0.3, 0.1)), cuboid(Vec3::new(0.5, 0.7, 0.05)));
    let turn = 0.3;
    let at = |x: f64, y: f64| {
        let plate = plate.placed(Affine::new(
            DVec3::new(0.8 + x, 0.1 + y, 0.6),
            DVec3::new(0.0, 0.0, turn),
            DVec3::ONE,
        ));
        Solid::group(&[
            bar.placed(Affine::new(DVec3::new(-0.2, 0.0, -0.6), DVec3::ZERO, DVec3::ONE)),
            plate,
        ])
    };
    let here = at(0.0, 0.0);
    let contours = Contours::of(&here, &camera);
    let by = contours.vjp(&here, &camera, &vec![[0.0, 0.0, 1.0, 0.0]; contours.len()]);
    // Seen straight on, a bar has two lines along x that continue behind the plate, on
    // each of its faces that can be distinguished.
    let lines = along(&by, &at(-1e-6, 0.0), &at(1e-6, 0.0), 2e-6) * 0.02;
    assert!((lines - lines.round()).abs() < 1e-3 && lines >= 2.0, "{lines}");
    let up = along(&by, &at(0.0, -1e-6), &at(0.0, 1e-6), 2e-6) * 0.02;
    assert!((up - lines * libm::tan(turn)).abs() < 1e-3, "{up} {lines}");
}
