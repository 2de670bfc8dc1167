//! Tests of armatures for boxes in a row and for bodies with arms.

use crate::rigging::*;
use glam::{DVec3, Vec3};
use pcadlang_scene::geom::armature::{Armature, JointPose, Rules};
use pcadlang_scene::geom::{Affine, GeomError, Mesh, Solid, cuboid, obj, sphere};
use std::fmt::Write;
use std::sync::Arc;

/// Boxes as OBJ groups, given by name, centre and size.
fn boxes(all: &[(&str, DVec3, DVec3)]) -> Mesh {
    let mut text = String::new();
    for (k, (name, at, size)) in all.iter().enumerate() {
        let _ = writeln!(text, "g {name}");
        for c in 0..8 {
            let sign = |bit: i32| if c >> bit & 1 == 1 { 0.5 } else { -0.5 };
            let p = *at + *size * DVec3::new(sign(0), sign(1), sign(2));
            let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
        }
        for f in
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
        {
            let [a, b, c, d] = f.map(|v| v + 1 + 8 * k);
            let _ = writeln!(text, "f {a} {b} {c} {d}");
        }
    }
    obj::load(text.as_bytes()).unwrap()
}

/// The vertices of a body in a pose, in the order of its positions.
fn posed_vertices(body: &Armature, pose: &[JointPose]) -> Vec<DVec3> {
    let t = body.rig().transforms(pose, &Rules::default()).unwrap();
    let all = body.positions().iter().zip(body.influences());
    all.map(|(p, i)| i.blend(&t, p.as_dvec3())).collect()
}

fn chain() -> Mesh {
    let x = |x: f64| DVec3::new(x, 0.0, 0.0);
    let size = DVec3::new(2.0, 0.5, 0.5);
    boxes(&[("hand", x(4.0), size), ("upper", x(0.0), size), ("fore", x(2.0), size)])
}

fn joint<'a>(a: &'a Armature, name: &str) -> &'a pcadlang_scene::geom::armature::Joint {
    &a.rig().joints()[a.rig().find(name).unwrap()]
}

fn parent(a: &Armature, name: &str) -> Option<String> {
    joint(a, name).parent.map(|p| a.rig().joints()[p].name.to_string())
}

