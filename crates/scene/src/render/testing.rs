//! Shapes and data folders for this module's tests.

use super::pixels::place::Point;
use crate::geom::{Mesh, Solid};
use crate::render::Contours;
use glam::{DVec3, Vec3};
use std::path::PathBuf;
use std::sync::Arc;

/// A solid of one part.
pub fn solid(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Solid {
    let parts = vec![0; triangles.len()];
    Solid::new(Arc::new(Mesh::new(positions, triangles, parts).unwrap()))
}

/// A surface of revolution about y through (radius, height) points given from the bottom
/// up; with `capped`, the ends that are off the axis are closed by discs.
pub fn lathe(profile: &[(f32, f32)], segments: u32, capped: bool) -> Solid {
    let mut points = profile.to_vec();
    if capped {
        let (first, last) = (points[0], points[points.len() - 1]);
        if first.0 > 0.0 {
            points.insert(0, (0.0, first.1));
        }
        if last.0 > 0.0 {
            points.push((0.0, last.1));
        }
    }
    let mut positions = Vec::new();
    for &(r, y) in &points {
        for s in 0..segments {
            let a = std::f32::consts::TAU * s as f32 / segments as f32;
            positions.push(Vec3::new(r * a.sin(), y, r * a.cos()));
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..points.len() as u32 - 1 {
        for s in 0..segments {
            let t = (s + 1) % segments;
            let (a, b) = (ring * segments + s, ring * segments + t);
            let (c, d) = (a + segments, b + segments);
            if points[ring as usize].0 > 0.0 {
                triangles.push([a, b, d]);
            }
            if points[ring as usize + 1].0 > 0.0 {
                triangles.push([a, d, c]);
            }
        }
    }
    solid(positions, triangles)
}

/// The unit sphere about the origin.
pub fn sphere(segments: u32, rings: u32) -> Solid {
    let profile: Vec<_> = (0..=rings)
        .map(|i| {
            let a = std::f64::consts::PI * f64::from(i) / f64::from(rings);
            let r = if i == 0 || i == rings { 0.0 } else { a.sin() };
            (r as f32, -a.cos() as f32)
        })
        .collect();
    lathe(&profile, segments, false)
}

/// A box with half extents, about the origin.
pub fn cuboid(half: Vec3) -> Solid {
    let corner = |i: u32| {
        let side = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
        half * Vec3::new(side(1), side(2), side(4))
    };
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    solid((0..8).map(corner).collect(), triangles)
}

/// Uniform numbers in 0..1, the same in every run.
pub struct Uniform(pub u64);

impl Uniform {
    /// The next number.
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mut x = self.0;
        x = (x ^ (x >> 33)).wrapping_mul(0xff51afd7ed558ccd);
        ((x ^ (x >> 33)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The next number, between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// A triangle of about some size in an image of 40 x 30 pixels, or partly outside of
    /// it; `halves` puts corners on half pixels.
    pub fn corners(&mut self, size: f64, halves: bool) -> [Point; 3] {
        let middle = [self.between(-2.0, 42.0), self.between(-2.0, 32.0)];
        std::array::from_fn(|_| {
            let [x, y] = middle.map(|at| {
                let v = at + size * (self.next() - 0.5);
                if halves { (v * 2.0).round() / 2.0 } else { v }
            });
            Point { x, y, nearness: 0.3 + self.next() }
        })
    }
}

/// The folders of the object data set that contain a camera, with their names, sorted;
/// empty if the data set is missing.
pub fn cases() -> Vec<(String, PathBuf)> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let roots =
        ["../../../shared", "../../../../shared"].map(|at| root.join(at).join("data/objects"));
    let mut out = Vec::new();
    for folder in
        roots.iter().filter(|r| r.is_dir()).take(1).flat_map(|r| [r.clone(), r.join("real")])
    {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.path().join("camera.json").is_file() {
                out.push((entry.file_name().to_string_lossy().into_owned(), entry.path()));
            }
        }
    }
    out.sort();
    out
}

/// The length of contours, weighted by a smooth function of position and summed, and its
/// derivatives with respect to the pieces.
pub fn weighted(c: &Contours) -> (f64, Vec<[f64; 4]>) {
    let one = |((x, y), length): ((&f32, &f32), &f32)| {
        let [x, y, length] = [x, y, length].map(|v| f64::from(*v));
        let weight = 1.0 + 0.004 * x + 0.002 * y + 0.2 * libm::sin(x / 25.0);
        let slope = 0.004 + 0.008 * libm::cos(x / 25.0);
        (weight * length, [slope * length, 0.002 * length, weight, 0.0])
    };
    let all: Vec<(f64, [f64; 4])> = c.x.iter().zip(&c.y).zip(&c.length).map(one).collect();
    (all.iter().map(|a| a.0).sum(), all.iter().map(|a| a.1).collect())
}

/// The slope of a function along a motion of size `way`, from its derivatives with
/// respect to the vertices and the solids before and after the motion.
pub fn along(by_vertex: &[DVec3], before: &Solid, after: &Solid, way: f64) -> f64 {
    let moved = before.vertices().zip(after.vertices()).map(|(a, b)| (b - a) / way);
    by_vertex.iter().zip(moved).map(|(g, d)| g.dot(d)).sum()
}

/// Asserts what holds for all contours.
pub fn check_invariants(c: &Contours) {
    let n = c.len();
    assert!([c.y.len(), c.tx.len(), c.ty.len(), c.length.len()].iter().all(|&m| m == n));
    for i in 0..n {
        assert!(
            (0.0..=c.width as f32).contains(&c.x[i]) && (0.0..=c.height as f32).contains(&c.y[i])
        );
        assert!((c.tx[i] * c.tx[i] + c.ty[i] * c.ty[i] - 1.0).abs() < 1e-5);
        assert!(c.length[i] > 0.0 && c.length[i] <= 1.5);
    }
}
