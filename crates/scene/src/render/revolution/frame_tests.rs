//! Exact depth, parts and normals against those of meshes with many sides.

use super::*;
use crate::geom::{Caps, Profile};
use crate::render::Projection;
use crate::render::revolution::testing::{Vessel, random_pose};
use crate::render::simd::portable;
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

/// The possible normals at a pixel, from the nearest spans of its part.
fn normals(
    surface: &Revolution,
    affine: &Affine,
    camera: &Camera,
    pixel: usize,
    frame: &Frame,
) -> Vec<DVec3> {
    let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
    let (depth, at) = (f64::from(frame.depth[pixel]), [f64::from(x) + 0.5, f64::from(y) + 0.5]);
    let (right, up, way) = match camera.projection {
        Projection::Pinhole { focal_px, cx, cy } => {
            let (x, y) = ((at[0] - cx) / focal_px, (cy - at[1]) / focal_px);
            (x * depth, y * depth, DVec3::new(x, y, -1.0))
        }
        Projection::Orthographic { units_per_pixel, cx, cy } => {
            ((at[0] - cx) * units_per_pixel, (cy - at[1]) * units_per_pixel, -DVec3::Z)
        }
    };
    let p = camera.eye + camera.right * right + camera.up * up + camera.forward * depth;
    let inverse = affine.0.matrix3.inverse();
    let p = inverse * (p - affine.0.translation);
    let r = libm::hypot(p.x, p.z);
    let mut found: Vec<(f64, DVec3)> = Vec::new();
    for span in surface.spans().iter().filter(|span| span.part == frame.part[pixel]) {
        let [a, b] = surface.ends(span).unwrap();
        let (dr, dy) = (b.r - a.r, b.y - a.y);
        let t = ((r - a.r) * dr + (p.y - a.y) * dy) / (dr * dr + dy * dy);
        let t = t.clamp(0.0, 1.0);
        let off = libm::hypot(a.r + dr * t - r, a.y + dy * t - p.y);
        let (nr, ny) = (a.nr + (b.nr - a.nr) * t, a.ny + (b.ny - a.ny) * t);
        let n = inverse.transpose() * DVec3::new(nr * p.x / r, ny, nr * p.z / r);
        let n = DVec3::new(n.dot(camera.right), n.dot(camera.up), -n.dot(camera.forward));
        let n = if n.dot(way) > 0.0 { -n } else { n };
        found.push((off, n.normalize()));
    }
    let least = found.iter().fold(f64::INFINITY, |least, f| least.min(f.0));
    found.into_iter().filter(|f| f.0 < least + 1e-4).map(|f| f.1).collect()
}

/// The depth at some pixels of a camera's image (row by row from the top): infinite
/// where the surface does not show, and everywhere if the placement is not invertible.
fn plain_depth(surface: &Revolution, affine: &Affine, camera: &Camera, pixels: &[u32]) -> Vec<f32> {
    let mut out = vec![f32::INFINITY; pixels.len()];
    let Some(sight) = Sight::new(camera, affine) else { return out };
    let width = camera.width.max(1);
    let mut spans = Spans::default();
    vectorised(
        #[inline(always)]
        || {
            spans.set(surface);
            for (pixels, out) in pixels.chunks(LANES).zip(out.chunks_mut(LANES)) {
                let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
                for (i, pixel) in pixels.iter().enumerate() {
                    x[i] = f64::from(pixel % width) + 0.5;
                    y[i] = f64::from(pixel / width) + 0.5;
                }
                let seen = spans.nearest(&sight.rays([&x, &y]));
                out.iter_mut().zip(seen.depth).for_each(|(out, d)| *out = d as f32);
            }
        },
    );
    out
}

#[test]
fn spans_are_tested_wherever_they_show() {
    let mut random = Uniform(77);
    let (mut shown, mut closed, mut cut) = (0, 0, 0);
    for round in 0..160 {
        let mut camera = Camera::default_for(if round % 8 == 0 { 300 } else { 70 }, 64);
        if round % 4 == 3 {
            let units_per_pixel = [0.035, 0.05][round / 4 % 2];
            camera.projection = Projection::Orthographic { units_per_pixel, cx: 30.0, cy: 32.5 };
        }
        let surface = Vessel::random(&mut random, round).exact();
        let mut v = |s: f64| {
            DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
        };
        // Some stand upright, reach behind the camera or are turned inside out.
        let at = if round % 10 == 9 { v(1.0) + DVec3::Z * 7.0 } else { v(0.4) };
        let turn = if round % 11 == 0 { DVec3::ZERO } else { v([0.5, 3.0][round % 2]) };
        let stretch = DVec3::new(1.0, [1.0, -1.2, 0.7][round % 3], 1.0) + v(0.3);
        let affine = Affine::new(at, turn, stretch);
        let affine = match round % 6 {
            5 => Affine::new(DVec3::ZERO, v(0.5), DVec3::new(1.0, 1.3, 0.7)) * affine,
            _ => affine,
        };
        let frame = Frame::of_revolution(&surface, &affine, &camera, Channels::All);
        let again = portable(|| Frame::of_revolution(&surface, &affine, &camera, Channels::All));
        assert!(frame == again, "round {round}");
        let pixels: Vec<u32> = (0..camera.pixels() as u32).collect();
        let plain = plain_depth(&surface, &affine, &camera, &pixels);
        assert!(frame.depth == plain, "round {round}");
        closed += usize::from(surface.encloses());
        let range = Sight::new(&camera, &affine).unwrap().range(&surface);
        cut += usize::from(range.near <= Camera::NEAR);
        let mut wrong = 0;
        for i in (0..camera.pixels()).filter(|i| plain[*i].is_finite()) {
            shown += 1;
            let n = DVec3::from(frame.normal[i].map(f64::from));
            let near = normals(&surface, &affine, &camera, i, &frame);
            wrong += usize::from(!near.iter().any(|m| (n - m).length() < 2e-3));
        }
        // Where a surface is seen at a small angle, single precision is not enough for the
        // side that shows.
        assert!(wrong < 4, "round {round}: {wrong}");
    }
    assert!(shown > 60_000 && closed > 30 && cut > 3, "{shown} {closed} {cut}");
}

#[test]
fn what_goes_up_and_down_again_inside_encloses_a_body() {
    let walls = |r: [f64; 3], thickness: f64, caps: Caps| {
        let part = Profile { y: vec![-1.0, 0.2, 0.9], r: r.to_vec() };
        let wall = crate::geom::Wall { thickness, floor: 0.3 };
        Vessel { parts: vec![part], wall, caps }.exact().encloses()
    };
    for r in [[0.4, 0.8, 0.3], [0.0, 0.5, 0.0], [0.9, 0.1, 0.9]] {
        assert!(walls(r, 0.0, Caps::Both), "{r:?}");
        assert!(walls(r, 0.1, Caps::Bottom) && walls(r, 0.1, Caps::None), "{r:?}");
    }
    assert!(!walls([0.4, 0.8, 0.3], 0.0, Caps::Bottom));
    assert!(!walls([0.4, 0.8, 0.3], 0.0, Caps::None));
}
