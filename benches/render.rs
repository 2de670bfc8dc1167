//! How long one evaluation takes: a lathe of 2000 triangles at 128 pixels.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use pcadlang::geom::{Affine, Mesh, Solid};
use pcadlang::render::{Camera, Channels, Contours, Frame};
use pcadlang::vision::region::Scratch;
use pcadlang::vision::{Limits, Region, RegionOptions};
use std::hint::black_box;
use std::sync::Arc;

/// A closed surface of revolution with 26 rings of 40 vertices (2000 triangles); `bulge` is the profile's parameter.
fn lathe(bulge: f32) -> Mesh {
    let (rings, sides) = (26u32, 40u32);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..rings {
        let t = ring as f32 / (rings - 1) as f32;
        let radius = if ring == 0 || ring == rings - 1 { 0.0 } else { 0.6 + bulge * (5.0 * t).sin() };
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

fn pose(step: &mut f64) -> Affine {
    *step += 1e-4;
    Affine::new(DVec3::new(0.1, -0.1, *step), DVec3::new(0.4 + *step, 0.3, 0.1), DVec3::splat(1.2))
}

fn render(c: &mut Criterion) {
    let camera = Camera::default_for(128, 128);
    let solid = Solid::new(Arc::new(lathe(0.2)));
    let mut step = 0.0;
    c.bench_function("pose/depth", |b| {
        b.iter(|| Frame::render(&solid.placed(pose(&mut step)), black_box(&camera), Channels::Depth))
    });
    c.bench_function("pose/frame", |b| {
        b.iter(|| Frame::render(&solid.placed(pose(&mut step)), black_box(&camera), Channels::All))
    });
    c.bench_function("pose/contours", |b| b.iter(|| Contours::of(&solid.placed(pose(&mut step)), black_box(&camera))));
    c.bench_function("profile/mesh", |b| b.iter(|| lathe(black_box(0.2))));
    c.bench_function("profile/contours", |b| {
        b.iter(|| {
            let solid = Solid::new(Arc::new(lathe(black_box(0.2))));
            Contours::of(&solid.placed(pose(&mut step)), &camera)
        })
    });
}

/// The region comparator alone, on a photograph at 128 pixels: counting and look-ups, and the shading term.
fn region(c: &mut Criterion) {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/coffee_cup.png");
    let photo = pcadlang::vision::photo::load(file.as_ref(), &Limits::default()).expect("a photograph");
    let (width, height) = pcadlang::vision::resize::fitted(photo.width(), photo.height(), 128);
    let camera = Camera::default_for(width, height);
    let solid = Solid::new(Arc::new(lathe(0.2)));
    let mut step = 0.0;
    let frame = Frame::render(&solid.placed(pose(&mut step)), &camera, Channels::All);
    let groups: Vec<u8> = frame.mask().map(u8::from).collect();
    let mut scratch = Scratch::default();
    for (name, shading) in [("region/colours", 0.0), ("region/colours and shading", 0.05)] {
        let options = RegionOptions { shading, ..RegionOptions::default() };
        let region = Region::prepare(&photo, width, height, &options).expect("a region");
        c.bench_function(name, |b| {
            b.iter(|| region.log_likelihood_with(black_box(&groups), &frame.normal, &mut scratch))
        });
    }
}

criterion_group!(benches, render, region);
criterion_main!(benches);
