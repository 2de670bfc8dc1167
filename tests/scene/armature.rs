//! The shipped body: posed as in its reference implementation at every level of detail;
//! its parts, shapes and derivatives.
//!
//! `data/mocap_poses.csv` holds two poses obtained from mocap.cs.cmu.edu (funded by NSF
//! EIA-0196217), retargeted to the rig.

use crate::shipped;
use glam::{DAffine3, DVec3};
use pcadlang_scene::geom::Affine;
use pcadlang_scene::geom::armature::{Armature, JointPose, Posed, Rules, Stretch, Turn};
use pcadlang_scene::render::{Camera, Contours, View};
use std::collections::HashMap;
use std::sync::Arc;

fn body(lod: &str) -> Arc<Armature> {
    shipped::human(lod).unwrap()
}

fn poses() -> HashMap<String, Vec<JointPose>> {
    let text = include_str!("../data/mocap_poses.csv");
    let numbers =
        |line: &str| line.split(',').skip(5).map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
    let pose = |line: &str| {
        numbers(line).chunks(3).map(|v| JointPose::turned(DVec3::from_slice(v))).collect()
    };
    text.lines().skip(1).map(|l| (l[..4].to_owned(), pose(l))).collect()
}

/// The vertices of a body in a pose, in the order of its positions.
pub fn posed_vertices(body: &Armature, pose: &[JointPose], rules: &Rules) -> Vec<DVec3> {
    let t = body.rig().transforms(pose, rules).unwrap();
    let all = body.positions().iter().zip(body.influences());
    all.map(|(p, i)| i.blend(&t, p.as_dvec3())).collect()
}

/// A slow, plain reference implementation that writes out each step of vertex' = sum w M
/// v, with M[j] = M[parent] T(head) R T(-head).
fn plain(body: &Armature, pose: &[JointPose]) -> Vec<DVec3> {
    let matrix = |j: &JointPose| match j.turn {
        Turn::Vector(v) => glam::DMat3::from_quat(glam::DQuat::from_scaled_axis(v)),
        _ => unreachable!(),
    };
    let mut m: Vec<DAffine3> = Vec::new();
    for (j, p) in body.rig().joints().iter().zip(pose) {
        let own = DAffine3::from_translation(j.head)
            * DAffine3::from_mat3(matrix(p))
            * DAffine3::from_translation(-j.head);
        m.push(j.parent.map_or(own, |up| m[up] * own));
    }
    let moved = |(p, i): (&glam::Vec3, &pcadlang_scene::geom::armature::Influence)| {
        (0..4)
            .map(|k| {
                m[usize::from(i.joints[k])].transform_point3(p.as_dvec3()) * f64::from(i.weights[k])
            })
            .sum()
    };
    body.positions().iter().zip(body.influences()).map(moved).collect()
}

#[test]
fn vertices_and_keypoints_are_where_the_makers_put_them() {
    // From the reference implementation in Python that came with the body, for two
    // captured poses.
    let known = [
        ("p001", "head_top", [0.0271, 1.5550, -0.3005]),
        ("p001", "l_wrist", [0.1562, 1.5884, -0.2086]),
        ("p001", "r_ankle", [-0.0507, 0.2325, 0.4381]),
        ("p500", "head_top", [-0.0165, 1.6618, 0.0487]),
        ("p500", "l_wrist", [0.6017, 1.3501, 0.1756]),
        ("p500", "r_ankle", [-0.2347, 0.1092, -0.0774]),
    ];
    let poses = poses();
    for lod in ["human", "human.lod1", "human.lod2"] {
        let body = body(lod);
        for (pose, name, at) in known {
            let solid = body.posed(&poses[pose], &Rules::default()).unwrap();
            let found = solid.landmarks().iter().find(|l| *l.name == *name).unwrap().position;
            assert!((found - DVec3::from(at)).length() < 2e-4, "{lod} {pose} {name}: {found}");
        }
        for pose in poses.values() {
            let (fast, slow) = (posed_vertices(&body, pose, &Rules::default()), plain(&body, pose));
            assert!(fast.iter().zip(&slow).all(|(a, b)| (*a - *b).length() < 1e-12));
            // The drawn mesh is the same in single precision.
            let solid = body.posed(pose, &Rules::default()).unwrap();
            let mesh = solid.to_mesh().unwrap();
            for p in &mesh.positions {
                let nearest =
                    slow.iter().map(|q| (*q - p.as_dvec3()).length()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 2e-6, "{lod}: {nearest}");
            }
            assert_eq!(mesh.topology.triangles.len(), body.triangles().len());
        }
    }
}

