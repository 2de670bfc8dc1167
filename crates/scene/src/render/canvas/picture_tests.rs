//! ImageCache against full drawings, bit for bit, and what they skip drawing.

use super::*;
use crate::geom::Affine;
use crate::geom::Mesh;
use crate::render::canvas::layer::camera_bits;
use crate::render::testing::{Uniform, cuboid, lathe, solid, sphere};
use crate::render::{Channels, Frame};
use glam::{DVec3, Vec3};

/// A ball, a box, or an open or closed lathe.
fn shape(random: &mut Uniform) -> Solid {
    let profile = [(0.5, -0.8), (0.7, -0.1), (0.4, 0.6)];
    match (random.next() * 4.0) as u32 {
        0 => sphere(11, 7),
        1 => cuboid(Vec3::new(0.4, 0.9, 0.3)),
        2 => lathe(&profile, 9, false),
        _ => lathe(&profile, 13, true),
    }
}

fn somewhere(random: &mut Uniform, reach: f64, size: f64) -> Affine {
    let mut at =
        |s: f64| DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s));
    Affine::new(at(reach), at(2.0), DVec3::splat(size))
}

/// A picture, and the pieces that a follower of its changes has collected.
struct Followed {
    picture: IncrementalImage,
    /// The same without contours, if that is compared, too.
    depth_alone: Option<IncrementalImage>,
    tools: Tools,
    at: Arc<()>,
    /// The current pieces of the stationary meshes as bits, in some order.
    pieces: Vec<[u32; 5]>,
}

fn bits(c: &Contours) -> Vec<[u32; 5]> {
    (0..c.len())
        .map(|i| [c.x[i], c.y[i], c.tx[i], c.ty[i], c.length[i]].map(f32::to_bits))
        .collect()
}

impl Followed {
    fn new(camera: &Camera) -> Followed {
        Followed {
            picture: IncrementalImage::new(camera_bits(camera), Shows::Contours),
            depth_alone: None,
            tools: Tools::default(),
            at: Arc::default(),
            pieces: Vec::new(),
        }
    }

    /// Draws a solid, and compares the picture and its change with a full drawing.
    /// Returns whether it was drawn incrementally, and whether the change continued from the
    /// last one.
    fn check(&mut self, solid: &Solid, camera: &Camera) -> [bool; 2] {
        let tools = &mut self.tools;
        let alone =
            self.depth_alone.as_mut().map(|alone| (alone.draw(solid, camera, tools), alone));
        let drawn = self.picture.draw(solid, camera, tools);
        let alone = alone.map(|(change, alone)| {
            assert_eq!(change.is_some(), drawn.is_some());
            assert!(change.is_none_or(|change| change.count == 0));
            &*alone
        });
        let Some(change) = drawn else { return [false; 2] };
        let (got, wanted) = (self.picture.contours(camera), Contours::of(solid, camera));
        assert_eq!(bits(&got), bits(&wanted));
        assert_eq!(change.count, wanted.len());
        let depth = Frame::render(solid, camera, Channels::Depth).depth;
        let is_depth = |picture: &IncrementalImage| {
            picture.depth().iter().map(|d| d.to_bits()).eq(depth.iter().map(|d| d.to_bits()))
        };
        assert!(is_depth(&self.picture) && alone.is_none_or(is_depth));
        let follows = Arc::ptr_eq(&self.at, &change.from);
        if follows {
            for removed in bits(&change.removed) {
                let at =
                    self.pieces.iter().position(|p| *p == removed).expect("what goes was there");
                self.pieces.swap_remove(at);
            }
            self.pieces.extend(bits(&change.added));
        } else {
            let moving = bits(&change.moving);
            self.pieces = bits(&got);
            for piece in moving {
                let at = self.pieces.iter().position(|p| *p == piece).expect("what moves is there");
                self.pieces.swap_remove(at);
            }
        }
        let mut sorted = [[&self.pieces[..], &bits(&change.moving)].concat(), bits(&wanted)];
        sorted.iter_mut().for_each(|pieces| pieces.sort_unstable());
        assert_eq!(sorted[0], sorted[1]);
        self.at = change.to;
        [true, follows]
    }
}

