//! What the GPU draws against what the CPU draws. Without a GPU these tests say so and
//! pass: nothing needs one.

mod scenes;

use glam::DVec3;
use pcadlang_gpu::{ContourBatch, Cores, Gpu, Scene};
use pcadlang_scene::geom::{Affine, Caps, Solid, cuboid, sphere};
use pcadlang_scene::render::{Camera, Projection};
use pcadlang_scene::vision::{Chamfer, ChamferOptions, ContourMap};
use scenes::{Difference, Spread, compare};
use std::error::Error;
use std::sync::Arc;

type Tested = Result<(), Box<dyn Error>>;

/// The stated tolerance, in pixels, and the fraction of the length.
const NEAR: f32 = 0.02;
const ALONE: f64 = 0.005;

fn gpu() -> Option<Gpu> {
    match Gpu::new() {
        Ok(gpu) => Some(gpu),
        Err(why) => {
            println!("skipped: {why}");
            None
        }
    }
}

/// Draws with both, and checks the difference.
fn check(gpu: &Gpu, what: &str, scenes: &[Scene], near: f32, alone: f64) -> Difference {
    let before = gpu.drawn_by_cpu();
    let (ours, wanted) = (gpu.contours(scenes), Cores::new(0).contours(scenes));
    assert_eq!((gpu.drawn_by_cpu() - before, gpu.error()), (0, None), "{what}");
    assert_eq!((ours.len(), &ours.sizes), (wanted.len(), &wanted.sizes));
    assert!(wanted.x.len() > 10 * scenes.len(), "{what}: {} pieces", wanted.x.len());
    let difference = compare(&ours, &wanted, near);
    println!("{what} on {}: {:.5} of the length, {difference:?}", gpu.name(), difference.share());
    assert!(difference.share() < alone, "{what}: {difference:?}");
    difference
}

#[test]
fn meshes_are_drawn_as_on_the_cpu() -> Tested {
    let Some(gpu) = gpu() else { return Ok(()) };
    let solid = |i: usize| -> Result<Solid, Box<dyn Error>> {
        Ok(match i % 6 {
            0 => scenes::lathe(i as u64, 40, 0.0, Caps::Both)?,
            1 => scenes::lathe(i as u64, 24, 0.0, Caps::Bottom)?,
            2 => scenes::lathe(i as u64, 64, 0.05, Caps::Bottom)?,
            3 => Solid::new(Arc::new(cuboid(DVec3::new(1.1, 1.4, 0.9))?)),
            4 => Solid::new(Arc::new(sphere(0.8, 48)?)),
            _ => {
                let ball = Solid::new(Arc::new(sphere(0.4, 32)?));
                let box_ = Solid::new(Arc::new(cuboid(DVec3::new(1.6, 0.3, 0.5))?));
                let lathe = scenes::lathe(3, 32, 0.0, Caps::Top)?;
                let there = Affine::new(DVec3::new(0.4, 0.2, 0.5), DVec3::ZERO, DVec3::ONE);
                Solid::group(&[ball.placed(there), box_, lathe])
            }
        })
    };
    let place = |i: usize, random: &mut Spread| Ok(solid(i)?.placed(random.placement()));
    for size in [64, 128, 200] {
        check(&gpu, &format!("meshes at {size}"), &scenes::scenes(120, size, place)?, NEAR, ALONE);
    }
    // Mirrored, by a parallel projection, in a picture that is not square.
    let mut odd = scenes::scenes(48, 100, |i, random| {
        let mirror = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(-1.0, 1.0, 1.0));
        Ok(solid(i)?.placed(mirror).placed(random.placement()))
    })?;
    for scene in &mut odd {
        let projection = Projection::Orthographic { units_per_pixel: 0.03, cx: 70.0, cy: 40.0 };
        scene.camera = Camera { projection, ..Camera::default_for(141, 90) };
    }
    check(&gpu, "parallel", &odd, NEAR, ALONE);
    Ok(())
}

#[test]
fn bodies_are_drawn_as_on_the_cpu() -> Tested {
    let Some(gpu) = gpu() else { return Ok(()) };
    let body = scenes::human()?;
    let scenes = scenes::scenes(32, 128, |_, random| scenes::posed(&body, random))?;
    check(&gpu, "bodies", &scenes, NEAR, ALONE);
    Ok(())
}

#[test]
fn surfaces_of_revolution_are_near_their_closed_form() -> Tested {
    let Some(gpu) = gpu() else { return Ok(()) };
    let kinds = [(0.0, Caps::Both), (0.0, Caps::Bottom), (0.05, Caps::Bottom), (0.0, Caps::None)];
    let scenes = scenes::scenes(64, 128, |i, random| {
        let (wall, caps) = kinds[i % 4];
        Ok(scenes::lathe(i as u64, 0, wall, caps)?.placed(random.placement()))
    })?;
    // Pieces are divided otherwise, so their middles differ by half a piece along the
    // contour.
    check(&gpu, "surfaces of revolution", &scenes, 0.8, 0.03);
    // The mesh of as many sides is what is drawn.
    let meshes: Vec<Scene> = scenes
        .iter()
        .map(|s| Scene { solid: Solid::of(s.solid.instances().into()), ..s.clone() })
        .collect();
    let (ours, wanted) = (gpu.contours(&scenes), Cores::new(0).contours(&meshes));
    let difference = compare(&ours, &wanted, NEAR);
    println!("their meshes: {:.5}, {difference:?}", difference.share());
    assert!(difference.share() < ALONE, "{difference:?}");
    Ok(())
}

