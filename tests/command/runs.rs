//! Runs of shipped and small programs: what is printed, word for word, what is left, and
//! the same draws on any number of threads. How snapshots are accepted: `cli.rs`.

use crate::common::folder::{Folder, disc, png};
use crate::common::snapshots::assert_session;
use serde_json::Value;

/// Returns a summary without its times, with numbers to six decimal places.
fn timeless(json: &str) -> serde_json::Value {
    fn strip(v: &mut serde_json::Value) {
        match v {
            serde_json::Value::Object(m) => {
                m.retain(|k, _| !k.contains("seconds") && !k.contains("per_second"));
                m.values_mut().for_each(strip);
            }
            serde_json::Value::Array(a) => a.iter_mut().for_each(strip),
            serde_json::Value::Number(n) if n.is_f64() => {
                let x = n.as_f64().unwrap();
                *v = serde_json::Value::String(format!("{x:.6}"));
            }
            _ => {}
        }
    }
    let mut v = serde_json::from_str(json).unwrap_or_else(|e| panic!("{e} in {json}"));
    strip(&mut v);
    v
}

#[test]
fn a_run_of_the_coin() {
    let f = Folder::new("coin");
    let quiet =
        f.succeeds(&["run", "coin.pcad", "--seed", "1", "--steps", "200", "--quiet", "--out", "a"]);
    assert_eq!((quiet.out.as_str(), quiet.err.as_str()), ("", ""), "--quiet says nothing");
    let json =
        f.succeeds(&["run", "coin.pcad", "--seed", "1", "--steps", "200", "--json", "--out", "b"]);
    assert_eq!(json.out.lines().count(), 1, "--json is one line: {}", json.out);
    assert_session("coin_json", &serde_json::to_string_pretty(&timeless(&json.out)).unwrap());
    assert_session("coin_notes", &json.err);
    let inside =
        |name: &String| name.contains("inference.zarr/") && !name.ends_with("inference.zarr/");
    let files: Vec<String> = f.files().into_iter().filter(|name| !inside(name)).collect();
    assert_session("coin_files", &files.join("\n"));
    assert_eq!(draws(&f, "a", 4), draws(&f, "b", 4));
    assert_eq!(timeless(&f.read("a/summary.json")), timeless(&f.read("b/summary.json")));
    let chain: Vec<String> = f.read("a/chain-1.csv").lines().take(8).map(str::to_owned).collect();
    assert_session("coin_chain", &chain.join("\n"));
    // The table is not a snapshot, since a line with the run time follows it.
    let plain = f.succeeds(&["run", "coin.pcad", "--seed", "1", "--steps", "200"]);
    assert!(plain.out.contains("heads") && plain.out.contains("seed 1, 4 chains"), "{}", plain.out);
    assert!(
        plain.out.trim_end().ends_with("runs/coin") && f.exists("runs/coin/report.html"),
        "{}",
        plain.out
    );
    f.succeeds(&["run", "coin.pcad", "--seed", "1", "--steps", "200", "--quiet"]);
    assert!(f.exists("runs/coin-2/report.html"));
    // Another seed gives other draws.
    f.succeeds(&["run", "coin.pcad", "--seed", "2", "--steps", "200", "--quiet", "--out", "c"]);
    assert_ne!(draws(&f, "a", 4), draws(&f, "c", 4));
}

/// Returns the draws of each chain, without comment lines.
fn draws(f: &Folder, dir: &str, chains: usize) -> Vec<String> {
    let chain = |i| {
        let text = f.read(&format!("{dir}/chain-{i}.csv"));
        text.lines().filter(|l| !l.starts_with('#')).map(|l| format!("{l}\n")).collect()
    };
    (1..=chains).map(chain).collect()
}

