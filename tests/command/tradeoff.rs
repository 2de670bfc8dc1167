//! `pcadlang tradeoff` on small cases with each kind of ground truth: tables, resumption,
//! presets, and their use by `run`.

use crate::common::folder::{Done, Folder, disc, png};
use serde_json::{Value, json};

/// A normal mean with a known posterior: mean 1.6, variance 0.2.
const MEAN: &str =
    "param n: int = 100; data d: json; assume x ~ normal(0, 1); observe normal(x, 0.5) = d.y;
    infer { warmup 50 { drift(@x); } repeat n { drift(@x); collect x; } }";

fn table(f: &Folder) -> Vec<Value> {
    let all: Value = serde_json::from_str(&f.read("tradeoff/tradeoff.json")).unwrap();
    all["rows"].as_array().unwrap().clone()
}

fn mean_cases(f: &Folder) {
    f.write("mean.pcad", MEAN);
    cases(f, &[("a", 2.0), ("b", -1.0)]);
    f.write("few.json", r#"{"base": {"chains": 2}, "vary": {"n": [2, 100, 20000]}}"#);
}

fn cases(f: &Folder, all: &[(&str, f64)]) {
    for (name, y) in all {
        std::fs::create_dir_all(f.path().join("cases").join(name)).unwrap();
        f.write(&format!("cases/{name}/d.json"), json!({ "y": y }).to_string());
        let reference = json!({ "x": { "mean": 0.8 * y, "sd": 0.2f64.sqrt() } });
        f.write(&format!("cases/{name}/reference.json"), reference.to_string());
    }
}

fn tradeoff(f: &Folder, more: &[&str]) -> Done {
    f.run(
        &[&["tradeoff", "mean.pcad", "--cases", "cases", "--settings", "few.json"], more].concat(),
    )
}

#[test]
#[ignore = "a quarter of a minute"]
fn more_draws_are_nearer_to_the_reference() {
    let f = Folder::new("tradeoff_draws");
    mean_cases(&f);
    // A better setting, for comparison only.
    f.write("more.json", r#"{"compare": true, "base": {"chains": 4, "n": 60000}}"#);
    let done = tradeoff(
        &f,
        &["--seeds", "4", "--settings", "more.json", "--presets", "mean.quality.json"],
    );
    assert_eq!(done.code, 0, "{}", done.err);
    let rows = table(&f);
    let of = |setting: &str| {
        let row = rows.iter().find(|r| r["setting"] == setting && r["end"] == true).unwrap();
        assert_eq!((&row["cases"], &row["runs"]), (&json!(2), &json!(8)));
        (row["error"].as_f64().unwrap(), row["ess_per_second"].as_f64())
    };
    let errors = ["chains=2 n=2", "chains=2", "chains=2 n=20000"].map(|s| of(s).0);
    assert!(errors[0] > 2.0 * errors[1] && errors[1] > 2.0 * errors[2], "{errors:?}");
    assert!(errors[2] < 0.1 && of("chains=2").1.unwrap() > 0.0);
    assert!(of("chains=4 n=60000").0 < errors[2]);
    let csv = f.read("tradeoff/table.csv");
    assert!(
        csv.starts_with(
            "setting,end,seconds,error,low,high,cases,runs,failed,ess_per_second,front"
        ),
        "{csv}"
    );
    let plot = f.read("tradeoff/plot.svg");
    assert!(plot.contains("reference posterior") && plot.contains("accurate</text>"));

    // The preset is used by name, and explicit settings take precedence.
    let run = |more: &[&str]| {
        let done = f.run(
            &[&["run", "mean.pcad", "--observe", "d=cases/a/d.json", "--out", "r"], more].concat(),
        );
        assert_eq!(done.code, 0, "{}", done.err);
        let run: Value = serde_json::from_str(&f.read("r/run.json")).unwrap();
        (run["set"].clone(), run["settings"]["chains"].clone(), done.err)
    };
    let (set, chains, said) = run(&["--quality", "accurate"]);
    assert_eq!((set, chains), (json!({ "n": "20000" }), json!(2)));
    assert!(
        said.contains(
            "note: --quality accurate: --set n=20000 --chains 2, from mean.quality.json (error 0."
        ),
        "{said}"
    );
    assert_eq!(run(&["--quality", "accurate", "--set", "n=10"]).0, json!({ "n": "10" }));
    assert_eq!(run(&["--quality", "own", "--time", "1s"]).0, json!({}));
    assert_eq!(run(&["--time", "1s", "--chains", "3"]).1, json!(3));
}

#[test]
fn what_was_run_is_not_run_again() {
    let f = Folder::new("tradeoff_again");
    mean_cases(&f);
    assert_eq!(tradeoff(&f, &["--only", "a"]).code, 0);
    let before = f.read("tradeoff/runs.jsonl");
    // Half a line, as left by a power failure.
    std::fs::write(f.path().join("tradeoff/runs.jsonl"), format!("{before}{{\"setting\": \"chai"))
        .unwrap();
    f.write("few.json", r#"{"base": {"chains": 2}, "vary": {"n": [2, 100, 20000, 50]}}"#);
    let again = tradeoff(&f, &["--only", "a"]);
    assert_eq!(again.code, 0, "{}", again.err);
    let after = f.read("tradeoff/runs.jsonl");
    assert!(after.starts_with(&before) && after.lines().count() == 5, "one more setting: {after}");
    // Failed runs are tried again.
    let failed = after.replacen(r#""seed":1,"#, r#""seed":1,"failed":"no","#, 1);
    assert_ne!(failed, after);
    f.write("tradeoff/runs.jsonl", failed);
    assert_eq!(tradeoff(&f, &["--only", "a"]).code, 0);
    let after = f.read("tradeoff/runs.jsonl");
    assert!(after.lines().count() == 5 && !after.contains("failed"), "{after}");
    // A program that fails does so in every run, and that is reported.
    f.write("mean.pcad", MEAN.replace("d.y", "d.z"));
    let failing = tradeoff(&f, &["--only", "a", "--out", "fails"]);
    assert!(failing.code == 1 && failing.err.contains("all 5 runs failed"), "{}", failing.err);
    f.write("mean.pcad", MEAN);
    assert_eq!(tradeoff(&f, &["--only", "a", "--out", "fails"]).code, 1, "another program");
    // Other cases, another program or another reference: the existing results no longer
    // apply.
    let refused = |more: &[&str], what: &str| {
        let done = tradeoff(&f, more);
        assert!(
            done.code == 1 && done.err.contains(&format!("{what} has changed")),
            "{}",
            done.err
        );
        assert_eq!(f.read("tradeoff/runs.jsonl"), after);
    };
    refused(&[], "cases");
    f.write("mean.pcad", MEAN.replace("0.5", "0.6"));
    refused(&["--only", "a"], "programs");
    f.write("mean.pcad", MEAN);
    f.write("cases/a/reference.json", r#"{"x": {"mean": 1.5, "sd": 0.4}}"#);
    refused(&["--only", "a"], "inputs");
    assert_eq!(tradeoff(&f, &["--fresh"]).code, 0);
    // A quantity that no run records is a mistake, not an error of 2.2.
    f.write("cases/a/reference.json", r#"{"y": {"mean": 1.5, "sd": 0.4}}"#);
    let misspelt = tradeoff(&f, &["--only", "a", "--out", "misspelt"]);
    let said = "the reference has `y`, which the program does not collect";
    assert!(misspelt.code == 1 && misspelt.err.contains(said), "{}", misspelt.err);
}

#[test]
fn a_short_budget_leaves_out_settings_and_says_so() {
    let f = Folder::new("tradeoff_budget");
    mean_cases(&f);
    cases(&f, &[("c", 0.5), ("d", 1.0), ("e", 1.5), ("f", -2.0)]);
    let none = tradeoff(&f, &["--budget", "1ms", "--jobs", "1"]);
    assert!(none.code == 1 && none.err.contains("the budget ran out"), "{}", none.err);
    // Twenty-four runs with an estimate of eleven seconds each: four minutes are enough
    // for all settings on three cases, and half of the settings on six.
    let half = tradeoff(&f, &["--budget", "4m", "--jobs", "1"]);
    assert!(half.code == 0 && half.err.contains("round 2 of"), "{}", half.err);
    let ends: Vec<Value> = table(&f).into_iter().filter(|r| r["end"] == true).collect();
    let through = ends.iter().filter(|r| r["cases"] == json!(6)).count();
    assert_eq!((through, ends.len()), (2, 4), "{ends:?}");
    assert!(ends.iter().all(|r| r["front"] == false || r["cases"] == json!(6)));
}

#[test]
fn surfaces_and_joints_are_scored() {
    let f = Folder::new("tradeoff_pictures");
    f.write(
        "ball.pcad",
        "include \"std/scene.pcad\" as scene; data photo: image; data points = keypoints();
         param tries: int = 5; param size: int = 48;
         assume r ~ uniform(0.3, 1.5);
         assume view = scene.render(scene.sphere(r));
         observe scene.chamfer(view, symmetric = true, size = size) = photo as picture;
         infer { repeat tries { drift(one(@**)); collect r; } }",
    );
    // A disc with a radius of 14 pixels at the centre of a 48 x 32 picture, and the
    // sphere that it shows.
    std::fs::create_dir_all(f.path().join("cases/ball")).unwrap();
    f.write("cases/ball/image.png", png(disc(48, 32, 24.0, 16.0, 14.0)));
    let pixel = |i: usize| {
        let (x, y) = ((i % 48) as f64 + 0.5 - 24.0, (i / 48) as f64 + 0.5 - 16.0);
        // 48 pixels are 4.4 units at the depth of the centre, 8.
        let (x, y, r) = (x * 4.4 / 48.0, y * 4.4 / 48.0, 14.0 * 4.4 / 48.0);
        let left = r * r - x * x - y * y;
        (if left > 0.0 { 8.0 - left.sqrt() } else { 0.0 }) as f32
    };
    let depth: Vec<f32> = (0..48 * 32).map(pixel).collect();
    f.write("cases/ball/depth.npy", pcadlang_scene::vision::npy::f32_array(&[32, 48], depth));
    f.write("s.json", r#"{"base": {"chains": 2}, "vary": {"tries": [5, 400]}}"#);
    let done = f.run(&["tradeoff", "ball.pcad", "--cases", "cases", "--settings", "s.json"]);
    assert_eq!(done.code, 0, "{}", done.err);
    let rows = table(&f);
    let end =
        rows.iter().find(|r| r["setting"] == "chains=2 tries=400" && r["end"] == true).unwrap();
    // In perspective, the ball is slightly nearer than in the formula above.
    assert!(
        end["error"].as_f64().unwrap() < 0.05 && end["scores"]["iou"].as_f64().unwrap() > 0.85,
        "{end}"
    );
    assert_eq!(end["scores"]["n_mse"], json!(2.0), "no normals are known");

    // People: a program without joints does not find any.
    std::fs::create_dir_all(f.path().join("people")).unwrap();
    f.write("people/one.png", png(disc(48, 32, 24.0, 16.0, 9.0)));
    let joints = json!({ "l_shoulder": [20, 8, 2], "r_hip": [26, 20, 2], "l_knee": [0, 0, 0] });
    f.write(
        "people/annotations.json",
        json!({ "people": [{ "id": "one", "image": "one.png", "keypoints": joints }] }).to_string(),
    );
    let done = f.run(&[
        "tradeoff",
        "ball.pcad",
        "--cases",
        "people",
        "--settings",
        "s.json",
        "--out",
        "joints",
    ]);
    assert_eq!(done.code, 0, "{}", done.err);
    let all: Value = serde_json::from_str(&f.read("joints/tradeoff.json")).unwrap();
    assert_eq!(all["rows"][0]["scores"], json!({ "error": 1.0, "joints": 2.0, "missed": 2.0 }));
}

#[test]
fn mistakes_are_said_before_anything_runs() {
    let f = Folder::new("tradeoff_mistakes");
    mean_cases(&f);
    f.write("bad.json", r#"{"vary": {"m": [1]}}"#)
        .write("worse.json", r#"{"vary": {"chains": [0]}}"#);
    let fails = |settings: &str, cases: &str| {
        let done = f.run(&[
            "tradeoff",
            "mean.pcad",
            "--cases",
            cases,
            "--settings",
            settings,
            "--out",
            "t",
        ]);
        assert_eq!(done.code, 1);
        assert!(!f.path().join("t").exists());
        done.err
    };
    assert!(
        fails("bad.json", "cases").contains("--set m: the program has no parameter of this name")
    );
    assert!(
        fails("worse.json", "cases")
            .contains("worse.json: `chains` cannot be 0: expected a whole number from 1 to 1024")
    );
    std::fs::create_dir_all(f.path().join("empty/x")).unwrap();
    f.write("empty/x/image.png", png(disc(48, 32, 24.0, 16.0, 9.0)));
    let none = fails("few.json", "empty");
    assert!(
        none.contains("observes no item of kind `image`")
            || none.contains("no case has ground truth"),
        "{none}"
    );
    let unknown = f.run(&["tradeoff", "mean.pcad", "--cases", "cases"]);
    assert!(unknown.err.contains("mean.settings.json does not exist"), "{}", unknown.err);
}
