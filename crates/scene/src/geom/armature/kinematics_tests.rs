//! Tests of kinematics: exact cases, continuity, and derivatives against finite
//! differences.

use super::super::rig::NamedJoint;
use super::super::{Turn, rig::Rig};
use super::*;

/// A root with two chains: spine -> neck -> head, and hip -> knee -> foot.
fn rig() -> Rig {
    let j = |name: &str, parent: Option<&str>, head: [f64; 3]| NamedJoint {
        name: name.into(),
        parent: parent.map(Into::into),
        head: head.into(),
        tail: DVec3::from(head) + DVec3::Y,
    };
    Rig::new(vec![
        j("root", None, [0.0, 1.0, 0.0]),
        j("spine", Some("root"), [0.0, 1.3, 0.05]),
        j("neck", Some("spine"), [0.0, 1.8, 0.0]),
        j("head", Some("neck"), [0.02, 2.1, 0.1]),
        j("hip", Some("root"), [0.2, 0.9, 0.0]),
        j("knee", Some("hip"), [0.25, 0.5, 0.1]),
        j("foot", Some("knee"), [0.25, 0.1, 0.0]),
    ])
    .unwrap()
}

fn some_pose(k: f64) -> Vec<JointPose> {
    let wave = |i: usize, a: f64| libm::sin(k + a * (i as f64 + 1.3));
    (0..7)
        .map(|i| JointPose {
            location: DVec3::new(wave(i, 1.1), wave(i, 2.3), wave(i, 3.7)) * 0.15,
            turn: match i % 2 {
                0 => Turn::Vector(DVec3::new(wave(i, 0.7), wave(i, 1.7), wave(i, 2.9))),
                _ => Turn::Angles(DVec3::new(wave(i, 0.9), wave(i, 1.9), wave(i, 3.1))),
            },
            scale: DVec3::new(
                1.0 + 0.2 * wave(i, 0.3),
                1.0 + 0.2 * wave(i, 0.4),
                1.0 + 0.2 * wave(i, 0.5),
            ),
        })
        .collect()
}

fn heads(rig: &Rig, t: &[DAffine3]) -> Vec<DVec3> {
    rig.joints().iter().zip(t).map(|(j, t)| t.transform_point3(j.head)).collect()
}

#[test]
fn the_rest_is_the_identity() {
    let rig = rig();
    for t in rig.transforms(&[JointPose::REST; 7], &Rules::default()).unwrap() {
        assert!((t.matrix3 - DMat3::IDENTITY).to_cols_array().iter().all(|x| *x == 0.0));
        assert!(t.translation.length() < 1e-15);
    }
    // Without locations, handles have no effect, whatever the stops.
    let still: Vec<JointPose> =
        some_pose(0.4).iter().map(|p| JointPose { location: DVec3::ZERO, ..*p }).collect();
    let all = Rules { stops: vec![true; 7], ..Rules::default() };
    assert_eq!(
        rig.transforms(&still, &Rules::default()).unwrap(),
        rig.transforms(&still, &all).unwrap()
    );
    let motions = rig.motions(&still, |x| x).unwrap();
    for (a, b) in
        places(&rig, motions, &all, true).iter().zip(rig.transforms(&still, &all).unwrap())
    {
        let rows = b.matrix3.transpose().to_cols_array_2d();
        assert!(
            a.linear.0.concat().iter().zip(rows.concat()).all(|(a, b)| (a - b).abs() < 1e-14),
            "t = 0 pulls nothing"
        );
    }
}

#[test]
fn a_turn_takes_the_subtree_along_and_nothing_else() {
    let rig = rig();
    let mut pose = [JointPose::REST; 7];
    pose[4] = JointPose::turned(DVec3::new(-1.2, 0.0, 0.0));
    let t = rig.transforms(&pose, &Rules::default()).unwrap();
    for j in [0, 1, 2, 3] {
        assert_eq!(t[j], rig.transforms(&[], &Rules::default()).unwrap()[j]);
    }
    let pivot = rig.joints()[4].head;
    let turn = DMat3::from_axis_angle(DVec3::X, -1.2);
    for j in [4, 5, 6] {
        let p = rig.joints()[j].head;
        assert!((t[j].transform_point3(p) - (pivot + turn * (p - pivot))).length() < 1e-14);
    }
}

#[test]
fn scale_acts_on_the_bone_alone_unless_inherited() {
    let rig = rig();
    let mut pose = [JointPose::REST; 7];
    pose[1].scale = DVec3::new(1.0, 2.0, 1.0);
    let own = rig.transforms(&pose, &Rules::default()).unwrap();
    let (spine, neck) = (rig.joints()[1].head, rig.joints()[2].head);
    let at = DVec3::new(0.1, 0.2, 0.0);
    assert!(
        (own[1].transform_point3(spine + at) - (spine + DVec3::new(0.1, 0.4, 0.0))).length()
            < 1e-14
    );
    assert!((own[2].transform_point3(neck) - neck).length() < 1e-14);
    let inherited =
        rig.transforms(&pose, &Rules { inherit_scale: true, ..Rules::default() }).unwrap();
    assert!(
        (inherited[2].transform_point3(neck)
            - (spine + (neck - spine) * DVec3::new(1.0, 2.0, 1.0)))
        .length()
            < 1e-14
    );
}

