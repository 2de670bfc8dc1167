//! `pcadlang evaluate` on small datasets: both layouts, resumption, failing cases, and
//! that the ground truth has no influence.

use crate::common::folder::{Done, Folder, disc, png};
use serde_json::{Value, json};

/// A sphere in a photograph.
const PROGRAM: &str = "include \"std/scene.pcad\" as scene; data photo: image \"the photograph\";
    param sd = 1 \"not used\";
    assume r ~ uniform(0.3, 1.5);
    assume view = scene.render(scene.sphere(r));
    observe scene.contour(view, size = 32) = photo as picture;
    infer { repeat 5 { drift(one(@**)); collect r; } }";

/// The same program with keypoints from a detector.
const DETECTED: &str =
    "include \"std/scene.pcad\" as scene; data photo: image; data keypoints: json = { keypoints: { hip: [0, 0] } };
    assume r ~ uniform(0.3, 1.5);
    assume view = scene.render(scene.sphere(r));
    observe scene.contour(view, size = 32) = photo as picture;
    predict x ~ normal(keypoints.keypoints.hip[0], 0.000001);
    infer { repeat 5 { drift(one(@**)); collect r, x; } }";

const CAMERA: &str = r#"{"model": "pinhole", "position": [0, 0, 6], "looks_along": [0, 0, -1], "up": [0, 1, 0],
    "image": [48, 32], "focal_px": 60, "principal_point": [24, 16]}"#;

fn picture(r: f64) -> Vec<u8> {
    png(disc(48, 32, 24.0, 16.0, r))
}

/// Writes the folders `a`, `b` (with a camera) and `notes` (without a picture).
fn folders(f: &Folder) {
    for name in ["data", "data/a", "data/b", "data/notes"] {
        std::fs::create_dir(f.path().join(name)).unwrap();
    }
    f.write("p.pcad", PROGRAM)
        .write("data/README.md", "a dataset")
        .write("data/notes/truth.txt", "x");
    f.write("data/a/image.png", picture(9.0))
        .write("data/b/image.png", picture(12.0))
        .write("data/b/camera.json", CAMERA);
}

/// Writes the people `one` and `two`; every field except for `id` and `image` is
/// `poison`.
fn people(f: &Folder, poison: &Value) {
    std::fs::create_dir_all(f.path().join("people")).unwrap();
    f.write("p.pcad", PROGRAM).write("d.pcad", DETECTED);
    f.write("people/one.png", picture(9.0)).write("people/two.png", picture(12.0));
    let person = |id: &str| {
        let mut p = json!({ "id": id, "image": format!("{id}.png") });
        for key in ["width", "height", "keypoints", "bbox", "camera", "tags", "seconds"] {
            p[key] = poison.clone();
        }
        p
    };
    let all =
        json!({ "format": poison, "people": [person("two"), person("one")], "truth": poison });
    f.write("people/annotations.json", all.to_string());
}

fn evaluate(f: &Folder, more: &[&str]) -> Done {
    let mut args = vec!["evaluate", "p.pcad"];
    args.extend(more);
    args.extend(["--steps", "20", "--warmup", "10", "--chains", "2"]);
    f.run(&args)
}

