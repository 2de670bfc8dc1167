//! Shapes in many random poses: shared with the test of the bound on the score.

#[path = "../shipped/mod.rs"]
pub mod shipped;

use glam::{DVec3, Vec3};
use pcadlang_scene::geom::armature::{Armature, JointPose, Rules};
use pcadlang_scene::geom::{Affine, Caps, GeomError, Mesh, Profile, Solid};
use shipped::human;
use std::sync::Arc;

/// A kind of shape with a sequence of poses.
pub struct Subject {
    /// Its name in the table.
    pub name: String,
    make: Make,
}

enum Make {
    Lathe,
    Body(Arc<Armature>),
    Mesh(Solid),
}

impl Subject {
    /// Returns a lathe, the body in its three levels of detail, and a dense mesh.
    pub fn all() -> Result<Vec<Subject>, GeomError> {
        let mut all = vec![Subject { name: "lathe".into(), make: Make::Lathe }];
        for lod in ["human", "human.lod1", "human.lod2"] {
            all.push(Subject { name: lod.into(), make: Make::Body(human(lod)?) });
        }
        let dense = Subject { name: "dense".into(), make: Make::Mesh(Solid::lasting(dense()?)) };
        all.push(dense);
        Ok(all)
    }

    /// Returns the shape in pose number `i`.
    pub fn at(&self, i: usize) -> Result<Solid, GeomError> {
        let mut rng = Uniform(i as u64 + 1);
        let size = rng.between(0.5, 1.0);
        let turn =
            DVec3::new(rng.between(-0.5, 0.5), rng.between(-3.0, 3.0), rng.between(-0.4, 0.4));
        let shift =
            DVec3::new(rng.between(-0.2, 0.2), rng.between(-0.2, 0.2), rng.between(-1.0, 1.0));
        let (solid, unit) = match &self.make {
            Make::Lathe => (vase(&mut rng)?, 1.9),
            Make::Mesh(solid) => (solid.clone(), 1.4),
            Make::Body(body) => {
                let mut joint = |_| {
                    JointPose::turned(DVec3::from_array([0; 3].map(|_| rng.between(-0.25, 0.25))))
                };
                let pose: Vec<JointPose> = (0..body.rig().joints().len()).map(&mut joint).collect();
                let middle = Affine::new(DVec3::new(0.0, -0.85, 0.0), DVec3::ZERO, DVec3::ONE);
                (body.posed(&pose, &Rules::default())?.placed(middle), 2.0)
            }
        };
        Ok(solid.placed(Affine::new(shift, turn, DVec3::splat(size * unit))))
    }
}

/// Builds a hollow vase of two profiles with about 31 rings and 48 sides.
fn vase(rng: &mut Uniform) -> Result<Solid, GeomError> {
    let (phase, waist) = (rng.between(0.0, 6.0), rng.between(0.2, 0.5));
    let profile = |from: f64, to: f64, n: usize| {
        let y = (0..n).map(|i| from + (to - from) * i as f64 / (n - 1) as f64);
        let r = |y: &f64| waist + 0.12 * libm::sin(3.0 * y + phase) + 0.04 * libm::sin(7.0 * y);
        let y: Vec<f64> = y.collect();
        Profile { r: y.iter().map(r).collect(), y }
    };
    Solid::lathe(&[profile(-1.0, 0.4, 24), profile(0.4, 1.0, 8)], 48, 0.03, Caps::Bottom)
}

/// Builds a lumpy ball of 100,352 triangles.
pub fn dense() -> Result<Mesh, GeomError> {
    let (rows, columns) = (225u32, 224u32);
    let point = |row: u32, column: u32| {
        let (a, b) = (
            std::f32::consts::PI * row as f32 / rows as f32,
            std::f32::consts::TAU * column as f32 / columns as f32,
        );
        let way =
            Vec3::new(libm::sinf(a) * libm::cosf(b), libm::cosf(a), libm::sinf(a) * libm::sinf(b));
        let lumps =
            libm::sinf(4.0 * way.x + 1.0) * libm::sinf(5.0 * way.y) * libm::sinf(3.0 * way.z + 2.0);
        way * (1.0 + 0.25 * lumps + 0.03 * libm::sinf(17.0 * way.x) * libm::sinf(19.0 * way.y))
    };
    let mut positions = vec![point(0, 0)];
    (1..rows).for_each(|row| positions.extend((0..columns).map(|column| point(row, column))));
    positions.push(point(rows, 0));
    let at = |row: u32, column: u32| match row {
        0 => 0,
        r if r == rows => (rows - 1) * columns + 1,
        r => (r - 1) * columns + 1 + column % columns,
    };
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [column, column + 1].map(|c| at(row, c));
            let [d, c] = [column, column + 1].map(|c| at(row + 1, c));
            triangles.extend(
                [[a, b, c], [a, c, d]].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2]),
            );
        }
    }
    let parts = vec![0; triangles.len()];
    Mesh::new(positions, triangles, parts)
}

/// Uniform random numbers, the same in every run.
struct Uniform(u64);

impl Uniform {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mut x = self.0;
        x = (x ^ (x >> 33)).wrapping_mul(0xff51afd7ed558ccd);
        x = (x ^ (x >> 33)).wrapping_mul(0xc4ceb9fe1a85ec53);
        low + (high - low) * ((x ^ (x >> 33)) >> 11) as f64 / (1u64 << 53) as f64
    }
}
