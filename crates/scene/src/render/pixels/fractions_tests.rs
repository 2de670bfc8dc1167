//! Tests of the fractions of pixels that a solid covers.

use super::*;
use crate::geom::armature::{Armature, JointPose, Posed, Rules, rig_from_json};
use crate::geom::obj;
use crate::render::pixels::project::project;
use crate::render::testing::{Uniform, cuboid, sphere};
use crate::render::{Channels, View};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

/// Fractions from a picture with `by` times as many pixels in both directions.
fn by_pixels(solid: &Solid, camera: &Camera, by: u32) -> Vec<f64> {
    let finer = camera.finer(by);
    let frame = Frame::render(solid, &finer, Channels::Depth);
    let mask: Vec<bool> = frame.mask().collect();
    let (width, by) = (camera.width as usize, by as usize);
    let count = |p: usize| {
        let (i, j) = (p % width * by, p / width * by);
        let row = |j: usize| (i..i + by).filter(|i| mask[j * width * by + i]).count();
        (j..j + by).map(row).sum::<usize>() as f64 / (by * by) as f64
    };
    (0..camera.pixels()).map(count).collect()
}

fn values(samples: &Samples) -> Arc<[f32]> {
    samples.count(&mut RowLists::default()).0
}

/// Fractions from all sides of all faces that are drawn.
fn by_faces(solid: &Solid, camera: &Camera) -> Arc<[f32]> {
    let mut samples = Samples::none(camera.width as usize, camera.height as usize);
    let mut projected = Projected::default();
    project(solid, camera, &mut projected);
    for (i, item) in solid.instances().iter().enumerate() {
        let back = back_of(&item.mesh, &Placement::new(camera, &item.affine), true);
        for corners in &item.mesh.topology.triangles {
            let points = corners.map(|v| projected.mesh(i).point(v));
            if clockwise(points.each_ref().map(place)) * back <= 0.0 {
                samples.add(&points);
            }
        }
    }
    values(&samples)
}

#[test]
fn triangles_that_share_edges_lose_no_sample_between_them() {
    let mut samples = Samples::none(7, 5);
    let point = |x: f64, y: f64| Point { x, y, nearness: 1.0 };
    let middle = point(3.137, 2.211);
    let around = [(-1.0, -2.0), (3.3, -2.5), (9.0, -1.0), (8.0, 6.5), (2.1, 7.0), (-3.0, 5.5)];
    let around = around.map(|(x, y)| point(x, y));
    for i in 0..6 {
        samples.add(&[around[i], middle, around[(i + 1) % 6]]);
    }
    assert!(values(&samples).iter().all(|f| *f == 1.0));
    let mut nothing = Samples::none(7, 5);
    nothing.add(&[point(f64::NAN, 1.0), point(2.0, 2.0), point(1.0, 4.0)]);
    nothing.add(&[point(1.0, 1.0), point(2.0, 1.0), point(5.0, 1.0)]);
    nothing.add(&[point(1e300, 1.0), point(1e300, 3.0), point(2e300, 2.0)]);
    assert!(values(&nothing).iter().all(|f| *f == 0.0));
}

#[test]
fn what_stays_is_taken_from_before() {
    let camera = Camera::default_for(40, 30);
    let at = |x: f64| Affine::new(DVec3::new(x, 0.1, 0.2), DVec3::splat(0.3), DVec3::ONE);
    let (ball, block) = (sphere(24, 12), cuboid(Vec3::new(1.4, 1.0, 0.8)).placed(at(0.4)));
    let scene = |x: f64| Solid::group(&[ball.placed(at(x)), block.clone()]);
    let before = Fractions::of(&scene(-0.5), &camera, None).unwrap();
    let gain = |pixel: usize| (pixel % 7) as f64 - 2.0;
    for x in [-0.5, -0.3, 3.0, 90.0] {
        let solid = scene(x);
        let [fresh, next] = [None, Some(&before)].map(|b| Fractions::of(&solid, &camera, b));
        let (fresh, next) = (fresh.unwrap(), next.unwrap());
        assert_eq!(fresh.values, next.values);
        assert_eq!(fresh.vjp(&solid, &camera, gain), next.vjp(&solid, &camera, gain));
        let outline = before.outline.as_ref().unwrap();
        let kept: Vec<bool> = solid
            .instances()
            .iter()
            .enumerate()
            .map(|(i, item)| {
                let first = next.outline.as_ref().unwrap().meshes[i].first;
                outline.same(i, item, first).is_some()
            })
            .collect();
        assert_eq!(kept, [x == -0.5, true]);
    }
    let other = Camera::default_for(40, 40);
    let [fresh, next] =
        [None, Some(&before)].map(|b| Fractions::of(&scene(-0.5), &other, b).unwrap().values);
    assert_eq!(fresh, next);
}

