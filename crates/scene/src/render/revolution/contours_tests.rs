//! Exact contours against those of meshes with many sides.

use super::*;
use crate::geom::{Caps, Profile, Solid, Wall};
use crate::render::Projection;
use crate::render::testing::Uniform;
use glam::DVec3;

/// A lathe: its profiles, wall and caps.
#[derive(Debug)]
struct Vessel {
    parts: Vec<Profile>,
    wall: Wall,
    caps: Caps,
}

impl Vessel {
    fn random(random: &mut Uniform, round: usize) -> Vessel {
        let count = 1 + round % 3;
        let points = [26, 9, 14][round % 3];
        let (a, b, p, q) = (
            random.between(0.1, 0.4),
            random.between(0.0, 0.12),
            random.next() * 6.0,
            random.next() * 6.0,
        );
        let radius =
            |y: f64| (0.55 + a * libm::sin(p + 1.5 * y) + b * libm::sin(q + 3.5 * y)).max(0.08);
        let mut parts = Vec::new();
        for k in 0..count {
            let (from, to) =
                (-1.0 + 2.0 * k as f64 / count as f64, -1.0 + 2.0 * (k + 1) as f64 / count as f64);
            let narrow = if k % 2 == 1 { random.between(0.5, 1.0) } else { 1.0 };
            let y: Vec<f64> =
                (0..points).map(|i| from + (to - from) * i as f64 / (points - 1) as f64).collect();
            let r = y.iter().map(|y| narrow * radius(*y)).collect();
            parts.push(Profile { y, r });
        }
        let thickness = if round % 4 < 2 { 0.0 } else { random.between(0.03, 0.2) };
        let wall = Wall { thickness, floor: random.between(0.0, 0.5) };
        let caps = [Caps::Both, Caps::Bottom, Caps::None, Caps::Top][(round / 4) % 4];
        Vessel { parts, wall, caps }
    }

    fn mesh(&self, sides: u32) -> Solid {
        Solid::lathe(&self.parts, sides, self.wall, self.caps).unwrap()
    }

    fn exact(&self) -> Revolution {
        Revolution::lathe(&self.parts, self.wall, self.caps).unwrap()
    }
}

fn random_pose(random: &mut Uniform) -> Affine {
    let mut v =
        |s: f64| DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s));
    let (at, turn) = (v(0.4), v(1.2));
    Affine::new(at, turn, DVec3::splat(random.between(0.7, 1.3)))
}

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

/// The length of pieces of the first that are further than `most` from the second.
fn off(a: &Contours, b: &Contours, most: f64) -> (f64, Vec<(f32, f32, f64)>) {
    let far: Vec<_> = (0..a.len())
        .map(|i| (i, nearest(a.x[i], a.y[i], b)))
        .filter(|(_, d)| *d > most)
        .map(|(i, d)| (a.x[i], a.y[i], d))
        .collect();
    let sum = (0..a.len())
        .filter(|i| nearest(a.x[*i], a.y[*i], b) > most)
        .map(|i| f64::from(a.length[i]))
        .sum();
    (sum, far)
}

#[test]
fn explore() {
    let mut random = Uniform(3);
    let camera = Camera::default_for(128, 128);
    let (mut total, mut missing, mut extra) = (0.0, 0.0, 0.0);
    for round in 0..48 {
        let vessel = Vessel::random(&mut random, round);
        let pose = random_pose(&mut random);
        let mesh = Contours::of(&vessel.mesh(512).placed(pose), &camera);
        let exact = Contours::of_revolution(&vessel.exact(), &pose, &camera);
        let (a, far_a) = off(&exact, &mesh, 0.05);
        let (b, far_b) = off(&mesh, &exact, 0.05);
        total += exact.total_length();
        (missing, extra) = (missing + b, extra + a);
        println!(
            "{round} {:?} wall {:.2}: exact {} pieces {:.1}, mesh {} {:.1}; extra {a:.1} missing {b:.1}",
            vessel.caps,
            vessel.wall.thickness,
            exact.len(),
            exact.total_length(),
            mesh.len(),
            mesh.total_length()
        );
        if a > 2.0 {
            println!("  extra {:?}", far_a.iter().step_by(far_a.len() / 4 + 1).collect::<Vec<_>>());
        }
        if b > 2.0 {
            println!(
                "  missing {:?}",
                far_b.iter().step_by(far_b.len() / 4 + 1).collect::<Vec<_>>()
            );
        }
    }
    println!("total {total} extra {extra} missing {missing}");
}
