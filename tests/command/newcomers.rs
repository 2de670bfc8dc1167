//! Things that stopped or misled people in their first hour: every run can be opened
//! again, data are accepted in the usual formats, messages name the fault, and names may
//! be typed as people type them.

use crate::common::folder::Folder;
use serde_json::Value;
use std::process::{Command, Stdio};

/// A program with a ball of radius `size` at `x`, from its first statements and its plan.
fn ball(before: &str, plan: &str) -> String {
    format!(
        "include \"std/scene.pcad\" as scene; {before}
         assume view = scene.render(scene.affine(translate = [x, 0, 0]) * scene.sphere(size));
         infer {{ {plan} }}"
    )
}

fn json(f: &Folder, name: &str) -> Value {
    serde_json::from_str(&f.read(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Returns the column names of a chain's file, and its draws.
fn chain(f: &Folder, name: &str) -> (String, Vec<Vec<f64>>) {
    let text = f.read(name);
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let names = lines.next().unwrap_or_default().to_owned();
    let number = |x: &str| x.parse::<f64>().unwrap_or_else(|_| panic!("{name}: {x}"));
    (names, lines.map(|l| l.split(',').map(number).collect()).collect())
}

/// All chains of a run end with the same number of draws and the same columns, regardless
/// of their speed and of the choices that appeared and vanished.
#[test]
fn chains_of_a_run_have_one_form() {
    let f = Folder::new("one-form");
    let program = "assume k ~ uniform_discrete(1, 6);
        assume w = map(fn(i) { z[i] ~ normal(i, 1); z[i] }, 0 .. k);
        observe normal(sum(w), 2) = 5;
        infer { warmup 50 { mh(one(@**)); } repeat 400 { mh(one(@**)); collect k, w; } }";
    f.write("parts.pcad", program);
    let all =
        |dir: &str| (1..=4).map(|c| chain(&f, &format!("{dir}/chain-{c}.csv"))).collect::<Vec<_>>();
    f.succeeds(&["run", "parts.pcad", "--chains", "4", "--quiet", "--out", "steps"]);
    let chains = all("steps");
    assert!(
        chains.iter().all(|(names, draws)| *names == chains[0].0 && draws.len() == 400),
        "{}",
        chains[0].0
    );
    let most = chains.iter().flat_map(|(_, draws)| draws).map(|d| d[6] as usize).max().unwrap();
    let ws: String = (1..=most).map(|i| format!("w.{i},")).collect();
    assert!(most > 3 && chains[0].0.ends_with(&format!("k,{ws}log_lik.1")), "{}", chains[0].0);
    for draw in chains.iter().flat_map(|(_, draws)| draws) {
        let (k, w) = (draw[6] as usize, &draw[7..7 + most]);
        assert!(
            w[..k].iter().all(|x| x.is_finite()) && w[k..].iter().all(|x| x.is_nan()),
            "{draw:?}"
        );
        // The log likelihood of the observation, whatever the structure, equals the
        // likelihood part of the log joint density.
        assert!((draw[draw.len() - 1] - draw[4]).abs() < 1e-9, "{draw:?}");
    }
    // Under a time limit, chains make different numbers of draws: all chain files have
    // the smallest of these, and all draws are kept.
    f.succeeds(&[
        "run",
        "parts.pcad",
        "--chains",
        "4",
        "--time",
        "700ms",
        "--quiet",
        "--out",
        "time",
    ]);
    let chains = all("time");
    assert!(
        chains
            .iter()
            .all(|(names, draws)| *names == chains[0].0 && draws.len() == chains[0].1.len())
    );
    let run = json(&f, "time/run.json");
    let made: Vec<u64> =
        run["chains"].as_array().unwrap().iter().map(|c| c["draws"].as_u64().unwrap()).collect();
    assert_eq!(chains[0].1.len() as u64, *made.iter().min().unwrap());
    for (c, n) in (1..).zip(&made) {
        let whole = format!("time/draws-{c}.csv");
        let kept = if f.exists(&whole) { whole } else { format!("time/chain-{c}.csv") };
        let rows =
            f.read(&kept).lines().filter(|l| !l.starts_with('#') && !l.starts_with("lp__")).count();
        assert_eq!(rows as u64, *n, "{kept}");
    }
    // The run resumes from all of its draws.
    f.succeeds(&[
        "run",
        "parts.pcad",
        "--chains",
        "4",
        "--time",
        "1200ms",
        "--quiet",
        "--resume",
        "--out",
        "time",
    ]);
    let again = all("time");
    assert!(
        again[0].1.len() > chains[0].1.len() && again.iter().all(|c| c.1.len() == again[0].1.len())
    );
    assert!(
        again.iter().zip(&chains).all(|(new, old)| new.1[0][..6] == old.1[0][..6]),
        "the first draws stay"
    );
}

#[test]
fn who_reads_may_go_away() {
    let f = Folder::new("closed");
    f.write("x.pcad", "assume x ~ normal(0, 1); observe normal(x, 1) = 1;");
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("pcadlang"))
        .current_dir(f.path())
        .args(["run", "x.pcad", "--out", "out"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Both pipes are closed before anything is printed.
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(json(&f, "out/run.json")["state"], "done");
}

#[test]
fn zeros_and_ones_are_truth_values() {
    let f = Folder::new("zeros");
    f.write("d.csv", "y\n1\n0\n1\n1\n");
    let program = |observe: &str| {
        format!("data d = csv(\"d.csv\"); assume p ~ beta(1, 1); {observe} predict q ~ flip(p);")
    };
    // beta(1, 1) and 3 of 4: beta(4, 2), whose mean is 2/3.
    let forms = [
        "observe flip(p) = d.y;",
        "for i in 0 .. 4 { observe flip(p) = d.y[i]; }",
        "observe iid(flip(p), 4) = d.y;",
        "observe flip(p) = [true, false, true, true];",
    ];
    for (i, form) in forms.iter().enumerate() {
        f.write("bits.pcad", program(form));
        let out = format!("out{i}");
        f.succeeds(&["run", "bits.pcad", "--seed", "2", "--quiet", "--out", &out]);
        let mean =
            json(&f, &format!("{out}/summary.json"))["quantities"]["p"]["mean"].as_f64().unwrap();
        assert!((mean - 2.0 / 3.0).abs() < 0.02, "{form}: {mean}");
    }
    f.write("bits.pcad", program("observe flip(p) = [1, 0, 2, 1];"));
    let d = f.run(&["run", "bits.pcad", "--out", "no"]);
    assert!(
        d.code == 1 && d.err.contains("the observed value 2 is outside the support"),
        "{}",
        d.err
    );
}

/// Data outside of a distribution's support are reported, with their position and the
/// support.
#[test]
fn data_outside_of_a_support_are_named() {
    let f = Folder::new("outside");
    for (observe, says) in [
        (
            "observe flip(0.3) = [1, 0, 2];",
            "the observed value 2 is outside the support of `flip` \
            (true and false)",
        ),
        (
            "observe poisson(exp(x)) = 2.5;",
            "the observed value 2.5 is outside the support of \
            `poisson` (integers of at least 0)",
        ),
        (
            "observe gamma(exp(x), 1) = [1, -1];",
            "the observed value -1 is outside the support of \
            `gamma` (numbers above 0)",
        ),
        (
            "observe beta(exp(x), 1) = 1.5;",
            "the observed value 1.5 is outside the support of \
            `beta` (numbers from 0 to 1)",
        ),
    ] {
        f.write("x.pcad", format!("assume x ~ normal(0, 1);\n{observe}\n"));
        let d = f.run(&["run", "x.pcad", "--out", "out"]);
        assert!(
            d.code == 1 && d.err.contains(says) && d.err.contains("x.pcad:2:"),
            "{observe}: {}",
            d.err
        );
        assert!(
            d.err.contains("check the data") && !d.err.contains("use a wider prior"),
            "{}",
            d.err
        );
    }
}

/// A standard deviation that may be negative: the log density is undefined there, and the
/// program samples where it is defined.
#[test]
fn spreads_that_may_be_negative_are_sampled() {
    let f = Folder::new("negative");
    for seed in ["1", "2", "3"] {
        f.write(
            "s.pcad",
            "assume m ~ normal(0, 3); assume s ~ normal(0, 5); observe normal(m, s) = [1, 2, 3, 2.5, 1.5];",
        );
        let d = f.run(&["run", "s.pcad", "--seed", seed, "--out", seed]);
        assert_eq!(d.code, 0, "{}", d.err);
        let s = &json(&f, &format!("{seed}/summary.json"))["quantities"]["s"];
        assert!(s["q05"].as_f64().unwrap() > 0.2 && s["q95"].as_f64().unwrap() < 5.0, "{s}");
    }
}

#[test]
fn what_does_not_move_has_no_r_hat_and_a_reason() {
    let f = Folder::new("still");
    f.write(
        "x.pcad",
        "assume x ~ normal(0, 1); assume c = 3; observe normal(x, 1) = 1; infer { repeat 100 { collect x, c; } }",
    );
    f.succeeds(&["run", "x.pcad", "--quiet", "--out", "out"]);
    let (summary, run) = (json(&f, "out/summary.json"), json(&f, "out/run.json"));
    let quantity = |name: &str| &summary["quantities"][name];
    assert!(quantity("x")["r_hat"].is_null() && quantity("c")["r_hat"].is_null());
    assert!(quantity("x")["r_hat_reason"].as_str().unwrap().contains("different values"));
    assert_eq!(quantity("c")["r_hat_reason"], "it never moved");
    assert!(
        run["r_hat_max"].is_null()
            && run["r_hat_max_reason"].as_str().unwrap().contains("different values")
    );
}

#[test]
fn names_are_found_as_people_type_them() {
    let f = Folder::new("names");
    assert!(f.succeeds(&["check", "coin"]).out.contains("coin.pcad: no mistakes found"));
    f.write("own.pcad", "assume x ~ normal(0, 1); infer { repeat 5 { mh(@x); } }");
    f.succeeds(&["run", "own", "--quiet", "--out", "out"]);
    let d = f.run(&["run", "nothing.pcad"]);
    assert!(d.code == 1 && d.err.contains("shipped programs are coin.pcad"), "{}", d.err);
    assert!(
        f.run(&["run", "lathes.pcad"]).err.contains("did you mean the shipped program lathe.pcad?")
    );
    for (words, name) in [
        ("logistic", "expit("),
        ("sigmoid", "expit("),
        ("bernoulli", "flip("),
        ("matrix multiply", "matmul("),
        ("scan", "fold("),
        ("softmax", "log_sum_exp("),
    ] {
        let d = f.succeeds(&["doc", "--search", words]);
        assert!(d.out.starts_with(name), "{words}: {}", d.out);
    }
}

/// Every kept draw can be restored, and the prompt resumes where the run ended.
#[test]
fn runs_are_opened_again() {
    let f = Folder::new("again");
    let before = "param size = 0.3; assume x ~ normal(0, 0.5); observe normal(x, 0.1) = 0.4 as y;";
    f.write(
        "ball.pcad",
        ball(before, "warmup 100 { drift(@x); } repeat 500 { drift(@x); collect x; }"),
    );
    f.succeeds(&[
        "run",
        "ball.pcad",
        "--set",
        "size=0.5",
        "--chains",
        "2",
        "--keep",
        "20",
        "--quiet",
        "--out",
        "out",
    ]);
    let kept: Vec<Value> =
        f.read("out/traces.jsonl").lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert!((10..=20).contains(&kept.len()), "{}", kept.len());
    let list = f.succeeds(&["show", "out"]).out;
    assert!(
        list.starts_with("pcadlang run ball.pcad --set size=0.5 --seed 1 --chains 2"),
        "{list}"
    );
    assert!(list.contains("\n3: chain 1, draw ") && list.contains("@x"), "{list}");
    // The third state is the draw that it names: its choice equals that in the file of
    // draws.
    let (_, draws) = chain(&f, "out/chain-1.csv");
    let draw = kept[2]["draw"].as_u64().unwrap() as usize;
    let said = f.succeeds(&["show", "out", "--draw", "3"]).out;
    let x: f64 = said
        .lines()
        .find(|l| l.starts_with("@x "))
        .unwrap()
        .split_whitespace()
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    assert!((x - draws[draw - 1][6]).abs() < 1e-3, "{said}: {:?}", draws[draw - 1]);
    for (n, name) in [("1", "a.png"), ("2", "b.png"), ("3", "c.obj"), ("4", "d.glb")] {
        f.succeeds(&["show", "out", "--draw", n, "-o", name]);
        assert!(f.exists(name), "{name}");
    }
    assert_ne!(
        std::fs::read(f.path().join("a.png")).unwrap(),
        std::fs::read(f.path().join("b.png")).unwrap()
    );
    // The settings of the run are applied: a ball of 0.5, not of 0.3.
    let highest = f
        .read("c.obj")
        .lines()
        .filter_map(|l| l.strip_prefix("v ")?.split(' ').nth(1)?.parse().ok())
        .fold(0.0, f64::max);
    assert!((highest - 0.5).abs() < 0.01, "{highest}");
    f.refuses(&["show", "out", "--draw", "99"], "no kept state 99");
    f.refuses(&["show", "out", "-o", "x.bmp"], "must end in .png, .obj or .glb");
    f.refuses(&["show", "."], "is not the folder of a run");
    let mut prompt = assert_cmd::Command::cargo_bin("pcadlang").unwrap();
    let done = prompt
        .current_dir(f.path())
        .args(["repl", "out"])
        .write_stdin("size\nx\n")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    let best = json(&f, "out/best.trace.json");
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines.contains(&"0.5"), "{said}");
    let x = best["choices"][0].to_string();
    assert!(lines.iter().any(|l| l.len() > 4 && x.contains(&l[..5])), "{said} {x}");
}

#[test]
fn runs_are_compared() {
    let f = Folder::new("compared");
    let before =
        "param at = 0.4; param size = 0.3; assume x ~ normal(0, 0.5); assume same ~ normal(0, 1);
         observe normal(x, 0.1) = at; observe normal(same, 1) = 0;";
    let plan = "warmup 100 { drift(one(@**)); } repeat 500 { repeat 5 { drift(one(@**)); } collect x, same; }";
    f.write("ball.pcad", ball(before, plan));
    f.succeeds(&["run", "ball.pcad", "--chains", "2", "--quiet", "--out", "a"]);
    f.succeeds(&["run", "ball.pcad", "--chains", "2", "--set", "at=-0.4", "--quiet", "--out", "b"]);
    let d = f.succeeds(&["compare", "a", "b", "-o", "both.png"]);
    assert!(d.out.contains("only A: -\nonly B: --set at=-0.4\n"), "{}", d.out);
    let rows: Vec<Vec<&str>> = d.out.lines().map(|l| l.split_whitespace().collect()).collect();
    let row = |name: &str| {
        rows.iter().position(|r| r.first() == Some(&name)).unwrap_or_else(|| panic!("{}", d.out))
    };
    let apart = |name: &str| rows[row(name)][5].parse::<f64>().unwrap();
    assert!(row("x") < row("same") && apart("x") > 5.0 && apart("same") < 0.3, "{}", d.out);
    let sheet = image::open(f.path().join("both.png")).unwrap();
    assert!(sheet.width() > 2 * 512, "{}", sheet.width());
    assert!(f.succeeds(&["compare", "a", "a"]).out.contains("are the same"));
    f.refuses(&["compare", "a", "."], "is not the folder of a run");
}

/// A run reports objects outside of its picture, and runs that it replaces.
#[test]
fn what_is_outside_and_what_is_replaced_is_said() {
    let f = Folder::new("outside-picture");
    let program = |x: f64| {
        let before =
            format!("let size = 0.5; assume x ~ normal({x}, 0.01); observe normal(x, 1) = {x};");
        ball(&before, "repeat 50 { drift(@x); }")
    };
    let run = |x: f64| {
        f.write("ball.pcad", program(x));
        f.succeeds(&["run", "ball.pcad", "--chains", "2", "--out", "out"])
    };
    let (within, beyond) = (run(0.0), run(2.4));
    assert!(
        !within.out.contains("outside of the picture") && !within.err.contains("is replaced"),
        "{}",
        within.err
    );
    assert!(beyond.out.contains("most of the best scene is outside the picture"), "{}", beyond.out);
    assert!(beyond.err.contains("note: replacing the earlier run in out"), "{}", beyond.err);
    f.succeeds(&["run", "ball.pcad", "--chains", "2", "--out", "fresh"]);
}

/// Choices with names are in the table and the files, under the names that they have in
/// the program.
#[test]
fn what_is_drawn_by_name_is_recorded() {
    let f = Folder::new("drawn-by-name");
    let program = "let y = [0.1, 0.5, 0.9];
        z[0] ~ normal(0, 1);
        for t in 1 .. 3 { z[t] ~ normal(z[t - 1], 0.5); observe normal(z[t], 0.3) = y[t]; }
        w ~ normal(z[2], 1);";
    f.write("walk.pcad", program);
    let done =
        f.succeeds(&["run", "walk.pcad", "--steps", "200", "--warmup", "100", "--out", "walk"]);
    for name in ["z[0] ", "z[1] ", "z[2] ", "w "] {
        assert!(done.out.lines().any(|l| l.starts_with(name)), "{name}: {}", done.out);
    }
    let (names, _) = chain(&f, "walk/chain-1.csv");
    assert!(names.contains("z.1,z.2,z.3,w,log_lik.1"), "{names}");
    // Each element has one address, wherever it is drawn; an element that is drawn twice
    // is an error.
    let all = f.read("walk/best.trace.json");
    assert!(!all.contains("z#2"), "{all}");
    f.write("twice.pcad", format!("{program} for t in 0 .. 2 {{ z[t] ~ normal(0, 1); }}"));
    f.refuses(&["run", "twice.pcad"], "is drawn twice");
}

/// An unknown number of components with a label for each point: the program samples, and
/// the run reports why its structure does not move.
#[test]
fn structure_that_does_not_move_is_named() {
    let f = Folder::new("structure");
    let points: Vec<String> = (0..60)
        .map(|i| format!("{:.2}", f64::from(i % 2) * 5.0 + f64::from(i * 37 % 60) / 40.0))
        .collect();
    let start = format!(
        "let ys = [{}]; assume k ~ uniform_discrete(1, 5);
         assume mu = map(fn(i) {{ m ~ normal(0, 5); m }}, 0 .. k);",
        points.join(", ")
    );
    let labels = "for i in 0 .. 60 { z[i] ~ uniform_discrete(0, k - 1); observe normal(mu[z[i]], 1) = ys[i]; }";
    let summed = "observe mixture(map(fn(m) { 1 / k }, mu), map(fn(m) { normal(m, 1) }, mu)) = ys;";
    f.write("labels.pcad", format!("{start} {labels}"));
    f.write("summed.pcad", format!("{start} {summed}"));
    let stuck = f.succeeds(&["run", "labels.pcad", "--seed", "1", "--steps", "20000"]);
    assert!(stuck.out.contains("warning: @k decides which other choices exist"), "{}", stuck.out);
    assert!(stuck.out.contains("observe mixture(map("), "{}", stuck.out);
    let moves = f.succeeds(&["run", "summed.pcad", "--seed", "1", "--steps", "20000"]);
    assert!(!moves.out.contains("decides which other choices"), "{}", moves.out);
    let k = moves.out.lines().find(|l| l.starts_with("@k ")).expect("the moves of k");
    let rate: f64 = k.trim_end_matches('%').rsplit(' ').next().unwrap().parse().unwrap();
    assert!(rate >= 1.0, "{k}");
}

/// `check` reports a column that is missing from a file, with the existing columns.
#[test]
fn checks_look_into_files() {
    let f = Folder::new("checks");
    f.write("d.csv", "age,height\n1,70\n2,82\n");
    let with =
        |column: &str| format!("data d = csv(\"d.csv\"); observe normal(80, 9) = d.{column};");
    f.write("good.pcad", with("height"));
    f.write("bad.pcad", with("heigth"));
    f.write(
        "asks.pcad",
        "data d = csv(\"d.csv\"); assume x = if has(d, \"z\") { d.z } else { 0 };",
    );
    f.succeeds(&["check", "good.pcad"]);
    f.succeeds(&["check", "asks.pcad"]);
    f.refuses(&["check", "bad.pcad"], "the record has no field `heigth`");
    f.write("gone.pcad", "data d = csv(\"gone.csv\"); observe normal(80, 9) = d.height;");
    f.refuses(&["check", "gone.pcad"], "cannot read gone.csv");
}

/// A chain that finds no state is named in the report, and the others keep their draws.
#[test]
fn chains_that_cannot_start_are_told() {
    let f = Folder::new("cannot-start");
    f.write(
        "rare.pcad",
        "assume x ~ normal(0, 1); assume y ~ normal(0, 1); observe normal(y, 1) = 1;
         observe flip(if x > 3.09 { 1 } else { 0 }) = true as seen;
         infer { repeat 100 { drift(@y); collect y; } }",
    );
    let done = f.succeeds(&["run", "rare.pcad", "--chains", "8", "--seed", "1", "--out", "out"]);
    let (summary, run) = (json(&f, "out/summary.json"), json(&f, "out/run.json"));
    let warning = summary["warnings"][0].as_str().unwrap();
    assert!(
        warning.contains(" of 8 could not start") && warning.contains("rare.pcad:2:18"),
        "{warning}"
    );
    assert!(done.out.contains("could not start"), "{}", done.out);
    let started = run["chains"].as_array().unwrap().len();
    assert!(started > 1 && started < 8, "{started}");
    assert!(summary["quantities"]["y"]["r_hat"].is_number(), "{summary}");
    f.succeeds(&["report", "out"]);
}

/// `check` says where an entry is missing, as does `run`; columns that are not read do not matter.
#[test]
fn missing_entries_have_a_line_and_a_column() {
    let f = Folder::new("missing-entries");
    f.write("d.csv", "x,y,z\n1,2.1,a\n2,,NA\n3,6.2,\"1,5\"\n4,NA,b\n");
    let program = |observed: &str| {
        format!(
            "data d = csv(\"d.csv\"); assume b ~ normal(0, 5);
             for i in 0 .. len(d.y) {{ {observed} }}"
        )
    };
    f.write("used.pcad", program("observe normal(b * d.x[i], 1) = d.y[i] as y;"));
    f.write("compared.pcad", program("factor(if d.y[i] == 2.1 { 1 } else { 0 });"));
    for (command, file) in
        [("check", "used.pcad"), ("run", "used.pcad"), ("check", "compared.pcad")]
    {
        f.refuses(&[command, file], "d.csv, line 3, column 2: the entry of `y` is empty");
    }
    let known = "if not is_missing(d.y[i]) { observe normal(b * d.x[i], 1) = d.y[i] as y; }";
    f.write("known.pcad", program(known));
    f.succeeds(&["check", "known.pcad"]);
    f.succeeds(&["run", "known.pcad", "--steps", "200", "--chains", "1", "--out", "known"]);
    f.write("other.pcad", program("observe normal(b, 1) = d.x[i] as x;"));
    f.succeeds(&["check", "other.pcad"]);
}
