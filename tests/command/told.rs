//! What is said about runs: one set of columns, categories, what differs, what would be lost,
//! names from elsewhere.

use crate::common::folder::Folder;
use serde_json::Value;

fn json(f: &Folder, name: &str) -> Value {
    serde_json::from_str(&f.read(name)).unwrap()
}

/// A chain that ends before `collect` has the columns that the others collect.
#[test]
fn chains_that_never_collect_have_the_same_columns() {
    let f = Folder::new("columns");
    f.write(
        "p.pcad",
        "assume x ~ normal(0, 1); assume y ~ iid(normal(0, 1), 9); observe normal(x, 1) = 0.5;
         infer { repeat 50 { stop when x > 0; drift(@x); collect log_joint(), x; } }",
    );
    let d = f.succeeds(&["run", "p.pcad", "--chains", "6", "--seed", "2", "--out", "out"]);
    let run = json(&f, "out/run.json");
    let draws: Vec<u64> =
        run["chains"].as_array().unwrap().iter().map(|c| c["draws"].as_u64().unwrap()).collect();
    assert!(draws.contains(&1) && draws.iter().any(|n| *n > 1), "{draws:?}");
    let quantities = json(&f, "out/summary.json")["quantities"].clone();
    let names: Vec<&String> = quantities.as_object().unwrap().keys().collect();
    assert_eq!(names, ["log_joint", "x"], "{}", d.out);
    assert!(quantities["x"]["mean"].is_f64() && quantities["log_joint"]["mean"].is_f64());
    let rows = |name: &str| d.out.lines().filter(|l| l.split(' ').next() == Some(name)).count();
    assert_eq!((rows("log_joint"), rows("x"), rows("y[0]")), (1, 1, 0), "{}", d.out);
}

