//! Derivatives of exact contours against central differences.

use super::*;
use crate::geom::{Caps, Profile};
use crate::render::testing::weighted;
use crate::render::{Channels, Projection};

/// A body, of which everything in view is visible in full: an egg, a cone standing on its
/// tip, or a flat ring.
fn bodies() -> Vec<(Vec<Profile>, Caps)> {
    let egg: Vec<(f64, f64)> = (0..=30)
        .map(|i| {
            let a = core::f64::consts::PI * f64::from(i) / 30.0;
            (0.8 * libm::sin(a) * (1.0 - 0.2 * libm::cos(a)), -libm::cos(a))
        })
        .collect();
    let cone: Vec<(f64, f64)> =
        (0..=20).map(|i| f64::from(i) / 20.0).map(|t| (0.9 * t.powf(0.8), t - 0.5)).collect();
    [(egg, Caps::None), (cone, Caps::Top), (vec![(0.9, 0.1), (0.4, 0.1)], Caps::None)]
        .into_iter()
        .map(|(points, caps)| {
            let (r, y) = points.into_iter().unzip();
            (vec![Profile { y, r }], caps)
        })
        .collect()
}

fn cameras() -> [Camera; 2] {
    let camera = Camera::default_for(160, 160);
    let projection = Projection::Orthographic { units_per_pixel: 0.02, cx: 79.0, cy: 81.0 };
    [camera, Camera { projection, ..camera }]
}

/// A placement near one that tips the top towards the camera.
fn placed(p: &[f64]) -> Affine {
    let inner = Affine::new(DVec3::ZERO, DVec3::new(0.0, 0.3, 0.1), DVec3::new(1.0, 0.95, 1.1));
    let turn = DVec3::new(0.7 + p[3], p[4], 0.2 + p[5]);
    Affine::new(DVec3::new(0.1 + p[0], p[1], p[2]), turn, DVec3::splat(1.0 + p[6])) * inner
}

fn value(surface: &Revolution, affine: &Affine, camera: &Camera) -> f64 {
    weighted(&Contours::of_revolution(surface, affine, camera)).0
}

#[test]
fn pieces_follow_the_placement() {
    let mut wrong = 0.0f64;
    for camera in cameras() {
        for (parts, caps) in bodies() {
            let surface = Revolution::lathe(&parts, 0.0, caps).unwrap();
            let here = placed(&[0.0; 7]);
            let by = weighted(&Contours::of_revolution(&surface, &here, &camera)).1;
            let found = Contours::vjp_revolution(&surface, &here, &camera, &by);
            for k in 0..7 {
                let h = 1e-2;
                let at = |h: f64| {
                    let mut p = [0.0; 7];
                    p[k] = h;
                    placed(&p)
                };
                let slope = (value(&surface, &at(h), &camera) - value(&surface, &at(-h), &camera))
                    / (2.0 * h);
                let way = (at(1e-6).0.matrix3 - at(-1e-6).0.matrix3) * 5e5;
                let shift = (at(1e-6).0.translation - at(-1e-6).0.translation) * 5e5;
                let along = found.shift.dot(shift)
                    + (0..3).map(|i| found.linear.col(i).dot(way.col(i))).sum::<f64>();
                wrong = wrong.max((along - slope).abs() - 0.01 * slope.abs());
            }
        }
    }
    assert!(wrong < 0.3, "{wrong}");
}

/// Profiles near those of a body.
fn bent(parts: &[Profile], h: f64, k: usize) -> Vec<Profile> {
    let mut parts = parts.to_vec();
    for p in &mut parts {
        for (i, (r, y)) in p.r.iter_mut().zip(&mut p.y).enumerate() {
            let bump = libm::sin(0.3 * i as f64 + k as f64);
            // Tips stay on the axis.
            *r *= 1.0 + if k.is_multiple_of(2) { h * bump } else { 0.0 };
            *y += if !k.is_multiple_of(2) { h * 0.3 * *y } else { 0.0 };
        }
    }
    parts
}

