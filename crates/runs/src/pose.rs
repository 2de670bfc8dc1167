//! The bodies of the best state as programs for animation have them: `pose.bvh` and
//! `pose.json`.

use crate::failure::Failure;
use crate::files::write_in;
use crate::record::write_json;
use glam::{DMat3, DQuat, DVec3};
use pcadlang_report::RunDir;
use pcadlang_scene::geom::armature::{Bone, Joint, PosedBody, bvh, quaternion, rotation_vector};
use pcadlang_scene::render::{Camera, View};
use pcadlang_scene::vision::keypoints::MEDIAPIPE;
use serde_json::{Map, Value, json};

/// The file of joints' rotations.
const POSE: &str = "pose.json";
/// The time between the frames of a BVH file, of which there is one here, in seconds.
const FRAME: f64 = 1.0 / 30.0;

/// A joint of SMPL (Loper et al. 2015, "SMPL: A Skinned Multi-Person Linear Model"): its name,
/// its parent's number, that joint of the shipped body which turns as it does.
type SmplJoint = (&'static str, Option<usize>, Option<&'static str>);

/// SMPL's 24 joints in its order. The shipped body's hands have no joints beyond the wrist.
const SMPL: [SmplJoint; 24] = [
    ("pelvis", None, Some("pelvis")),
    ("left_hip", Some(0), Some("thigh_l")),
    ("right_hip", Some(0), Some("thigh_r")),
    ("spine1", Some(0), Some("spine_01")),
    ("left_knee", Some(1), Some("calf_l")),
    ("right_knee", Some(2), Some("calf_r")),
    ("spine2", Some(3), Some("spine_02")),
    ("left_ankle", Some(4), Some("foot_l")),
    ("right_ankle", Some(5), Some("foot_r")),
    ("spine3", Some(6), Some("spine_03")),
    ("left_foot", Some(7), Some("ball_l")),
    ("right_foot", Some(8), Some("ball_r")),
    ("neck", Some(9), Some("neck")),
    ("left_collar", Some(9), Some("clavicle_l")),
    ("right_collar", Some(9), Some("clavicle_r")),
    ("head", Some(12), Some("head")),
    ("left_shoulder", Some(13), Some("upperarm_l")),
    ("right_shoulder", Some(14), Some("upperarm_r")),
    ("left_elbow", Some(16), Some("lowerarm_l")),
    ("right_elbow", Some(17), Some("lowerarm_r")),
    ("left_wrist", Some(18), Some("hand_l")),
    ("right_wrist", Some(19), Some("hand_r")),
    ("left_hand", Some(20), None),
    ("right_hand", Some(21), None),
];
/// The first of the joints of the arms, which SMPL has at rest along the x axis.
const ARMS: usize = 16;

/// Writes the bodies of a view; a second one as `pose-2.bvh`.
pub fn write_poses(dir: &RunDir, view: &View) -> Result<(), Failure> {
    let bodies = view.solid().bodies();
    let scale = 1.0 / view.metre().unwrap_or(1.0);
    let mut all: Vec<Value> = Vec::new();
    for (i, body) in bodies.iter().enumerate() {
        let bones: Vec<Bone> = body.bones().iter().map(|b| scaled(b, scale)).collect();
        let name = if i == 0 { "pose.bvh".into() } else { format!("pose-{}.bvh", i + 1) };
        let text = bvh::write(std::slice::from_ref(&bones), FRAME);
        write_in(dir, &name, text.as_bytes())?;
        let mut said = json!({ "bvh": name, "joints": joints(body, &bones) });
        if let Some(pose) = smpl(body, &bones) {
            said["smpl"] = pose;
        }
        if view.metre().is_some()
            && let Some(points) = mediapipe(body, view.camera(), scale)
        {
            said["pose_world_landmarks"] = points;
        }
        all.push(said);
    }
    if all.is_empty() {
        return Ok(());
    }
    let unit = if view.metre().is_some() { "metre" } else { "scene unit" };
    write_json(dir, POSE, &json!({ "unit": unit, "bodies": all }))
}