fn sound(a: &Armature) {
    for i in a.influences() {
        assert!(
            (i.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5
                && i.weights.iter().all(|w| *w >= 0.0)
        );
    }
    let rest = posed_vertices(a, &[]);
    assert!(rest.iter().zip(a.positions()).all(|(p, q)| (*p - q.as_dvec3()).length() < 1e-6));
    for (j, k) in a.rig().joints().iter().zip(a.rig().keypoints()) {
        assert!(j.name == k.name && j.head == k.rest);
    }
}

#[test]
fn three_boxes_in_a_row_are_three_bones() {
    let a = by_groups(&chain()).unwrap();
    sound(&a);
    assert_eq!(a.positions().len(), 16, "points at one place are one");
    assert_eq!(parent(&a, "fore"), None, "the middle one is the root");
    assert_eq!(
        [parent(&a, "hand"), parent(&a, "upper")],
        [Some("fore".into()), Some("fore".into())]
    );
    let near = |p: DVec3, x: f64| assert!((p - DVec3::new(x, 0.0, 0.0)).length() < 1e-6, "{p}");
    near(joint(&a, "fore").head, 2.0);
    near(joint(&a, "hand").head, 3.0);
    near(joint(&a, "upper").head, 1.0);
    assert!((joint(&a, "hand").tail.x - 5.0).abs() < 1e-6);
    // Shared vertices get half their weight from either group; all others follow their
    // own.
    let fore = a.rig().find("fore").unwrap() as u16;
    for (p, i) in a.positions().iter().zip(a.influences()) {
        let on_fore = i
            .joints
            .iter()
            .zip(i.weights)
            .filter(|(j, w)| **j == fore && *w > 0.0)
            .map(|(_, w)| w)
            .sum::<f32>();
        let end = p.x < 0.0 || p.x > 4.0;
        assert_eq!(on_fore, if end { 0.0 } else { 0.5 }, "{p}");
    }
    let mut pose = vec![JointPose::REST; 3];
    pose[a.rig().find("hand").unwrap()] = JointPose::turned(DVec3::new(0.0, 0.0, 1.0));
    let turned = posed_vertices(&a, &pose);
    for (p, q) in a.positions().iter().zip(turned) {
        assert_eq!((p.as_dvec3() - q).length() > 0.1, p.x > 2.9, "{p} to {q}");
    }
}

#[test]
fn what_touches_nothing_hangs_on_the_nearest() {
    let one = DVec3::ONE;
    let at = |x, y| DVec3::new(x, y, 0.0);
    let a = by_groups(&boxes(&[
        ("trunk", at(0.0, 0.0), DVec3::new(4.0, 8.0, 4.0)),
        ("far", at(7.0, 0.0), one),
        ("arm", at(3.5, 0.0), DVec3::new(4.0, 1.0, 1.0)),
        ("low", at(0.0, -7.0), one),
        ("farther", at(9.0, 0.0), one),
    ]));
    let a = a.unwrap();
    sound(&a);
    assert_eq!(parent(&a, "arm"), Some("trunk".into()), "it reaches into the trunk");
    assert_eq!(parent(&a, "far"), Some("arm".into()));
    assert_eq!(parent(&a, "farther"), Some("far".into()));
    assert_eq!(parent(&a, "low"), Some("trunk".into()));
    assert!((joint(&a, "low").head.y + 5.25).abs() < 0.1, "{}", joint(&a, "low").head);
    let head = joint(&a, "arm").head;
    assert!((head - at(1.75, 0.0)).length() < 0.3, "in the middle of the overlap: {head}");
}

#[test]
fn names_given_twice_are_numbered() {
    let arm = Solid::new(Arc::new(chain()));
    // Upright, with its upper end over the middle of the other one.
    let turn = DVec3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let upright = arm.placed(Affine::new(DVec3::new(2.0, 3.0, 0.0), turn, DVec3::ONE));
    let a = by_groups(&Solid::group(&[arm, upright]).to_mesh().unwrap()).unwrap();
    sound(&a);
    let parents = ["upper#2", "fore#2", "hand#2", "fore", "hand", "upper"].map(|n| parent(&a, n));
    let expected =
        [None, Some("upper#2"), Some("fore#2"), Some("upper#2"), Some("fore"), Some("fore")];
    assert_eq!(parents, expected.map(|p| p.map(String::from)));
}

/// Long ellipsoids from the origin to the tips.
fn star(tips: &[DVec3]) -> Mesh {
    let arm = |tip: &DVec3| {
        let along = glam::DQuat::from_rotation_arc(DVec3::Y, tip.normalize());
        let ball = Solid::new(Arc::new(sphere(1.0, 24).unwrap()));
        let half = tip.length() / 2.0;
        let m = ball
            .placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(0.3, half + 0.15, 0.3)))
            .to_mesh()
            .unwrap();
        let centre = *tip / 2.0 - tip.normalize() * 0.15;
        let turned =
            m.positions.iter().map(|p| (along * p.as_dvec3() + centre).as_vec3()).collect();
        Solid::new(Arc::new(
            Mesh::new(turned, m.topology.triangles.clone(), m.topology.parts.clone()).unwrap(),
        ))
    };
    Solid::group(&tips.iter().map(arm).collect::<Vec<_>>()).to_mesh().unwrap()
}

