//! Contours against circles, against the depth jumps of a much larger depth image, and
//! for continuity.

use super::*;
use crate::geom::Affine;
use crate::render::testing::{Uniform, check_invariants, cuboid, lathe, sphere};
use crate::render::{Channels, Frame, Projection};
use glam::{DVec3, Vec3};

fn place(at: [f64; 3], turn: [f64; 3], scale: f64) -> Affine {
    Affine::new(DVec3::from_array(at), DVec3::from_array(turn), DVec3::splat(scale))
}

#[test]
fn a_sphere_gives_a_circle() {
    let camera = Camera {
        projection: Projection::Pinhole { focal_px: 232.0, cx: 70.0, cy: 60.0 },
        ..Camera::default_for(128, 128)
    };
    let ball = sphere(96, 64).placed(place([0.0; 3], [0.4, 0.2, 0.1], 1.2));
    let c = Contours::of(&ball, &camera);
    check_invariants(&c);
    // A sphere on the axis at distance d: the outline's radius is f r / sqrt(d^2 - r^2).
    let radius = 232.0 * 1.2 / (64.0f64 - 1.44).sqrt();
    for i in 0..c.len() {
        let (x, y) = (f64::from(c.x[i]) - 70.0, f64::from(c.y[i]) - 60.0);
        let r = x.hypot(y);
        assert!((r - radius).abs() < 0.1, "{r} {radius}");
        // Outward is to the left of the tangent.
        assert!((x * f64::from(c.ty[i]) - y * f64::from(c.tx[i])) / r > 0.9);
    }
    let around = std::f64::consts::TAU * radius;
    assert!((c.total_length() / around - 1.0).abs() < 0.02, "{} {around}", c.total_length());
}

#[test]
fn a_box_shows_nine_edges_seen_from_a_corner() {
    let camera = Camera {
        projection: Projection::Orthographic { units_per_pixel: 0.03, cx: 64.0, cy: 64.0 },
        ..Camera::default_for(128, 128)
    };
    // Each edge of a cube turned with its diagonal to the viewer shows sqrt(2/3) of its
    // length.
    let tilt = (1.0f64 / 2.0f64.sqrt()).atan();
    let cube = cuboid(Vec3::ONE).placed(
        place([0.0; 3], [tilt, 0.0, 0.0], 1.0)
            * place([0.0; 3], [0.0, std::f64::consts::FRAC_PI_4, 0.0], 1.0),
    );
    let c = Contours::of(&cube, &camera);
    check_invariants(&c);
    let wanted = 9.0 * 2.0 / 0.03 * (2.0f64 / 3.0).sqrt();
    assert!((c.total_length() / wanted - 1.0).abs() < 0.02, "{} {wanted}", c.total_length());
}

#[test]
fn nothing_in_view_gives_nothing() {
    let camera = Camera::default_for(64, 64);
    for affine in [
        place([0.0, 0.0, 20.0], [0.0; 3], 1.0),
        place([50.0, 0.0, 0.0], [0.0; 3], 1.0),
        place([0.0; 3], [0.0; 3], 0.0),
        place([f64::NAN, 0.0, 0.0], [0.0; 3], 1.0),
        place([0.0; 3], [0.0; 3], 1e200),
    ] {
        for thing in
            [sphere(16, 8), cuboid(Vec3::ONE), lathe(&[(0.5, -1.0), (0.5, 1.0)], 12, false)]
        {
            let c = Contours::of(&thing.placed(affine), &camera);
            assert!(c.is_empty(), "{affine:?}: {c:?}");
        }
    }
}

#[test]
fn edges_from_behind_the_camera_are_cut() {
    // A bar along z from behind the camera into the distance, below the line of sight.
    let bar = cuboid(Vec3::new(0.2, 0.2, 100.0)).placed(place([0.0, -1.0, 0.0], [0.0; 3], 1.0));
    let c = Contours::of(&bar, &Camera::default_for(96, 96));
    check_invariants(&c);
    // Its two upper edges run from the horizon to the lower border.
    assert!(c.total_length() > 80.0);
    assert!((0..c.len()).all(|i| c.y[i] > 47.0));
}

