//! Trees of faces against drawing every face: pieces, depth ranges, contours and depths, bit for
//! bit.

use super::hiding::Hiding;
use super::pieces::{Found, extract_posed};
use super::*;
use crate::geom::{self, Affine, Caps, Profile};
use crate::render::lines::extraction::{Room, extract_mesh};
use crate::render::lines::silhouette::Crossed;
use crate::render::pixels::project::{Projected, project};
use crate::render::testing::{Uniform, cuboid, lathe, solid, sphere};
use crate::render::{Camera, Channels, Contours, Frame, Projection};
use glam::{EulerRot, Vec3};
use std::sync::Arc;

/// A surface of revolution with bumps, open at both ends.
fn bumpy(rings: u32, sides: u32) -> Solid {
    let plain = lathe(
        &(0..rings)
            .map(|i| {
                let t = i as f32 / (rings - 1) as f32;
                (0.28 + 0.22 * (7.0 * t + 0.4).sin() * (1.0 - 0.4 * t), 1.8 * t - 0.9)
            })
            .collect::<Vec<_>>(),
        sides,
        false,
    );
    let mesh = &plain.instances()[0].mesh;
    let bump = |p: &Vec3| 1.0 + 0.05 * (7.0 * p.z.atan2(p.x) + 5.0 * p.y).sin();
    let moved = |p: &Vec3| Vec3::new(p.x * bump(p), p.y, p.z * bump(p));
    solid(mesh.positions.iter().map(moved).collect(), mesh.topology.triangles.clone())
}

/// The same mesh with other vertices.
fn mapped(of: &Solid, map: impl Fn(Vec3) -> Vec3) -> Solid {
    let mesh = &of.instances()[0].mesh;
    solid(mesh.positions.iter().map(|p| map(*p)).collect(), mesh.topology.triangles.clone())
}

/// Triangles at random, some of them slivers, some of them shared.
fn soup(random: &mut Uniform, count: usize) -> Solid {
    let mut positions = Vec::new();
    let mut at = |spread: f64| Vec3::from([(); 3].map(|()| random.between(-spread, spread) as f32));
    for i in 0..count {
        let middle = at(0.8);
        let size = [0.02, 0.1, 0.6][i % 3];
        positions.extend([
            middle,
            middle + at(size),
            middle + at(if i % 5 == 0 { 1e-5 } else { size }),
        ]);
    }
    let n = positions.len() as u32;
    let mut triangles: Vec<[u32; 3]> = (0..n / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    triangles.extend((0..n / 9).map(|i| [i, (i * 7 + 3) % n, (i * 3 + 11) % n]));
    solid(positions, triangles)
}

/// Meshes of all kinds: open and closed, with creases, with faces of all shapes, small and
/// large, far from their origin.
fn meshes() -> Vec<(&'static str, Solid)> {
    let mut random = Uniform(5);
    let profile = [Profile { y: vec![-1.0, -0.2, 0.3, 1.0], r: vec![0.6, 0.3, 0.7, 0.2] }];
    let closed = |wall, caps| Solid::new(geom::lathe(&profile, 60, wall, caps).unwrap().into());
    let steps: Vec<(f32, f32)> = (0..24)
        .map(|i| (if i / 2 % 2 == 0 { 0.4 } else { 0.7 }, (i + 1) as f32 / 12.0 / 2.0))
        .collect();
    vec![
        ("bumpy", bumpy(40, 48)),
        ("sphere", sphere(40, 24)),
        ("closed", closed(0.0, Caps::Both)),
        ("vessel", closed(0.05, Caps::Bottom)),
        ("steps", lathe(&steps, 24, true)),
        ("soup", soup(&mut random, 300)),
        ("small", mapped(&sphere(30, 20), |p| p * 1e-4)),
        ("large", mapped(&bumpy(30, 30), |p| p * 3e4)),
        ("far", mapped(&bumpy(30, 30), |p| p + Vec3::new(300.0, -20.0, 50.0))),
        ("flat", mapped(&bumpy(30, 30), |p| Vec3::new(p.x, p.y, 0.0))),
    ]
}

/// A placement that puts a mesh before a camera, or around it.
fn placement(random: &mut Uniform, mesh: &Mesh, round: usize) -> Affine {
    let bounds = mesh.bounds().unwrap();
    let (middle, size) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length());
    let angle = [(); 3].map(|()| random.between(-3.2, 3.2));
    let mut matrix = DMat3::from_euler(EulerRot::XYZ, angle[0], angle[1], angle[2])
        * (random.between(0.7, 1.3) * 2.0 / size);
    if round % 3 == 1 {
        // Sheared, flattened, perhaps mirrored.
        let scale = DVec3::from([(); 3].map(|()| random.between(0.3, 1.5)));
        matrix *= DMat3::from_diagonal(scale * if round.is_multiple_of(2) { 1.0 } else { -1.0 });
        matrix *= DMat3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.0), DVec3::Z);
    }
    let depth = [3.0, 1.5, 6.0, 0.9, 2.0, 40.0, 0.2][round % 7];
    let aside = random.between(-0.5, 0.5) * if round.is_multiple_of(11) { 8.0 } else { 1.0 };
    let shift = DVec3::new(aside, random.between(-0.4, 0.4), 3.0 - depth) - matrix * middle;
    Affine(glam::DAffine3 { matrix3: matrix, translation: shift })
}

