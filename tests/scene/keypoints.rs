//! Detected joints from the file to the posterior, with the library and with the command.

use crate::common::folder::{Folder, disc, png};
use crate::common::snapshots::assert_session;
use pcadlang::{Model, Program, RunOptions};
use pcadlang_engine::lang::value::Value;
use pcadlang_library::scene::{ImageValue, KeypointsValue};
use pcadlang_scene::vision::Photo;
use pcadlang_scene::vision::keypoints::{
    Detection, Keypoint, KeypointLikelihood, KeypointOptions, Keypoints, People,
};

/// A bar with two landmarks at its ends, which moves in the picture plane.
const BAR: &str = "include \"std/scene.pcad\" as scene;
data photo: image \"the photograph\";
data points = keypoints();
param sd = 1.5;
let bar = scene.landmarks(scene.box([0.2, 2, 0.2]), { nose: [0, 1, 0], l_ankle: [0, -1, 0] });
assume x ~ normal(0, 1);
assume y ~ normal(0, 1);
let view = scene.render(scene.affine(translate = [x, y, 0]) * bar);
observe scene.keypoints(view, sd = sd) = points as joints;
infer { warmup 1000 { drift(one(@**)); } repeat 4000 { drift(one(@**)); collect x, y; } }";

fn picture() -> Vec<u8> {
    png(disc(440, 220, 220.0, 110.0, 50.0))
}

fn photo() -> Value {
    let photo = pcadlang_scene::vision::photo::decode(&picture(), &Default::default());
    let photo: Photo = photo.unwrap();
    Value::object(ImageValue::photo(photo))
}

