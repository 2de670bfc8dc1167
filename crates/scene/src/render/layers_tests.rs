//! Layers against full drawings, bit for bit, over sequences of changes; and their
//! limits.

use super::*;
use crate::render::testing::{Uniform, cuboid, lathe, sphere};
use crate::render::{Channels, Frame};
use glam::{DVec3, Vec3};

/// A mesh in posed coordinates: a ball, a box, or an open or closed lathe, at a random
/// placement.
fn part(random: &mut Uniform) -> Arc<Mesh> {
    let at = |random: &mut Uniform, s: f64| {
        DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
    };
    let profile = [(0.5, -0.8), (0.7, -0.1), (0.4, 0.6)];
    let shape = match (random.next() * 4.0) as u32 {
        0 => sphere(11, 7),
        1 => cuboid(Vec3::new(0.4, 0.9, 0.3)),
        2 => lathe(&profile, 9, false),
        _ => lathe(&profile, 13, true),
    };
    let (middle, turn, size) =
        (at(random, 1.0), at(random, 2.0), DVec3::splat(random.between(0.2, 0.7)));
    Arc::new(shape.placed(Affine::new(middle, turn, size)).to_mesh().unwrap())
}

fn group(meshes: &[Arc<Mesh>], by: Affine) -> Solid {
    let solids: Vec<_> = meshes.iter().map(|m| Solid::new(m.clone())).collect();
    Solid::group(&solids).placed(by)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Checks that the layers' picture and contours are those of a full drawing.
fn check(layers: &mut Layers, solid: &Solid, camera: &Camera) {
    let (got, wanted) = (layers.contours(solid, camera).unwrap(), Contours::drawn(solid, camera));
    assert_eq!(got, wanted);
    for (a, b) in [(&got.x, &wanted.x), (&got.y, &wanted.y), (&got.length, &wanted.length)] {
        assert_eq!(bits(a), bits(b));
    }
    assert_eq!(bits(&layers.depth), bits(&Frame::render(solid, camera, Channels::Depth).depth));
    assert_eq!(layers.bytes, layers.slots.iter().map(|s| s.layer.bytes()).sum::<usize>());
}

#[test]
fn layers_give_what_is_drawn_at_once() {
    let mut random = Uniform(21);
    let mut layers = Layers::default();
    let mut pieces = 0;
    for round in 0..10 {
        let mut camera = Camera::default_for(40 + 7 * round, 96 - 5 * round);
        if round % 3 == 1 {
            camera.projection =
                Projection::Orthographic { units_per_pixel: 0.05, cx: 30.0, cy: 40.0 };
        } else if round % 3 == 2 {
            // The near plane cuts some meshes.
            camera.eye.z = 0.4;
        }
        let mut meshes: Vec<_> = (0..3 + round).map(|_| part(&mut random)).collect();
        let mut by = Affine::IDENTITY;
        for step in 0..50 {
            let before = (meshes.clone(), by);
            if step % 10 == 9 {
                let turn = DVec3::new(random.next(), random.next(), 0.3);
                by = Affine::new(
                    DVec3::new(0.2, 0.1, random.next()),
                    turn,
                    DVec3::new(-1.0, 1.0, 1.2),
                );
            }
            for _ in 0..1 + step % 3 {
                let at = (random.next() * meshes.len() as f64) as usize;
                meshes[at] = part(&mut random);
            }
            check(&mut layers, &group(&meshes, by), &camera);
            pieces += layers.found;
            if random.next() < 0.5 {
                (meshes, by) = before;
                check(&mut layers, &group(&meshes, by), &camera);
            }
        }
    }
    assert!(pieces > 50_000, "{pieces}");
}

#[test]
fn what_did_not_move_is_not_drawn_again() {
    let mut random = Uniform(22);
    let camera = Camera::default_for(64, 64);
    let mut layers = Layers::default();
    let mut meshes: Vec<_> = (0..22).map(|_| part(&mut random)).collect();
    // Two instances of one mesh share a layer.
    meshes[21] = meshes[20].clone();
    check(&mut layers, &group(&meshes, Affine::IDENTITY), &camera);
    assert_eq!(layers.slots.len(), 21);
    let first = layers.shown.clone();
    check(&mut layers, &group(&meshes, Affine::IDENTITY), &camera);
    assert_eq!(layers.shown, first);
    // A step that is not taken, many times: the slot of the dropped mesh is reused.
    for _ in 0..300 {
        let old = std::mem::replace(&mut meshes[3], part(&mut random));
        check(&mut layers, &group(&meshes, Affine::IDENTITY), &camera);
        let same = layers.shown.iter().zip(&first).filter(|(a, b)| a == b).count();
        assert_eq!((same, layers.slots.len()), (21, 22));
        meshes[3] = old;
    }
    check(&mut layers, &group(&meshes, Affine::IDENTITY), &camera);
    assert_eq!(layers.shown, first);
    // Another placement and another camera need other layers.
    let by = Affine::new(DVec3::new(0.0, 1e-12, 0.0), DVec3::ZERO, DVec3::ONE);
    check(&mut layers, &group(&meshes, by), &camera);
    assert_eq!(layers.slots.len(), 22 + 20);
    check(&mut layers, &group(&meshes, by), &Camera::default_for(64, 65));
    assert_eq!(layers.slots.len(), 22 + 20 + 21);
}

#[test]
fn number_and_memory_stay_bounded() {
    let mut random = Uniform(23);
    let mut layers = Layers::default();
    let meshes: Vec<_> = (0..40).map(|_| part(&mut random)).collect();
    for step in 0..12 {
        let by = Affine::new(
            DVec3::new(0.01 * f64::from(step), 0.0, 0.0),
            DVec3::ZERO,
            DVec3::splat(2.0),
        );
        check(&mut layers, &group(&meshes, by), &Camera::default_for(64, 64));
    }
    assert_eq!(layers.slots.len(), SLOTS);
    for step in 0..6 {
        let by = Affine::new(
            DVec3::new(0.0, 0.01 * f64::from(step), 0.0),
            DVec3::ZERO,
            DVec3::splat(3.0),
        );
        check(&mut layers, &group(&meshes[..4], by), &Camera::default_for(1200, 1200));
        assert!(layers.bytes <= BYTES, "{}", layers.bytes);
    }
    assert!(layers.bytes > BYTES / 2);
}

#[test]
fn few_many_or_huge_are_drawn_at_once() {
    let mut random = Uniform(24);
    let meshes: Vec<_> = (0..MOST + 1).map(|_| part(&mut random)).collect();
    let camera = Camera::default_for(48, 48);
    for (count, kept) in
        [(0, false), (1, false), (2, false), (3, true), (MOST, true), (MOST + 1, false)]
    {
        let solid = group(&meshes[..count], Affine::IDENTITY);
        assert_eq!(contours(&solid, &camera).is_some(), kept, "{count}");
        assert_eq!(Contours::of(&solid, &camera), Contours::drawn(&solid, &camera));
    }
    assert!(
        contours(&group(&meshes[..10], Affine::IDENTITY), &Camera::default_for(2000, 2000))
            .is_none()
    );
}

#[test]
fn what_cannot_be_seen_leaves_an_empty_layer() {
    let camera = Camera::default_for(48, 48);
    let mut layers = Layers::default();
    let mut random = Uniform(25);
    let meshes: Vec<_> = (0..3).map(|_| part(&mut random)).collect();
    for at in [
        [0.0, 0.0, 30.0],
        [90.0, 0.0, 0.0],
        [0.0, -90.0, 0.0],
        [f64::NAN, 0.0, 0.0],
        [0.0, 0.0, -1e12],
    ] {
        let solid = group(&meshes, Affine::new(DVec3::from_array(at), DVec3::ZERO, DVec3::ONE));
        check(&mut layers, &solid, &camera);
        assert!(layers.found == 0 && layers.depth.iter().all(|d| *d == f32::INFINITY), "{at:?}");
    }
}

#[test]
fn a_mesh_between_the_centres_of_pixels_has_contours_as_soon_as_it_is_there() {
    let camera = Camera::default_for(48, 48);
    let cube = |half: f32, x: f64| {
        let by = Affine::new(DVec3::new(x, 0.0, 0.0), DVec3::ZERO, DVec3::ONE);
        Arc::new(cuboid(Vec3::splat(half)).placed(by).to_mesh().unwrap())
    };
    let mut layers = Layers::default();
    let mut meshes = vec![cube(0.4, -1.0), cube(0.4, 1.0)];
    let others = Contours::drawn(&group(&meshes, Affine::IDENTITY), &camera).len();
    meshes.push(cube(0.02, 0.0));
    // A pixel is 0.09 wide, and four of them meet in the middle. The depth range stays
    // the same.
    for half in [0.02, 0.015, 0.01, 0.025] {
        meshes[2] = cube(half, 0.0);
        check(&mut layers, &group(&meshes, Affine::IDENTITY), &camera);
        assert!(layers.shown[2].area.pixels() == 0 && layers.found > others, "{half}");
    }
}

#[test]
fn flat_meshes_between_the_centres_of_pixels_are_seen_in_the_first_drawing() {
    let camera = Camera::default_for(48, 48);
    // Triangles at one depth: the range of the scene is 0 from the start.
    let flat = |half: f32, x: f32| {
        let corners =
            [[-half, -half], [half, -half], [0.0, half]].map(|[u, v]| Vec3::new(x + u, v, 0.0));
        Arc::new(Mesh::new(corners.to_vec(), vec![[0, 1, 2]], vec![0]).unwrap())
    };
    let meshes = [flat(0.4, -1.0), flat(0.4, 1.0), flat(0.02, 0.0)];
    let mut layers = Layers::default();
    check(&mut layers, &group(&meshes, Affine::IDENTITY), &camera);
    assert_eq!(layers.extent, 0.0);
    assert!(layers.shown[2].area.pixels() == 0 && layers.found > 0);
}

#[test]
fn memory_is_taken_first_from_meshes_that_are_gone() {
    // Each fills the picture: 1.4 MB of depth in the small one, 5.8 MB in the large one.
    let blocks = |count: u32| -> Vec<Arc<Mesh>> {
        let block = |i: u32| cuboid(Vec3::splat(3.0 + 0.01 * i as f32)).to_mesh().unwrap();
        (0..count).map(|i| Arc::new(block(i))).collect()
    };
    let mut layers = Layers::default();
    check(&mut layers, &group(&blocks(20), Affine::IDENTITY), &Camera::default_for(600, 600));
    assert!(layers.slots.iter().all(|slot| slot.mesh.strong_count() == 0));
    let there = group(&blocks(3), Affine::IDENTITY);
    let large = Camera::default_for(1200, 1200);
    check(&mut layers, &there, &large);
    assert!(layers.bytes <= BYTES && layers.slots.len() < 20);
    let before = work::work();
    check(&mut layers, &there, &large);
    assert_eq!((work::work() - before).kept, 3);
}