fn camera(random: &mut Uniform, round: usize) -> Camera {
    let (width, height) = [(64, 64), (96, 40), (128, 128), (33, 57)][round % 4];
    let projection = match round % 5 {
        0 => Projection::Orthographic { units_per_pixel: 3.0 / 64.0, cx: 30.0, cy: 25.5 },
        // Nearly orthographic is `depth` 40 with a long lens.
        1 => Projection::Pinhole { focal_px: 1500.0, cx: 40.0, cy: 30.0 },
        _ => {
            let focal_px = random.between(40.0, 200.0);
            Projection::Pinhole { focal_px, cx: random.between(10.0, 60.0), cy: 28.0 }
        }
    };
    let turn = DMat3::from_rotation_y(random.between(-0.1, 0.1));
    let (right, up, forward) = (turn * DVec3::X, DVec3::Y, turn * DVec3::NEG_Z);
    Camera { eye: DVec3::new(0.0, 0.0, 3.0), right, up, forward, width, height, projection }
}

fn make(solid: &Solid) {
    for instance in solid.instances() {
        assert!(instance.mesh.clusters.make(instance.mesh.shape()).is_some());
    }
}

/// The pieces with and without trees, in order, with everything that their tests need; and
/// the depth ranges.
#[test]
fn pieces_and_ranges_are_those_of_the_plain_way() {
    let mut random = Uniform(71);
    let (mut same, mut count, mut plain) = (0, 0, 0);
    for (name, solid) in meshes() {
        make(&solid);
        for round in 0..60 {
            let mesh = &solid.instances()[0].mesh;
            let camera = camera(&mut random, round);
            let placed = solid.placed(placement(&mut random, mesh, round));
            let Some(posed) = all_posed(&placed, &camera) else {
                plain += 1;
                continue;
            };
            let mut projected = Projected::default();
            let range = project(&placed, &camera, &mut projected);
            let own = posed[0].range();
            assert_eq!([own.near, own.far], [range.near, range.far], "{name}, round {round}");
            let (mut room, vertices) = (Room::default(), projected.mesh(0));
            assert!(vertices.whole && (!posed[0].outside || vertices.outside(&camera)));
            let (mut with, mut without) = (Vec::new(), Vec::new());
            let tools = (&mut Found::default(), &mut Crossed::default());
            extract_posed(&posed[0], &camera, tools, |piece, from| {
                with.push(format!("{piece:?} {from:?}"))
            });
            let placement = &posed[0].placement;
            extract_mesh(mesh, placement, &camera, &vertices, &mut room, |piece, from| {
                without.push(format!("{piece:?} {from:?}"))
            });
            assert_eq!(with, without, "{name}, round {round}");
            same += 1;
            count += with.len();
        }
    }
    assert!(same > 400 && plain > 50 && count > 100_000, "{same} {plain} {count}");
}