#[test]
fn pictures_give_what_is_drawn_at_once() {
    let mut random = Uniform(31);
    let (mut drawn, mut followed) = (0, 0);
    for round in 0..8 {
        let mut camera = Camera::default_for(60 + 7 * round, 96 - 5 * round);
        if round % 3 == 1 {
            let units_per_pixel = 0.05;
            camera.projection =
                crate::render::Projection::Orthographic { units_per_pixel, cx: 30.0, cy: 40.0 };
        } else if round % 3 == 2 {
            // The near plane cuts some meshes.
            camera.eye.z = 1.4;
        }
        let count = 4 + 6 * round as usize;
        let mut solids: Vec<Solid> = (0..count)
            .map(|_| shape(&mut random).placed(somewhere(&mut random, 1.2, 0.25)))
            .collect();
        let moving = 1 + round as usize % 3;
        let shapes: Vec<Solid> = (0..moving).map(|_| shape(&mut random)).collect();
        let mut followers = Followed::new(&camera);
        followers.depth_alone = Some(IncrementalImage::new(camera_bits(&camera), Shows::Depth));
        for step in 0..60 {
            let before = solids.clone();
            // Far, near, and out of the picture; now and then another mesh moves as well.
            let (k, reach) = ((random.next() * moving as f64) as usize, [0.05, 0.8, 3.0][step % 3]);
            solids[k] = shapes[k].placed(somewhere(&mut random, reach, 0.5));
            if step % 20 == 19 {
                solids[count - 1] = shape(&mut random).placed(somewhere(&mut random, 1.0, 0.3));
            }
            let (front, rest) = solids.split_at(moving);
            let nested = [front, &[Solid::group(rest)]].concat();
            let solid = if step % 2 == 0 { Solid::group(&solids) } else { Solid::group(&nested) };
            let [incremental, follows] = followers.check(&solid, &camera);
            drawn += usize::from(incremental);
            followed += usize::from(follows);
            if random.next() < 0.5 {
                solids = before;
            }
        }
    }
    assert!(drawn > 400 && followed > 250, "{drawn} {followed}");
}

#[test]
fn a_scene_that_changes_altogether_is_drawn_in_full() {
    let mut random = Uniform(32);
    let camera = Camera::default_for(48, 48);
    let mut scene = |count: usize| -> Vec<Solid> {
        (0..count).map(|_| shape(&mut random).placed(somewhere(&mut random, 1.0, 0.3))).collect()
    };
    let mut followed = Followed::new(&camera);
    for count in [10, 10, 7, 12, 2] {
        assert!(!followed.check(&Solid::group(&scene(count)), &camera)[0] || count == 2);
    }
    let fixed = scene(8);
    followed.check(&Solid::group(&fixed), &camera);
    assert!(followed.check(&Solid::group(&fixed), &camera)[0], "requested again, it is kept");
    let mut moved = fixed.clone();
    moved[3] = sphere(7, 5);
    assert!(followed.check(&Solid::group(&moved), &camera)[0], "most of it stands still");
    assert!(followed.check(&Solid::group(&moved), &camera)[0], "nothing has moved");
    assert!(!followed.check(&Solid::group(&scene(8)), &camera)[0]);
}

#[test]
fn what_is_outside_or_behind_costs_no_drawing() {
    let camera = Camera::default_for(64, 64);
    let at = |x: f64, z: f64| Affine::new(DVec3::new(x, 0.0, z), DVec3::ZERO, DVec3::splat(0.4));
    let wall = cuboid(Vec3::new(3.0, 3.0, 0.2));
    let floor =
        cuboid(Vec3::new(0.2, 0.2, 4.0)).placed(Affine::new(DVec3::Y, DVec3::ZERO, DVec3::ONE));
    let fixed = Solid::group(&[wall, floor.clone(), floor]);
    let ball = sphere(16, 9);
    let mut followed = Followed::new(&camera);
    let mut took = |place: Affine| {
        let solid = Solid::group(&[fixed.clone(), ball.placed(place)]);
        let before = work::work();
        let change = followed.picture.draw(&solid, &camera, &mut followed.tools);
        let spent = work::work() - before;
        if change.is_some() {
            assert_eq!(
                bits(&followed.picture.contours(&camera)),
                bits(&Contours::of(&solid, &camera))
            );
        }
        spent
    };
    for x in [0.0, 0.1, 0.2] {
        took(at(x, 1.0));
    }
    let seen = took(at(0.3, 1.0));
    assert_eq!((seen.drawn, seen.outside, seen.hidden, seen.kept), (1, 0, 0, 3));
    let outside = took(at(9.0, 1.0));
    assert_eq!((outside.drawn, outside.outside, outside.hidden), (0, 1, 0));
    let behind = took(at(0.0, -1.5));
    assert_eq!((behind.drawn, behind.outside, behind.hidden), (0, 0, 1));
    // It moves out again, and is visible.
    assert_eq!(took(at(0.0, 1.0)).drawn, 1);
    // Around the camera's position, a mesh cannot be known to be hidden: its corners
    // beyond the near plane are not all of it.
    let beam = |x: f64| {
        cuboid(Vec3::new(0.1, 0.1, 6.0)).placed(Affine::new(
            DVec3::new(x, 0.0, 3.0),
            DVec3::ZERO,
            DVec3::ONE,
        ))
    };
    for x in [0.5, 0.6, 0.7] {
        let solid = Solid::group(&[fixed.clone(), beam(x)]);
        followed.picture.draw(&solid, &camera, &mut followed.tools);
        let (seen, wanted) = (followed.picture.contours(&camera), Contours::of(&solid, &camera));
        assert_eq!(bits(&seen), bits(&wanted));
        assert!(wanted.len() > Contours::of(&fixed, &camera).len());
    }
    // A full drawing also skips meshes outside of the picture.
    let before = work::work();
    let lonely = Contours::of(&ball.placed(at(9.0, 1.0)), &camera);
    let spent = work::work() - before;
    assert_eq!((lonely.len(), spent.drawn, spent.outside), (0, 0, 1));
}

