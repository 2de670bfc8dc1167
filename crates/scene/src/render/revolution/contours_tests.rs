//! Exact contours against those of meshes with many sides, against circles, and against
//! much denser samples of themselves.

use super::*;
use crate::render::Projection;
use crate::render::revolution::testing::{Vessel, random_pose};
use crate::render::simd::portable;
use crate::render::testing::{Uniform, check_invariants};
use glam::DVec3;

/// The distance from a point to the nearest piece.
fn nearest(x: f32, y: f32, c: &Contours) -> f64 {
    let one = |i: usize| {
        let [x, y, cx, cy, tx, ty, l] =
            [x, y, c.x[i], c.y[i], c.tx[i], c.ty[i], c.length[i]].map(f64::from);
        let along = ((x - cx) * tx + (y - cy) * ty).clamp(-0.5 * l, 0.5 * l);
        libm::hypot(x - cx - along * tx, y - cy - along * ty)
    };
    (0..c.len()).map(one).fold(1e9, f64::min)
}

/// The length of the pieces of one that are further than `most` pixels from the other.
fn apart(a: &Contours, b: &Contours, most: f64) -> f64 {
    let far = |i: &usize| nearest(a.x[*i], a.y[*i], b) > most;
    (0..a.len()).filter(far).map(|i| f64::from(a.length[i])).sum()
}

/// Compares with meshes of 512 sides. Where they differ, it is by a piece or two where a
/// contour goes behind something: a mesh is tested at whole pixels.
fn compare(
    rounds: usize,
    seed: u64,
    camera: impl Fn(usize) -> Camera,
    pose: impl Fn(Affine) -> Affine,
) {
    let mut random = Uniform(seed);
    let (mut total, mut extra, mut missing, mut wide) = (0.0, 0.0, 0.0, 0.0);
    for round in 0..rounds {
        let camera = camera(round);
        let vessel = Vessel::random(&mut random, round);
        let pose = pose(random_pose(&mut random));
        let mesh = Contours::of(&vessel.mesh(512).placed(pose), &camera);
        let exact = Contours::of_revolution(&vessel.exact(), &pose, &camera);
        check_invariants(&exact);
        total += exact.total_length();
        extra += apart(&exact, &mesh, 0.05);
        missing += apart(&mesh, &exact, 0.05);
        wide += apart(&exact, &mesh, 2.0) + apart(&mesh, &exact, 2.0);
    }
    assert!(total > 100.0 * rounds as f64, "{total}");
    assert!(extra < 0.01 * total && missing < 0.01 * total, "{extra} {missing} of {total}");
    assert!(wide < 1e-3 * total, "{wide} of {total}");
}

#[test]
fn contours_are_those_of_meshes_with_many_sides() {
    compare(48, 3, |_| Camera::default_for(128, 128), |pose| pose);
}

#[test]
fn parallel_projections_and_stretched_surfaces_agree_too() {
    let parallel = |round: usize| {
        let camera = Camera::default_for(128, 100);
        match round % 2 {
            0 => camera,
            _ => Camera {
                projection: Projection::Orthographic { units_per_pixel: 0.04, cx: 60.0, cy: 50.0 },
                ..camera
            },
        }
    };
    let stretched = |pose: Affine| {
        pose * Affine::new(DVec3::ZERO, DVec3::new(0.2, 0.1, 0.3), DVec3::new(-0.7, 1.2, 0.9))
    };
    compare(24, 5, parallel, stretched);
}

#[test]
fn a_cylinder_from_the_side_is_a_rectangle() {
    let camera = Camera {
        projection: Projection::Orthographic { units_per_pixel: 0.03, cx: 64.0, cy: 64.0 },
        ..Camera::default_for(128, 128)
    };
    let surface = Vessel::cylinder(0.5, 1.0).exact();
    let c = Contours::of_revolution(&surface, &Affine::IDENTITY, &camera);
    check_invariants(&c);
    for i in 0..c.len() {
        let (x, y) = (f64::from(c.x[i]) - 64.0, f64::from(c.y[i]) - 64.0);
        let side = (x.abs() - 0.5 / 0.03).abs().min((y.abs() - 1.0 / 0.03).abs());
        assert!(side < 1e-4, "{x} {y}");
        // Outward is to the left of the tangent.
        assert!(x * f64::from(c.ty[i]) - y * f64::from(c.tx[i]) > 0.0);
    }
    // The two discs are seen edge-on, by the front and by the back half of their rims.
    let sides = 4.0 / 0.03;
    assert!(c.total_length() > sides && c.total_length() < sides + 4.0 / 0.03 + 1.0);
}