/// Compiles `BAR` with the joints of this JSON text.
fn model(joints: Option<&str>) -> Model {
    let mut p = Program::parse(BAR).unwrap().observe("photo", photo());
    if let Some(text) = joints {
        let k = People::parse(text.as_bytes()).unwrap().pick(None, None).unwrap();
        p = p.observe("points", Value::object(KeypointsValue(k)));
    }
    p.compile().unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn no_detections_have_the_log_density_zero() {
    for m in
        [model(None), model(Some("{\"keypoints\": null}")), model(Some("{\"l_eye\": [1, 2, 0.5]}"))]
    {
        let t = m.simulate(1, 0).unwrap();
        assert_eq!(t.log_likelihood(), 0.0);
        assert!(!t.is_pseudo());
    }
}

#[test]
fn programs_read_landmarks() {
    let text = "include \"std/scene.pcad\" as scene;
        let arm = scene.landmarks(scene.sphere(1), { hand: [0, 2, 0], elbow: [0, 1, 0] });
        let both = scene.group([arm, scene.affine(translate = [5, 0, 0], scale = 3) * arm]).landmarks;
        assume x ~ normal(both[\"hand#2\"][0] + both.elbow[1], 1);
        observe normal(both[\"elbow#2\"][1], 1) = 3;";
    let t = Model::from_text(text).unwrap_or_else(|e| panic!("{e}")).simulate(1, 0).unwrap();
    assert!(
        (t.log_likelihood() + 0.5 * f64::ln(std::f64::consts::TAU)).abs() < 1e-12,
        "{}",
        t.log_likelihood()
    );
    let wrong = text.replace("{ hand: [0, 2, 0]", "{ hand: [0, 2]");
    let said = Model::from_text(&wrong).unwrap().simulate(1, 0).unwrap_err().to_string();
    assert!(
        said.contains("scene.landmarks: `points` must be a record of points [x, y, z]"),
        "{said}"
    );
}

#[test]
fn the_likelihood_is_that_of_the_projected_landmarks() {
    // The default camera shows 4.4 units over 440 pixels at its own depth of 8.
    let m = model(Some("{\"nose\": [250, 20], \"l_ankle\": [230, 205, 0.25], \"r_ear\": [5, 5]}"));
    let by = KeypointLikelihood::new(440.0, 220.0, 0.0, &KeypointOptions::default()).unwrap();
    for seed in 0..5 {
        let t = m.simulate(seed, 0).unwrap();
        let find =
            |n: &str| t.choices().into_iter().find(|(a, ..)| a.to_string().contains(n)).unwrap().1;
        let (Value::Num(x), Value::Num(y)) = (find("x"), find("y")) else { panic!("two numbers") };
        let at = |dy: f64| Some([220.0 + 100.0 * x, 110.0 - 100.0 * (y + dy)]);
        let expected = by.log_density(&Detection::new([250.0, 20.0], 1.0), at(1.0))
            + by.log_density(&Detection::new([230.0, 205.0], 0.25), at(-1.0));
        assert!((t.log_likelihood() - expected).abs() < 1e-9, "{} {expected}", t.log_likelihood());
    }
}

/// OpenPose's toes and COCO-WholeBody's hands go to MediaPipe's landmarks, with their spread.
#[test]
fn joints_go_to_the_landmark_in_the_same_place() {
    let text = BAR
        .replace("{ nose: [0, 1, 0], l_ankle:", "{ l_foot_index: [0, 1, 0], l_index:")
        .replace("param sd = 1.5;", "let sd = { other: 1, l_foot_index: 4, l_index: 2 };");
    let likelihood = |joints: &str| {
        let k = People::parse(joints.as_bytes()).unwrap().pick(None, None).unwrap();
        let p = Program::parse(&text).unwrap().observe("photo", photo());
        let m = p.observe("points", Value::object(KeypointsValue(k))).compile();
        m.unwrap_or_else(|e| panic!("{e}")).simulate(3, 0).unwrap().log_likelihood()
    };
    let own = likelihood("{\"l_foot_index\": [250, 20], \"l_index\": [230, 205]}");
    let zeros = |n: usize| "0, 0, 0, ".repeat(n);
    let openpose = format!(
        "{{\"people\": [{{\"pose_keypoints_2d\": [{}250, 20, 1, {}0, 0, 0], \
         \"hand_left_keypoints_2d\": [{}230, 205, 1, {}0, 0, 0]}}]}}",
        zeros(19),
        zeros(4),
        zeros(5),
        zeros(14)
    );
    assert!(own.is_finite() && own != 0.0);
    assert_eq!(likelihood(&openpose), own);
}

#[test]
fn pixels_shares_and_other_sizes_of_the_picture_agree() {
    let likelihood = |k: Keypoints| {
        let p = Program::parse(BAR)
            .unwrap()
            .observe("photo", photo())
            .observe("points", Value::object(KeypointsValue(k)));
        p.compile().unwrap().simulate(3, 0).unwrap().log_likelihood()
    };
    let of = |joints: [(&str, f64, f64); 2]| {
        let point = |(n, x, y): (&str, f64, f64)| Keypoint::new(n, [x, y], 0.75);
        Keypoints::new(joints.map(point).to_vec()).unwrap()
    };
    let pixels = likelihood(of([("nose", 250.0, 20.0), ("l_ankle", 230.0, 205.0)]));
    let list: Vec<String> = (0..33)
        .map(|i| {
            let (x, y) = if i == 0 { (250.0, 20.0) } else { (230.0, 205.0) };
            format!("{{\"x\": {}, \"y\": {}, \"visibility\": 0.75}}", x / 440.0, y / 220.0)
        })
        .collect();
    let shares =
        People::parse(format!("{{\"pose_landmarks\": [{}]}}", list.join(", ")).as_bytes()).unwrap();
    let shares = shares.pick(None, None).unwrap();
    let known = |n: &&Keypoint| ["nose", "l_ankle"].contains(&&*n.name);
    assert!(shares.is_normalised());
    let kept = Keypoints::new(
        shares
            .points()
            .iter()
            .filter(known)
            .map(|p| {
                let [x, y] = shares.position(p, (440, 220));
                Keypoint { x, y, ..p.clone() }
            })
            .collect(),
    );
    assert!((likelihood(kept.unwrap()) - pixels).abs() < 1e-9);
    // A picture of twice the size: a density over four times the area, for each of two
    // joints.
    let double = of([("nose", 500.0, 40.0), ("l_ankle", 460.0, 410.0)]).in_image(880, 440);
    assert!((likelihood(double) + 2.0 * f64::ln(4.0) - pixels).abs() < 1e-9);
}

#[test]
fn the_posterior_is_that_of_a_normal_mean() {
    // With a negligible proportion of outliers, x given two detections is normal.
    let m = model(Some("{\"nose\": [270, 40], \"l_ankle\": [262, 236]}"));
    let p = m.run(&RunOptions { seed: 2, ..RunOptions::default() }, 4, 2).unwrap();
    let s = 0.015 * f64::hypot(440.0, 220.0) / 100.0;
    let precision = 1.0 + 2.0 / (s * s);
    let (mean, sd) = ((0.5 + 0.42) / (s * s) / precision, precision.sqrt().recip());
    let x = p.quantity("x").unwrap().summary;
    assert!(
        (x.mean - mean).abs() < 0.2 * sd && (x.sd / sd - 1.0).abs() < 0.15,
        "{x:?} {mean} {sd}"
    );
}

const RUN: [&str; 11] = [
    "run",
    "bar.pcad",
    "--observe",
    "anna.png",
    "--steps",
    "300",
    "--warmup",
    "300",
    "--chains",
    "2",
    "--quiet",
];

fn run<'a>(more: &[&'a str]) -> Vec<&'a str> {
    RUN.iter().copied().chain(more.iter().copied()).collect()
}

fn folder(name: &str) -> Folder {
    let f = Folder::new(name);
    f.write("bar.pcad", BAR).write("anna.png", picture());
    f.write(
        "one.json",
        "{\"nose\": [270, 40, 0.9], \"l_ankle\": [262, 236, 0.9], \"l_eye\": [1, 1, 1]}",
    );
    f.write(
        "many.json",
        "{\"bert\": {\"keypoints\": {\"nose\": [100, 20]}}, \"anna\": {\"keypoints\": {\"nose\": [270, 40], \"l_ankle\": [262, 236]}}}",
    );
    f
}

#[test]
fn a_run_leaves_where_the_joints_are() {
    let f = folder("keypoints_run");
    f.succeeds(&run(&["--keypoints", "one.json", "--out", "a"]));
    f.succeeds(&run(&["--keypoints", "many.json", "--out", "b", "--threads", "1"]));
    f.succeeds(&run(&["--observe", "points=many.json#anna", "--out", "c", "--threads", "2"]));
    f.succeeds(&run(&["--keypoints", "many.json#bert", "--out", "d"]));
    f.succeeds(&run(&["--out", "e"]));
    let json = |dir: &str| -> serde_json::Value {
        serde_json::from_str(&f.read(&format!("{dir}/keypoints.json"))).unwrap()
    };
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    let (a, b, c) = (json("a"), json("b"), json("c"));
    assert_eq!(
        a.as_object().unwrap().keys().collect::<Vec<_>>(),
        ["keypoints", "body", "scene", "best", "seconds"]
    );
    // Without an offset, the joints equal those of the scene; the camera shows 4.4 units
    // over 440 pixels.
    assert_eq!(a["keypoints"], a["body"]);
    let (own, scene) = (&a["body"]["nose"], &a["scene"]["nose"]);
    assert!((number(&own[0]) - 220.0 - 100.0 * number(&scene[0])).abs() < 0.5, "{own} {scene}");
    assert!((110.0 - number(&own[1]) - 100.0 * number(&scene[1])).abs() < 0.5, "{own} {scene}");
    for of in [&a, &b] {
        let nose = &of["keypoints"]["nose"];
        assert!(
            (number(&nose[0]) - 266.0).abs() < 6.0 && (number(&nose[1]) - 38.0).abs() < 6.0,
            "{nose}"
        );
        // Two detections with a standard deviation of 1.5 percent of the diagonal.
        let sd = 0.015 * f64::hypot(440.0, 220.0) / f64::sqrt(2.0);
        assert!((number(&nose[2]) / sd - 1.0).abs() < 0.5, "{nose} {sd}");
        let best = &of["best"]["l_ankle"];
        assert!(
            (number(&best[0]) - 266.0).abs() < 6.0 && (number(&best[1]) - 238.0).abs() < 6.0,
            "{best}"
        );
        assert_eq!(
            (of["keypoints"].as_object().unwrap().len(), of["best"].as_object().unwrap().len()),
            (2, 2)
        );
    }
    assert_eq!(
        (&b["keypoints"], &b["best"]),
        (&c["keypoints"], &c["best"]),
        "the same on any number of threads"
    );
    assert!((number(&json("d")["keypoints"]["nose"][0]) - 100.0).abs() < 12.0);
    assert!(number(&json("e")["keypoints"]["nose"][2]) > 50.0, "the prior alone");
    assert!(number(&json("a")["seconds"]) > 0.0);
    assert!(f.read("b/run.json").contains("keypoints=many.json"));
    let overlay = image::open(f.path().join("a/overlay.png")).unwrap().to_rgb8();
    assert!(overlay.pixels().any(|p| p.0 == [255, 220, 0]), "its landmarks are drawn");

    f.write("ball.pcad", "include \"std/scene.pcad\" as scene; assume r ~ uniform(0.5, 1); let view = scene.render(scene.sphere(r)); observe normal(r, 0.1) = 0.7;");
    f.succeeds(&["run", "ball.pcad", "--steps", "10", "--warmup", "10", "--quiet", "--out", "a"]);
    assert!(!f.exists("a/keypoints.json"), "nothing of an earlier run stays");
}

/// Systematic errors, about which detections are uninformative: the draws are the same,
/// and the intervals of the joints and of the body's own joints are wider.
#[test]
fn systematic_errors_widen_what_is_said_and_nothing_else() {
    let f = folder("keypoints_systematic");
    f.succeeds(&run(&["--keypoints", "one.json", "--out", "a"]));
    f.write("bar.pcad", BAR.replace("sd = sd)", "sd = sd, systematic = 2)"));
    f.succeeds(&run(&["--keypoints", "one.json", "--out", "b"]));
    let json = |dir: &str| -> serde_json::Value {
        serde_json::from_str(&f.read(&format!("{dir}/keypoints.json"))).unwrap()
    };
    let (a, b) = (json("a"), json("b"));
    assert_eq!((&a["best"], &a["scene"]), (&b["best"], &b["scene"]), "the density is as it was");
    let error = 0.02 * f64::hypot(440.0, 220.0);
    for (of, joint) in [("keypoints", "nose"), ("body", "nose"), ("body", "l_ankle")] {
        let [before, after] = [&a, &b].map(|j| j[of][joint][2].as_f64().unwrap());
        assert!((after - f64::hypot(before, error)).abs() < 0.01, "{of} {joint}: {before} {after}");
    }
}

#[test]
fn the_means_are_those_of_the_collected_draws() {
    let f = folder("keypoints_means");
    f.succeeds(&run(&["--keypoints", "one.json", "--out", "a"]));
    let json: serde_json::Value = serde_json::from_str(&f.read("a/keypoints.json")).unwrap();
    let (mut sum, mut n) = ([0.0; 2], 0.0);
    for chain in ["a/chain-1.csv", "a/chain-2.csv"] {
        let text = f.read(chain);
        let mut rows = text.lines().filter(|l| !l.starts_with('#'));
        let header: Vec<&str> = rows.next().unwrap().split(',').collect();
        let at = |name: &str| {
            header.iter().position(|h| *h == name).unwrap_or_else(|| panic!("{header:?}"))
        };
        for row in rows {
            let cells: Vec<f64> = row.split(',').map(|c| c.parse().unwrap()).collect();
            sum = [sum[0] + cells[at("x")], sum[1] + cells[at("y")]];
            n += 1.0;
        }
    }
    let nose = [220.0 + 100.0 * sum[0] / n, 110.0 - 100.0 * (sum[1] / n + 1.0)];
    for i in 0..2 {
        let told = json["keypoints"]["nose"][i].as_f64().unwrap();
        assert!((told - nose[i]).abs() < 2e-3, "{told} {nose:?}");
    }
}

/// The messages of refused runs, word for word.
#[test]
fn what_is_said_of_keypoints_that_are_wrong() {
    let f = folder("keypoints_wrong");
    f.write("cut.json", "{\"nose\": [1, 2")
        .write("nan.json", "{\"nose\": [NaN, 2]}")
        .write("odd.json", "[1, 2]");
    f.write("tail.json", "{\"nose\": [1, 2], \"l_ankel\": [3, 4]}")
        .write("sure.json", "{\"nose\": [1, 2, -1]}");
    f.write("wide.json", "{\"keypoints\": {\"nose\": [1, 2]}, \"width\": 100, \"height\": 900}");
    f.write("mp.json", "{\"pose_landmarks\": [{\"x\": 0, \"y\": 0}]}");
    f.write(
        "coco.json",
        "{\"annotations\": [{\"id\": 3, \"image_id\": 4, \"keypoints\": [1, 2, 3]}]}",
    );
    f.write("others.json", "{\"bert\": {\"keypoints\": null}, \"carl\": {\"keypoints\": null}}");
    f.write(
        "none.pcad",
        "data photo: image; assume x ~ normal(0, 1); observe normal(x, 1) = photo.width;",
    );
    f.write(
        "needs.pcad",
        "data joints: keypoints; assume x ~ normal(0, 1); observe normal(x, 1) = joints.count;",
    );
    f.write(
        "two.pcad",
        "data a = keypoints(); data b = keypoints(); assume x ~ normal(0, 1); observe normal(x, 1) = a.count + b.count;",
    );
    let mut all = String::new();
    let mut says = |args: &[&str]| {
        let d = f.run(args);
        assert_eq!(d.code, 1, "{args:?}: {}{}", d.out, d.err);
        all.push_str(&format!("$ pcadlang {}\n{}\n\n", args.join(" "), d.err.trim_end()));
    };
    for file in ["cut", "nan", "odd", "tail", "sure", "wide", "mp", "coco", "others", "missing"] {
        says(&run(&["--out", "out", "--keypoints", &format!("{file}.json")]));
    }
    says(&run(&["--out", "out", "--keypoints", "many.json#ann"]));
    says(&run(&["--out", "out", "--keypoints", "one.json#anna"]));
    says(&run(&["--out", "out", "--observe", "points=others.json"]));
    says(&["run", "none.pcad", "--observe", "anna.png", "--keypoints", "one.json"]);
    says(&["run", "two.pcad", "--keypoints", "one.json"]);
    says(&["run", "needs.pcad"]);
    assert_session("keypoints_wrong", all.trim_end());
}

#[test]
fn the_people_of_the_development_pictures_are_found_by_their_files() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/humans");
    let file = root.join("baselines/mediapipe_full.json");
    let picture = root.join("coco_535506_441444.jpg");
    if !file.exists() || !picture.exists() {
        return;
    }
    let f = Folder::new("keypoints_development");
    let joints: Vec<String> = pcadlang_scene::vision::keypoints::COCO[5..]
        .iter()
        .map(|n| format!("{n}: [0, 0, 0]"))
        .collect();
    f.write(
        "p.pcad",
        format!(
            "include \"std/scene.pcad\" as scene; data photo: image; data k = keypoints(); assume x ~ normal(0, 1);
             let s = scene.landmarks(scene.sphere(0.5), {{ {} }});
             let view = scene.render(scene.affine(translate = [x, 0, 0]) * s);
             observe scene.keypoints(view) = k;",
            joints.join(", ")
        ),
    );
    let (file, picture) =
        (file.to_string_lossy().into_owned(), picture.to_string_lossy().into_owned());
    f.succeeds(&[
        "run",
        "p.pcad",
        "--observe",
        &picture,
        "--keypoints",
        &file,
        "--steps",
        "20",
        "--warmup",
        "20",
        "--quiet",
        "--out",
        "o",
    ]);
    let json: serde_json::Value = serde_json::from_str(&f.read("o/keypoints.json")).unwrap();
    assert_eq!(json["best"].as_object().unwrap().len(), 12);
    // The picture is 337 x 512 pixels; all joints are in its middle row.
    assert_eq!(json["keypoints"]["l_hip"][1], 256.0);
}
