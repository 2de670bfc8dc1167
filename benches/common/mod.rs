//! Shapes from simple to dense, poses, a photograph and contours that several benchmarks
//! use.

// Each benchmark uses only some of these.
#![allow(dead_code)]

pub mod parts;
#[path = "../src/bin/shipped/mod.rs"]
pub mod shipped;

use criterion::Criterion;
use glam::{DVec3, Vec3};
use image::imageops::{FilterType, resize};
use pcadlang_scene::geom::{Affine, Mesh, Solid};
use pcadlang_scene::vision::{Limits, Photo, photo};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Configures few samples of short runs, so that a file of benchmarks takes some minutes.
pub fn short() -> Criterion {
    Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(1000))
}

/// Builds a closed surface of revolution (two triangles for each vertex except those of
/// the last ring); `bulge` is the parameter of the profile.
pub fn lathe(bulge: f32, rings: u32, sides: u32) -> Mesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..rings {
        let t = ring as f32 / (rings - 1) as f32;
        let radius =
            if ring == 0 || ring == rings - 1 { 0.0 } else { 0.6 + bulge * (5.0 * t).sin() };
        for side in 0..sides {
            let angle = std::f32::consts::TAU * side as f32 / sides as f32;
            positions.push(Vec3::new(radius * angle.sin(), 2.0 * t - 1.0, radius * angle.cos()));
            if ring + 1 < rings {
                let (a, b) = (ring * sides + side, ring * sides + (side + 1) % sides);
                triangles.push([a, b, b + sides]);
                triangles.push([a, b + sides, a + sides]);
            }
        }
    }
    let parts = vec![0; triangles.len()];
    Mesh::new(positions, triangles, parts).expect("a valid mesh")
}

/// Builds a lathe of 2,000 triangles.
pub fn vase() -> Solid {
    Solid::new(Arc::new(lathe(0.2, 26, 40)))
}

/// Builds a lathe of 100,352 triangles.
pub fn dense() -> Solid {
    Solid::new(Arc::new(lathe(0.2, 225, 224)))
}

/// Returns a slightly different pose on every call, so that no cached result can be used.
pub fn pose(step: &mut f64) -> Affine {
    *step += 1e-4;
    Affine::new(DVec3::new(0.1, -0.1, *step), DVec3::new(0.4 + *step, 0.3, 0.1), DVec3::splat(1.2))
}

/// Returns the pose of a shipped human body before the default camera, rotated by `turn`
/// radians.
pub fn standing(turn: f64) -> Affine {
    Affine::new(DVec3::new(0.0, -1.8, 0.0), DVec3::new(0.05, 0.5 + turn, 0.0), DVec3::splat(2.1))
}

/// Returns the path of a shipped photograph.
pub fn picture(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/images").join(name)
}

/// Loads the photograph of the skier at `side` by `side` pixels.
pub fn photograph(side: u32) -> Photo {
    let bytes = std::fs::read(picture("skier.jpg")).expect("a photograph");
    let photo = photo::decode(&bytes, &Limits::default()).expect("a photograph");
    Photo::from_rgb(resize(photo.rgb(), side, side, FilterType::Triangle))
        .expect("a photograph with pixels")
}
