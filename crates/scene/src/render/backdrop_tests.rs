//! Backdrops against full drawings, bit for bit, and what they skip drawing.

use super::*;
use crate::geom::Affine;
use crate::render::testing::{Uniform, cuboid, lathe, solid, sphere};
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

/// A backdrop, and the pieces that a follower of its changes has collected.
struct Followed {
    backdrop: Backdrop,
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
            backdrop: Backdrop::new(camera),
            tools: Tools::default(),
            at: Arc::default(),
            pieces: Vec::new(),
        }
    }

    /// Draws a solid, and compares the picture and its change with a full drawing.
    /// Returns whether the backdrop drew it, and whether the change continued from the
    /// last one.
    fn check(&mut self, solid: &Solid, camera: &Camera) -> [bool; 2] {
        let Some(change) = self.backdrop.draw(solid, camera, &mut self.tools) else {
            return [false; 2];
        };
        let (got, wanted) = (self.backdrop.contours(camera), Contours::drawn(solid, camera));
        assert_eq!(bits(&got), bits(&wanted));
        assert_eq!(change.count, wanted.len());
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
fn backdrops_give_what_is_drawn_at_once() {
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
            let [by_backdrop, follows] = followers.check(&solid, &camera);
            drawn += usize::from(by_backdrop);
            followed += usize::from(follows);
            if random.next() < 0.5 {
                solids = before;
            }
        }
    }
    assert!(drawn > 400 && followed > 250, "{drawn} {followed}");
}

#[test]
fn a_scene_that_changes_altogether_is_drawn_in_another_way() {
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
    assert!(
        !followed.check(&Solid::group(&fixed), &camera)[0],
        "asked for again, it is still better drawn so"
    );
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
        let change = followed.backdrop.draw(&solid, &camera, &mut followed.tools);
        let spent = work::work() - before;
        if change.is_some() {
            assert_eq!(
                bits(&followed.backdrop.contours(&camera)),
                bits(&Contours::drawn(&solid, &camera))
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
        followed.backdrop.draw(&solid, &camera, &mut followed.tools);
        let (seen, wanted) =
            (followed.backdrop.contours(&camera), Contours::drawn(&solid, &camera));
        assert_eq!(bits(&seen), bits(&wanted));
        assert!(wanted.len() > Contours::drawn(&fixed, &camera).len());
    }
    // A full drawing also skips meshes outside of the picture.
    let before = work::work();
    let lonely = Contours::drawn(&ball.placed(at(9.0, 1.0)), &camera);
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
        let [by_backdrop, _] =
            followed.check(&Solid::group(&[fixed.clone(), ball.placed(by)]), &camera);
        assert_eq!(by_backdrop, step > 0);
        let seen = followed.backdrop.contours(&camera);
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
        let seen = followed.backdrop.contours(&camera);
        let middle =
            seen.x.iter().zip(&seen.y).any(|(&x, &y)| (x - 32.0).abs().max((y - 32.0).abs()) < 8.0);
        assert_eq!(middle, step > 0 && range > 2.0045, "{range}");
    }
}
