//! What stopped or misled people in their first hour: every run opens elsewhere, data in the forms that people have them, messages that
//! name what is wrong, names typed as people type them.

#[path = "common/folder.rs"]
mod folder;

use folder::Folder;
use serde_json::Value;
use std::process::{Command, Stdio};

fn json(f: &Folder, name: &str) -> Value {
    serde_json::from_str(&f.read(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// The names of a chain's columns and its draws.
fn chain(f: &Folder, name: &str) -> (String, Vec<Vec<f64>>) {
    let text = f.read(name);
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let names = lines.next().unwrap_or_default().to_owned();
    let number = |x: &str| x.parse::<f64>().unwrap_or_else(|_| panic!("{name}: {x}"));
    (names, lines.map(|l| l.split(',').map(number).collect()).collect())
}

/// Chains end with equally many draws and the same columns, however far each came in its time and whatever came and went in it.
#[test]
fn chains_of_a_run_have_one_form() {
    let f = Folder::new("one-form");
    let program = "assume k ~ uniform_discrete(1, 6);
        assume w = map(fn(i) { z[i] ~ normal(i, 1); z[i] }, 0 .. k);
        observe normal(sum(w), 2) = 5;
        infer { warmup 50 { mh(one(@**)); } repeat 400 { mh(one(@**)); collect k, w; } }";
    f.write("parts.pcad", program);
    let all = |dir: &str| (1..=4).map(|c| chain(&f, &format!("{dir}/chain-{c}.csv"))).collect::<Vec<_>>();
    f.succeeds(&["run", "parts.pcad", "--chains", "4", "--quiet", "--out", "steps"]);
    let chains = all("steps");
    assert!(chains.iter().all(|(names, draws)| *names == chains[0].0 && draws.len() == 400), "{}", chains[0].0);
    assert!(chains[0].0.ends_with("k,w.1,w.2,w.3,w.4,w.5,w.6"), "{}", chains[0].0);
    for draw in chains.iter().flat_map(|(_, draws)| draws) {
        let (k, w) = (draw[4] as usize, &draw[5..]);
        assert!(w[..k].iter().all(|x| x.is_finite()) && w[k..].iter().all(|x| x.is_nan()), "{draw:?}");
    }
    // In a limit of time chains come to numbers of draws of their own: the files have as many as all have, all are kept.
    f.succeeds(&["run", "parts.pcad", "--chains", "4", "--time", "700ms", "--quiet", "--out", "time"]);
    let chains = all("time");
    assert!(chains.iter().all(|(names, draws)| *names == chains[0].0 && draws.len() == chains[0].1.len()));
    let run = json(&f, "time/run.json");
    let made: Vec<u64> = run["chains"].as_array().unwrap().iter().map(|c| c["draws"].as_u64().unwrap()).collect();
    assert_eq!(chains[0].1.len() as u64, *made.iter().min().unwrap());
    for (c, n) in (1..).zip(&made) {
        let whole = format!("time/draws-{c}.csv");
        let kept = if f.exists(&whole) { whole } else { format!("time/chain-{c}.csv") };
        let rows = f.read(&kept).lines().filter(|l| !l.starts_with('#') && !l.starts_with("lp__")).count();
        assert_eq!(rows as u64, *n, "{kept}");
    }
    // It goes on from all that it had.
    f.succeeds(&["run", "parts.pcad", "--chains", "4", "--time", "1200ms", "--quiet", "--resume", "--out", "time"]);
    let again = all("time");
    assert!(again[0].1.len() > chains[0].1.len() && again.iter().all(|c| c.1.len() == again[0].1.len()));
    assert!(again.iter().zip(&chains).all(|(new, old)| new.1[0][..4] == old.1[0][..4]), "the first draws stay");
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
    // Both ends are closed before anything is said.
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(json(&f, "out/run.json")["state"], "done");
}

#[test]
fn zeros_and_ones_are_truth_values() {
    let f = Folder::new("zeros");
    f.write("d.csv", "y\n1\n0\n1\n1\n");
    let program =
        |observe: &str| format!("data d = csv(\"d.csv\"); assume p ~ beta(1, 1); {observe} predict q ~ flip(p);");
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
        let mean = json(&f, &format!("{out}/summary.json"))["quantities"]["p"]["mean"].as_f64().unwrap();
        assert!((mean - 2.0 / 3.0).abs() < 0.02, "{form}: {mean}");
    }
    f.write("bits.pcad", program("observe flip(p) = [1, 0, 2, 1];"));
    f.refuses(&["run", "bits.pcad", "--out", "no"], "no chain can start");
}

/// What no choice can give is named, with its place and the support.
#[test]
fn data_outside_of_a_support_are_named() {
    let f = Folder::new("outside");
    for (observe, says) in [
        ("observe flip(0.3) = [1, 0, 2];", "2 is observed, and the support of `flip` is true and false"),
        ("observe poisson(exp(x)) = 2.5;", "2.5 is observed, and the support of `poisson` is integers from 0 up"),
        ("observe gamma(exp(x), 1) = [1, -1];", "-1 is observed, and the support of `gamma` is numbers above 0"),
        ("observe beta(exp(x), 1) = 1.5;", "1.5 is observed, and the support of `beta` is numbers from 0 to 1"),
    ] {
        f.write("x.pcad", format!("assume x ~ normal(0, 1);\n{observe}\n"));
        let d = f.run(&["run", "x.pcad", "--out", "out"]);
        assert!(d.code == 1 && d.err.contains(says) && d.err.contains("x.pcad:2:"), "{observe}: {}", d.err);
        assert!(d.err.contains("check the data") && !d.err.contains("widen the prior"), "{}", d.err);
    }
}

/// A spread that may be negative: the program has no value there, and samples where it has one.
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
    f.write("x.pcad", "assume x ~ normal(0, 1); assume c = 3; infer { repeat 100 { collect x, c; } }");
    f.succeeds(&["run", "x.pcad", "--quiet", "--out", "out"]);
    let (summary, run) = (json(&f, "out/summary.json"), json(&f, "out/run.json"));
    let quantity = |name: &str| &summary["quantities"][name];
    assert!(quantity("x")["r_hat"].is_null() && quantity("c")["r_hat"].is_null());
    assert!(quantity("x")["r_hat_reason"].as_str().unwrap().contains("at different values"));
    assert_eq!(quantity("c")["r_hat_reason"], "it never moved");
    assert!(run["r_hat_max"].is_null() && run["r_hat_max_reason"].as_str().unwrap().contains("at different values"));
}

#[test]
fn names_are_found_as_people_type_them() {
    let f = Folder::new("names");
    assert!(f.succeeds(&["check", "coin"]).out.contains("coin.pcad: no mistakes found"));
    f.write("own.pcad", "assume x ~ normal(0, 1); infer { repeat 5 { mh(@x); } }");
    f.succeeds(&["run", "own", "--quiet", "--out", "out"]);
    let d = f.run(&["run", "nothing.pcad"]);
    assert!(d.code == 1 && d.err.contains("shipped programs are coin.pcad"), "{}", d.err);
    assert!(f.run(&["run", "lathes.pcad"]).err.contains("did you mean the shipped program lathe.pcad?"));
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