/// Matrices, records and texts have their shape, fields and meaning in every file and table.
#[test]
fn shapes_fields_and_texts_survive() {
    let f = Folder::new("shapes");
    f.write(
        "shapes.pcad",
        "assume a ~ normal(0, 1);
         assume R = [[a, 1, -0.0], [3, 4, 5]];
         assume P = { x: a, y: 2 * a };
         assume parts = [{ r: 1, h: a }, { r: 2, h: 3 * a }];
         assume kind = if a > 0 { \"thin = vase\" } else { \"cup\" };
         infer { warmup 30 { drift(@a); } repeat 200 { drift(@a); } }",
    );
    let run = ["run", "shapes.pcad", "--seed", "1", "--chains", "2", "--out", "out"];
    let said = f.succeeds(&run).out;
    let row = |name: &str| {
        let line = said.lines().find(|l| l.split_whitespace().next() == Some(name));
        line.unwrap_or_else(|| panic!("{name}: {said}")).split_whitespace().collect::<Vec<_>>()
    };
    assert_eq!(row("R[1,2]")[1..5], ["5", "0", "5", "5"]);
    assert_eq!(row("R[0,2]")[1..5], ["0", "0", "0", "0"], "not -0");
    assert!(row("parts/h[1]").len() == 8 && said.contains("%)"), "{said}");
    let summary: Value = serde_json::from_str(&f.read("out/summary.json")).unwrap();
    let text = summary["quantities"]["kind"]["most_frequent"]["text"].as_str().unwrap();
    assert!(["thin = vase", "cup"].contains(&text));

    for (i, chain) in draws(&f, "out", 2).iter().enumerate() {
        let all = f.read(&format!("out/chain-{}.csv", i + 1));
        let said = |key: &str| {
            let line = all.lines().find(|l| l.starts_with(&format!("# {key} = "))).unwrap();
            line.split_once(" = ").unwrap().1.trim_end().to_owned()
        };
        let counts = ["num_samples", "num_warmup", "save_warmup", "thin"].map(said);
        assert_eq!(counts, ["200", "30", "0", "1"]);
        assert_eq!([said("method"), said("algorithm")], ["sample", "drift"]);
        for time in ["(Warm-up)", "(Sampling)", "(Total)"] {
            assert!(all.contains(&format!(" seconds {time}\n")), "{all}");
        }
        let levels = all.lines().find_map(|l| l.strip_prefix("# levels of kind: ")).unwrap();
        let levels: Vec<String> = serde_json::from_str(levels).unwrap();
        let mut lines = chain.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').skip(6).collect();
        let wanted = "a,R.1.1,R.2.1,R.1.2,R.2.2,R.1.3,R.2.3,P_x,P_y,parts_r.1,parts_r.2,parts_h.1,parts_h.2,kind";
        assert_eq!(names.join(","), wanted);
        assert_eq!(lines.clone().count(), 200);
        for line in lines {
            let x: Vec<f64> = line.split(',').skip(6).map(|x| x.parse().unwrap()).collect();
            assert_eq!(x[1..7], [x[0], 3.0, 1.0, 4.0, 0.0, 5.0]);
            assert_eq!(x[7..13], [x[0], 2.0 * x[0], 1.0, 2.0, x[0], 3.0 * x[0]]);
            assert_eq!(levels[x[13] as usize], if x[0] > 0.0 { "thin = vase" } else { "cup" });
        }
    }
    let dims = |name: &str| {
        let file = f.read(&format!("out/inference.zarr/posterior/{name}/.zattrs"));
        serde_json::from_str::<Value>(&file).unwrap()["_ARRAY_DIMENSIONS"].to_string()
    };
    assert_eq!(dims("R"), r#"["chain","draw","R_dim_0","R_dim_1"]"#);
    assert_eq!(dims("P"), r#"["chain","draw","P_field"]"#);
    assert_eq!(dims("parts"), r#"["chain","draw","parts_dim_0","parts_field"]"#);
    assert_eq!(dims("kind_level"), r#"["kind_level"]"#);
    // The page made from the folder has the same names.
    f.succeeds(&["report", "out"]);
    let page = f.read("out/report.html");
    assert!(page.contains("R[<wbr>1,<wbr>2]") && page.contains(&format!("<td>{text} (")));
}

/// Chains that a time limit ends have the same counts, which are those of their draws.
#[test]
fn counts_are_those_of_the_draws() {
    let f = Folder::new("counts");
    f.write(
        "slow.pcad",
        "assume k ~ poisson(3); assume w = map(fn(i) { i }, 0 .. k); observe normal(k, 1) = 3;",
    );
    f.succeeds(&["run", "slow.pcad", "--time", "1s", "--chains", "3", "--quiet", "--out", "out"]);
    let of = |i: usize| {
        let text = f.read(&format!("out/chain-{i}.csv"));
        let count = |key: &str| {
            let line = text.lines().find_map(|l| l.strip_prefix(&format!("# {key} = "))).unwrap();
            line.trim_end().parse::<usize>().unwrap()
        };
        assert_eq!(count("num_samples"), text.lines().filter(|l| !l.starts_with('#')).count() - 1);
        assert!(text.ends_with("# \n"), "times come last");
        (count("num_samples"), count("num_warmup"))
    };
    assert!(of(1).0 > 0 && of(1) == of(2) && of(2) == of(3));
}

/// Columns of `log_lik` are of the same observations in all chains, or are left out, so that
/// nothing compares models by columns that mean different things.
#[test]
fn chains_that_observe_different_things_have_no_log_lik() {
    let f = Folder::new("observing");
    let program = |n: &str| {
        format!(
            "assume n ~ uniform_discrete(1, 6); assume x ~ normal(0, 1);
             for i in 0 .. {n} {{ observe normal(x, 1) = i; }}
             infer {{ repeat 10 {{ mh(@x); collect n, x; }} }}"
        )
    };
    let observed = |name: &str, n: &str| {
        f.write(&format!("{name}.pcad"), program(n));
        f.succeeds(&["run", &format!("{name}.pcad"), "--seed", "1", "--quiet", "--out", name]);
        let names = draws(&f, name, 4).into_iter().map(|c| c.lines().next().unwrap().to_owned());
        let names: Vec<String> = names.collect();
        assert!(names.iter().all(|n| n == &names[0]), "{names:?}");
        (names[0].contains("log_lik.1"), f.exists(&format!("{name}/inference.zarr/log_likelihood")))
    };
    assert_eq!(observed("same", "3"), (true, true));
    assert_eq!(observed("other", "n"), (false, false));
}

/// The shipped program on a small picture gives the same draws, bit for bit, on any
/// number of threads, and with and without incremental updates.
#[test]
fn the_lathe_draws_the_same_on_any_number_of_threads() {
    let f = Folder::new("lathe");
    f.write("disc.png", png(disc(64, 48, 34.0, 22.0, 15.0)));
    let run = |out: &str, more: &[&str]| {
        let mut args =
            vec!["run", "lathe.pcad", "--observe", "disc.png", "--set", "size=48", "--chains", "2"];
        args.extend(["--steps", "60", "--warmup", "60", "--seed", "5", "--quiet", "--out", out]);
        args.extend(["--set", "tries=100"]);
        args.extend(more);
        f.succeeds(&args);
        let all = draws(&f, out, 2);
        assert!(all.iter().all(|c| c.lines().count() > 5), "{all:?}");
        assert!(all[0] != all[1], "chains differ");
        all
    };
    let one = run("one", &["--threads", "1"]);
    assert_eq!(one, run("two", &["--threads", "2"]));
    assert_eq!(one, run("full", &["--threads", "2", "--no-incremental"]));
    assert!(f.exists("one/best.obj") && f.exists("one/overlay.png") && f.exists("one/depth.npy"));
    // An unknown camera is one more choice, and it is recorded.
    run("lens", &["--set", "known=false", "--set", "steep=60"]);
    let summary: serde_json::Value = serde_json::from_str(&f.read("lens/summary.json")).unwrap();
    let choices = summary["choices"].as_array().unwrap();
    assert!(
        choices.iter().any(|c| c["address"].as_str().is_some_and(|a| a.contains("longer"))),
        "{choices:?}"
    );
}

/// A wide cup seen from above in perspective: those starts of the shipped program with
/// the right tilt also have the right height and position.
#[test]
fn starts_of_the_lathe_are_seen_in_perspective() {
    let f = Folder::new("starts");
    let cup = "include \"std/scene.pcad\" as scene;
        assume x ~ normal(0, 1); observe normal(x, 1) = 0;
        let cup = scene.lathe({ y: [0, 0.9], r: [1.1, 1.1] }, thickness = 0.05);
        assume view = scene.render(scene.affine(translate = [0.3, 0.2, 0], rotate = [deg(25), 0, 0]) * scene.centred(cup));
        infer { repeat 20 { mh(@x); collect x; } }";
    f.write("cup.pcad", cup);
    f.succeeds(&["run", "cup.pcad", "--chains", "1", "--quiet", "--out", "cup"]);
    let text = pcadlang_library::shipped::file("lathe.pcad").unwrap();
    let (model, plan) = text.split_once("infer {").unwrap();
    let (from, _) = plan.split_once("from = ").unwrap().1.split_once("));").unwrap();
    let starts =
        format!("infer {{ init(best_of(1, from = {from})); collect H, S_L.axis, S_L.translate; }}");
    f.write("starts.pcad", format!("{model}{starts}"));
    f.succeeds(&[
        "run",
        "starts.pcad",
        "--observe",
        "cup/mask.png",
        "--mask",
        "cup/mask.png",
        "--chains",
        "100",
        "--quiet",
        "--out",
        "starts",
    ]);
    let mut near = Vec::new();
    for chain in draws(&f, "starts", 100) {
        let (names, row) = chain.split_once('\n').unwrap();
        let number = |name: &str| -> f64 {
            let at = names.split(',').position(|n| n == name).unwrap_or_else(|| panic!("{names}"));
            row.trim().split(',').nth(at).unwrap().parse().unwrap()
        };
        if (number("S_L_axis_z").asin() - 25f64.to_radians()).abs() < 0.07 {
            near.push((number("H"), number("S_L_translate_y")));
        }
    }
    assert!(near.len() >= 5, "{near:?}");
    // Some have no flat ends, and are longer.
    let right = near.iter().filter(|(height, _)| (height - 0.9).abs() < 0.15).count();
    near.sort_by(|a, b| a.1.total_cmp(&b.1));
    let y = near[near.len() / 2].1;
    assert!(3 * right >= near.len() && (y - 0.2).abs() < 0.05, "{y} {near:?}");
}

/// Chains that cannot leave their mode: the probability of each mode is its mass,
/// regardless of the number of chains in it, and `keypoints.json` weights the modes by
/// it.
#[test]
fn modes_have_their_probabilities() {
    let f = Folder::new("probabilities");
    let program = "include \"std/scene.pcad\" as scene;
        assume far ~ flip(0.7);
        assume x ~ normal(if far { 1 } else { -1 }, 0.1);
        observe normal(x, 100) = 0;
        let ball = scene.landmarks(scene.sphere(0.3), { nose: [0, 0, 0] });
        assume view = scene.render(scene.affine(translate = [x, 0, 0]) * ball);
        infer { warmup 200 { drift(@x); } repeat 1500 { drift(@x); collect x, far; } }";
    f.write("two.pcad", program.as_bytes());
    let said = f.succeeds(&["run", "two.pcad", "--chains", "6", "--seed", "4", "--out", "two"]);
    assert!(
        said.out.contains("the chains are in 2 different modes")
            && said.out.contains("probability"),
        "{}",
        said.out
    );
    let summary: serde_json::Value = serde_json::from_str(&f.read("two/summary.json")).unwrap();
    let modes = summary["modes"].as_array().unwrap();
    let far = |m: &serde_json::Value| m["quantities"]["far"][0].as_f64().unwrap();
    assert_eq!(
        (modes.len(), far(&modes[0]), far(&modes[1])),
        (2, 1.0, 0.0),
        "the most probable first"
    );
    let probability = modes[0]["probability"].as_f64().unwrap();
    assert!((probability - 0.7).abs() < 0.03, "{probability}");
    let evidence = |i: usize| modes[i]["log_evidence"][0].as_f64().unwrap();
    assert!((evidence(0) - evidence(1) - (7f64 / 3.0).ln()).abs() < 0.2, "{modes:?}");
    assert_eq!(modes[0]["by_evidence"], true);
    assert!(
        (modes[0]["share"].as_f64().unwrap() - 0.7).abs() > 0.1,
        "chains fell otherwise: {}",
        modes[0]["share"]
    );
    let keypoints: serde_json::Value = serde_json::from_str(&f.read("two/keypoints.json")).unwrap();
    let x = keypoints["scene"]["nose"][0].as_f64().unwrap();
    assert!((x - (2.0 * probability - 1.0)).abs() < 0.03, "{x} {probability}");
}

/// Chains that never move stay where they start: a picture of each mode, and a warning
/// that the chains disagree.
#[test]
fn modes_that_chains_stay_in_are_shown() {
    let f = Folder::new("modes");
    let program = |spread: &str| {
        format!(
            "include \"std/scene.pcad\" as scene;
             assume x ~ uniform(-{spread}, {spread}); observe normal(x, 9) = 0;
             assume view = scene.render(scene.affine(translate = [x, 0, 0]) * scene.sphere(0.4));
             infer {{ repeat 60 {{ collect x; }} }}"
        )
    };
    let run = |name: &str, spread: &str| {
        f.write(&format!("{name}.pcad"), program(spread).as_bytes());
        f.succeeds(&[
            "run",
            &format!("{name}.pcad"),
            "--chains",
            "3",
            "--seed",
            "1",
            "--quiet",
            "--out",
            name,
        ]);
        let agreement: serde_json::Value =
            serde_json::from_str(&f.read(&format!("{name}/run.json"))).unwrap();
        (
            agreement["agreement"].as_f64().unwrap(),
            f.read(&format!("{name}/summary.json")).contains("of the pixels they cover"),
        )
    };
    let (far, near) = (run("far", "1.5"), run("near", "0.0001"));
    assert!(far.0 < 0.5 && far.1, "{far:?}");
    assert!(near.0 > 0.95 && !near.1, "{near:?}");
    let sheet = image::open(f.path().join("far/modes.png")).unwrap();
    assert!(sheet.width() > 3 * 384 && sheet.width() < 3 * 400, "{}", sheet.width());
}

#[test]
fn sheets_of_the_prior() {
    let f = Folder::new("sheets");
    assert_session("sample_coin", &f.session(&["sample", "coin.pcad", "-n", "3"]));
    f.write("disc.png", png(disc(64, 48, 34.0, 22.0, 15.0)));
    assert_session("contours", &f.session(&["contours", "disc.png"]));
    assert_eq!(f.files(), ["contours.png", "disc.png"]);
}

/// People are detected, written in a form that `--keypoints` reads, and drawn; an invalid
/// network file is refused.
#[test]
fn people_in_photographs() {
    let f = Folder::new("detect");
    let skier = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/skier.jpg");
    std::fs::copy(skier, f.path().join("skier.jpg")).unwrap();
    f.write("grey.png", png(image::GrayImage::from_pixel(90, 60, image::Luma([128]))));
    std::fs::create_dir(f.path().join("nets")).unwrap();
    f.write("nets/pose_landmark_lite.tflite", b"not a network");
    let mut text = f.session(&["detect", "skier.jpg", "--overlay", "skier.png"]);
    text += &f.session(&["detect", "skier.jpg", "-o", "mediapipe.json", "--format", "mediapipe"]);
    text += &f.session(&["detect", "grey.png", "-o", "nobody.json"]);
    text += &f.session(&["detect", "grey.png", "--models", "nets"]);
    text += &f.session(&["detect", "grey.png", "--models", "."]);
    text += &f.session(&["detect", "none.jpg"]);
    assert_session("detect", &text);
    for (file, found) in [("people.json", 1), ("mediapipe.json", 1), ("nobody.json", 0)] {
        let bytes = std::fs::read(f.path().join(file)).unwrap();
        let people = pcadlang_scene::vision::keypoints::People::parse(&bytes).unwrap();
        let points = people.pick(None, None).map_or(0, |k| k.in_image(344, 425).points().len());
        assert_eq!(points > 16, found == 1, "{file}: {points}");
    }
    assert!(f.exists("skier.png"));
}

/// Objects are detected, listed, written as COCO's annotations, and drawn as boxes.
#[test]
fn objects_in_photographs() {
    let f = Folder::new("detect_objects");
    let skier = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/skier.jpg");
    std::fs::copy(skier, f.path().join("skier.jpg")).unwrap();
    f.write("grey.png", png(image::GrayImage::from_pixel(90, 60, image::Luma([128]))));
    let mut text = f.session(&["detect", "--objects", "skier.jpg", "--overlay", "boxes.png"]);
    text += &f.session(&["detect", "--objects", "grey.png", "-o", "nothing.json"]);
    text += &f.session(&["detect", "--objects", "skier.jpg", "--views", "4"]);
    assert_session("detect_objects", &text);
    let read = |file: &str| -> serde_json::Value { serde_json::from_str(&f.read(file)).unwrap() };
    let coco = read("objects.json");
    assert_eq!(coco["images"][0]["file_name"], "skier.jpg");
    assert_eq!(
        (&coco["images"][0]["width"], &coco["images"][0]["height"]),
        (&344.into(), &425.into())
    );
    let categories = coco["categories"].as_array().unwrap();
    let named = |i: u64| categories.iter().find(|c| c["id"] == i).map(|c| c["name"].clone());
    assert_eq!(
        (named(1), named(35), named(90)),
        (Some("person".into()), Some("skis".into()), Some("toothbrush".into()))
    );
    assert_eq!((categories.len(), named(12)), (80, None));
    let person = &coco["annotations"][0];
    assert_eq!((&person["category_id"], &person["image_id"]), (&1.into(), &1.into()));
    let place: Vec<f64> =
        person["bbox"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    for (got, expected) in place.iter().zip([62.0, 44.0, 215.0, 348.0]) {
        assert!((got - expected).abs() < 10.0, "{place:?}");
    }
    assert!(read("nothing.json")["annotations"].as_array().unwrap().is_empty());
    // The left side of the best box is red.
    let boxes = image::open(f.path().join("boxes.png")).unwrap().to_rgb8();
    let scale = f64::from(boxes.width()) / 344.0;
    let [x, y] = [place[0], place[1] + 0.5 * place[3]].map(|p| (p * scale) as u32);
    let image::Rgb([red, green, blue]) = *boxes.get_pixel(x, y);
    assert!(red > 180 && green < 120 && blue < 120, "{red} {green} {blue}");
}

/// Ctrl-C ends a run; all draws so far are kept and summarised.
#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_its_draws() {
    use std::process::{Command, Stdio};
    use std::time::Duration;
    let f = Folder::new("interrupted");
    let mut child = Command::new(env!("CARGO_BIN_EXE_pcadlang"))
        .args([
            "run",
            "linreg.pcad",
            "--time",
            "300s",
            "--warmup",
            "10",
            "--out",
            "out",
            "--chains",
            "2",
        ])
        .current_dir(f.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let under_way =
        |f: &Folder| f.exists("out/chain-2.csv") && f.read("out/chain-2.csv").lines().count() > 20;
    for _ in 0..600 {
        if under_way(&f) {
            break;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(under_way(&f), "draws are written as they come");
    assert!(f.read("out/run.json").contains("\"running\""));
    assert!(
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success()
    );
    assert_eq!(child.wait().unwrap().code(), Some(3));
    assert!(f.read("out/run.json").contains("\"interrupted\""));
    assert!(f.exists("out/report.html") && f.exists("out/summary.json"));
    let rows = draws(&f, "out", 2);
    let columns = rows[0].lines().next().unwrap().split(',').count();
    assert!(
        rows.iter()
            .all(|r| r.ends_with('\n') && r.lines().all(|l| l.split(',').count() == columns))
    );
}

/// The output of `run --explain` for a scene in which some things can be skipped: a
/// choice that nothing depends on, one that no kernel names, and an object outside of the
/// picture.
#[test]
fn explained() {
    let f = Folder::new("explained");
    f.write("disc.png", png(disc(64, 48, 34.0, 22.0, 15.0)));
    f.write(
        "balls.pcad",
        "include \"std/scene.pcad\" as scene;
data photo: image \"the picture\";
for k in [\"x\", \"y\"] { t[k] ~ normal(0, 0.5) #place; }
assume radius ~ uniform(0.3, 1.2);
assume far    ~ uniform(9, 10);
assume level  ~ normal(0, 1);
assume idle   ~ normal(0, 1);
let fixed = map(fn(x) { scene.affine(translate = [x, -1, -1]) * scene.sphere(0.3) }, [-1, 0, 1]);
let ball = scene.affine(translate = [t.x, t.y, 0]) * scene.sphere(radius);
let lost = scene.affine(translate = [far, 0, 0]) * scene.box(0.2);
observe scene.contour(scene.render(scene.group([scene.group(fixed), ball, lost])), size = 64) = photo as picture;
observe normal(level, 1) = 0.5 as height;
infer { warmup 20 { drift(one($place)); } repeat 60 { drift(one($place)); block($place + @radius); mh(@far); collect radius; } }
",
    );
    let job =
        ["run", "balls.pcad", "--observe", "disc.png", "--chains", "1", "--explain", "--out", "a"];
    let done = f.succeeds(&job);
    let lines = done.out.lines().skip_while(|l| !l.starts_with("modelled"));
    let said: Vec<&str> = lines
        .take_while(|l| !["warning:", "note:", "seed "].iter().any(|s| l.starts_with(s)))
        .collect();
    assert_session("explained", said.join("\n").trim_end());
    let json: serde_json::Value = serde_json::from_str(&f.read("a/explained.json")).unwrap();
    let radius =
        json["choices"].as_array().unwrap().iter().find(|c| c["address"] == "@radius").unwrap();
    assert_eq!(
        (&radius["choices"], &radius["kernels"][0]),
        (&1.into(), &"block($place + @radius)".into())
    );
    assert_eq!(radius["one_proposal_draws"]["meshes_drawn"], 1);
}

#[test]
fn a_run_in_a_pipe() {
    let f = Folder::new("pipe");
    let program = "assume x ~ normal(0, 1); assume w = [x, 1]; observe normal(x, 1) = 2;";
    let base = ["run", "-", "--seed", "1", "--steps", "40", "--chains", "2"];
    let json = f.given(program, &[&base[..], &["--json"]].concat());
    let said: serde_json::Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!(said["out"], "runs/stdin");
    let streamed = f.given(program, &[&base[..], &["--stream"]].concat());
    let lines: Vec<serde_json::Value> =
        streamed.out.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    for chain in 0..2 {
        let own: Vec<_> = lines.iter().filter(|l| l["chain"] == chain).collect();
        let kept = f.read(&format!("runs/stdin/chain-{}.csv", chain + 1));
        let rows = kept.lines().filter(|l| !l.starts_with('#')).count() - 1;
        assert!(own.len() == rows && rows > 10, "{} lines, {rows} rows", own.len());
        for (i, line) in own.iter().enumerate() {
            assert_eq!(line["draw"], i);
            assert_eq!(line["values"]["w"][0], line["values"]["x"]);
        }
    }
}