#[test]
fn odd_placements_are_as_drawn_at_once() {
    let mut random = Uniform(33);
    let camera = Camera::default_for(64, 48);
    let fixed: Vec<Solid> =
        (0..6).map(|_| shape(&mut random).placed(somewhere(&mut random, 1.0, 0.4))).collect();
    let mut followed = Followed::new(&camera);
    let odd = [
        (DVec3::new(f64::NAN, 0.0, 0.0), 1.0),
        (DVec3::new(0.0, f64::INFINITY, 0.0), 1.0),
        (DVec3::splat(1e300), 1.0),
        (DVec3::new(0.3, 0.0, 8.0), 1.0),
        (DVec3::ZERO, 0.0),
        (DVec3::ZERO, 1e-300),
        (DVec3::ZERO, 1e9),
        (DVec3::new(0.0, 0.0, -1e7), 1e6),
    ];
    let mut drawn = 0;
    for (at, size) in odd.into_iter().cycle().take(24) {
        for place in
            [Affine::new(at, DVec3::ZERO, DVec3::splat(size)), somewhere(&mut random, 0.6, 0.5)]
        {
            let solid = Solid::group(&[&fixed[..], &[sphere(11, 7).placed(place)]].concat());
            drawn += usize::from(followed.check(&solid, &camera)[0]);
        }
    }
    assert!(drawn > 30, "{drawn}");
}

#[test]
fn what_looks_out_from_behind_a_wall_is_seen_on_every_side() {
    let camera = Camera::default_for(64, 64);
    // In the picture the wall extends 15 pixels from the middle, and the ball behind it 5
    // pixels from its centre.
    let (wall, inside) = (cuboid(Vec3::new(1.0, 1.0, 0.2)), cuboid(Vec3::splat(0.1)));
    let fixed = Solid::group(&[wall, inside.clone(), inside]);
    let ball = sphere(16, 9);
    let mut followed = Followed::new(&camera);
    let places =
        [[0.0, 0.0], [0.1, 0.0], [0.0, -0.98], [0.0, 0.98], [-0.98, 0.0], [0.98, 0.0], [0.0, 0.1]];
    for (step, [x, y]) in places.into_iter().enumerate() {
        let by = Affine::new(DVec3::new(x, y, -1.5), DVec3::ZERO, DVec3::splat(0.4));
        let [incremental, _] =
            followed.check(&Solid::group(&[fixed.clone(), ball.placed(by)]), &camera);
        assert_eq!(incremental, step > 0);
        let seen = followed.picture.contours(&camera);
        let beside = seen
            .x
            .iter()
            .zip(&seen.y)
            .any(|(&x, &y)| (x - 32.0).abs().max((y - 32.0).abs()) > 16.0);
        assert_eq!(beside, (2..6).contains(&step), "{x} {y}");
    }
}