#[test]
fn a_star_has_a_branch_for_each_tip() {
    let y = [DVec3::new(0.0, -3.0, 0.0), DVec3::new(1.6, 2.0, 0.0), DVec3::new(-1.6, 2.0, 0.5)];
    let t = [DVec3::new(0.0, -2.5, 0.0), DVec3::new(2.0, 0.0, 0.0), DVec3::new(-2.2, 0.0, 0.0)];
    for tips in [y, t] {
        let mesh = star(&tips);
        let a = by_skeleton(&mesh, 16).unwrap();
        sound(&a);
        let joints = a.rig().joints();
        let ends: Vec<DVec3> = (0..joints.len())
            .filter(|i| !joints.iter().any(|j| j.parent == Some(*i)))
            .map(|i| joints[i].tail)
            .collect();
        assert_eq!(ends.len(), 3, "{joints:#?}");
        for tip in tips {
            let near = ends.iter().map(|e| (*e - tip).length()).fold(f64::INFINITY, f64::min);
            assert!(near < 0.25, "{tip}: {near} {ends:?}");
        }
        assert!(
            joints[0].head.length() < 0.5
                && &*joints[0].name == "root"
                && &*joints[1].name == "bone_1"
        );
        let b = by_skeleton(&mesh, 16).unwrap();
        assert!(a.rig() == b.rig() && a.influences() == b.influences(), "no chance in it");
        for most in [1, 2, 3] {
            assert!(by_skeleton(&mesh, most).unwrap().rig().joints().len() <= most);
        }
        // The bone that ends at a tip moves that tip and not the others.
        let last = (0..joints.len()).find(|i| (joints[*i].tail - tips[0]).length() < 0.25).unwrap();
        let mut pose = vec![JointPose::REST; joints.len()];
        pose[last] = JointPose::turned(DVec3::new(0.0, 0.0, 0.5));
        let turned = posed_vertices(&a, &pose);
        for (p, q) in a.positions().iter().zip(turned) {
            let (p, moved) = (p.as_dvec3(), (p.as_dvec3() - q).length());
            assert!((p - tips[0]).length() > 0.3 || moved > 0.3, "{p}");
            assert!(
                tips[1..].iter().all(|t| (p - *t).length() > 0.8) || moved == 0.0,
                "{p} {moved}"
            );
        }
    }
}

#[test]
fn a_bend_is_a_joint_and_a_ball_has_none() {
    // An L of two boxes that overlap at the corner.
    let l = boxes(&[
        ("a", DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.8, 4.8, 0.8)),
        ("b", DVec3::new(2.4, 0.0, 0.0), DVec3::new(5.6, 0.8, 0.8)),
    ]);
    let a = by_skeleton(&l, 16).unwrap();
    sound(&a);
    let corner = a.rig().joints().iter().map(|j| j.head.length()).fold(f64::INFINITY, f64::min);
    assert!(corner < 0.6, "{:#?}", a.rig().joints());
    let ball = by_skeleton(&sphere(1.0, 24).unwrap(), 16).unwrap();
    sound(&ball);
    assert_eq!(ball.rig().joints().len(), 1);
    assert!(ball.rig().joints()[0].head.length() < 0.1);
}

#[test]
fn what_cannot_be_rigged_is_refused() {
    let e = |r: Result<Armature, GeomError>| r.unwrap_err().to_string();
    let cube = cuboid(DVec3::ONE).unwrap();
    assert_eq!(
        e(by_groups(&cube)),
        "an armature by groups needs 2 to 256 groups in the mesh; it has 1"
    );
    assert!(e(by_skeleton(&cube, 0)).contains("1 to 256 bones, not 0"));
    let tri = |p: [Vec3; 3]| Mesh::new(p.to_vec(), vec![[0, 1, 2]], vec![0]).unwrap();
    let open = tri([Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(
        e(by_skeleton(&open, 16)),
        "a skeleton needs a closed mesh; this one has 3 open edges"
    );
    let thin = cuboid(DVec3::new(1.0, 1.0, 1e-4)).unwrap();
    assert_eq!(
        e(by_skeleton(&thin, 16)),
        "a skeleton needs a mesh with an interior; this one is too thin"
    );
    let many = sphere(1.0, 256).unwrap();
    assert!(many.topology.triangles.len() > MOST_GROUPED_TRIANGLES);
    assert!(e(by_groups(&many)).contains("at most 20000 triangles"));
}