#[test]
fn pieces_follow_the_profile() {
    let mut wrong = 0.0f64;
    for camera in cameras() {
        for (parts, caps) in bodies() {
            let at = |h: f64, k: usize| bent(&parts, h, k);
            let here = placed(&[0.0; 7]);
            let surface = |h: f64, k: usize| Revolution::lathe(&at(h, k), 0.0, caps).unwrap();
            let by = weighted(&Contours::of_revolution(&surface(0.0, 0), &here, &camera)).1;
            let rings = Contours::vjp_revolution(&surface(0.0, 0), &here, &camera, &by).rings;
            let found = Revolution::vjp_lathe(&parts, 0.0, caps, &rings).unwrap();
            for k in 0..4 {
                let h = 1e-2;
                let slope = (value(&surface(h, k), &here, &camera)
                    - value(&surface(-h, k), &here, &camera))
                    / (2.0 * h);
                let (after, before) = (at(1e-6, k), at(-1e-6, k));
                let mut along = 0.0;
                for ((g, p), q) in found.profiles.iter().zip(&after).zip(&before) {
                    for i in 0..g.r.len() {
                        along += g.r[i] * (p.r[i] - q.r[i]) * 5e5;
                        along += g.y[i] * (p.y[i] - q.y[i]) * 5e5;
                    }
                }
                wrong = wrong.max((along - slope).abs() - 0.01 * slope.abs());
            }
        }
    }
    assert!(wrong < 0.3, "{wrong}");
}

#[test]
fn depth_follows_the_placement_and_the_profile() {
    let (mut wrong, mut counted) = (0.0f64, 0);
    for camera in cameras() {
        let mut bodies = bodies();
        // A bowl, of which the inside shows too.
        let y: Vec<f64> = (0..12).map(|i| f64::from(i) / 11.0 - 0.5).collect();
        let r = y.iter().map(|y| 0.7 + 0.5 * y).collect();
        bodies.push((vec![Profile { y, r }], Caps::Bottom));
        for (parts, caps) in bodies {
            let thickness = if caps == Caps::Bottom { 0.1 } else { 0.0 };
            let at = |h: f64, k: usize| {
                let mut p = [0.0; 7];
                let bend = if k < 7 { 0.0 } else { h };
                if k < 7 {
                    p[k] = h;
                }
                let parts = bent(&parts, bend, k.saturating_sub(7));
                (Revolution::lathe(&parts, thickness, caps).unwrap(), placed(&p), parts)
            };
            let depth = |h: f64, k: usize| {
                let (surface, affine, _) = at(h, k);
                Frame::of_revolution(&surface, &affine, &camera, Channels::Depth).depth
            };
            let (surface, affine, _) = at(0.0, 0);
            let middle = depth(0.0, 0);
            for k in 0..11 {
                let h = 2e-3;
                let (before, after) = (depth(-h, k), depth(h, k));
                let (mut by, mut slope, mut size) = (vec![0.0; middle.len()], 0.0, 0.0);
                for i in 0..by.len() {
                    let [a, b, c] = [before[i], middle[i], after[i]].map(f64::from);
                    // Away from edges, where depth jumps, and outlines, where it bends.
                    let (change, bend) = (c - a, a + c - 2.0 * b);
                    if change.is_finite() && bend.abs() < 1e-5 + 0.02 * change.abs() {
                        by[i] = 1.0 + libm::sin(0.3 * i as f64);
                        slope += by[i] * change / (2.0 * h);
                        size += by[i] * (change / (2.0 * h)).abs();
                        counted += 1;
                    }
                }
                let found = Frame::vjp_revolution(&surface, &affine, &camera, &by);
                let (_, next, after) = at(1e-6, k);
                let (_, last, before) = at(-1e-6, k);
                let way = (next.0.matrix3 - last.0.matrix3) * 5e5;
                let shift = (next.0.translation - last.0.translation) * 5e5;
                let mut along = found.shift.dot(shift)
                    + (0..3).map(|i| found.linear.col(i).dot(way.col(i))).sum::<f64>();
                let by = Revolution::vjp_lathe(&parts, thickness, caps, &found.rings).unwrap();
                for ((g, p), q) in by.profiles.iter().zip(&after).zip(&before) {
                    for i in 0..g.r.len() {
                        along += g.r[i] * (p.r[i] - q.r[i]) * 5e5;
                        along += g.y[i] * (p.y[i] - q.y[i]) * 5e5;
                    }
                }
                wrong = wrong.max((along - slope).abs() - 0.015 * size);
            }
        }
    }
    assert!(counted > 200_000, "{counted}");
    // Depths are rounded to single precision, and slopes on two sides of a ring differ.
    assert!(wrong < 0.05, "{wrong}");
}