#[test]
fn what_only_the_depth_range_decides_is_told_anew_behind_what_stays_as_deep() {
    let camera = Camera::default_for(64, 64);
    let square = |half: f32, x: f32, z: f32| {
        [[-half, -half], [half, -half], [half, half], [-half, half]]
            .map(|[u, v]| Vec3::new(x + u, v, z))
    };
    let flat =
        |half: f32, x: f32, z: f32| solid(square(half, x, z).to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    // In the middle at depth 8, and on both sides at 7, the least depth.
    let fixed = Solid::group(&[flat(0.3, 0.0, 0.0), flat(0.2, 1.6, 1.0), flat(0.2, -1.6, 1.0)]);
    // A shield, and behind it the farthest square: stretching leaves the shield in place.
    let corners = [square(1.0, 0.0, 0.0), square(0.1, 0.0, -1.0)].concat();
    let shield = solid(corners, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]);
    // The shield is nearer than the middle by this much, and hides it where 0.006 of the
    // depth range plus 1e-6 of the depth is less.
    let nearer = 0.006 * 2.0045 + 8e-6;
    let mut followed = Followed::new(&camera);
    for (step, range) in [1.8, 2.0, 2.009, 2.0, 2.009].into_iter().enumerate() {
        let stretched = DVec3::new(1.0, 1.0, range - 1.0 + nearer);
        let by = Affine::new(DVec3::new(0.0, 0.0, nearer), DVec3::ZERO, stretched);
        let drawn = followed.check(&Solid::group(&[fixed.clone(), shield.placed(by)]), &camera);
        assert_eq!(drawn, [step > 0, step > 1]);
        let seen = followed.picture.contours(&camera);
        let middle =
            seen.x.iter().zip(&seen.y).any(|(&x, &y)| (x - 32.0).abs().max((y - 32.0).abs()) < 8.0);
        assert_eq!(middle, step > 0 && range > 2.0045, "{range}");
    }
}

fn part(random: &mut Uniform) -> Arc<Mesh> {
    let place = somewhere(random, 1.0, 0.4);
    Arc::new(shape(random).placed(place).to_mesh().unwrap())
}

fn group(meshes: &[Arc<Mesh>], by: Affine) -> Solid {
    let solids: Vec<_> = meshes.iter().map(|m| Solid::new(m.clone())).collect();
    Solid::group(&solids).placed(by)
}

#[test]
fn meshes_that_move_by_turns_are_as_drawn_at_once() {
    let mut random = Uniform(21);
    let mut incremental = 0;
    for round in 0..10 {
        let mut camera = Camera::default_for(40 + 7 * round, 96 - 5 * round);
        if round % 3 == 2 {
            camera.eye.z = 0.4;
        }
        let mut followed = Followed::new(&camera);
        let mut meshes: Vec<_> = (0..2 + round).map(|_| part(&mut random)).collect();
        let mut by = Affine::IDENTITY;
        for step in 0..50 {
            let before = (meshes.clone(), by);
            if step % 10 == 9 {
                let turn = DVec3::new(random.next(), random.next(), 0.3);
                let shift = DVec3::new(0.2, 0.1, random.next());
                by = Affine::new(shift, turn, DVec3::new(-1.0, 1.0, 1.2));
            }
            for _ in 0..1 + step % 3 {
                let at = (random.next() * meshes.len() as f64) as usize;
                meshes[at] = part(&mut random);
            }
            if step % 17 == 16 {
                meshes.push(part(&mut random));
            }
            incremental += usize::from(followed.check(&group(&meshes, by), &camera)[0]);
            if random.next() < 0.5 {
                (meshes, by) = before;
                incremental += usize::from(followed.check(&group(&meshes, by), &camera)[0]);
            }
        }
    }
    assert!(incremental > 400, "{incremental}");
}

#[test]
fn what_did_not_move_is_not_drawn_again() {
    let mut random = Uniform(22);
    let camera = Camera::default_for(64, 64);
    let mut followed = Followed::new(&camera);
    let mut meshes: Vec<_> = (0..22).map(|_| part(&mut random)).collect();
    let mut took = |meshes: &[Arc<Mesh>], by: Affine| {
        let before = work::work();
        let drawn = followed.picture.draw(&group(meshes, by), &camera, &mut followed.tools);
        (drawn.is_some(), (work::work() - before).drawn)
    };
    // All move by turns, then one by one and back.
    for i in 0..44 {
        meshes[i % 22] = part(&mut random);
        took(&meshes, Affine::IDENTITY);
    }
    for i in 0..300 {
        let old = std::mem::replace(&mut meshes[i % 22], part(&mut random));
        assert_eq!(took(&meshes, Affine::IDENTITY), (true, 1));
        meshes[i % 22] = old;
    }
    assert_eq!(took(&meshes, Affine::IDENTITY), (true, 0));
    // A placement of the whole that is not kept leaves the picture as it is.
    let by = Affine::new(DVec3::new(0.0, 1e-12, 0.0), DVec3::ZERO, DVec3::ONE);
    assert!(!took(&meshes, by).0);
    assert_eq!(took(&meshes, Affine::IDENTITY), (true, 0));
    // One that is requested again is shown.
    assert_eq!(took(&meshes, by), (true, 22));
    meshes[4] = part(&mut random);
    assert_eq!(took(&meshes, by), (true, 1));
}