fn json_of(f: &Folder, name: &str) -> Value {
    serde_json::from_str(&f.read(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn draws(f: &Folder, dir: &str) -> String {
    f.read(&format!("{dir}/chain-1.csv"))
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|l| format!("{l}\n"))
        .collect()
}

fn modified(f: &Folder, name: &str) -> std::time::SystemTime {
    std::fs::metadata(f.path().join(name)).unwrap().modified().unwrap()
}

#[test]
fn a_folder_for_each_case() {
    let f = Folder::new("evaluate_folders");
    folders(&f);
    let d = evaluate(&f, &["data", "--out", "out"]);
    assert_eq!(d.code, 0, "{}", d.err);
    let said: Vec<&str> = d.err.lines().collect();
    assert_eq!(said[0], "note: notes has no image and is skipped");
    assert!(said[1].starts_with("1/2 a: ") && said[1].contains("draws"), "{}", d.err);
    assert!(said[2].starts_with("2/2 b: ") && said.len() == 3, "{}", d.err);
    assert_eq!(d.out, f.read("out/table.md"));
    assert!(d.out.starts_with("| case | status |") && d.out.lines().count() == 4, "{}", d.out);
    let e = json_of(&f, "out/evaluation.json");
    assert_eq!(
        (&e["program"], &e["seed"], &e["layout"]),
        (&json!("p.pcad"), &json!(1), &json!("folders"))
    );
    assert_eq!(
        e["settings"],
        json!({ "chains": 2, "steps": 20, "warmup": 10, "time": null, "incremental": true })
    );
    for (i, name) in ["a", "b"].iter().enumerate() {
        let row = &e["cases"][i];
        assert_eq!(
            (&row["case"], &row["status"], &row["error"]),
            (&json!(name), &json!("done"), &Value::Null)
        );
        assert!(
            row["seconds"].as_f64() <= row["wall_seconds"].as_f64()
                && row["seconds"].as_f64() > Some(0.0)
        );
        assert!(row["best_log_joint"].is_f64() && row["draws"].as_u64() > Some(0), "{row}");
        assert_eq!(row["steps"], json!(40), "of both chains; the program has no warm-up");
        for file in ["depth.npy", "normals.npy", "mask.png", "best.obj", "report.html", "run.json"]
        {
            assert!(f.exists(&format!("out/{name}/{file}")), "{name}/{file}");
        }
    }
    assert!(!f.exists("out/predictions.json") && !f.exists("out/notes"));
    // Each case equals the result of `run`, including its camera.
    let run = |camera: &[&str], out: &str| {
        let image = format!("data/{out}/image.png");
        let mut args = vec!["run", "p.pcad", "--observe", &image, "--out", out, "--quiet"];
        args.extend(["--steps", "20", "--warmup", "10", "--chains", "2"]);
        args.extend(camera);
        f.succeeds(&args);
        assert_eq!(draws(&f, out), draws(&f, &format!("out/{out}")));
    };
    run(&[], "a");
    run(&["--camera", "data/b/camera.json"], "b");
}

/// Other files beside a picture are not even opened: reading a pipe without a writer
/// would block forever.
#[cfg(unix)]
#[test]
fn the_truth_in_a_folder_is_not_opened() {
    let f = Folder::new("evaluate_truth");
    folders(&f);
    for truth in ["gt.npz", "mask.png", "depth16.png", "meta.json", "mesh.obj"] {
        let made = std::process::Command::new("mkfifo")
            .arg(f.path().join("data/a").join(truth))
            .status()
            .unwrap();
        assert!(made.success());
    }
    assert_eq!(evaluate(&f, &["data", "--out", "out", "--only", "a", "--quiet"]).code, 0);
}

#[test]
fn people_and_their_predictions() {
    let f = Folder::new("evaluate_people");
    people(&f, &json!({ "l_hip": [1, 2, 2] }));
    let d = evaluate(&f, &["people", "--out", "out", "--json"]);
    assert_eq!((d.code, d.out.lines().count()), (0, 1), "{}", d.err);
    let e = json_of(&f, "out/evaluation.json");
    assert_eq!(serde_json::from_str::<Value>(&d.out).unwrap(), e);
    assert_eq!(
        (&e["layout"], &e["cases"][0]["case"], &e["cases"][1]["case"]),
        (&json!("people"), &json!("two"), &json!("one"))
    );
    // The scene has no landmarks.
    let p = json_of(&f, "out/predictions.json");
    assert_eq!((&p["one"]["keypoints"], &p["two"]["keypoints"]), (&Value::Null, &Value::Null));
    assert_eq!(p["one"]["seconds"], e["cases"][1]["seconds"]);
    // A run that has keypoints is reused with them.
    f.write(
        "out/one/keypoints.json",
        r#"{"keypoints": {"l_hip": [3.5, 4, 0.2]}, "best": {"l_hip": [0, 0]}, "seconds": 7}"#,
    );
    assert_eq!(evaluate(&f, &["people", "--out", "out", "--quiet"]).code, 0);
    let p = json_of(&f, "out/predictions.json");
    assert_eq!(p["one"], json!({ "keypoints": { "l_hip": [3.5, 4.0] }, "seconds": 7.0 }));
    assert_eq!(p["two"]["keypoints"], Value::Null);
}

#[test]
fn other_fields_of_annotations_have_no_influence() {
    let mut all = Vec::new();
    for (i, poison) in [
        json!({ "l_hip": [1, 2, 2] }),
        json!("not what is expected"),
        json!(-1e300),
        json!([[{ "image": "x.png" }]]),
    ]
    .iter()
    .enumerate()
    {
        let f = Folder::new(&format!("evaluate_poison_{i}"));
        people(&f, poison);
        let d = evaluate(&f, &["people", "--out", "out", "--quiet"]);
        assert_eq!((d.code, d.out.as_str(), d.err.as_str()), (0, "", ""));
        let mut run = json_of(&f, "out/one/run.json");
        let of_the_clock =
            |k: &&String| k.contains("seconds") || ["chains", "begun"].contains(&k.as_str());
        let keys: Vec<String> =
            run.as_object().unwrap().keys().filter(of_the_clock).cloned().collect();
        keys.iter().for_each(|k| run[k] = Value::Null);
        let files: Vec<String> = f.files().into_iter().filter(|n| n.starts_with("out")).collect();
        all.push((draws(&f, "out/one"), draws(&f, "out/two"), run, files));
    }
    assert!(all.iter().all(|a| *a == all[0]), "{all:?}");
    assert!(all[0].0 != all[0].1 && all[0].0.lines().count() > 5);
}

#[test]
fn keypoints_of_a_detector() {
    let f = Folder::new("evaluate_detected");
    people(&f, &json!(null));
    f.write(
        "found.json",
        r#"{"one": {"keypoints": {"hip": [41.5, 3]}, "seconds": 1}, "two": {"keypoints": null}}"#,
    );
    let args = [
        "evaluate",
        "d.pcad",
        "people",
        "--keypoints",
        "found.json",
        "--steps",
        "20",
        "--chains",
        "1",
        "--out",
        "out",
    ];
    let d = f.succeeds(&args);
    assert!(
        d.err.contains("note: no keypoints for two: it runs on its picture alone"),
        "{}",
        d.err
    );
    assert!(!d.err.contains("detected in one"), "{}", d.err);
    let x = |case: &str| {
        json_of(&f, &format!("out/{case}/summary.json"))["quantities"]["x"]["mean"]
            .as_f64()
            .unwrap()
    };
    assert!((x("one") - 41.5).abs() < 1e-3 && x("two").abs() < 1e-3, "{} {}", x("one"), x("two"));
    let run = json_of(&f, "out/one/run.json");
    assert_eq!(run["observe"], json!(["photo=people/one.png", "keypoints=found.json#one"]));
    // Another person in the file does not affect this one.
    f.write(
        "found.json",
        r#"{"one": {"keypoints": {"hip": [41.5, 3]}, "seconds": 1}, "three": {}}"#,
    );
    assert!(f.succeeds(&args).err.contains("1/2 two: already done\n2/2 one: already done"));
    f.write("found.json", r#"{"one": {"keypoints": {"hip": [0, 3]}}}"#);
    f.refuses(&args, "one was run with different settings: picture, hint, camera or keypoints");
    f.refuses(
        &["evaluate", "p.pcad", "people", "--keypoints", "found.json", "--out", "x"],
        "no item of kind `keypoints`",
    );
    f.write("found.json", "[]");
    f.refuses(&args, "found.json: expected a JSON object with one entry per case");
}

#[test]
fn what_is_done_is_not_done_again() {
    let f = Folder::new("evaluate_again");
    folders(&f);
    let all = ["data", "--out", "out"];
    assert_eq!(evaluate(&f, &["data", "--out", "out", "--only", "b"]).code, 0);
    let table = f.read("out/table.md");
    assert!(table.contains("| b ") && !table.contains("| a "), "{table}");
    assert!(evaluate(&f, &all).err.contains("2/2 b: already done"));
    let (before, files) = (f.read("out/evaluation.json"), f.files());
    let times = ["out/a/run.json", "out/b/run.json"].map(|n| modified(&f, n));
    let d = evaluate(&f, &all);
    assert!(
        d.err.ends_with("1/2 a: already done\n2/2 b: already done\n") && d.code == 0,
        "{}",
        d.err
    );
    assert_eq!((f.read("out/evaluation.json"), f.files()), (before, files));
    assert_eq!(["out/a/run.json", "out/b/run.json"].map(|n| modified(&f, n)), times);
    // A case whose folder is missing, and one that was interrupted, are run again.
    let (a, b) = (draws(&f, "out/a"), draws(&f, "out/b"));
    std::fs::remove_dir_all(f.path().join("out/a")).unwrap();
    let stopped = f.read("out/b/run.json").replace("\"done\"", "\"running\"");
    f.write("out/b/run.json", stopped).write("out/b/chain-1.csv", "half a");
    let d = evaluate(&f, &all);
    assert!(d.code == 0 && !d.err.contains("before"), "{}", d.err);
    assert_eq!((draws(&f, "out/a"), draws(&f, "out/b")), (a, b));
    // One case is run again: the other stays in the table.
    let d = evaluate(&f, &["data", "--out", "out", "--only", "a", "--fresh"]);
    assert!(
        !d.err.contains("before") && d.out.contains("| a ") && d.out.contains("| b "),
        "{}{}",
        d.err,
        d.out
    );
}

#[test]
fn other_settings_are_an_error_that_names_them() {
    let f = Folder::new("evaluate_other");
    folders(&f);
    let base = [
        "evaluate", "p.pcad", "data", "--out", "out", "--steps", "20", "--warmup", "10",
        "--chains", "2",
    ];
    f.succeeds(&base);
    let with = |more: &[&'static str]| {
        base.iter().copied().chain(more.iter().copied()).collect::<Vec<_>>()
    };
    f.refuses(
        &with(&["--seed", "2"]),
        "out/a was run with different settings: seed (was 1, now 2)",
    );
    f.refuses(&with(&["--set", "sd=2"]), "program, --set");
    f.refuses(
        &with(&["--time", "3s", "--no-incremental"]),
        "time (was none, now 3.0), incremental (was true, now false)",
    );
    f.write("p.pcad", format!("{PROGRAM} // changed"));
    f.refuses(&base, "different settings: program");
    f.write("p.pcad", PROGRAM).write("data/b/image.png", picture(5.0));
    f.refuses(&base, "out/b was run with different settings: picture, hint, camera or keypoints");
    let old = draws(&f, "out/b");
    f.succeeds(&with(&["--fresh"]));
    assert_ne!(draws(&f, "out/b"), old);
    f.succeeds(&base);
}

#[test]
fn a_case_that_fails_does_not_stop_the_rest() {
    let f = Folder::new("evaluate_broken");
    folders(&f);
    f.write("data/a/image.png", "no picture");
    let d = evaluate(&f, &["data", "--out", "out"]);
    assert_eq!(d.code, 1);
    assert!(d.err.contains("1/2 a: failed\nerror: data/a/image.png: "), "{}", d.err);
    assert!(d.err.ends_with("error: 1 of 2 cases failed: a\n"), "{}", d.err);
    let e = json_of(&f, "out/evaluation.json");
    assert_eq!(
        (&e["cases"][0]["status"], &e["cases"][1]["status"]),
        (&json!("failed"), &json!("done"))
    );
    assert!(e["cases"][0]["error"].as_str().unwrap().contains("data/a/image.png"));
    assert!(d.out.contains("| failed ") && d.out.contains("* a: data/a/image.png: "), "{}", d.out);
    assert_eq!(json_of(&f, "out/a/run.json")["state"], "failed");
    assert!(!f.exists("out/a/depth.npy") && f.exists("out/b/depth.npy"));
    // After the file is repaired, only that case is run.
    f.write("data/a/image.png", picture(9.0));
    let d = evaluate(&f, &["data", "--out", "out"]);
    assert!(d.code == 0 && d.err.contains("2/2 b: already done"), "{}", d.err);
    assert!(f.exists("out/a/depth.npy"));
    // An invalid camera also affects only its own case, and the earlier results of that
    // case are removed.
    f.write("data/b/camera.json", "{}");
    let d = evaluate(&f, &["data", "--out", "out", "--fresh"]);
    assert!(d.code == 1 && d.err.contains("error: data/b/camera.json: "), "{}", d.err);
    assert!(!f.exists("out/b/depth.npy") && f.exists("out/a/depth.npy"));
}

#[test]
fn what_is_no_dataset_leaves_nothing() {
    let f = Folder::new("evaluate_refused");
    folders(&f);
    let refuses = |f: &Folder, dataset: &str, says: &str| {
        f.refuses(&["evaluate", "p.pcad", dataset, "--out", "out"], says)
    };
    std::fs::create_dir(f.path().join("empty")).unwrap();
    refuses(&f, "empty", "empty: not a dataset");
    refuses(&f, "nowhere", "cannot read nowhere: ");
    refuses(&f, "data/a", "data/a: not a dataset");
    let d = f.run(&["evaluate", "p.pcad", "data/a", "--out", "out"]);
    assert!(d.err.contains("hint: this is a single case"), "{}", d.err);
    f.refuses(
        &["evaluate", "p.pcad", "data", "--out", "out", "--only", "aa"],
        "data: there is no case \"aa\"",
    );
    f.refuses(
        &["evaluate", "p.pcad", "data", "--out", "data"],
        "data is not empty and is not the folder of an evaluation",
    );
    f.refuses(&["evaluate", "p.pcad", "data", "--out", "out", "--set", "x=1"], "x");
    f.refuses(
        &["evaluate", "coin.pcad", "data", "--out", "out"],
        "the program observes no item of kind `image`",
    );
    let people = |text: &str| {
        f.write("empty/annotations.json", text);
    };
    for (text, says) in [
        ("{", "annotations.json: EOF"),
        ("{\"images\": []}", "missing field `people`"),
        ("{\"people\": []}", "empty: not a dataset"),
        ("{\"people\": [{\"id\": 3, \"image\": \"x.png\"}]}", "expected a string"),
        (
            "{\"people\": [{\"id\": \"a\", \"image\": \"../x.png\"}]}",
            "is not a file in the same folder",
        ),
        (
            "{\"people\": [{\"id\": \"../a\", \"image\": \"x.png\"}]}",
            "cannot be used as a folder name",
        ),
        (
            "{\"people\": [{\"id\": \"table.md\", \"image\": \"x.png\"}]}",
            "cannot be used as a folder name",
        ),
        (
            "{\"people\": [{\"id\": \"a\", \"image\": \"x\"}, {\"id\": \"a\", \"image\": \"y\"}]}",
            "the case a occurs twice",
        ),
    ] {
        people(text);
        refuses(&f, "empty", says);
    }
}

/// Ctrl-C ends the present case, keeps its draws, and does not count it as done.
#[cfg(unix)]
#[test]
fn an_interrupted_evaluation_goes_on_later() {
    use std::process::{Command, Stdio};
    use std::time::Duration;
    let f = Folder::new("evaluate_interrupted");
    folders(&f);
    // The first evaluation would take a year.
    let program = PROGRAM.replace("repeat 5", "repeat 1000000000");
    f.write("p.pcad", program);
    let mut child = Command::new(env!("CARGO_BIN_EXE_pcadlang"))
        .args(["evaluate", "p.pcad", "data", "--out", "out", "--chains", "2", "--threads", "2"])
        .current_dir(f.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let under_way = |f: &Folder| {
        f.exists("out/a/chain-2.csv") && f.read("out/a/chain-2.csv").lines().count() > 20
    };
    for _ in 0..600 {
        if under_way(&f) {
            break;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(under_way(&f));
    let status = |i: usize| json_of(&f, "out/evaluation.json")["cases"][i]["status"].clone();
    assert_eq!(
        (status(0), status(1)),
        (json!("pending"), json!("pending")),
        "readable before the first case ends"
    );
    assert!(
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success()
    );
    assert_eq!(child.wait().unwrap().code(), Some(3));
    assert_eq!((status(0), status(1)), (json!("interrupted"), json!("pending")));
    assert!(f.read("out/table.md").contains("| interrupted |") && !f.exists("out/b"));
    assert!(f.exists("out/a/depth.npy") && draws(&f, "out/a").lines().count() > 10);
    // Settings that differ from those of an unfinished case are an error, too.
    let d = evaluate(&f, &["data", "--out", "out"]);
    assert!(
        d.code == 1
            && d.err.contains(
                "out/a was run with different settings: steps (was none, \
                                       now 20)"
            ),
        "{}",
        d.err
    );
}