#[test]
fn a_pose_that_differs_in_one_joint_shares_all_other_parts() {
    let body = body("human.lod2");
    let pose = poses()["p500"].clone();
    let rules = Rules::default();
    let (before, posed) = body.posed_after(&pose, &rules, None).unwrap();
    assert!(!before.instances().is_empty(), "meshes are made when they are first needed");
    let hand = body.rig().find("hand_l").unwrap();
    let mut other = pose.clone();
    other[hand] = JointPose::turned(DVec3::new(0.5, 0.2, 0.1));
    let (after, _) = body.posed_after(&other, &rules, Some(&posed)).unwrap();
    let moved = |a: &pcadlang_scene::geom::Solid, b: &pcadlang_scene::geom::Solid| {
        a.instances()
            .iter()
            .zip(b.instances())
            .filter(|(a, b)| !Arc::ptr_eq(&a.mesh, &b.mesh))
            .count()
    };
    // The hand, and the forearm, whose last vertices follow the hand.
    assert!((1..=2).contains(&moved(&before, &after)), "{}", moved(&before, &after));
    let (again, _) = body.posed_after(&pose, &rules, Some(&posed)).unwrap();
    assert_eq!(moved(&before, &again), 0, "the same pose shares all meshes");
    // Sharing does not change results.
    let fresh = body.posed(&other, &rules).unwrap();
    for (a, b) in after.instances().iter().zip(fresh.instances()) {
        assert!(*a.mesh == *b.mesh && !Arc::ptr_eq(&a.mesh, &b.mesh));
    }
}

#[test]
fn incremental_contours_of_a_moving_body_equal_full_ones() {
    let body = body("human.lod2");
    let rules = Rules::default();
    let camera = Camera::default_for(128, 128);
    let place =
        Affine::new(DVec3::new(0.1, -1.8, 0.0), DVec3::new(0.1, 0.4, 0.0), DVec3::splat(2.0));
    let mut state: Option<(Posed, View)> = None;
    let mut pose = poses()["p001"].clone();
    for step in 0..60usize {
        let (joint, back) = ((step * 7) % pose.len(), pose.clone());
        let wave = |a: f64| libm::sin(step as f64 * a);
        pose[joint] = JointPose::turned(DVec3::new(wave(0.7), wave(1.1), wave(1.9)) * 0.6);
        let (before, last) = (state.as_ref().map(|s| &s.0), state.as_ref().map(|s| &s.1));
        let (solid, posed) = body.posed_after(&pose, &rules, before).unwrap();
        let view = View::new(solid.placed(place), camera);
        let view = match last {
            Some(last) => view.after(last),
            None => view,
        };
        let here = view.contours(128);
        let fresh = body.posed(&pose, &rules).unwrap().placed(place);
        assert!(*here == Contours::of(&fresh, &camera), "step {step}");
        state = Some((posed, view));
        assert!(!here.x.is_empty());
        if step % 3 == 0 {
            pose = back;
        }
    }
}

#[test]
fn shapes_add_up_and_move_the_joints() {
    let body = body("human.lod1");
    let height = |b: &Armature| {
        let y = b.positions().iter().map(|p| f64::from(p.y));
        y.clone().fold(f64::MIN, f64::max) - y.fold(f64::MAX, f64::min)
    };
    let tall = body.shaped(&[("tall", 1.0)]).unwrap();
    assert!((height(&tall) - height(&body) - 0.18).abs() < 0.05, "{}", height(&tall));
    let top =
        |b: &Armature| b.rig().keypoints().iter().find(|k| &*k.name == "head_top").unwrap().rest.y;
    assert!((top(&tall) - top(&body) - (height(&tall) - height(&body))).abs() < 0.03);
    let both = body.shaped(&[("tall", 0.5), ("short", 0.5)]).unwrap();
    assert!((height(&both) - height(&body)).abs() < 0.02);
    let e = body.shaped(&[("wide", 1.0)]).unwrap_err().to_string();
    assert_eq!(e, "the body has no morph `wide`; it has male, female, heavy, thin, tall, short");
    assert!(body.shaped(&[("tall", f64::NAN)]).is_err());
}

