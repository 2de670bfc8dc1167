//! The pose of the shipped body: what is written says how its bones lie.

use super::*;
use pcadlang_library::Program;

/// The view of a program with the shipped body in a pose.
fn view(scene: &str) -> std::sync::Arc<View> {
    let text = format!(
        "include \"std/scene.pcad\" as scene;
         data body = armature(\"std/human/human.lod2.rig.json\");
         let pose = {{
           pelvis: [0.3, -0.9, 0.2], spine_02: [0.4, 0.1, 0], clavicle_l: [0, 0.2, 0.3],
           upperarm_l: [0.3, -0.4, 1.2], lowerarm_l: [0, -1.1, 0.2], hand_l: [0.2, 0.1, -0.4],
           upperarm_r: [0.1, 0.8, -0.6], thigh_r: [-1.1, 0, 0.1], calf_r: [0.8, 0, 0],
         }};
         {scene}"
    );
    let model = Program::parse(&text).and_then(Program::compile).unwrap();
    let draws = crate::scene::predictive(1, 0);
    let mut trace = crate::scene::rebuilt(&model, &[], draws).unwrap();
    crate::scene::view(&mut trace, draws, None).unwrap()
}

const PLACED: &str = "let view = scene.render(
    scene.affine(translate = [0.2, -1, 0.4], rotate = [0.1, 0.5, 0], scale = 2) * scene.skin(body, pose),
    metre = 2
  );";

fn vector(v: &Value) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|i| v[i].as_f64().unwrap()))
}

fn turn(v: &Value) -> DMat3 {
    DMat3::from_quat(DQuat::from_scaled_axis(vector(v)))
}

#[test]
fn rotations_lead_to_the_joints() {
    let view = view(PLACED);
    let body = &view.solid().bodies()[0];
    let bones: Vec<Bone> = body.bones().iter().map(|b| scaled(b, 0.5)).collect();
    let all = joints(body, &bones);
    let all = all.as_array().unwrap();
    let mut worlds: Vec<(DMat3, DVec3)> = Vec::new();
    for (i, joint) in all.iter().enumerate() {
        let own = turn(&joint["rotvec"]);
        let q: Vec<f64> =
            joint["quaternion"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let same = DMat3::from_quat(DQuat::from_xyzw(q[1], q[2], q[3], q[0])) - own;
        assert!(same.to_cols_array().iter().all(|x| x.abs() < 1e-9));
        let place = match joint["parent"].as_str() {
            None => (own, vector(&joint["head"])),
            Some(name) => {
                let p = all[..i].iter().position(|j| j["name"] == name).unwrap();
                let (up, from) = worlds[p];
                (up * own, from + up * (vector(&joint["rest"]) - vector(&all[p]["rest"])))
            }
        };
        worlds.push(place);
        // The body is twice as large in the scene, and a metre is two units: it has its size.
        assert!(place.1.distance(vector(&joint["head"])) < 1e-9, "{joint}");
    }
}

#[test]
fn arms_are_measured_from_smpl_s_rest() {
    let view = view(PLACED);
    let body = &view.solid().bodies()[0];
    let bones = body.bones();
    let said = smpl(body, &bones).unwrap();
    let mut worlds: Vec<DMat3> = Vec::new();
    for (i, (_, parent, _)) in SMPL.iter().enumerate() {
        worlds.push(parent.map_or(DMat3::IDENTITY, |p| worlds[p]) * turn(&said["pose"][i]));
    }
    // The directions of bones in SMPL's rest, turned by its pose.
    let lies = |joint: usize, rest: DVec3, from: &str, to: &str| {
        let at = |name: &str| bones.iter().find(|b| &*b.name == name).unwrap().head;
        let bone = (at(to) - at(from)).normalize();
        assert!((worlds[joint] * rest).distance(bone) < 1e-9, "{from}");
    };
    lies(16, DVec3::X, "upperarm_l", "lowerarm_l");
    lies(17, DVec3::NEG_X, "upperarm_r", "lowerarm_r");
    lies(18, DVec3::X, "lowerarm_l", "hand_l");
    lies(19, DVec3::NEG_X, "lowerarm_r", "hand_r");
    let rest = body.body.rig();
    let thigh = rest.joints()[rest.find("calf_r").unwrap()].head
        - rest.joints()[rest.find("thigh_r").unwrap()].head;
    lies(2, thigh.normalize(), "thigh_r", "calf_r");
    // With arms along the x axis, SMPL's are at rest.
    let at = |i: usize| vector(&said["pose"][i]);
    assert_eq!((at(22), at(1)), (DVec3::ZERO, DVec3::ZERO));
    assert!(at(2).distance(DVec3::new(-1.1, 0.0, 0.1)) < 1e-9);
}

#[test]
fn landmarks_are_metres_from_the_hips() {
    let view = view(PLACED);
    let said = mediapipe(&view.solid().bodies()[0], view.camera(), 0.5).unwrap();
    let at = |name: &str| {
        let l = &said[MEDIAPIPE.iter().position(|n| *n == name).unwrap()];
        let of = |axis: &str| l[axis].as_f64().unwrap();
        (DVec3::new(of("x"), of("y"), of("z")), l["visibility"].clone())
    };
    assert_eq!(said.as_array().unwrap().len(), 33);
    assert!((at("l_hip").0 + at("r_hip").0).length() < 1e-9);
    let landmark =
        |name: &str| view.solid().landmarks().iter().find(|l| &*l.name == name).unwrap().position;
    let apart = (landmark("nose") - landmark("l_hip").midpoint(landmark("r_hip"))) / 2.0;
    // Right, down, away.
    assert!(at("nose").0.distance(DVec3::new(apart.x, -apart.y, -apart.z)) < 1e-9);
    assert!(at("nose").0.y < -0.2, "{}", at("nose").0);
    for name in MEDIAPIPE {
        let there = view.solid().landmarks().iter().any(|l| &*l.name == name);
        assert_eq!(at(name).1, if there { 1 } else { 0 }, "{name}");
    }
}

#[test]
fn files_of_every_body() {
    let path = std::env::temp_dir().join(format!("pcadlang-poses-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    let dir = RunDir::create(&path).unwrap();
    let two = "let one = scene.skin(body, pose);
      let view = scene.render(scene.group({ a: one, b: scene.affine(translate = [2, 0, 0]) * one }));";
    write_poses(&dir, &view(two)).unwrap();
    let said: Value = serde_json::from_slice(&std::fs::read(path.join(POSE)).unwrap()).unwrap();
    assert_eq!(
        (&said["unit"], &said["bodies"][1]["bvh"]),
        (&json!("scene unit"), &json!("pose-2.bvh"))
    );
    assert!(said["bodies"][0].get("pose_world_landmarks").is_none());
    let text = std::fs::read_to_string(path.join("pose-2.bvh")).unwrap();
    assert!(text.starts_with("HIERARCHY\nROOT pelvis\n") && text.matches("JOINT").count() == 21);
    std::fs::remove_dir_all(&path).unwrap();
}