#[test]
fn scenes_do_not_depend_on_others_and_the_cpu_draws_what_is_left() -> Tested {
    let Some(gpu) = gpu() else { return Ok(()) };
    let mut scenes = scenes::scenes(40, 96, |i, random| {
        Ok(scenes::lathe(i as u64 % 3, 32, 0.0, Caps::Both)?.placed(random.placement()))
    })?;
    // Behind the camera, around it, far away, in a large picture, without a picture.
    let moved =
        |z: f64, scale: f64| Affine::new(DVec3::new(0.0, 0.0, z), DVec3::ZERO, DVec3::splat(scale));
    scenes[3].solid = scenes[3].solid.placed(moved(20.0, 1.0));
    scenes[4].solid = scenes[4].solid.placed(moved(7.5, 1.0));
    scenes[5].solid = scenes[5].solid.placed(moved(0.0, 1e200));
    scenes[6].solid = scenes[6].solid.placed(moved(f64::NAN, 1.0));
    scenes[7].camera = Camera::default_for(500, 400);
    scenes[8].solid = Solid::group(&[]);
    let all = gpu.contours(&scenes);
    assert_eq!(gpu.drawn_by_cpu(), 5, "all but the empty scene");
    let cpu = Cores::new(0).contours(&scenes);
    for i in 3..=8 {
        assert_eq!(all.scene(i), cpu.scene(i), "{i}");
    }
    assert!(compare(&all, &cpu, NEAR).share() < ALONE);
    assert_eq!(gpu.contours(&scenes), all, "again");
    for i in [0, 4, 9, 39] {
        assert_eq!(gpu.contours(&scenes[i..=i]).scene(0), all.scene(i), "{i} alone");
    }
    assert_eq!(gpu.contours(&[]), ContourBatch::default());
    Ok(())
}

#[test]
fn scores_are_those_of_the_contours() -> Tested {
    let Some(gpu) = gpu() else { return Ok(()) };
    let mut scenes = scenes::scenes(64, 128, |i, random| {
        Ok(scenes::lathe(i as u64, 40, 0.0, Caps::Both)?.placed(random.placement()))
    })?;
    scenes[5].solid =
        scenes[5].solid.placed(Affine::new(DVec3::new(0.0, 0.0, 50.0), DVec3::ZERO, DVec3::ONE));
    let contours = gpu.contours(&scenes);
    let map = ContourMap::of(&contours.scene(0));
    let options = [
        ChamferOptions::default(),
        ChamferOptions { truncate: Some(2.0), oriented: Some(3.0), ..ChamferOptions::default() },
        ChamferOptions { symmetric: true, ..ChamferOptions::default() },
    ];
    for options in options {
        let chamfer = Chamfer::prepare(&map, 128, 128, &options)?;
        let scores = gpu.log_likelihoods(&scenes, &chamfer);
        for (i, score) in scores.iter().enumerate() {
            let wanted = chamfer.log_likelihood(&contours.scene(i));
            let near = (score - wanted).abs() <= 1e-4 * (1.0 + wanted.abs());
            assert!(near, "{i}: {score} {wanted} {options:?}");
        }
        assert!(scores[0] > scores[1], "{scores:?}");
        assert_eq!(gpu.log_likelihoods(&scenes, &chamfer), scores);
    }
    Ok(())
}

#[test]
fn batches_follow_each_other_and_find_room() -> Tested {
    let Some(gpu) = gpu() else { return Ok(()) };
    // Boxes for more than one batch, then bodies, which have many more pieces than boxes.
    let cube = Solid::new(Arc::new(cuboid(DVec3::ONE)?));
    let place = |_, random: &mut Spread| Ok(cube.placed(random.placement()));
    let mut scenes = scenes::scenes(2100, 32, place)?;
    let body = scenes::human()?;
    let bodies = scenes::scenes(6, 128, |_, random| scenes::posed(&body, random))?;
    scenes.extend(bodies.iter().cloned());
    scenes.extend(scenes[..3].to_vec());
    let difference = check(&gpu, "batches", &scenes, NEAR, ALONE);
    assert!(difference.pieces > 0);
    let all = gpu.contours(&scenes);
    assert_eq!(all.scene(2106), all.scene(0));
    assert_eq!(gpu.contours(&bodies).scene(5), all.scene(2105));
    let map = ContourMap::of(&all.scene(0));
    let chamfer = Chamfer::prepare(&map, 32, 32, &ChamferOptions::default())?;
    let scores = gpu.log_likelihoods(&scenes[..2100], &chamfer);
    let same = (0..2100).filter(|&i| {
        let wanted = chamfer.log_likelihood(&all.scene(i));
        (scores[i] - wanted).abs() <= 1e-4 * (1.0 + wanted.abs())
    });
    assert_eq!(same.count(), 2100);
    Ok(())
}