#[test]
fn chords_keep_to_the_curves() {
    // A larger picture of the same scene has more and shorter chords of the same curves.
    let mut random = Uniform(8);
    let camera = Camera::default_for(96, 96);
    let (mut total, mut off) = (0.0, 0.0);
    for round in 0..12 {
        let vessel = Vessel::random(&mut random, round);
        let (surface, pose) = (vessel.exact(), random_pose(&mut random));
        let small = Contours::of_revolution(&surface, &pose, &camera);
        let mut large = Contours::of_revolution(&surface, &pose, &camera.scaled_to(96 * 4));
        for list in [&mut large.x, &mut large.y, &mut large.length] {
            list.iter_mut().for_each(|v| *v /= 4.0);
        }
        total += small.total_length();
        // Which pieces are hidden depends on the size of pixels: those that the larger
        // picture does not show do not count, except next to some that it shows.
        off += apart(&small, &large, 0.025) - apart(&small, &large, 0.5);
    }
    assert!(total > 1000.0 && off < 0.015 * total, "{off} of {total}");
}

#[test]
fn near_the_camera_contours_are_cut() {
    let mut random = Uniform(31);
    let camera = Camera::default_for(64, 48);
    let (mut total, mut extra, mut missing) = (0.0, 0.0, 0.0);
    for round in 0..60 {
        let vessel = Vessel::random(&mut random, round);
        let mut v = |s: f64| {
            DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
        };
        let (at, turn, scale) = (v(3.0) + DVec3::Z * 5.0, v(3.0), v(4.0));
        let affine = Affine::new(at, turn, scale);
        let exact = Contours::of_revolution(&vessel.exact(), &affine, &camera);
        check_invariants(&exact);
        let mesh = Contours::of(&vessel.mesh(512).placed(affine), &camera);
        total += exact.total_length();
        extra += apart(&exact, &mesh, 0.1);
        missing += apart(&mesh, &exact, 0.1);
    }
    // Where meshes are cut by the border or the near plane, tests of visibility differ.
    assert!(extra < 0.06 * total && missing < 0.06 * total, "{extra} {missing} of {total}");
}

#[test]
fn nothing_in_view_gives_nothing() {
    let surface = Vessel::cylinder(0.5, 1.0).exact();
    for (at, scale) in [
        (DVec3::new(0.0, 0.0, 20.0), 1.0),
        (DVec3::new(50.0, 0.0, 0.0), 1.0),
        (DVec3::ZERO, 0.0),
        (DVec3::new(f64::NAN, 0.0, 0.0), 1.0),
        (DVec3::ZERO, 1e200),
    ] {
        let affine = Affine::new(at, DVec3::ZERO, DVec3::splat(scale));
        let c = Contours::of_revolution(&surface, &affine, &Camera::default_for(64, 64));
        assert!(c.is_empty(), "{affine:?} {c:?}");
    }
}

#[test]
fn every_processor_gives_the_same_bits() {
    let mut random = Uniform(17);
    let camera = Camera::default_for(100, 80);
    for round in 0..12 {
        let (surface, pose) =
            (Vessel::random(&mut random, round).exact(), random_pose(&mut random));
        let wide = Contours::of_revolution(&surface, &pose, &camera);
        assert_eq!(portable(|| Contours::of_revolution(&surface, &pose, &camera)), wide);
    }
}

#[test]
fn from_the_axis_itself_silhouettes_are_circles() {
    let mut random = Uniform(19);
    let camera = Camera::default_for(128, 128);
    let quarter = core::f64::consts::FRAC_PI_2;
    let along = Affine::new(DVec3::ZERO, DVec3::new(quarter, 0.0, 0.0), DVec3::ONE);
    let (mut total, mut off) = (0.0, 0.0);
    for round in 0..12 {
        let vessel = Vessel::random(&mut random, round);
        let exact = Contours::of_revolution(&vessel.exact(), &along, &camera);
        let mesh = Contours::of(&vessel.mesh(512).placed(along), &camera);
        check_invariants(&exact);
        assert!(!exact.is_empty());
        total += exact.total_length();
        off += apart(&exact, &mesh, 0.05) + apart(&mesh, &exact, 0.05);
    }
    // Circles less than a pixel from others may show in parts in a mesh.
    assert!(off < 0.05 * total, "{off} of {total}");
}