#[test]
fn meshes_that_rest_for_long_count_as_stationary_again() {
    let mut random = Uniform(26);
    let camera = Camera::default_for(48, 48);
    let mut followed = Followed::new(&camera);
    let mut meshes: Vec<_> = (0..6).map(|_| part(&mut random)).collect();
    for i in 0..12 {
        meshes[i % 6] = part(&mut random);
        followed.check(&group(&meshes, Affine::IDENTITY), &camera);
    }
    assert_eq!(followed.picture.dynamic.len(), 6);
    let pair = [part(&mut random), part(&mut random)];
    for i in 0..2 * PATIENCE as usize {
        meshes[1] = pair[i % 2].clone();
        followed.picture.draw(&group(&meshes, Affine::IDENTITY), &camera, &mut followed.tools);
    }
    assert_eq!(followed.picture.dynamic.len(), 1);
    meshes[1] = part(&mut random);
    assert!(followed.check(&group(&meshes, Affine::IDENTITY), &camera)[0]);
}

#[test]
fn what_would_need_too_much_memory_is_drawn_in_full() {
    let mut random = Uniform(24);
    let camera = Camera::default_for(2000, 2000);
    let mut followed = Followed::new(&camera);
    let mut meshes: Vec<_> = (0..5).map(|_| part(&mut random)).collect();
    let drawn: Vec<bool> = (0..6)
        .map(|i| {
            meshes[i % 5] = part(&mut random);
            let solid = group(&meshes, Affine::IDENTITY);
            followed.picture.draw(&solid, &camera, &mut followed.tools).is_some()
        })
        .collect();
    assert_eq!(drawn, [false, true, true, false, false, true]);
}

#[test]
fn what_cannot_be_seen_leaves_an_empty_picture() {
    let camera = Camera::default_for(48, 48);
    let mut random = Uniform(25);
    let mut meshes: Vec<_> = (0..4).map(|_| part(&mut random)).collect();
    for at in [
        [0.0, 0.0, 30.0],
        [90.0, 0.0, 0.0],
        [0.0, -90.0, 0.0],
        [f64::NAN, 0.0, 0.0],
        [0.0, 0.0, -1e12],
    ] {
        let by = Affine::new(DVec3::from_array(at), DVec3::ZERO, DVec3::ONE);
        let mut followed = Followed::new(&camera);
        followed.check(&group(&meshes, by), &camera);
        meshes[2] = part(&mut random);
        assert!(followed.check(&group(&meshes, by), &camera)[0]);
        let picture = &followed.picture;
        assert!(picture.count == 0 && picture.depth.iter().all(|d| *d == f32::INFINITY), "{at:?}");
    }
}

#[test]
fn a_mesh_between_the_centres_of_pixels_has_contours_as_soon_as_it_is_there() {
    let camera = Camera::default_for(48, 48);
    let cube = |half: f32, x: f64| {
        let by = Affine::new(DVec3::new(x, 0.0, 0.0), DVec3::ZERO, DVec3::ONE);
        Arc::new(cuboid(Vec3::splat(half)).placed(by).to_mesh().unwrap())
    };
    let mut followed = Followed::new(&camera);
    let mut meshes = vec![cube(0.4, -1.0), cube(0.4, 1.0)];
    let others = Contours::of(&group(&meshes, Affine::IDENTITY), &camera).len();
    meshes.push(cube(0.02, 0.0));
    // A pixel is 0.09 wide, and four of them meet in the middle. The depth range stays
    // the same.
    for (step, half) in [0.03, 0.02, 0.015, 0.01, 0.025].into_iter().enumerate() {
        meshes[2] = cube(half, 0.0);
        let drawn = followed.check(&group(&meshes, Affine::IDENTITY), &camera)[0];
        assert_eq!(drawn, step > 0);
        if let Some(mesh) = followed.picture.dynamic.first() {
            assert!(mesh.now.layer.area.pixels() == 0 && followed.picture.count > others, "{half}");
        }
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
    let mut meshes = [flat(0.4, -1.0), flat(0.4, 1.0), flat(0.03, 0.0)];
    let mut followed = Followed::new(&camera);
    followed.check(&group(&meshes, Affine::IDENTITY), &camera);
    meshes[2] = flat(0.02, 0.0);
    assert!(followed.check(&group(&meshes, Affine::IDENTITY), &camera)[0]);
    assert_eq!(followed.picture.extent, 0.0);
    let mesh = &followed.picture.dynamic[0];
    assert!(mesh.now.layer.area.pixels() == 0 && !mesh.seen.is_empty());
}