/// The number of a category has no mean, in any of the tables.
#[test]
fn categories_have_a_most_frequent_value() {
    let f = Folder::new("categories");
    f.write(
        "p.pcad",
        "param at = 4; assume z ~ categorical([0.25, 0.25, 0.5]);
         for i in 0 .. 2 { k[i] ~ categorical([1, 3]) #d; observe normal(k[i], 5) = 1; }
         assume x ~ normal(z, 0.3); observe normal(x, 0.3) = at;
         infer { repeat 2000 { gibbs(@z); gibbs(one($finite)); drift(@x); collect z, k, x; } }",
    );
    let run = ["run", "p.pcad", "--chains", "2", "--seed", "1", "--out"];
    let d = f.succeeds(&[&run[..], &["out"]].concat());
    let row = |text: &str, name: &str| -> Vec<String> {
        let line = text.lines().find(|l| l.split_whitespace().next() == Some(name));
        line.unwrap_or_else(|| panic!("{text}")).split_whitespace().map(str::to_owned).collect()
    };
    let z = row(&d.out, "z");
    assert_eq!((&*z[1], &z[2][..1], &z[3..6]), ("2", "(", &["-", "-", "-"].map(str::to_owned)[..]));
    assert_eq!(row(&d.out, "k[1]")[1], "1");
    assert!(row(&d.out, "x")[1].parse::<f64>().is_ok_and(|mean| (mean - 3.0).abs() < 0.5));
    let frequent = &json(&f, "out/summary.json")["quantities"]["z"]["most_frequent"];
    assert_eq!(frequent["value"], 2.0);
    assert!(frequent["share"].as_f64().unwrap() > 0.95, "{frequent}");
    let cell = format!("<td>2 ({:.0}%)<td>-", 100.0 * frequent["share"].as_f64().unwrap());
    assert!(f.read("out/report.html").contains(&cell), "{cell}");
    // A page that is made again says the same.
    f.succeeds(&["report", "out"]);
    assert!(f.read("out/report.html").contains(&cell), "{cell}");
    f.succeeds(&[&run[..], &["other", "--set", "at=0"]].concat());
    let compared = row(&f.succeeds(&["compare", "out", "other"]).out, "z");
    assert_eq!((&*compared[1], &*compared[3], &*compared[4], &*compared[7]), ("2", "-", "0", "-"));
}

const COIN: &str = "param bias = 1; assume p ~ beta(bias, 1); observe flip(p) = true;
    infer { repeat 20 { mh(@p); } }";

/// Settings are no part of a program: only its text, and those it includes, are.
#[test]
fn settings_and_programs_differ_apart() {
    let f = Folder::new("differ");
    f.write("coin.pcad", COIN);
    f.succeeds(&["run", "coin.pcad", "--quiet", "--out", "a"]);
    f.succeeds(&["run", "coin.pcad", "--quiet", "--set", "bias=2", "--out", "b"]);
    f.write("coin.pcad", COIN.replace("repeat 20", "repeat 30"));
    f.succeeds(&["run", "coin.pcad", "--quiet", "--out", "c"]);
    let said = f.succeeds(&["compare", "a", "b"]).out;
    assert!(said.contains("only B: --set bias=2\nonly settings differ"), "{said}");
    assert!(!said.contains("programs differ"), "{said}");
    let said = f.succeeds(&["compare", "a", "c"]).out;
    assert!(said.contains("the programs differ") && !said.contains("only settings"), "{said}");
}

/// The run of another program is not lost by a mistaken `--out`.
#[test]
fn another_programs_run_is_kept() {
    let f = Folder::new("kept");
    f.write("coin.pcad", COIN).write("other.pcad", COIN);
    f.succeeds(&["run", "coin.pcad", "--quiet", "--out", "out"]);
    let before = f.read("out/run.json");
    let other = ["run", "other.pcad", "--quiet", "--out", "out"];
    let d = f.succeeds(&other);
    assert!(d.err.contains("out holds a run of coin.pcad, which is now in out.coin"), "{}", d.err);
    assert_eq!(f.read("out.coin/run.json"), before);
    assert_eq!(json(&f, "out/run.json")["program"], "other.pcad");
    // The same program, changed or not, is run again as before.
    f.write("other.pcad", COIN.replace("beta(bias, 1)", "beta(bias, 2)"));
    f.succeeds(&other);
    assert!(!f.exists("out.other"));
    f.succeeds(&["run", "coin.pcad", "--quiet", "--out", "out", "--overwrite"]);
    assert!(!f.exists("out.other"));
    f.succeeds(&other);
    assert!(f.exists("out.coin-2/run.json"));
}

/// In a terminal the user is asked.
#[cfg(unix)]
#[test]
fn in_a_terminal_the_user_is_asked() {
    let f = Folder::new("asked");
    f.write("coin.pcad", COIN).write("other.pcad", COIN);
    f.succeeds(&["run", "coin.pcad", "--quiet", "--out", "out"]);
    for (answer, program) in [("n", "coin.pcad"), ("y", "other.pcad")] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_pcadlang"));
        command.args(["run", "other.pcad", "--out", "out"]).current_dir(f.path());
        let mut session = rexpect::session::spawn_command(command, Some(60_000)).unwrap();
        session.exp_string("out holds a run of coin.pcad: replace it? [y/N]").unwrap();
        session.send_line(answer).unwrap();
        session.exp_eof().unwrap();
        assert_eq!(json(&f, "out/run.json")["program"], program);
    }
}

/// The manual has a page for each command.
#[test]
fn the_manual_of_a_command() {
    let f = Folder::new("manual");
    let page = f.succeeds(&["man", "run"]).out;
    assert!(page.contains(".TH pcadlang-run 1") && page.contains("observe"), "{page}");
    assert!(!page.contains("replicates"), "nothing of other commands: {page}");
    let d = f.run(&["man", "runn"]);
    assert!(d.code == 1 && d.err.contains("the commands are run, evaluate"), "{}", d.err);
}