/// A body is followed as one mesh, from the pose before where parts stay; its parts' meshes cover
/// the same, and change as it does.
#[test]
fn a_body_covers_what_its_parts_do() {
    const RIG: &[u8] = include_bytes!("../../../../../programs/std/human/human.lod2.rig.json");
    const MESH: &[u8] = include_bytes!("../../../../../programs/std/human/human.lod2.obj");
    let (rig, mesh) = (rig_from_json(RIG).unwrap(), obj::indexed(MESH).unwrap());
    let (positions, triangles) = (mesh.positions, mesh.triangles);
    let body = Arc::new(Armature::new(rig.rig, positions, triangles, rig.influences).unwrap());
    let camera = Camera::default_for(30, 40);
    let place =
        Affine::new(DVec3::new(0.2, -1.7, 0.0), DVec3::new(0.1, 0.8, 0.0), DVec3::splat(2.0));
    let gain = |pixel: usize| (pixel % 7) as f64 - 2.0;
    let mut pose = vec![JointPose::REST; body.rig().joints().len()];
    let mut random = Uniform(7);
    let mut before = None::<(Fractions, Posed)>;
    for round in 0..40 {
        let joint = (random.next() * pose.len() as f64) as usize;
        pose[joint] = JointPose::turned(DVec3::from_array([(); 3].map(|()| random.next() - 0.5)));
        let was = before.as_ref().map(|(_, posed)| posed);
        let (solid, posed) = body.posed_after(&pose, &Rules::default(), was).unwrap();
        let solid = solid.placed(place);
        let next = Fractions::of(&solid, &camera, before.as_ref().map(|(f, _)| f)).unwrap();
        let fresh = Fractions::of(&solid, &camera, None).unwrap();
        assert_eq!(next.values, by_faces(&solid, &camera), "round {round}");
        assert_eq!(next.values, fresh.values);
        let by_vertex = next.vjp(&solid, &camera, gain).unwrap();
        assert_eq!(by_vertex, fresh.vjp(&solid, &camera, gain).unwrap());
        let meshes = Solid::of(solid.instances().into());
        let of_meshes = Fractions::of(&meshes, &camera, None).unwrap();
        assert_eq!(next.values, of_meshes.values);
        let by_parts = of_meshes.vjp(&meshes, &camera, gain).unwrap();
        let [own, other] = [&by_vertex, &by_parts].map(|by| {
            let mut all = vec![DVec3::ZERO; body.positions().len()];
            body.vjp_parts(by).into_iter().for_each(|(v, by)| all[v as usize] += by);
            all
        });
        // Where a part's end and the outline cross a row at one sample, either moves it.
        let apart = own.iter().zip(&other).map(|(own, other)| (*own - *other).length());
        let size: f64 = own.iter().map(|by| by.length()).sum();
        let most = apart.clone().sum::<f64>() / size;
        let count = apart.filter(|apart| *apart > 1e-12 * size).count();
        assert!(most < 0.02 && 10 * count < by_vertex.len(), "{most} {count}");
        let edges = [&next, &of_meshes].map(|f| f.outline.as_ref().unwrap().edges.len());
        assert!(edges[0] > 50 && 3 * edges[0] < 2 * edges[1], "{edges:?}");
        before = Some((next, posed));
    }
}

#[test]
fn large_pictures_take_bounded_memory() {
    let camera = Camera::default_for(1200, 1200);
    assert!(Fractions::of(&sphere(24, 12), &camera, None).is_none());
    let view = View::new(sphere(24, 12), camera);
    let mask: Vec<f32> = view.depth(1200).mask().map(|m| f32::from(u8::from(m))).collect();
    assert_eq!(view.fractions(1200)[..], mask[..]);
    assert!(view.vjp_fractions(1200, |_| 1.0).iter().any(|(_, g)| g.x != 0.0));
}

proptest! {
    #[test]
    fn fractions_are_those_of_a_finer_picture(
        place in prop::array::uniform3(-1.2f64..1.2),
        turn in prop::array::uniform3(-3.0f64..3.0),
        distance in prop_oneof![Just(0.0), Just(6.9), Just(7.6)],
    ) {
        let camera = Camera::default_for(20, 15);
        let by = Affine::new(
            DVec3::from(place) + distance * DVec3::Z, DVec3::from(turn), DVec3::ONE);
        for solid in [sphere(24, 12), cuboid(Vec3::new(1.4, 1.0, 0.8))] {
            let solid = solid.placed(by);
            let own = View::new(solid.clone(), camera).fractions(20);
            if distance == 0.0 {
                prop_assert_eq!(&own, &by_faces(&solid, &camera));
                let mirror = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(-1.0, 1.0, 1.0));
                let mirrored = solid.placed(mirror);
                let other = View::new(mirrored.clone(), camera).fractions(20);
                prop_assert_eq!(&other, &by_faces(&mirrored, &camera));
                let far = other.chunks(20).flat_map(|row| row.iter().rev()).zip(own.iter());
                let far = far.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                prop_assert!(far < 0.02, "{far}");
            }
            let finer = by_pixels(&solid, &camera, 32);
            let far = own.iter().zip(&finer).map(|(a, b)| (f64::from(*a) - b).abs());
            let worst = far.fold(0.0, f64::max);
            // Rows of samples are a quarter of a pixel high. Along a straight edge all differences
            // may have one sign, so those of whole pictures have no lower bound.
            prop_assert!(worst <= 0.13, "{worst}");
        }
    }
}