fn scaled(b: &Bone, by: f64) -> Bone {
    let [head, tail, offset, end] = [b.head, b.tail, b.offset, b.end].map(|v| v * by);
    Bone { head, tail, offset, end, ..b.clone() }
}

/// Returns the joints by name, in rig order.
fn joints(body: &PosedBody, bones: &[Bone]) -> Value {
    let rest = body.body.rig().joints();
    let one = |(bone, joint): (&Bone, &Joint)| {
        let q = quaternion(bone.local);
        let all: Map<String, Value> = [
            ("name", json!(*bone.name)),
            ("parent", json!(bone.parent.map(|p| &*bones[p].name))),
            ("rest", numbers(joint.head)),
            ("head", numbers(bone.head)),
            ("tail", numbers(bone.tail)),
            ("rotvec", numbers(rotation_vector(bone.local))),
            ("quaternion", [q.w, q.x, q.y, q.z].map(rounded).into_iter().collect()),
        ]
        .map(|(k, v)| (k.to_owned(), v))
        .into_iter()
        .collect();
        Value::Object(all)
    };
    bones.iter().zip(rest).map(one).collect()
}

/// Returns the rotation vectors of SMPL's joints, if the body has the shipped one's. Arms are
/// measured from SMPL's rest, in which they are along the x axis, and not from the body's, in
/// which they hang.
fn smpl(body: &PosedBody, bones: &[Bone]) -> Option<Value> {
    let rig = body.body.rig();
    let at_rest = |joint: usize, next: Option<usize>| {
        let joints = rig.joints();
        next.map_or(joints[joint].tail, |n| joints[n].head) - joints[joint].head
    };
    let mut world: Vec<DMat3> = Vec::with_capacity(SMPL.len());
    for (i, (_, parent, own)) in SMPL.iter().enumerate() {
        let Some(own) = own else {
            world.push(parent.map_or(DMat3::IDENTITY, |p| world[p]));
            continue;
        };
        let joint = rig.find(own)?;
        let turned = bones.get(joint)?.world;
        if i < ARMS {
            world.push(turned);
            continue;
        }
        let next = SMPL.iter().find(|(_, p, own)| *p == Some(i) && own.is_some());
        let next = next.and_then(|(_, _, own)| rig.find((*own)?));
        let bone = at_rest(joint, next).try_normalize()?;
        let along = if i % 2 == 0 { DVec3::X } else { DVec3::NEG_X };
        world.push(turned * DMat3::from_quat(DQuat::from_rotation_arc(along, bone)));
    }
    let local = |(i, (_, parent, _)): (usize, &SmplJoint)| {
        let up = parent.map_or(DMat3::IDENTITY, |p| world[p]);
        numbers(rotation_vector(up.transpose() * world[i]))
    };
    Some(json!({
        "order": SMPL.map(|(name, ..)| name),
        "pose": SMPL.iter().enumerate().map(local).collect::<Value>(),
    }))
}

/// Returns MediaPipe's 33 landmarks in metres from the mid-hip, x to the right, y down, z away
/// from the camera; a landmark that the body lacks has visibility 0. `None` without hips.
fn mediapipe(body: &PosedBody, camera: &Camera, scale: f64) -> Option<Value> {
    let find = |name: &str| body.keypoints().find(|(n, _)| *n == name).map(|(_, at)| at);
    let hips = find("l_hip")?.midpoint(find("r_hip")?);
    let one = |name: &&str| {
        let at = find(name).map_or(DVec3::ZERO, |at| (at - hips) * scale);
        let [x, y, z] =
            [camera.right, -camera.up, camera.forward].map(|axis| rounded(axis.dot(at)));
        let visibility = if find(name).is_some() { 1 } else { 0 };
        json!({ "x": x, "y": y, "z": z, "visibility": visibility })
    };
    Some(MEDIAPIPE.iter().map(one).collect())
}

fn numbers(v: DVec3) -> Value {
    v.to_array().map(rounded).into_iter().collect()
}

/// Rounds to a millionth of a millionth, far below what is known, and drops the sign of zero.
fn rounded(x: f64) -> Value {
    json!((x * 1e12).round() / 1e12 + 0.0)
}

#[cfg(test)]
#[path = "pose_tests.rs"]
mod tests;
