//! What several benchmarks draw and compare: shapes from plain to fine, poses, a
//! photograph, contours as comparators take them.

// Every benchmark uses some of it.
#![allow(dead_code)]

pub mod parts;
#[path = "../../examples/shipped/mod.rs"]
pub mod shipped;

use criterion::Criterion;
use glam::{DVec3, Vec3};
use image::imageops::{FilterType, resize};
use pcadlang::geom::{Affine, Mesh, Solid};
use pcadlang::render::Contours;
use pcadlang::vision::elements::Elements;
use pcadlang::vision::{Limits, Photo, photo};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Few samples of short runs: a file of benchmarks is done in some minutes.
pub fn short() -> Criterion {
    Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(1000))
}

/// A closed surface of revolution (two triangles for each vertex but the last ring's);
/// `bulge` is the profile's parameter.
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

/// A lathe of 2,000 triangles.
pub fn vase() -> Solid {
    Solid::new(Arc::new(lathe(0.2, 26, 40)))
}

/// One of 100,352 triangles.
pub fn dense() -> Solid {
    Solid::new(Arc::new(lathe(0.2, 225, 224)))
}

/// A pose a little farther on with every call, so that no result can be one from before.
pub fn pose(step: &mut f64) -> Affine {
    *step += 1e-4;
    Affine::new(DVec3::new(0.1, -0.1, *step), DVec3::new(0.4 + *step, 0.3, 0.1), DVec3::splat(1.2))
}

/// Where a shipped human body stands before the default camera, turned by so much
/// (radians).
pub fn standing(turn: f64) -> Affine {
    Affine::new(DVec3::new(0.0, -1.8, 0.0), DVec3::new(0.05, 0.5 + turn, 0.0), DVec3::splat(2.1))
}

/// A shipped photograph's path.
pub fn picture(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/images").join(name)
}

/// The skier at `side` by `side` pixels.
pub fn photograph(side: u32) -> Photo {
    let photo = photo::load(&picture("skier.jpg"), &Limits::default()).expect("a photograph");
    Photo::from_rgb(resize(photo.rgb(), side, side, FilterType::Triangle))
        .expect("a photograph with pixels")
}

/// Contours as comparators take them.
pub fn elements(c: &Contours) -> Elements<'_> {
    Elements {
        x: &c.x,
        y: &c.y,
        tx: &c.tx,
        ty: &c.ty,
        length: &c.length,
        width: c.width,
        height: c.height,
    }
}
