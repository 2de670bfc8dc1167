//! Meshes: topologies shared by surfaces of revolution, and parts of posed bodies.

use super::{mesh_bits, shipped};
use glam::DVec3;
use pcadlang_scene::geom::armature::{Armature, JointPose, Rules, Turn};
use pcadlang_scene::geom::{Caps, Profile, Solid, lathe, sphere};
use std::sync::Arc;

/// Topologies shared by surfaces of revolution.
#[test]
fn surfaces_of_other_numbers() {
    let profile = |points: usize, top: f64| {
        let y: Vec<f64> = (0..points).map(|i| i as f64 / (points - 1) as f64).collect();
        let r = y.iter().map(|y| 0.5 + (top - 0.5) * y).collect();
        Profile { y, r }
    };
    let round = |points: usize, least: f64| {
        let at = |i: usize| std::f64::consts::PI * i as f64 / (points - 1) as f64;
        let r = (0..points)
            .map(|i| if i % (points - 1) == 0 { least } else { libm::sin(at(i)).max(least) })
            .collect();
        Profile { y: (0..points).map(|i| -libm::cos(at(i))).collect(), r }
    };
    let flat_bottom =
        Profile { y: vec![0.0, 0.0, 0.2, 0.4, 0.6, 0.8], r: vec![0.0, 0.5, 0.5, 0.45, 0.4, 0.4] };
    let above = |p: Profile, by: f64| Profile { y: p.y.iter().map(|y| y + by).collect(), ..p };
    let one = || vec![profile(6, 0.4)];
    type Asked = (&'static str, Vec<Profile>, u32, f64, Caps);
    let all: Vec<Asked> = vec![
        ("the first", one(), 12, 0.0, Caps::Both),
        ("sides", one(), 13, 0.0, Caps::Both),
        ("points", vec![profile(7, 0.4)], 12, 0.0, Caps::Both),
        ("a pole", vec![profile(6, 0.0)], 12, 0.0, Caps::Both),
        ("a wall", one(), 12, 0.05, Caps::Both),
        ("the lower cap", one(), 12, 0.0, Caps::Bottom),
        ("the upper cap", one(), 12, 0.0, Caps::Top),
        ("no cap", one(), 12, 0.0, Caps::None),
        ("two parts", vec![profile(6, 0.4), above(profile(6, 0.4), 1.0)], 12, 0.0, Caps::Both),
        (
            "two parts that meet",
            vec![profile(6, 0.5), above(profile(6, 0.5), 1.0)],
            12,
            0.0,
            Caps::Both,
        ),
        (
            "two parts that meet at an angle",
            vec![profile(6, 0.5), above(profile(6, 2.0), 1.0)],
            12,
            0.0,
            Caps::Both,
        ),
        (
            "two parts that bend",
            vec![profile(6, 0.5), above(profile(6, 0.2), 1.0)],
            12,
            0.0,
            Caps::Both,
        ),
        // The same strips, with and without a crease between the first two.
        ("a disc of its own", vec![flat_bottom], 12, 0.0, Caps::None),
        (
            "a tip",
            vec![Profile { y: vec![0.0, 0.2, 0.4, 0.6, 0.8], r: vec![0.0, 0.05, 0.1, 0.15, 0.2] }],
            12,
            0.0,
            Caps::None,
        ),
        ("a dome", vec![round(9, 0.0)], 12, 0.0, Caps::None),
        ("a round tube", vec![round(9, 0.2)], 12, 0.0, Caps::None),
        (
            "parts of other numbers",
            vec![profile(5, 0.5), above(profile(7, 0.5), 1.0)],
            12,
            0.0,
            Caps::Both,
        ),
        ("radii", vec![profile(6, 0.3)], 12, 0.0, Caps::Both),
    ];
    let make = |(_, parts, sides, thickness, caps): &Asked| {
        // Only an open vessel can have a wall thickness.
        let caps = if *thickness > 0.0 { Caps::Bottom } else { *caps };
        lathe(parts, *sides, *thickness, caps)
            .map(|m| mesh_bits(&m))
            .unwrap_or_else(|e| format!("{e}"))
    };
    // More topologies than the cache keeps, so that none of those above stays in it.
    let forget = || (40..60).for_each(|sides| drop(lathe(&one(), sides, 0.0, Caps::Both)));
    for a in &all {
        for b in &all {
            make(a);
            let here = make(b);
            forget();
            assert!(here == make(b), "{} after {}", b.0, a.0);
            assert_eq!(here == make(a), a.0 == b.0, "{} and {}", a.0, b.0);
        }
    }
    // The same number of rings with a different number of parts.
    let ball = || mesh_bits(&sphere(0.7, 12).unwrap());
    for points in 3..30 {
        let egg = ("an egg", vec![round(points, 0.0)], 12, 0.0, Caps::Both);
        for _ in 0..2 {
            let here = [ball(), make(&egg)];
            forget();
            let ball = ball();
            forget();
            assert!(here == [ball, make(&egg)], "a sphere and an egg of {points} rings");
        }
    }
}

/// Parts of bodies that earlier poses moved in the same way.
#[test]
fn bodies_in_other_poses() {
    let body = shipped::human("human.lod2").unwrap();
    let stout = Arc::new(body.shaped(&[("heavy", 0.7)]).unwrap());
    let rest: Vec<JointPose> = (0..body.rig().joints().len())
        .map(|i| JointPose::turned(DVec3::new(0.1, 0.02 * i as f64, 0.0)))
        .collect();
    let before = std::cell::RefCell::new(None);
    let hash = |posed: &Solid| -> Vec<String> {
        let landmarks = posed
            .landmarks()
            .iter()
            .map(|l| format!("{:?}", l.position.to_array().map(f64::to_bits)));
        let meshes = posed.instances().iter().map(|i| {
            let numbers = i.mesh.positions.iter().chain(&i.mesh.normals).flat_map(|v| v.to_array());
            numbers
                .fold(0u64, |h, x| (h ^ u64::from(x.to_bits())).wrapping_mul(0x100000001b3))
                .to_string()
        });
        landmarks.chain(meshes).collect()
    };
    // A pose drawn from the one before, whatever its body.
    let bits = |body: &Arc<Armature>, pose: &[JointPose], rules: &Rules| {
        let (solid, posed) = body.posed_after(pose, rules, before.borrow().as_ref()).unwrap();
        let bits = hash(&solid);
        before.replace(Some(posed));
        bits
    };
    let alone = |body: &Arc<Armature>, pose: &[JointPose]| {
        hash(&body.posed(pose, &Rules::default()).unwrap())
    };
    let rules = Rules::default();
    let first = bits(&body, &rest, &rules);
    type Moved = (&'static str, fn(&mut JointPose));
    let changes: [Moved; 11] = [
        ("x of the turn", |p| p.turn = turned(p.turn, DVec3::X * 0.01)),
        ("y of the turn", |p| p.turn = turned(p.turn, DVec3::Y * 0.01)),
        ("z of the turn", |p| p.turn = turned(p.turn, DVec3::Z * 0.01)),
        ("x of the location", |p| p.location.x += 0.01),
        ("z of the location", |p| p.location.z += 0.01),
        ("the location, hardly", |p| p.location.y += 1e-7),
        ("the turn in the last bit", |p| p.turn = turned(p.turn, DVec3::X * 1e-17)),
        ("-0", |p| p.turn = turned(p.turn, DVec3::Z * -0.0)),
        ("the location", |p| p.location.y += 0.01),
        ("the scale", |p| p.scale.x += 0.01),
        ("the scale, hardly", |p| p.scale.x += f64::EPSILON),
    ];
    // At rest, a location changes a single number of a transform.
    let still = vec![JointPose::REST; rest.len()];
    for joint in (0..rest.len()).step_by(3) {
        for (what, change) in changes {
            let mut pose = still.clone();
            bits(&body, &pose, &rules);
            change(&mut pose[joint]);
            assert!(
                bits(&body, &pose, &rules) == alone(&body, &pose),
                "{joint}, at rest: another {what}"
            );
            let mut pose = rest.clone();
            bits(&body, &pose, &rules);
            change(&mut pose[joint]);
            let here = bits(&body, &pose, &rules);
            assert!(here == alone(&body, &pose), "joint {joint}: another {what}");
            assert!(bits(&body, &rest, &rules) == first, "joint {joint}: {what}, and back");
            assert!(
                here != first
                    || ["-0", "the turn in the last bit"].contains(&what)
                    || what.contains("hardly"),
                "{what}"
            );
        }
    }
    // With zero rotations, only the signs of zeros differ.
    for sign in [0.0, -0.0, 0.0] {
        let pose = vec![JointPose::turned(DVec3::splat(sign)); rest.len()];
        assert!(bits(&body, &pose, &rules) == alone(&body, &pose), "turned by {sign}");
    }
    let other = bits(&stout, &rest, &rules);
    assert!(other != first && other == alone(&stout, &rest) && bits(&body, &rest, &rules) == first);
}

fn turned(turn: Turn, by: DVec3) -> Turn {
    match turn {
        Turn::Vector(v) => Turn::Vector(v + by),
        other => other,
    }
}
