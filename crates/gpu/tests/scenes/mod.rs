//! Scenes that tests and the example draw, and how two drawings are compared.

use glam::DVec3;
use pcadlang_gpu::{ContourBatch, Scene};
use pcadlang_scene::geom::armature::{Armature, JointPose, Rules, rig_from_json};
use pcadlang_scene::geom::{Affine, Caps, Profile, Solid, obj};
use pcadlang_scene::render::{Camera, ContourSlice};
use std::error::Error;
use std::sync::Arc;

/// A source of numbers that are spread evenly (Weyl sequence).
pub struct Spread(u64);

impl Spread {
    pub fn new(seed: u64) -> Spread {
        Spread(seed.wrapping_mul(0xd134_2543_de82_ef95))
    }

    /// A number between two.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        low + (high - low) * (mixed >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| self.between(-size, size)))
    }

    /// A placement that keeps most of an object of size 2 in the picture.
    pub fn placement(&mut self) -> Affine {
        let scale = DVec3::splat(self.between(0.8, 1.3));
        Affine::new(self.vector(0.4), self.vector(1.2), scale)
    }
}

/// A profile of 26 points; others for other seeds.
pub fn profile(seed: u64) -> Profile {
    let mut random = Spread::new(seed);
    let (a, b) = (random.between(0.1, 0.35), random.between(0.0, 6.0));
    let y: Vec<f64> = (0..26).map(|i| f64::from(i) / 12.5 - 1.0).collect();
    let r = y.iter().map(|y| 0.55 + a * (b + 3.0 * y).sin()).collect();
    Profile { y, r }
}

/// The body shipped with the language.
pub fn human() -> Result<Arc<Armature>, Box<dyn Error>> {
    let rig = rig_from_json(include_bytes!("../../../../programs/std/human/human.rig.json"))?;
    let mesh = obj::indexed(include_bytes!("../../../../programs/std/human/human.obj"))?;
    let body = Armature::new(rig.rig, mesh.positions, mesh.triangles, rig.influences)?;
    Ok(Arc::new(body))
}

/// A pose of the body, at the size of the picture.
pub fn posed(body: &Arc<Armature>, random: &mut Spread) -> Result<Solid, Box<dyn Error>> {
    let joints = body.rig().joints().len();
    let pose: Vec<JointPose> =
        (0..joints).map(|_| JointPose::turned(random.vector(0.25))).collect();
    Ok(set(&body.posed(&pose, &Rules::default())?, random))
}

/// A body somewhere in the picture.
pub fn set(body: &Solid, random: &mut Spread) -> Solid {
    let at = DVec3::new(random.between(-0.3, 0.3), -1.8, random.between(-0.3, 0.3));
    let turn = DVec3::new(0.05, random.between(-3.0, 3.0), 0.0);
    body.placed(Affine::new(at, turn, DVec3::splat(2.1)))
}

/// A lathe as a mesh, or as the surface itself if `sides` is 0.
pub fn lathe(seed: u64, sides: u32, wall: f64, caps: Caps) -> Result<Solid, Box<dyn Error>> {
    let profile = [profile(seed)];
    Ok(match sides {
        0 => Solid::exact_lathe(&profile, 96, wall, caps)?,
        _ => Solid::new(pcadlang_scene::geom::lathe(&profile, sides, wall, caps)?.into()),
    })
}

/// Scenes of a size, each of the shapes from `make` at a random place.
pub fn scenes(
    count: usize,
    size: u32,
    mut make: impl FnMut(usize, &mut Spread) -> Result<Solid, Box<dyn Error>>,
) -> Result<Vec<Scene>, Box<dyn Error>> {
    let mut random = Spread::new(count as u64 + 7);
    let one =
        |i| Ok(Scene { solid: make(i, &mut random)?, camera: Camera::default_for(size, size) });
    (0..count).map(one).collect()
}

/// How two drawings of the same scenes differ.
#[derive(Clone, Copy, Debug, Default)]
pub struct Difference {
    /// Length in both, in pixels.
    pub length: f64,
    /// Length of pieces that only one of them has.
    pub alone: f64,
    /// The greatest distance between the middles of two pieces that are the same.
    pub farthest: f64,
    /// The mean of it.
    pub mean: f64,
    pub pieces: usize,
}

impl Difference {
    /// The fraction of the length that only one of them has.
    pub fn share(&self) -> f64 {
        self.alone / self.length.max(1e-9)
    }
}

/// Pieces of two drawings whose middles are within `near` pixels are the same.
pub fn compare(a: &ContourBatch, b: &ContourBatch, near: f32) -> Difference {
    let mut out = Difference::default();
    for i in 0..a.len() {
        let (a, b) = (a.scene(i), b.scene(i));
        for (from, to) in [(a, b), (b, a)] {
            for k in 0..from.len() {
                let length = f64::from(from.length[k]);
                out.length += length;
                match nearest([from.x[k], from.y[k]], [from.tx[k], from.ty[k]], &to) {
                    distance if distance <= near => {
                        out.farthest = out.farthest.max(f64::from(distance));
                        out.mean += f64::from(distance);
                        out.pieces += 1;
                    }
                    _ => out.alone += length,
                }
            }
        }
    }
    out.mean /= out.pieces.max(1) as f64;
    out
}

/// The distance to the nearest piece along the same line.
fn nearest([x, y]: [f32; 2], [tx, ty]: [f32; 2], to: &ContourSlice<'_>) -> f32 {
    let along = |k: usize| (tx * to.tx[k] + ty * to.ty[k]).abs() > 0.95;
    let distance = |k: usize| (to.x[k] - x).powi(2) + (to.y[k] - y).powi(2);
    let all = (0..to.len()).map(|k| (distance(k), k));
    let near = all.filter(|(d, k)| *d < 1.0 && along(*k)).map(|(d, _)| d);
    near.fold(f32::INFINITY, f32::min).sqrt()
}
