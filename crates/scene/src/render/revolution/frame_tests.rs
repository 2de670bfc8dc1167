//! Exact depth, parts and normals against those of meshes with many sides.

use super::*;
use crate::render::Projection;
use crate::render::revolution::testing::{Vessel, random_pose};
use crate::render::testing::Uniform;
use glam::DVec3;

#[test]
fn pictures_are_those_of_meshes_with_many_sides() {
    let mut random = Uniform(21);
    let camera = Camera::default_for(128, 96);
    let parallel = Camera {
        projection: Projection::Orthographic { units_per_pixel: 0.035, cx: 60.0, cy: 50.0 },
        ..camera
    };
    let (mut shown, mut masks, mut depths, mut parts, mut normals) = (0, 0, 0, 0, 0);
    for round in 0..24 {
        let camera = if round % 4 == 3 { parallel } else { camera };
        let vessel = Vessel::random(&mut random, round);
        let pose = random_pose(&mut random);
        let mesh = Frame::render(&vessel.mesh(512).placed(pose), &camera, Channels::All);
        let exact = Frame::of_revolution(&vessel.exact(), &pose, &camera, Channels::All);
        let alone = Frame::of_revolution(&vessel.exact(), &pose, &camera, Channels::Depth);
        assert_eq!(exact.depth, alone.depth);
        let pixels: Vec<u32> = (0..camera.pixels() as u32).collect();
        let plain = vessel.exact().depth_at(&pose, &camera, &pixels);
        let other = (0..pixels.len()).filter(|i| plain[*i] != exact.depth[*i]).count();
        assert_eq!(other, 0, "round {round}");
        for i in 0..camera.pixels() {
            let (d, e) = (mesh.depth[i], exact.depth[i]);
            assert_eq!(e.is_finite(), exact.part[i] != u16::MAX);
            if d.is_finite() != e.is_finite() {
                masks += 1;
                continue;
            }
            if !d.is_finite() {
                continue;
            }
            shown += 1;
            depths += usize::from((d - e).abs() > 2e-3 * e);
            parts += usize::from(mesh.part[i] != exact.part[i]);
            let dot: f32 = (0..3).map(|k| mesh.normal[i][k] * exact.normal[i][k]).sum();
            normals += usize::from(dot < 0.999);
            let n = exact.normal[i];
            assert!((n.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5);
        }
    }
    // The rest are pixels at outlines, where a mesh's corners are rounded to 1/1024 of a
    // pixel, and at creases.
    let few = |count: usize, what: &str| {
        assert!(count * 200 < shown, "{what}: {count} of {shown} pixels");
    };
    assert!(shown > 30_000, "{shown}");
    few(masks, "masks");
    few(depths, "depths");
    few(parts, "parts");
    few(normals, "normals");
}

#[test]
fn a_cylinder_has_its_depth() {
    let vessel = Vessel::cylinder(0.5, 1.0);
    let camera = Camera::default_for(64, 64);
    let frame = Frame::of_revolution(&vessel.exact(), &Affine::IDENTITY, &camera, Channels::All);
    // The pixel right of and below the middle: its line of sight meets x^2 + z^2 = 1/4.
    let slope = 0.5 * 4.4 / (8.0 * 64.0);
    let (a, b, c) = (1.0 + slope * slope, -16.0, 64.0 - 0.25);
    let depth = (-b - libm::sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
    let i = 32 * 64 + 32;
    assert!((f64::from(frame.depth[i]) - depth).abs() < 1e-6, "{} {depth}", frame.depth[i]);
    assert_eq!(frame.part[i], 0);
    assert!(frame.normal[i][2] > 0.997);
}

#[test]
fn nothing_shows_of_what_is_flat_or_behind() {
    let surface = Vessel::cylinder(0.5, 1.0).exact();
    let camera = Camera::default_for(32, 32);
    for (at, scale) in [
        (DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)),
        (DVec3::new(0.0, 0.0, 20.0), DVec3::ONE),
        (DVec3::new(f64::NAN, 0.0, 0.0), DVec3::ONE),
        (DVec3::ZERO, DVec3::splat(1e200)),
    ] {
        let affine = Affine::new(at, DVec3::ZERO, scale);
        let frame = Frame::of_revolution(&surface, &affine, &camera, Channels::All);
        assert!(frame.depth.iter().all(|d| *d == f32::INFINITY), "{affine:?}");
        assert!(frame.part.iter().all(|p| *p == u16::MAX));
    }
}
