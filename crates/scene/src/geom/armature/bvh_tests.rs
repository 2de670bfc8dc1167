//! A reader of BVH files, apart from the writer, finds each joint where the posed body has it.

use super::*;
use crate::geom::armature::{Armature, Influence, JointPose, NamedJoint, Rig, Rules, Turn};
use crate::geom::{Affine, Solid, cuboid};
use std::sync::Arc;

/// The joints of a file by name, ends included, and where they are in a frame, by forward
/// kinematics as the format defines it.
fn read(text: &str, frame: usize) -> Vec<(String, DVec3)> {
    struct Read {
        name: String,
        parent: Option<usize>,
        offset: DVec3,
        channels: Vec<String>,
    }
    let mut words = text.split_whitespace().peekable();
    let mut joints: Vec<Read> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    assert_eq!(words.next(), Some("HIERARCHY"));
    loop {
        match words.next().unwrap() {
            "ROOT" | "JOINT" | "End" => {
                let name = words.next().unwrap().to_owned();
                let parent = open.last().copied();
                let name = match name.as_str() {
                    "Site" => format!("{}.end", joints[parent.unwrap()].name),
                    _ => name,
                };
                joints.push(Read { name, parent, offset: DVec3::ZERO, channels: Vec::new() });
            }
            "{" => open.push(joints.len() - 1),
            "}" => drop(open.pop()),
            "OFFSET" => {
                let mut number = || words.next().unwrap().parse::<f64>().unwrap();
                joints.last_mut().unwrap().offset = DVec3::new(number(), number(), number());
            }
            "CHANNELS" => {
                let n: usize = words.next().unwrap().parse().unwrap();
                let all = (0..n).map(|_| words.next().unwrap().to_owned()).collect();
                joints.last_mut().unwrap().channels = all;
            }
            "MOTION" => break,
            word => panic!("{word}"),
        }
    }
    assert!(open.is_empty());
    assert_eq!(words.next(), Some("Frames:"));
    let frames: usize = words.next().unwrap().parse().unwrap();
    assert_eq!((words.next(), words.next()), (Some("Frame"), Some("Time:")));
    let _: f64 = words.next().unwrap().parse().unwrap();
    let numbers: Vec<f64> = words.map(|w| w.parse().unwrap()).collect();
    let per: usize = joints.iter().map(|j| j.channels.len()).sum();
    assert_eq!(numbers.len(), frames * per);
    let mut own = numbers[frame * per..].iter();
    let mut places: Vec<(DMat3, DVec3)> = Vec::new();
    for j in &joints {
        let (up, from) = j.parent.map_or((DMat3::IDENTITY, DVec3::ZERO), |p| places[p]);
        let (mut turn, mut shift) = (DMat3::IDENTITY, j.offset);
        for channel in &j.channels {
            let x = *own.next().unwrap();
            let angle = x.to_radians();
            match channel.as_str() {
                "Xposition" => shift.x += x,
                "Yposition" => shift.y += x,
                "Zposition" => shift.z += x,
                "Xrotation" => turn *= DMat3::from_rotation_x(angle),
                "Yrotation" => turn *= DMat3::from_rotation_y(angle),
                "Zrotation" => turn *= DMat3::from_rotation_z(angle),
                other => panic!("{other}"),
            }
        }
        places.push((up * turn, from + up * shift));
    }
    joints.into_iter().map(|j| j.name).zip(places.into_iter().map(|(_, at)| at)).collect()
}

fn joint(name: &str, parent: Option<&str>, head: [f64; 3], tail: [f64; 3]) -> NamedJoint {
    let (head, tail) = (DVec3::from_array(head), DVec3::from_array(tail));
    NamedJoint { name: name.into(), parent: parent.map(Into::into), head, tail }
}

/// Not in the order of a file's hierarchy: `arm` comes before `leg`'s child.
fn body(more: Vec<NamedJoint>) -> Arc<Armature> {
    let mut joints = vec![
        joint("hips", None, [0.1, 0.9, 0.0], [0.1, 1.1, 0.1]),
        joint("leg", Some("hips"), [0.3, 0.8, 0.0], [0.4, 0.4, 0.1]),
        joint("left arm", Some("hips"), [0.2, 1.3, 0.0], [0.7, 1.3, 0.2]),
        joint("foot", Some("leg"), [0.4, 0.4, 0.1], [0.4, 0.1, 0.3]),
    ];
    joints.extend(more);
    let cube = cuboid(DVec3::ONE).unwrap();
    let own = Influence { joints: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] };
    let influences = vec![own; cube.positions.len()];
    let triangles = cube.topology.triangles.clone();
    let rig = Rig::new(joints).unwrap();
    Arc::new(Armature::new(rig, cube.positions, triangles, influences).unwrap())
}