#[test]
fn stretching_a_bone_moves_what_hangs_on_it() {
    let body = body("human.lod2");
    let at = |name: &str| body.rig().find(name).unwrap();
    let longer = body.stretched(&[(at("thigh_l"), Stretch::Along(1.2))]).unwrap();
    let bone = |b: &Armature, name: &str| {
        let j = &b.rig().joints()[at(name)];
        j.tail - j.head
    };
    let thigh = bone(&body, "thigh_l");
    assert!((bone(&longer, "thigh_l") - thigh * 1.2).length() < 1e-9);
    let ankle =
        |b: &Armature| b.rig().keypoints().iter().find(|k| &*k.name == "l_ankle").unwrap().rest;
    assert!((ankle(&longer) - ankle(&body) - thigh * 0.2).length() < 1e-9, "the calf moves along");
    assert!(
        (bone(&longer, "calf_l") - bone(&body, "calf_l")).length() < 1e-9,
        "and is not stretched"
    );
    for (v, (p, q)) in body.positions().iter().zip(longer.positions()).enumerate() {
        let moved = (*q - *p).as_dvec3();
        let weight = |name| {
            let i = &body.influences()[v];
            i.joints
                .iter()
                .zip(i.weights)
                .filter(|(j, _)| usize::from(**j) == at(name))
                .map(|(_, w)| w)
                .sum::<f32>()
        };
        if weight("calf_l") == 1.0 {
            assert!((moved - thigh * 0.2).length() < 1e-6);
        }
        if weight("thigh_l") + weight("calf_l") + weight("foot_l") + weight("ball_l") == 0.0 {
            assert!(moved.length() < 1e-6, "vertex {v} belongs to others");
        }
    }
    let wide = body.stretched(&[(at("pelvis"), Stretch::Axes(DVec3::new(1.5, 1.0, 1.0)))]).unwrap();
    let hip = |b: &Armature| b.rig().joints()[at("thigh_l")].head;
    assert!(
        (hip(&wide).x - 1.5 * hip(&body).x).abs() < 1e-9
            && (hip(&wide).y - hip(&body).y).abs() < 1e-9
    );
    let e = body.stretched(&[(at("head"), Stretch::Along(0.0))]).unwrap_err().to_string();
    assert_eq!(e, "the stretch of `head` must be positive and finite");
    assert!(body.stretched(&[(99, Stretch::Along(1.0))]).is_err());
}

#[test]
fn derivatives_of_posed_vertices_agree_with_differences() {
    let body = body("human.lod2");
    let mut pose = poses()["p500"].clone();
    let foot = body.rig().find("foot_r").unwrap();
    pose[foot].location = DVec3::new(0.05, 0.02, -0.03);
    let rules = Rules {
        stops: (0..22).map(|j| j == body.rig().find("thigh_r").unwrap()).collect(),
        inherit_scale: false,
    };
    let wave = |i: usize, a: f64| libm::sin(i as f64 * a + 0.5);
    let by_vertex: Vec<DVec3> = (0..body.positions().len())
        .map(|i| DVec3::new(wave(i, 0.3), wave(i, 0.7), wave(i, 1.1)))
        .collect();
    let by_keypoint: Vec<DVec3> =
        (0..body.rig().keypoints().len()).map(|i| DVec3::splat(wave(i, 0.9))).collect();
    let value = |pose: &[JointPose]| -> f64 {
        let v = posed_vertices(&body, pose, &rules);
        let solid = body.posed(pose, &rules).unwrap();
        let points = solid
            .landmarks()
            .iter()
            .zip(&by_keypoint)
            .map(|(l, g)| l.position.dot(*g))
            .sum::<f64>();
        v.iter().zip(&by_vertex).map(|(v, g)| v.dot(*g)).sum::<f64>() + points
    };
    let numbered: Vec<(u32, DVec3)> = (0..).zip(by_vertex.iter().copied()).collect();
    let by_transform = body.transforms_gradient(&numbered, &by_keypoint);
    let gradient = body.rig().transforms_vjp(&pose, &rules, &by_transform).unwrap();
    for j in 0..pose.len() {
        for k in 0..3 {
            let moved = |h: f64| {
                let mut pose = pose.clone();
                match &mut pose[j].turn {
                    Turn::Vector(v) => v[k] += h,
                    _ => unreachable!(),
                }
                value(&pose)
            };
            let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!(
                (gradient[j].turn[k] - numeric).abs() < 1e-5 * (1.0 + numeric.abs()),
                "{j} {k}"
            );
            let pulled = |h: f64| {
                let mut pose = pose.clone();
                pose[j].location[k] += h;
                value(&pose)
            };
            let numeric = (pulled(1e-5) - pulled(-1e-5)) / 2e-5;
            assert!(
                (gradient[j].location[k] - numeric).abs() < 1e-5 * (1.0 + numeric.abs()),
                "{j} {k} location"
            );
        }
    }
}