#[test]
fn a_body_in_front_hides_contours() {
    let camera = Camera::default_for(128, 128);
    let small = sphere(48, 32).placed(place([0.1, 0.0, -1.5], [0.0; 3], 0.4));
    let large = sphere(64, 48).placed(place([0.0; 3], [0.0; 3], 1.0));
    let alone = Contours::of(&large, &camera).total_length();
    let both = Contours::of(&Solid::group(&[small.clone(), large.clone()]), &camera).total_length();
    assert!((both - alone).abs() < 1.0);
    // In front, the small one's outline is visible in full.
    let small = small.placed(place([0.0, 0.0, 3.0], [0.0; 3], 1.0));
    let wanted = alone + Contours::of(&small, &camera).total_length();
    let both = Contours::of(&Solid::group(&[small, large]), &camera).total_length();
    assert!((both / wanted - 1.0).abs() < 0.02, "{both} {wanted}");
}

#[test]
fn the_far_rim_of_a_bowl_shows_on_both_sides() {
    let camera = Camera::default_for(128, 128);
    let profile: Vec<_> = (0..24)
        .map(|i| {
            let a = f64::from(i) / 23.0 * std::f64::consts::FRAC_PI_2;
            (a.sin() as f32, (0.5 - a.cos()) as f32)
        })
        .collect();
    let bowl = lathe(&profile, 48, false);
    let seen = Contours::of(&bowl.placed(place([0.0; 3], [0.5, 0.0, 0.0], 1.0)), &camera);
    // From above: the whole rim and the outer outline.
    let rim = std::f64::consts::TAU * 0.77 * 29.0;
    assert!(seen.total_length() > 1.2 * rim, "{}", seen.total_length());
    for turn in [0.5, -0.9] {
        let (there, back) =
            distances(&bowl.placed(place([0.0; 3], [turn, 0.0, 0.0], 1.0)), &camera);
        assert!(there < 0.5 && back < 0.5, "{turn}: {there} {back}");
    }
}

/// A depth image `factor` times larger, and the positions (in small pixels) of its depth
/// jumps.
fn jumps(solid: &Solid, camera: &Camera, factor: u32) -> Vec<(f32, f32)> {
    let large = camera.scaled_to(camera.width.max(camera.height) * factor);
    let depth = Frame::render(solid, &large, Channels::Depth).depth;
    let (w, h) = (large.width as usize, large.height as usize);
    let seen = depth.iter().filter(|d| d.is_finite());
    let (near, far) = seen.fold((f32::MAX, 0.0f32), |(a, b), &d| (a.min(d), b.max(d)));
    let least = 0.08 * (far - near);
    let mut out = Vec::new();
    let mut jump = |a: f32, b: f32, x: f32, y: f32| {
        if (a - b).abs() > least {
            out.push((x / factor as f32, y / factor as f32));
        }
    };
    for y in 0..h {
        for x in 0..w {
            if x + 1 < w {
                jump(depth[y * w + x], depth[y * w + x + 1], x as f32 + 1.0, y as f32 + 0.5);
            }
            if y + 1 < h {
                jump(depth[y * w + x], depth[(y + 1) * w + x], x as f32 + 0.5, y as f32 + 1.0);
            }
        }
    }
    out
}

/// Distance from a point to the nearest of others, at most 10.
fn nearest(x: f32, y: f32, others: &[(f32, f32)]) -> f64 {
    f64::from(
        others.iter().fold(100.0f32, |best, o| best.min((o.0 - x).powi(2) + (o.1 - y).powi(2))),
    )
    .sqrt()
}

/// Mean distances from jumps to contours and from contours to jumps, in pixels.
fn distances(solid: &Solid, camera: &Camera) -> (f64, f64) {
    let reference = jumps(solid, camera, 8);
    let c = Contours::of(solid, camera);
    check_invariants(&c);
    let pieces: Vec<_> = c.x.iter().copied().zip(c.y.iter().copied()).collect();
    let there = reference.iter().map(|p| nearest(p.0, p.1, &pieces)).sum::<f64>()
        / reference.len().max(1) as f64;
    let back: f64 =
        (0..c.len()).map(|i| f64::from(c.length[i]) * nearest(c.x[i], c.y[i], &reference)).sum();
    (there, back / c.total_length().max(1e-9))
}