fn bones(solid: &Solid) -> Vec<Bone> {
    assert_eq!(solid.bodies().len(), 1);
    solid.bodies()[0].bones()
}

/// Compares the heads and ends in a file with those of the bones; they agree to ten digits.
fn agrees(text: &str, frame: usize, bones: &[Bone]) {
    let read = read(text, frame);
    for bone in bones {
        let at = |name: &str| read.iter().find(|(n, _)| *n == name).map(|(_, at)| *at);
        let name = bone.name.replace(' ', "_");
        let head = at(&name).unwrap();
        assert!(head.distance(bone.head) < 1e-8, "{name}: {head} {}", bone.head);
        if let Some(end) = at(&format!("{name}.end")) {
            assert!(end.distance(bone.tail) < 1e-8, "{name}: {end} {}", bone.tail);
        }
    }
}

/// Turns for the joints, one of them where the angles about two axes are not determined.
fn pose(by: f64) -> Vec<JointPose> {
    let quarter = DMat3::from_rotation_z(0.4)
        * DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2)
        * DMat3::from_rotation_y(by);
    vec![
        JointPose::turned(DVec3::new(0.3, -2.1, 0.8 * by)),
        JointPose { turn: Turn::Matrix(quarter), ..JointPose::REST },
        JointPose { turn: Turn::Angles(DVec3::new(1.0, -0.4, by)), ..JointPose::REST },
        JointPose::turned(DVec3::new(-1.2, 0.1, 0.5)),
    ]
}

#[test]
fn joints_are_where_the_body_has_them() {
    let body = body(Vec::new());
    let place =
        Affine::new(DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.2, 1.1, -0.4), DVec3::splat(3.0));
    let stands = |by: f64| body.posed(&pose(by), &Rules::default()).unwrap().placed(place);
    let frames: Vec<Vec<Bone>> = [0.7, -1.3].map(|by| bones(&stands(by))).to_vec();
    let text = write(&frames, 0.5);
    agrees(&text, 0, &frames[0]);
    // Without handles and scales, later frames have the bones of the first.
    agrees(&text, 1, &frames[1]);
    let rest = body.rig().joints();
    for (bone, joint) in frames[0].iter().zip(rest) {
        let Some(p) = joint.parent else { continue };
        assert!(bone.offset.distance((joint.head - rest[p].head) * 3.0) < 1e-9, "{}", joint.name);
    }
    assert!(text.contains("JOINT left_arm\n"), "{text}");
    let whole = Solid::group(&[stands(0.7), stands(0.2).placed(place)]);
    assert_eq!(whole.bodies()[1].bones(), bones(&stands(0.2).placed(place)));
}

#[test]
fn handles_scales_and_mirrors_are_in_the_offsets() {
    let body = body(Vec::new());
    let mut pulled = pose(0.6);
    pulled[3].location = DVec3::new(0.4, 0.9, -0.7);
    pulled[0].scale = DVec3::new(1.5, 0.7, 2.0);
    let place = Affine::new(DVec3::ONE, DVec3::new(0.2, 0.0, 1.0), DVec3::new(-1.0, 2.0, 0.5));
    for inherit_scale in [false, true] {
        let rules = Rules { inherit_scale, ..Rules::default() };
        let bones = bones(&body.posed(&pulled, &rules).unwrap().placed(place));
        agrees(&write(std::slice::from_ref(&bones), 1.0), 0, &bones);
        for b in &bones {
            let unit = b.local * b.local.transpose() - DMat3::IDENTITY;
            assert!(unit.to_cols_array().iter().all(|x| x.abs() < 1e-12), "{}", b.name);
            assert!(b.local.determinant() > 0.0);
        }
    }
    let flat = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0));
    let bones = bones(&body.posed(&pulled, &Rules::default()).unwrap().placed(flat));
    agrees(&write(std::slice::from_ref(&bones), 1.0), 0, &bones);
}

#[test]
fn several_roots_get_one() {
    let body = body(vec![joint("hat", None, [0.0, 2.0, 0.0], [0.0, 2.5, 0.0])]);
    let bones = bones(&body.posed(&pose(0.4), &Rules::default()).unwrap());
    let text = write(std::slice::from_ref(&bones), 1.0);
    assert_eq!(text.matches("ROOT").count(), 1);
    agrees(&text, 0, &bones);
}
