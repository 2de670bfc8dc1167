//! A standing figure of 22 closed parts.

use glam::Vec3;
use pcadlang_scene::geom::Mesh;

/// The parts of a standing figure: centre, direction of the long axis, half length,
/// radius.
pub const BODY: [([f32; 3], [f32; 3], f32, f32); 22] = [
    ([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.35, 0.32),
    ([0.0, 0.35, 0.02], [0.0, 1.0, 0.0], 0.35, 0.30),
    ([0.0, 0.75, 0.0], [0.0, 1.0, 0.1], 0.40, 0.36),
    ([0.0, 1.2, 0.0], [0.0, 1.0, 0.0], 0.20, 0.12),
    ([0.0, 1.55, 0.05], [0.0, 1.0, 0.1], 0.30, 0.24),
    ([-0.25, 1.0, 0.0], [1.0, 0.1, 0.0], 0.25, 0.14),
    ([0.25, 1.0, 0.0], [1.0, -0.1, 0.0], 0.25, 0.14),
    ([-0.55, 0.7, 0.0], [0.4, 1.0, 0.0], 0.38, 0.13),
    ([0.55, 0.7, 0.0], [-0.4, 1.0, 0.0], 0.38, 0.13),
    ([-0.72, 0.1, 0.1], [0.1, 1.0, -0.3], 0.36, 0.11),
    ([0.72, 0.1, 0.1], [-0.1, 1.0, -0.3], 0.36, 0.11),
    ([-0.78, -0.3, 0.2], [0.1, 1.0, 0.0], 0.15, 0.08),
    ([0.78, -0.3, 0.2], [-0.1, 1.0, 0.0], 0.15, 0.08),
    ([-0.80, -0.48, 0.25], [0.1, 1.0, 0.2], 0.10, 0.05),
    ([0.80, -0.48, 0.25], [-0.1, 1.0, 0.2], 0.10, 0.05),
    ([-0.22, -0.6, 0.0], [0.1, 1.0, 0.0], 0.50, 0.19),
    ([0.22, -0.6, 0.0], [-0.1, 1.0, 0.0], 0.50, 0.19),
    ([-0.27, -1.4, -0.03], [0.0, 1.0, 0.1], 0.48, 0.14),
    ([0.27, -1.4, -0.03], [0.0, 1.0, 0.1], 0.48, 0.14),
    ([-0.28, -1.88, 0.1], [0.0, 0.1, 1.0], 0.22, 0.09),
    ([0.28, -1.88, 0.1], [0.0, 0.1, 1.0], 0.22, 0.09),
    ([0.0, 1.78, -0.05], [0.0, 1.0, -0.4], 0.14, 0.12),
];

/// Builds a closed spindle of 110 triangles around an axis.
pub fn spindle(middle: [f32; 3], axis: [f32; 3], half: f32, radius: f32) -> Mesh {
    let (rings, sides) = (5u32, 11u32);
    let (middle, axis) = (Vec3::from(middle), Vec3::from(axis).normalize());
    let (u, v) = axis.any_orthonormal_pair();
    let mut positions = vec![middle - axis * half];
    for ring in 1..=rings {
        let t = std::f32::consts::PI * (ring as f32 / (rings + 1) as f32 - 0.5);
        for side in 0..sides {
            let a = std::f32::consts::TAU * side as f32 / sides as f32;
            positions.push(
                middle + axis * half * t.sin() + (u * a.cos() + v * a.sin()) * (radius * t.cos()),
            );
        }
    }
    positions.push(middle + axis * half);
    let at = |ring: u32, side: u32| 1 + ring * sides + side % sides;
    let mut triangles = Vec::new();
    for side in 0..sides {
        triangles.push([0, at(0, side + 1), at(0, side)]);
        for ring in 0..rings - 1 {
            triangles.push([at(ring, side), at(ring, side + 1), at(ring + 1, side + 1)]);
            triangles.push([at(ring, side), at(ring + 1, side + 1), at(ring + 1, side)]);
        }
        triangles.push([at(rings - 1, side), at(rings - 1, side + 1), 1 + rings * sides]);
    }
    let parts = vec![0; triangles.len()];
    Mesh::new(positions, triangles, parts).expect("a valid mesh")
}
