//! Random vessels and poses for this module's tests.

use crate::geom::{Affine, Caps, Profile, Revolution, Solid, Wall, lathe};
use crate::render::testing::Uniform;
use glam::DVec3;

/// A lathe: its profiles, wall and caps.
#[derive(Clone, Debug)]
pub struct Vessel {
    pub parts: Vec<Profile>,
    pub wall: Wall,
    pub caps: Caps,
}

impl Vessel {
    /// A vessel of one to three profiles; open or closed, thin or thick.
    pub fn random(random: &mut Uniform, round: usize) -> Vessel {
        let count = 1 + round % 3;
        let points = [26, 9, 14][round % 3];
        let [a, b] = [random.between(0.1, 0.4), random.between(0.0, 0.12)];
        let [p, q] = [random.next() * 6.0, random.next() * 6.0];
        let radius =
            |y: f64| (0.55 + a * libm::sin(p + 1.5 * y) + b * libm::sin(q + 3.5 * y)).max(0.08);
        let mut parts = Vec::new();
        for k in 0..count {
            let end = |k: usize| -1.0 + 2.0 * k as f64 / count as f64;
            let (from, to) = (end(k), end(k + 1));
            let narrow = if k % 2 == 1 { random.between(0.5, 1.0) } else { 1.0 };
            let at = |i: usize| from + (to - from) * i as f64 / (points - 1) as f64;
            let y: Vec<f64> = (0..points).map(at).collect();
            let r = y.iter().map(|y| narrow * radius(*y)).collect();
            parts.push(Profile { y, r });
        }
        let thickness = if round % 4 < 2 { 0.0 } else { random.between(0.03, 0.2) };
        let wall = Wall { thickness, floor: random.between(0.0, 0.5) };
        let caps = [Caps::Both, Caps::Bottom, Caps::None, Caps::Top][(round / 4) % 4];
        Vessel { parts, wall, caps }
    }

    /// A closed cylinder.
    pub fn cylinder(radius: f64, half: f64) -> Vessel {
        let part = Profile { y: vec![-half, half], r: vec![radius; 2] };
        Vessel { parts: vec![part], wall: Wall::default(), caps: Caps::Both }
    }

    pub fn mesh(&self, sides: u32) -> Solid {
        Solid::new(lathe(&self.parts, sides, self.wall, self.caps).unwrap().into())
    }

    pub fn exact(&self) -> Revolution {
        let solid = Solid::exact_lathe(&self.parts, 96, self.wall, self.caps).unwrap();
        Revolution::clone(&solid.revolution().unwrap().surface)
    }
}

/// A pose in front of the default camera.
pub fn random_pose(random: &mut Uniform) -> Affine {
    let mut v =
        |s: f64| DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s));
    let (at, turn) = (v(0.4), v(1.2));
    Affine::new(at, turn, DVec3::splat(random.between(0.7, 1.3)))
}