/// Whole contours, of single meshes and groups.
#[test]
fn contours_are_those_of_the_plain_way() {
    let mut random = Uniform(72);
    let all = meshes();
    all.iter().for_each(|(_, solid)| make(solid));
    let (mut with_trees, mut count) = (0, 0);
    for round in 0..900 {
        let (name, solid) = &all[round % all.len()];
        let camera = camera(&mut random, round / 3);
        let placed = |random: &mut Uniform, solid: &Solid| {
            solid.placed(placement(random, &solid.instances()[0].mesh, round / 7))
        };
        let mut scene = placed(&mut random, solid);
        if round % 4 == 0 {
            let other = &all[(round / 4) % all.len()].1;
            scene = Solid::group(&[scene, placed(&mut random, other)]);
        }
        let plain = Contours::of_any(&scene, &camera);
        assert_eq!(Contours::of(&scene, &camera), plain, "{name}, round {round}");
        if let Some(posed) = all_posed(&scene, &camera) {
            assert_eq!(Contours::of_posed(&posed, &camera), plain, "{name}, round {round}");
            with_trees += 1;
            count += plain.len();
        }
    }
    assert!(with_trees > 500 && count > 100_000, "{with_trees} {count}");
}

/// The depth of every pixel, looked up one by one.
#[test]
fn depth_by_lines_of_sight_is_that_of_whole_pictures() {
    let mut random = Uniform(73);
    let mut shown = 0;
    for (name, solid) in meshes() {
        make(&solid);
        for round in 0..15 {
            let camera = camera(&mut random, round);
            let placed = solid.placed(placement(&mut random, &solid.instances()[0].mesh, round));
            let Some(posed) = all_posed(&placed, &camera).filter(|posed| !posed[0].outside) else {
                continue;
            };
            let wanted = Frame::render(&placed, &camera, Channels::Depth).depth;
            let (step, plain) = ([1, 7919][round % 2], round / 2 % 2 == 0);
            let own = super::hiding::depth(&posed[0], &camera, step, plain);
            shown += wanted.iter().filter(|d| d.is_finite()).count();
            assert_eq!(own, wanted, "{name}, round {round}");
        }
    }
    assert!(shown > 100_000, "{shown}");
}

#[test]
fn most_faces_are_skipped() {
    let solid = bumpy(160, 160);
    make(&solid);
    let faces = solid.instances()[0].mesh.topology.triangles.len();
    let camera = Camera::default_for(128, 128);
    let mut random = Uniform(74);
    let (mut hiding, mut found) = (Hiding::default(), Found::default());
    let rounds = 20;
    for round in 0..rounds {
        let affine = placement(&mut random, &solid.instances()[0].mesh, 7 * round);
        let placed = solid.placed(affine);
        let posed = all_posed(&placed, &camera).unwrap();
        let mut pieces = Vec::new();
        let tools = (&mut found, &mut Crossed::default());
        extract_posed(&posed[0], &camera, tools, |piece, _| pieces.push(piece));
        assert!(pieces.len() > 200);
        let mut hidden = vec![true; pieces.len()];
        for side in 0..2 {
            let extent = posed[0].range().extent();
            hiding.test(&posed, &camera, extent, (side, &pieces, &mut hidden));
        }
    }
    let share = |count: usize| count as f64 / (faces * rounds) as f64;
    let shares = [share(found.faced), share(hiding.tested), share(hiding.drawn)];
    assert!(shares[0] < 0.2 && shares[1] < 0.3 && shares[2] < 0.02, "{shares:?}");
}

/// Trees are made after several drawings of one mesh, never for copies.
#[test]
fn trees_are_made_for_meshes_that_are_drawn_often() {
    let camera = Camera::default_for(64, 64);
    let mesh = Arc::clone(&sphere(30, 20).instances()[0].mesh);
    let kept = Solid::new(Arc::clone(&mesh));
    for _ in 0..100 {
        let copy = Solid::new(Arc::new(Mesh::clone(&mesh)));
        Contours::of(&copy, &camera);
        assert!(posed(&copy, &camera).is_none());
    }
    let drawn: Vec<Contours> = (0..40).map(|_| Contours::of(&kept, &camera)).collect();
    assert!(posed(&kept, &camera).is_some());
    assert!(drawn.iter().all(|c| *c == drawn[0] && !c.is_empty()));
    let other =
        Mesh { positions: mesh.positions.iter().map(|p| *p * 2.0).collect(), ..Mesh::clone(&mesh) };
    assert!(other.drawn().is_none());
    // Few faces are drawn as quickly without.
    let small = cuboid(Vec3::ONE);
    (0..40).for_each(|_| drop(Contours::of(&small, &camera)));
    assert!(posed(&small, &camera).is_none());
}