/// Names from elsewhere are known, in programs and in the reference.
#[test]
fn names_from_elsewhere_are_known() {
    let f = Folder::new("elsewhere");
    let factor = "factor(log_normal_cdf((mean - limit) / sd))";
    for (name, here) in [
        ("sigmoid", "expit"),
        ("bernoulli", "flip"),
        ("censored", factor),
        ("cdf", "normal_cdf"),
        ("kalman", "delayed"),
    ] {
        f.write("p.pcad", format!("let y = {name}(0.5);"));
        let wanted = format!("write `{here}`");
        for command in [["check", "p.pcad"], ["doc", name]] {
            let d = f.run(&command);
            assert!(d.code == 1 && d.err.contains(&wanted), "{name}: {}", d.err);
        }
    }
    assert!(f.succeeds(&["doc", "--search", "kalman"]).out.starts_with("delayed("));
    assert!(f.succeeds(&["doc", "--search", "cdf"]).out.contains("normal_cdf("));
}

/// Weights that are written like probabilities but do not sum to 1 are pointed out; others
/// are as they are meant.
#[test]
fn weights_that_are_no_probabilities() {
    let f = Folder::new("weights");
    let program = |d: &str| format!("assume k ~ {d}; infer {{ repeat 5 {{ mh(@k); }} }}");
    let said = |d: &str| {
        f.write("p.pcad", program(d));
        let d = f.succeeds(&["check", "p.pcad"]);
        assert!(d.out.contains("no mistakes found"), "{}", d.out);
        d.err
    };
    for (d, sum) in [
        ("categorical([0.5, 0.4])", "0.9"),
        ("categorical(weights = [0.5, 0.2, 0.4])", "1.1"),
        ("mixture([0.5, 0.3], [normal(0, 1), normal(5, 1)])", "0.8"),
    ] {
        let err = said(d);
        assert!(err.contains("warning") && err.contains(&format!("sum to {sum}")), "{d}: {err}");
    }
    for d in [
        "categorical([1, 2, 3])",
        "categorical([0.5, 0.5])",
        "categorical([0.33, 0.33, 0.33])",
        "categorical([0.1, 0.2])",
        "categorical([0.7, 0.7, 0.7, 0.7])",
    ] {
        assert_eq!(said(d), "", "{d}");
    }
    f.write("p.pcad", program("categorical([0.5, 0.4])"));
    assert!(f.succeeds(&["run", "p.pcad", "--out", "out"]).err.contains("sum to 0.9"));
    assert_eq!(f.succeeds(&["run", "p.pcad", "--quiet", "--out", "out"]).err, "");
}

/// However short the time, each phase makes a step, and a warm-up whose steps are given makes
/// all of them, so that no state is just a draw from the prior.
#[test]
fn a_time_limit_leaves_room_for_a_search() {
    let f = Folder::new("search");
    f.write(
        "p.pcad",
        "assume x ~ normal(0, 1); observe normal(x, 0.1) = 3;
         infer { warmup 50 { drift(@x); } repeat 50 { drift(@x); collect x; } }",
    );
    let steps = |options: &[&str]| {
        f.succeeds(
            &[&["run", "p.pcad", "--quiet", "--time", "0s", "--out", "out"], options].concat(),
        );
        let run = json(&f, "out/run.json");
        let all = run["chains"].as_array().unwrap().iter();
        all.map(|c| ["warmup", "steps", "draws"].map(|k| c[k].as_u64().unwrap()))
            .collect::<Vec<_>>()
    };
    assert_eq!(steps(&[]), [[1, 1, 1]; 4]);
    assert_eq!(steps(&["--warmup", "30"]), [[30, 1, 1]; 4]);
    assert_eq!(steps(&["--steps", "0", "--warmup", "0"]), [[0, 0, 1]; 4], "as it was asked for");
}

/// A run with a time limit whose chains never moved is an error, whatever it wrote.
#[test]
fn a_run_that_never_moved_is_an_error() {
    let f = Folder::new("unmoved");
    f.write(
        "p.pcad",
        "assume x ~ normal(0, 1); observe normal(x, 1) = 3;
         infer { repeat 50 { stop when x < 1e9; mh(@x); } }",
    );
    let d = f.run(&["run", "p.pcad", "--time", "5s", "--out", "out"]);
    assert!(d.code == 1 && d.err.contains("no kernel made a step"), "{} {}", d.code, d.err);
}

