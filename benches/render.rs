//! Benchmarks of rendering, stage by stage: building a mesh, posing a body, depth, all
//! channels and contours, for a lathe of 2,000 triangles, the shipped human body and a
//! mesh of 100,352 triangles at 64 to 512 pixels; for round lathes beside their meshes;
//! and for a body of 22 parts (2,420 triangles), some of which move.
//!
//!     cargo bench -p pcadlang-benches --bench render -- "contours/human" --quick

mod common;

use common::parts::{BODY, spindle};
use common::shipped::human;
use common::{dense, lathe, pose, short, standing, vase};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use pcadlang_scene::geom::armature::{JointPose, Rules};
use pcadlang_scene::geom::{self, Affine, Caps, Mesh, Profile, Solid};
use pcadlang_scene::render::{Camera, Channels, Contours, Frame, View};
use pcadlang_scene::vision::ContourMap;
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions, Scratch};
use std::cell::RefCell;
use std::hint::black_box;
use std::sync::Arc;

const SIZES: [u32; 4] = [64, 128, 256, 512];

/// Measures a solid in new poses: depth, all channels, contours.
fn drawn(c: &mut Criterion, name: &str, solid: &Solid, pose: &dyn Fn(&mut f64) -> Affine) {
    let mut step = 0.0;
    for size in SIZES {
        let camera = Camera::default_for(size, size);
        for (what, channels) in [("depth", Channels::Depth), ("frame", Channels::All)] {
            c.bench_function(&format!("{what}/{name} at {size}"), |b| {
                b.iter(|| {
                    Frame::render(&solid.placed(pose(&mut step)), black_box(&camera), channels)
                })
            });
        }
        c.bench_function(&format!("contours/{name} at {size}"), |b| {
            b.iter(|| Contours::of(&solid.placed(pose(&mut step)), black_box(&camera)))
        });
    }
}

fn meshes(c: &mut Criterion) {
    drawn(c, "lathe", &vase(), &pose);
    drawn(c, "dense", &dense(), &pose);
}

/// Measures new profiles: the mesh, its normals and edges, and its contours.
fn profile(c: &mut Criterion) {
    let camera = Camera::default_for(128, 128);
    let mut step = 0.0;
    c.bench_function("profile/mesh", |b| b.iter(|| lathe(black_box(0.2), 26, 40)));
    c.bench_function("profile/contours", |b| {
        b.iter(|| {
            let solid = Solid::new(Arc::new(lathe(black_box(0.2), 26, 40)));
            Contours::of(&solid.placed(pose(&mut step)), &camera)
        })
    });
}

/// Measures round lathes of 26 rings, closed or with a thick wall, without a mesh and as
/// meshes of 24 sides in new poses at 128 pixels: contours and their chamfer score, depth,
/// all channels.
fn round(c: &mut Criterion) {
    let camera = Camera::default_for(128, 128);
    let y: Vec<f64> = (0..26).map(|i| f64::from(i) / 12.5 - 1.0).collect();
    let r = y.iter().map(|y| 0.75 + 0.25 * (2.5 * y).sin()).collect();
    let profile = [Profile { y, r }];
    for (name, wall, caps) in [("closed", 0.0, Caps::Both), ("vessel", 0.1, Caps::Bottom)] {
        let solid = |sides: u32| match sides {
            0 => Solid::exact_lathe(&profile, 96, wall, caps).expect("a lathe"),
            _ => Solid::new(Arc::new(geom::lathe(&profile, sides, wall, caps).expect("a lathe"))),
        };
        let seen = Contours::of(&solid(0).placed(pose(&mut 0.0)), &camera);
        let map = ContourMap::of(&seen.slice());
        let chamfer = Chamfer::prepare(&map, 128, 128, &ChamferOptions::default());
        let (chamfer, mut scratch) = (chamfer.expect("contours"), Scratch::default());
        for (what, sides) in [("round", 0), ("mesh of 24 sides", 24)] {
            let (solid, mut step) = (solid(sides), 0.0);
            let mut view = || View::new(solid.placed(pose(&mut step)), camera);
            c.bench_function(&format!("round/{name}, {what}, score"), |b| {
                b.iter(|| {
                    let contours = view().contours(128);
                    chamfer.log_likelihood_with(&contours.slice(), &mut scratch)
                })
            });
            c.bench_function(&format!("round/{name}, {what}, depth"), |b| {
                b.iter(|| view().depth(128))
            });
            c.bench_function(&format!("round/{name}, {what}, frame"), |b| {
                b.iter(|| view().frame(128))
            });
        }
    }
}

/// Measures the shipped body: posing and skinning with one joint moved and with all
/// joints moved, and rendering it with fixed joints.
fn person(c: &mut Criterion) {
    let rules = Rules::default();
    for lod in ["human.lod2", "human"] {
        let body = human(lod).expect("a shipped body");
        let rest = vec![JointPose::REST; body.rig().joints().len()];
        let mut step = 0.0;
        let mut turned = |moved: usize| {
            step += 1e-4;
            let mut pose = rest.clone();
            pose.iter_mut()
                .rev()
                .take(moved)
                .for_each(|p| *p = JointPose::turned(DVec3::new(0.1 + step, 0.05, 0.02)));
            pose
        };
        for (what, moved) in [("one joint", 1), ("all joints", rest.len())] {
            c.bench_function(&format!("posed/{lod}, {what}"), |b| {
                b.iter_batched(
                    || turned(moved),
                    |pose| body.posed(&pose, &rules),
                    BatchSize::SmallInput,
                )
            });
        }
        let solid = body.posed(&turned(rest.len()), &rules).expect("a posed body");
        drawn(c, lod, &solid, &|step| {
            *step += 1e-4;
            standing(*step)
        });
    }
}

/// Measures the contours of the body when some of its parts have new meshes, as after a
/// joint moved.
fn body(c: &mut Criterion) {
    let camera = Camera::default_for(128, 128);
    let parts: Vec<_> =
        BODY.iter().map(|&(m, a, half, radius)| Arc::new(spindle(m, a, half, radius))).collect();
    let pose = Affine::new(DVec3::new(0.05, 0.02, 0.1), DVec3::new(0.1, 0.4, 0.05), DVec3::ONE);
    let last = RefCell::new(Arc::new(View::new(Solid::group(&[]), camera)));
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
        let view = View::new(Solid::group(&solids).placed(pose), camera).after(&last.borrow());
        let view = Arc::new(view);
        last.replace(Arc::clone(&view));
        view
    };
    let all: Vec<usize> = (0..parts.len()).collect();
    let mut step = 0u32;
    for (name, moved) in [
        ("nothing", &[][..]),
        ("a hand", &[11]),
        ("the chest", &[2]),
        ("an arm", &[7, 9, 11, 13]),
        ("all", &all),
    ] {
        let mut next = || {
            step += 1;
            view(moved, 1e-3 * (step % 97) as f32)
        };
        c.bench_function(&format!("body/contours, {name} moved"), |b| {
            b.iter_batched(&mut next, |view| (view.contours(128), view), BatchSize::PerIteration)
        });
    }
}

criterion_group! { name = benches; config = short(); targets = meshes, profile, round, person, body }
criterion_main!(benches);