#[test]
fn one_handle_ends_where_it_is_pulled_and_stops_stop() {
    let rig = rig();
    let rest = heads(&rig, &rig.transforms(&[], &Rules::default()).unwrap());
    for (b, stop) in [(3, 1), (3, 2), (6, 4), (6, 0)] {
        let mut pose = [JointPose::REST; 7];
        pose[b].location = DVec3::new(0.2, -0.1, 0.15);
        let mut rules = Rules { stops: vec![false; 7], ..Rules::default() };
        rules.stops[stop] = true;
        let t = rig.transforms(&pose, &rules).unwrap();
        let now = heads(&rig, &t);
        assert!((now[b] - rest[b] - pose[b].location).length() < 1e-12, "{b} {stop}");
        // The stop rotates but does not move. The joints above it and the other chain do
        // neither.
        assert!((now[stop] - rest[stop]).length() < 1e-12);
        let turned = |j: usize| {
            (t[j].matrix3 - DMat3::IDENTITY).to_cols_array().iter().any(|x| x.abs() > 1e-6)
        };
        let mut above = rig.joints()[stop].parent;
        while let Some(a) = above {
            assert!(!turned(a), "{a} is above the stop");
            above = rig.joints()[a].parent;
        }
        let mut between = rig.joints()[b].parent;
        while let Some(a) = between.filter(|a| *a >= stop) {
            assert!(turned(a), "{a} is pulled");
            between = rig.joints()[a].parent;
        }
        for (a, c) in now.iter().zip(&rest).skip(4).filter(|_| b == 3) {
            assert!((*a - *c).length() < 1e-12, "the leg stays");
        }
    }
}

#[test]
fn the_effect_is_continuous() {
    let rig = rig();
    let rules = Rules { stops: vec![false, true], ..Rules::default() };
    let (mut before, mut largest) = (None::<Vec<DVec3>>, 0.0f64);
    for k in 0..=4000 {
        let now = heads(&rig, &rig.transforms(&some_pose(f64::from(k) * 1e-3), &rules).unwrap());
        if let Some(b) = before {
            largest = b.iter().zip(&now).map(|(a, b)| (*a - *b).length()).fold(largest, f64::max);
        }
        before = Some(now);
    }
    assert!(largest > 1e-4 && largest < 0.02, "{largest} per thousandth");
}

#[test]
fn gradients_agree_with_differences() {
    let rig = rig();
    for (k, inherit_scale) in [(0.3, false), (1.9, true), (4.0, false)] {
        let rules = Rules { stops: vec![false, true, false, false, true], inherit_scale };
        let mut pose = some_pose(k);
        // One handle that does not pull, and one rotation given as a matrix.
        pose[5].location = DVec3::ZERO;
        pose[2].turn = Turn::Matrix(DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7));
        let wave = |a: usize| libm::cos(0.37 * a as f64 + k);
        let adjoint: Vec<DAffine3> = (0..7)
            .map(|j| DAffine3::from_cols_array(&std::array::from_fn(|i| wave(12 * j + i))))
            .collect();
        let value = |pose: &[JointPose]| -> f64 {
            let t = rig.transforms(pose, &rules).unwrap();
            let dot = |(a, b): (&DAffine3, &DAffine3)| -> f64 {
                a.to_cols_array().iter().zip(b.to_cols_array()).map(|(a, b)| a * b).sum()
            };
            t.iter().zip(&adjoint).map(dot).sum()
        };
        let gradient = rig.transforms_vjp(&pose, &rules, &adjoint).unwrap();
        for j in 0..7 {
            for c in 0..9 {
                let moved = |h: f64| {
                    let mut pose = pose.clone();
                    let p = &mut pose[j];
                    match (c / 3, &mut p.turn) {
                        (0, _) => p.location[c % 3] += h,
                        (2, _) => p.scale[c % 3] += h,
                        (_, Turn::Vector(v) | Turn::Angles(v)) => v[c % 3] += h,
                        (_, Turn::Matrix(m)) => {
                            *m = DMat3::from_axis_angle(DVec3::AXES[c % 3], h) * *m
                        }
                    }
                    value(&pose)
                };
                let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                let g = [gradient[j].location, gradient[j].turn, gradient[j].scale][c / 3][c % 3];
                assert!(
                    (g - numeric).abs() < 1e-6 * (1.0 + numeric.abs()),
                    "joint {j}, number {c}: {g} {numeric}"
                );
            }
        }
    }
}

#[test]
fn poses_that_are_not_finite_are_refused() {
    let mut pose = [JointPose::REST; 7];
    pose[3].scale.y = f64::NAN;
    let e = rig().transforms(&pose, &Rules::default()).unwrap_err().to_string();
    assert_eq!(e, "the pose of the joint `head` must be finite");
    // Straight through the parent, onto it, and far away: the transforms stay finite.
    for t in [DVec3::new(0.0, -1.0, 0.0), DVec3::new(-0.02, -0.3, -0.1), DVec3::splat(1e100)] {
        let mut pose = [JointPose::REST; 7];
        pose[3].location = t;
        assert!(rig().transforms(&pose, &Rules::default()).unwrap().iter().all(|t| t.is_finite()));
    }
}

/// The short way for poses of rotations, against the general one.
#[test]
fn poses_that_only_turn_are_those_of_the_general_computation() {
    let (rig, rules) = (rig(), Rules::default());
    for k in 0..200 {
        let mut pose = some_pose(f64::from(k) * 0.37);
        for p in &mut pose {
            (p.location, p.scale) = (DVec3::ZERO, DVec3::ONE);
        }
        pose[1].turn = Turn::Angles(DVec3::new(0.1, -0.2, 1.5));
        pose.truncate(7 - k as usize % 3);
        let motions = rig.motions(&pose, |x| x).unwrap();
        let places = places(&rig, motions, &rules, false);
        let found = rig.transforms(&pose, &rules).unwrap();
        assert_eq!(found.len(), places.len());
        for (t, p) in found.iter().zip(&places) {
            let expected = p.linear.transposed().0.concat().into_iter().chain(p.shift.0);
            let bits = |x: f64| x.to_bits();
            assert!(t.to_cols_array().map(bits).into_iter().eq(expected.map(bits)), "{k}");
        }
    }
}