/// The lamp's picture, enlarged to this many pixels along its sides, as a JPEG file.
fn enlarged(side: u32) -> Vec<u8> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/table_lamp.png");
    let lamp = image::open(file).unwrap().to_rgb8();
    let large = image::imageops::resize(&lamp, side, side, image::imageops::FilterType::Nearest);
    let mut bytes = std::io::Cursor::new(Vec::new());
    large.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

/// Results of a large photograph are bounded, unless all of it is asked for.
#[test]
fn results_of_large_photographs_are_bounded() {
    let f = Folder::new("large");
    f.write("large.jpg", enlarged(8000)).write("above.jpg", enlarged(1700));
    let run = |photo: &str, out: &str, options: &[&str]| {
        let quick = ["--set", "tries=5", "--set", "keep=2", "--steps", "1", "--warmup", "1"];
        let run =
            ["run", "lathe.pcad", "--chains", "1", "--quiet", "--observe", photo, "--out", out];
        f.succeeds(&[&run[..], &quick, options].concat());
        let size =
            |name: &str| image::image_dimensions(f.path().join(format!("{out}/{name}"))).unwrap();
        let shape = f.path().join(format!("{out}/depth.npy"));
        let head = String::from_utf8_lossy(&std::fs::read(shape).unwrap()[..128]).into_owned();
        let side = size("mask.png").0;
        assert!(head.contains(&format!("'shape': ({side}, {side}")), "{head}");
        assert_eq!((size("overlay.png"), size("contours.png")), ((side, side), (side, side)));
        assert_eq!(json(&f, &format!("{out}/run.json"))["size"], serde_json::json!([side, side]));
        side
    };
    assert_eq!(run("large.jpg", "large", &[]), 1600);
    let bytes = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().metadata().unwrap().len();
    let all: u64 = std::fs::read_dir(f.path().join("large")).unwrap().map(bytes).sum();
    assert!(all < 60 << 20, "{all} bytes");
    assert_eq!(run("above.jpg", "above", &[]), 1600);
    assert_eq!(run("above.jpg", "above", &["--full-size"]), 1700);
    let arguments = json(&f, "above/run.json")["arguments"].to_string();
    assert!(arguments.contains("--full-size"), "the command that repeats it: {arguments}");
}

/// The search of a preset ends on any machine, however busy: time limits what follows.
#[test]
fn the_search_of_a_preset_ends() {
    let f = Folder::new("preset");
    let root = env!("CARGO_MANIFEST_DIR");
    let lamp = format!("{root}/examples/images/table_lamp.png");
    std::fs::copy(lamp, f.path().join("lamp.png")).unwrap();
    let least = |name: &str| -> Vec<u64> {
        let text = std::fs::read_to_string(format!("{root}/programs/{name}.quality.json")).unwrap();
        let presets: Value = serde_json::from_str(&text).unwrap();
        let front = presets["front"].as_array().unwrap().iter();
        front.map(|p| p["search"]["warmup"].as_u64().unwrap_or(0)).collect()
    };
    assert!(least("human").iter().all(|n| *n > 0));
    let [fast, ..] = least("lathe")[..] else { panic!() };
    let run = ["run", "lathe.pcad", "--observe", "lamp.png", "--quality", "fast", "--quiet"];
    // No time at all is left for it.
    f.succeeds(&[&run[..], &["--time", "1ms", "--out", "out"]].concat());
    for c in json(&f, "out/run.json")["chains"].as_array().unwrap() {
        let [warmup, steps] = ["warmup", "steps"].map(|k| c[k].as_u64().unwrap());
        assert_eq!((warmup, steps), (fast, 1));
    }
}

#[test]
fn a_table_without_a_vessel_says_so() {
    let f = Folder::new("told_table");
    let skier = "examples/images/skier.jpg";
    std::fs::copy(skier, f.path().join("skier.jpg")).unwrap();
    let done = f.run(&["run", "table.pcad", "--observe", "skier.jpg"]);
    assert_eq!(done.code, 1);
    assert!(done.err.contains("not found: no vessel is seen; --at X,Y"), "{}", done.err);
}
