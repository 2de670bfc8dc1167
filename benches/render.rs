//! How long one evaluation takes at 128 pixels: a lathe of 2000 triangles, and a body of 22 parts (2420 triangles) of which
//! some move.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use pcadlang::geom::{Affine, Mesh, Solid};
use pcadlang::render::{Camera, Channels, Contours, Frame, View};
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

/// The parts of a standing figure: middle, direction of the long axis, half its length, radius.
const BODY: [([f32; 3], [f32; 3], f32, f32); 22] = [
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

/// A closed spindle of 110 triangles about an axis.
fn spindle(middle: [f32; 3], axis: [f32; 3], half: f32, radius: f32) -> Mesh {
    let (rings, sides) = (5u32, 11u32);
    let (middle, axis) = (Vec3::from(middle), Vec3::from(axis).normalize());
    let (u, v) = axis.any_orthonormal_pair();
    let mut positions = vec![middle - axis * half];
    for ring in 1..=rings {
        let t = std::f32::consts::PI * (ring as f32 / (rings + 1) as f32 - 0.5);
        for side in 0..sides {
            let a = std::f32::consts::TAU * side as f32 / sides as f32;
            positions.push(middle + axis * half * t.sin() + (u * a.cos() + v * a.sin()) * (radius * t.cos()));
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

/// The contours of the body when the meshes of some of its parts are new, as when a joint moved.
fn body(c: &mut Criterion) {
    let camera = Camera::default_for(128, 128);
    let parts: Vec<_> = BODY.iter().map(|&(m, a, half, radius)| Arc::new(spindle(m, a, half, radius))).collect();
    let pose = Affine::new(DVec3::new(0.05, 0.02, 0.1), DVec3::new(0.1, 0.4, 0.05), DVec3::ONE);
    let view = |moved: &[usize], by: f32| {
        let solids: Vec<_> = (0..parts.len())
            .map(|i| match moved.contains(&i) {
                false => Solid::new(parts[i].clone()),
                true => {
                    let positions = parts[i].positions.iter().map(|p| *p + Vec3::X * by).collect();
                    Solid::new(Arc::new(Mesh { positions, ..(*parts[i]).clone() }))
                }
            })
            .collect();
        View::new(Solid::group(&solids).placed(pose), camera)
    };
    let all: Vec<usize> = (0..parts.len()).collect();
    let mut step = 0u32;
    for (name, moved) in
        [("nothing", &[][..]), ("a hand", &[11]), ("the chest", &[2]), ("an arm", &[7, 9, 11, 13]), ("all", &all)]
    {
        let mut next = || {
            step += 1;
            view(moved, 1e-3 * (step % 97) as f32)
        };
        c.bench_function(&format!("body/contours, {name} moved"), |b| {
            b.iter_batched(&mut next, |view| (view.contours(128), view), BatchSize::PerIteration)
        });
    }
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

criterion_group!(benches, render, body, region);
criterion_main!(benches);
