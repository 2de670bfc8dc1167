//! Degenerate triangles, pictures with and without wide instructions, and depth at a few
//! pixels against the full depth image.

use super::simd::portable;
use super::testing::{Uniform, cuboid, lathe, solid, sphere};
use super::{Camera, Channels, Contours, Frame, Projection};
use crate::geom::{Affine, Mesh, Solid, Topology};
use glam::{DVec3, Vec3};
use std::sync::Arc;

fn affine(random: &mut Uniform, reach: f64) -> Affine {
    let mut v =
        |s: f64| DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s));
    Affine::new(v(reach), v(3.0), DVec3::ONE + v(0.6))
}

fn camera(random: &mut Uniform, round: usize) -> Camera {
    let side = |random: &mut Uniform| random.between(5.0, 300.0) as u32;
    let mut camera = Camera::default_for(side(random), side(random));
    match round % 4 {
        0 => {
            camera.projection =
                Projection::Orthographic { units_per_pixel: 0.03, cx: 40.0, cy: 50.0 }
        }
        // The near plane cuts some meshes.
        1 => camera.eye.z = random.between(-0.5, 1.5),
        _ => {}
    }
    camera
}

fn scene(random: &mut Uniform) -> Solid {
    let profile = [(0.5, -0.8), (0.7, -0.1), (0.4, 0.6)];
    let shapes = [
        sphere(31, 17),
        cuboid(Vec3::new(0.4, 0.9, 0.3)),
        lathe(&profile, 9, false),
        lathe(&profile, 40, true),
    ];
    let count = 1 + (random.next() * 3.0) as usize;
    let one =
        |random: &mut Uniform| shapes[(random.next() * 4.0) as usize].placed(affine(random, 1.0));
    Solid::group(&(0..count).map(|_| one(random)).collect::<Vec<_>>())
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn assert_same(a: &Contours, b: &Contours) {
    assert_eq!(a.len(), b.len());
    for (a, b) in
        [(&a.x, &b.x), (&a.y, &b.y), (&a.tx, &b.tx), (&a.ty, &b.ty), (&a.length, &b.length)]
    {
        assert_eq!(bits(a), bits(b));
    }
}

#[test]
fn wide_instructions_change_nothing() {
    let mut random = Uniform(41);
    let (mut pixels, mut pieces) = (0, 0);
    for round in 0..60 {
        let (thing, camera) = (scene(&mut random), camera(&mut random, round));
        let draw =
            || (Frame::render(&thing, &camera, Channels::Depth), Contours::of(&thing, &camera));
        let (wide, plain) = (draw(), portable(draw));
        assert_eq!(bits(&wide.0.depth), bits(&plain.0.depth));
        assert_same(&wide.1, &plain.1);
        (pixels, pieces) = (pixels + wide.0.mask().filter(|m| *m).count(), pieces + wide.1.len());
    }
    assert!(pixels > 100_000 && pieces > 10_000, "{pixels} {pieces}");
}

#[test]
fn depth_at_a_few_pixels_is_depth_at_all() {
    let mut random = Uniform(42);
    let mut pieces = 0;
    for round in 0..150 {
        let (thing, camera) = (scene(&mut random), camera(&mut random, round));
        let depth = Frame::render(&thing, &camera, Channels::Depth).depth;
        let all = Contours::with_depth(&thing, &camera, &depth);
        assert_same(&Contours::of(&thing, &camera), &all);
        pieces += all.len();
    }
    assert!(pieces > 20_000, "{pieces}");
}

/// A mesh without any checks of its numbers.
fn raw(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Solid {
    let normals = vec![Vec3::Z; positions.len()];
    let topology = Topology {
        parts: vec![0; triangles.len()],
        triangles,
        part_count: 1,
        ..Topology::default()
    };
    Solid::new(Arc::new(Mesh::of(positions, normals, Arc::new(topology))))
}

#[test]
fn triangles_that_are_none_leave_no_trace() {
    let good = [Vec3::new(-0.7, -0.6, 0.2), Vec3::new(0.8, -0.5, -0.4), Vec3::new(0.1, 0.9, 0.3)];
    let [nan, infinite, far] = [f32::NAN, f32::INFINITY, 1e30].map(|v| Vec3::new(v, 0.1, 0.2));
    let odd = [nan, infinite, -infinite, far, good[0], good[0], good[0].lerp(good[1], 0.5)];
    let camera = Camera::default_for(96, 80);
    for channels in [Channels::Depth, Channels::All] {
        let plain = Frame::render(&raw(good.to_vec(), vec![[0, 1, 2]]), &camera, channels);
        assert!(plain.mask().filter(|m| *m).count() > 300);
        let positions: Vec<Vec3> = good.iter().copied().chain(odd).collect();
        let mut triangles = vec![[0, 1, 2]];
        // Unusable corners, points, lines, and vertices that do not exist.
        triangles.extend((3..7).flat_map(|v| [[v, 0, 1], [1, v, 2], [v, v, v]]));
        triangles.extend([[0, 7, 8], [7, 8, 1], [0, 9, 1], [0, 1, 99], [u32::MAX, 1, 2]]);
        let frame = Frame::render(&raw(positions.clone(), triangles.clone()), &camera, channels);
        assert_eq!(bits(&frame.depth), bits(&plain.depth));
        assert_eq!((frame.part, frame.normal), (plain.part, plain.normal));
        let contours = Contours::of(&raw(positions, triangles), &camera);
        assert!(contours.x.iter().chain(&contours.length).all(|v| v.is_finite()));
    }
}

#[test]
fn slivers_and_enormous_triangles_keep_their_depth() {
    let mut random = Uniform(43);
    let camera = Camera::default_for(128, 100);
    let mut drawn = 0;
    for round in 0..2000 {
        // From a thousandth of a pixel to ten thousand pictures, with the smaller side
        // down to nearly 0.
        let size = libm::pow(10.0, random.between(-4.0, 4.5));
        let thin = libm::pow(10.0, random.between(-9.0, 0.0));
        let mut v = |s: f64| {
            DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
        };
        let (middle, along, across) = (v(1.0), v(size), v(size * thin));
        let corners = [middle - along, middle + along, middle + across].map(|p| p.as_vec3());
        let frame =
            Frame::render(&raw(corners.to_vec(), vec![[0, 1, 2]]), &camera, Channels::Depth);
        let depth = corners.map(|p| 8.0 - p.z);
        let (near, far) = (
            depth.iter().copied().fold(f32::MAX, f32::min),
            depth.iter().copied().fold(0.0, f32::max),
        );
        for d in frame.depth.iter().filter(|d| d.is_finite()) {
            assert!(
                *d >= near.max(0.0) * (1.0 - 1e-5) && *d <= far * (1.0 + 1e-5),
                "{round}: {d} not in {near} {far}"
            );
            drawn += 1;
        }
    }
    assert!(drawn > 500_000, "{drawn}");
}

#[test]
fn one_enormous_triangle_is_a_plane() {
    let camera = Camera::default_for(64, 48);
    for size in [10.0f32, 1e3, 1e5] {
        let corners = vec![
            Vec3::new(-size, -size, 0.5),
            Vec3::new(size, -size, 0.5),
            Vec3::new(0.0, size, 0.5),
        ];
        let frame = Frame::render(&solid(corners, vec![[0, 1, 2]]), &camera, Channels::Depth);
        assert!(frame.depth.iter().all(|d| (d - 7.5).abs() < 1e-5 * 7.5), "{size}");
    }
}

#[test]
fn holes_too_small_to_be_seen_change_nothing() {
    let camera = Camera::default_for(128, 128);
    let ball = |hole: f32| {
        let profile: Vec<_> = (0..=40)
            .map(|i| {
                let a = std::f32::consts::PI * (i as f32 / 40.0 - 0.5) * (1.0 - hole);
                (a.cos().max(1e-7), a.sin())
            })
            .collect();
        lathe(&profile, 40, false).placed(Affine::new(
            DVec3::ZERO,
            DVec3::new(0.9, 0.3, 0.2),
            DVec3::ONE,
        ))
    };
    let [tiny, seen] = [1e-4, 0.05].map(|hole| Contours::of(&ball(hole), &camera).total_length());
    let around = Contours::of(&sphere(40, 40), &camera).total_length();
    assert!((tiny - around).abs() < 0.01 * around, "{tiny} {around}");
    assert!(seen > around + 10.0, "{seen} {around}");
}