fn smooth_profile(random: &mut Uniform, points: usize) -> Vec<(f32, f32)> {
    let (a, b, p, q) = (
        random.between(0.1, 0.4),
        random.between(0.0, 0.15),
        random.next() * 6.0,
        random.next() * 6.0,
    );
    (0..points)
        .map(|i| {
            let t = i as f64 / (points - 1) as f64;
            let r = 0.55 + a * (p + 3.0 * t).sin() + b * (q + 7.0 * t).sin();
            (r.max(0.08) as f32, (2.0 * t - 1.0) as f32)
        })
        .collect()
}

fn random_pose(random: &mut Uniform) -> Affine {
    let mut v = |s: f64| [(); 3].map(|()| random.between(-s, s));
    let (at, turn) = (v(0.4), v(0.6));
    place(at, turn, random.between(0.7, 1.3))
}

#[test]
fn open_lathes_agree_with_depth_jumps() {
    let mut random = Uniform(11);
    let camera = Camera::default_for(128, 128);
    for round in 0..12 {
        let thing =
            lathe(&smooth_profile(&mut random, 32), 48, false).placed(random_pose(&mut random));
        let (there, back) = distances(&thing, &camera);
        assert!(there < 0.5 && back < 0.5, "{round}: {there} {back}");
    }
}

#[test]
fn capped_lathes_agree_with_depth_jumps() {
    let mut random = Uniform(12);
    let camera = Camera::default_for(128, 128);
    for round in 0..12 {
        let segments = if round % 2 == 0 { 24 } else { 64 };
        let thing = lathe(&smooth_profile(&mut random, 32), segments, true)
            .placed(random_pose(&mut random));
        let (there, back) = distances(&thing, &camera);
        // The near part of the top's crease has no jump.
        assert!(there < 0.5 && back < 4.0, "{round}: {there} {back}");
    }
}

#[test]
fn boxes_agree_with_depth_jumps() {
    let mut random = Uniform(13);
    let camera = Camera::default_for(128, 100);
    for round in 0..12 {
        let half = Vec3::new(random.between(0.3, 1.2) as f32, random.between(0.3, 1.2) as f32, 0.5);
        let (there, _) = distances(&cuboid(half).placed(random_pose(&mut random)), &camera);
        assert!(there < 0.5, "{round}: {there}");
    }
}

/// Length-weighted mean of a smooth function along the contours.
fn smooth_mean(solid: &Solid, camera: &Camera) -> f64 {
    let c = Contours::of(solid, camera);
    let sum: f64 = (0..c.len())
        .map(|i| {
            let (x, y) = (f64::from(c.x[i]) / 128.0, f64::from(c.y[i]) / 128.0);
            f64::from(c.length[i]) * ((3.0 * x).sin() + (4.0 * y).cos() + x * y)
        })
        .sum();
    sum / c.total_length()
}

#[test]
fn a_small_step_changes_little() {
    let mut random = Uniform(14);
    let camera = Camera::default_for(128, 128);
    let (mut total, mut most, rounds) = (0.0, 0.0f64, 40);
    for _ in 0..rounds {
        let thing = lathe(&smooth_profile(&mut random, 32), 48, true);
        let pose = random_pose(&mut random);
        let step = place([1e-3, -1e-3, 1e-3], [1e-3, 1e-3, -1e-3], 1.0);
        let change = (smooth_mean(&thing.placed(pose), &camera)
            - smooth_mean(&thing.placed(step * pose), &camera))
        .abs();
        total += change;
        most = most.max(change);
    }
    assert!(
        total / f64::from(rounds) < 4e-3 && most < 2e-2,
        "{} {most}",
        total / f64::from(rounds)
    );
}

#[test]
fn random_poses_never_panic() {
    let mut random = Uniform(6);
    let things =
        [lathe(&[(0.2, -1.0), (0.9, -0.3), (0.4, 0.5)], 7, false), cuboid(Vec3::ONE), sphere(9, 5)];
    for round in 0..300 {
        let mut v = |s: f64| {
            DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
        };
        let affine = Affine::new(v(12.0), v(3.0), v(20.0));
        check_invariants(&Contours::of(
            &things[round % 3].placed(affine),
            &Camera::default_for(40, 27),
        ));
    }
}
