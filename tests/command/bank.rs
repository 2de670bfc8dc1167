//! Banks end to end: learnt, read back, refused when they do not match the program, and
//! used for proposals.

use crate::common::folder::{Folder, disc, png};
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Constraint, Draws, Limits, Trace};
use pcadlang_inference::{Banks, Neighbours, RunOptions};
use pcadlang_library::scene::{ImageValue, KeypointsValue};
use pcadlang_scene::render::Contours;
use pcadlang_scene::vision::ContourMap;
use pcadlang_scene::vision::features::Query;
use pcadlang_scene::vision::keypoints::{Keypoint, Keypoints};
use pcadlang_workbench::bank::{Bank, BankError, Features, Observed};
use pcadlang_workbench::session::as_view;
use std::sync::Arc;

/// A lathed solid, with or without a waist.
const SMALL: &str = r#"include "std/scene.pcad" as scene;
param sides: int = 12;
data photo: image "the photograph";
assume h ~ uniform(0.8, 3);
assume r ~ lognormal(-0.9, 0.4);
assume x ~ uniform(-1, 1);
assume waist ~ flip(0.5);
fn middle() { d ~ beta(2, 2); d }
assume rs = [1, 1, if waist { middle() } else { 1 }, 1, 1];
assume view = scene.render(scene.affine(translate = [x, 0, 0])
            * scene.centred(scene.lathe([{ y: linspace(0, h, 5), r: r * rs }], sides = sides)));
observe scene.chamfer(view, sigma = 5, symmetric = true, size = 64) = photo as distance;
infer {
  warmup 20 { knn(@**, bank = "small.bank", k = 5); }
  repeat 200 {
    mix { 0.5 => knn(@**, bank = "small.bank", k = 5); 0.5 => drift(one(@**)); }
    collect h, r, x, waist, log_joint();
  }
}
"#;

fn small(name: &str) -> Folder {
    let f = Folder::new(name);
    f.write("small.pcad", SMALL).write("disc.png", png(disc(64, 64, 36.0, 30.0, 15.0)));
    f
}

const LEARN: [&str; 8] =
    ["learn", "small.pcad", "-n", "40", "--features-size", "64", "-o", "small.bank"];
const RUN: [&str; 8] =
    ["run", "small.pcad", "--observe", "disc.png", "--chains", "2", "--out", "out"];

/// Compiles the program with these contours observed.
fn model(f: &Folder, contours: ContourMap) -> Model {
    let program = Program::open(f.path().join("small.pcad").to_str().unwrap()).unwrap();
    program.observe("photo", Value::object(ImageValue::contours(contours, None))).compile().unwrap()
}

/// Returns arbitrary contours, so that the program can be run.
fn line() -> ContourMap {
    let picture = image::GrayImage::from_fn(64, 64, |i, j| {
        image::Luma([if i == 32 && j > 8 { 255 } else { 0 }])
    });
    ContourMap::from_image(&picture)
}

#[test]
fn a_bank_is_the_same_on_any_number_of_threads_and_so_are_draws_from_it() {
    let f = small("bank_threads");
    let said = f.succeeds(&[&LEARN[..], &["--threads", "1"]].concat()).out;
    assert!(said.contains("small.bank: 40 scenes from the prior"), "{said}");
    let one = std::fs::read(f.path().join("small.bank")).unwrap();
    f.succeeds(&[&LEARN[..], &["--threads", "2", "--quiet"]].concat());
    assert_eq!(one, std::fs::read(f.path().join("small.bank")).unwrap());
    f.succeeds(&["learn", "small.pcad", "-n", "40", "--seed", "2", "-o", "other.bank", "--quiet"]);
    assert_ne!(one, std::fs::read(f.path().join("other.bank")).unwrap());
    assert_eq!(f.files(), ["disc.png", "other.bank", "small.bank", "small.pcad"]);
    let draws = |out: &str, threads: &str| {
        f.succeeds(&[
            "run",
            "small.pcad",
            "--observe",
            "disc.png",
            "--chains",
            "2",
            "--threads",
            threads,
            "--quiet",
            "--out",
            out,
        ]);
        let rows = |i: u32| -> Vec<String> {
            let text = f.read(&format!("{out}/chain-{i}.csv"));
            text.lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect()
        };
        [rows(1), rows(2)]
    };
    assert_eq!(draws("a", "1"), draws("b", "2"));
    let summary: serde_json::Value = serde_json::from_str(&f.read("a/summary.json")).unwrap();
    let kernels = summary["kernels"].as_array().unwrap();
    let knn = kernels.iter().find(|k| k["name"].as_str().unwrap().starts_with("knn")).unwrap();
    assert!(
        knn["proposals"].as_u64().unwrap() > 30 && knn["accepted"].as_u64().unwrap() > 0,
        "{knn}"
    );
}

#[test]
fn entries_come_back_and_the_nearest_picture_of_an_entry_is_its_own() {
    let f = small("bank_entries");
    f.succeeds(&LEARN);
    let bank = Bank::open(&f.path().join("small.bank")).unwrap();
    let m = model(&f, line());
    bank.check(m.hash()).unwrap();
    assert_eq!((bank.len(), &bank.header().features), (40, &Features::Contours { size: 64 }));
    let mut waists = 0;
    for i in 0..bank.len() {
        let latents = bank.latents(i).unwrap();
        let names: Vec<&str> = latents.iter().map(|c| c.address.as_str()).collect();
        let deep = names.iter().any(|n| n.ends_with("/d"));
        assert_eq!(names.len(), if deep { 5 } else { 4 }, "{names:?}");
        waists += usize::from(deep);
        let values = latents.iter().map(|c| (c.hash, Constraint::Stored(c.stored.clone())));
        let (mut t, _) =
            Trace::generate(Arc::clone(m.code()), values, Draws::default(), Limits::default())
                .unwrap();
        let coordinates = |t: &Trace, hash: u64| {
            let at = t.all_targets().iter().find(|c| t.address_hash(**c) == hash).unwrap();
            t.free(*at).map(|(y, _)| y)
        };
        latents.iter().for_each(|c| assert_eq!(coordinates(&t, c.hash), c.free, "{}", c.address));
        let view = t.global("view", Draws::default()).unwrap().unwrap();
        let view = as_view(&view, None).unwrap();
        let features = bank.header().features.of(&view).unwrap();
        assert_eq!(features, bank.features(i).unwrap(), "entry {i}");
        assert_eq!(bank.nearest(&Query::new(features), 3).unwrap()[0], (i, 0.0));
        // An observed picture gives contour points without lengths, and its features are
        // moved slightly to find a better match.
        let c: Arc<Contours> = view.contours(64);
        let (tx, ty, strength) = (c.tx.clone(), c.ty.clone(), vec![1.0; c.len()]);
        let map =
            ContourMap { width: 64, height: 64, x: c.x.clone(), y: c.y.clone(), tx, ty, strength };
        let near = bank
            .nearest(&Query::contours(&pcadlang_scene::vision::features::observed(&map)), 3)
            .unwrap();
        assert_eq!(near[0].0, i);
    }
    assert!((8..32).contains(&waists), "{waists} of 40 have a waist");
    assert!(bank.latents(40).is_err() && bank.features(40).is_err());
    assert!(matches!(bank.nearest(&Query::new(vec![0.0; 3]), 1), Err(BankError::Command(_))));
    let near = bank.nearest(&Query::new(bank.features(7).unwrap()), 100).unwrap();
    assert!(near.len() == 40 && near.windows(2).all(|w| w[0].1 <= w[1].1), "all of them, in order");
}

#[test]
fn banks_that_do_not_fit_are_refused() {
    let f = small("bank_refused");
    refused(&f, "small.bank: no such file");
    f.write("small.bank", "not a bank");
    refused(&f, "it is not a bank");
    f.succeeds(&LEARN);
    f.succeeds(&[&RUN[..], &["--quiet"]].concat());
    let whole = std::fs::read(f.path().join("small.bank")).unwrap();
    // Another program text, or other parameters.
    refused_with(&f, &["--set", "sides=13"], "made from another program");
    f.write("small.pcad", SMALL.replace("0.8, 3", "0.8, 4"));
    refused(&f, "made from another program");
    f.write("small.pcad", SMALL);
    // Another version, a truncated file, an altered header.
    let mut other = whole.clone();
    other[8] = 99;
    f.write("small.bank", &other);
    refused(&f, "format version 99");
    for n in [whole.len() - 1, whole.len() / 2, 70, 20] {
        f.write("small.bank", &whole[..n]);
        refused(&f, "damaged");
    }
    let mut other = whole.clone();
    let at = other.len() - 10;
    other[at] ^= 1;
    f.write("small.bank", &other);
    refused(&f, "header is altered");
    // Features that the program does not observe.
    f.write("bare.pcad", "assume x ~ normal(0, 1); observe normal(x, 1) = 0;");
    f.refuses(&["learn", "bare.pcad", "-o", "bare.bank"], "the program has nothing to draw");
    f.refuses(&["learn", "small.pcad", "-o", "k.bank", "--features", "keypoints"], "no landmarks");
    f.refuses(
        &["learn", "small.pcad", "-o", "no/such/folder.bank"],
        "cannot write no/such/folder.bank",
    );
}

fn refused(f: &Folder, says: &str) {
    refused_with(f, &[], says);
}

fn refused_with(f: &Folder, more: &[&str], says: &str) {
    let d = f.run(&[&RUN[..], more].concat());
    assert!(d.code == 1 && d.err.contains(says), "{says:?} is not in {}{}", d.out, d.err);
}

/// A user's own feature command; here, it returns the number of bytes of the picture.
#[cfg(unix)]
#[test]
fn features_may_come_from_a_command() {
    let f = small("bank_command");
    f.write("detector.sh", "wc -c < \"$1\"; echo 0.5, 1e-3");
    let command = "sh detector.sh {png}";
    f.succeeds(&[&LEARN[..], &["--features-from", command]].concat());
    let bank = Bank::open(&f.path().join("small.bank")).unwrap();
    let features = bank.features(0).unwrap();
    assert!(
        features.len() == 3 && features[0] > 100.0 && features[1..] == [0.5, 1e-3],
        "{features:?}"
    );
    refused(
        &f,
        "give it again: --features-from 'sh detector.sh {png}'"
            .trim_start_matches("give it again: "),
    );
    f.succeeds(&[&RUN[..], &["--features-from", command, "--quiet"]].concat());
    f.write("detector.sh", "echo nothing");
    f.refuses(&[&LEARN[..], &["--features-from", command]].concat(), "must print finite numbers");
    f.write("detector.sh", "exit 3");
    f.refuses(&[&LEARN[..], &["--features-from", command]].concat(), "it failed");
}

/// The nearest scene to the keypoints of a scene is that scene, also when half of them
/// are missing.
#[test]
fn a_bank_of_bodies_is_searched_by_keypoints() {
    let f = Folder::new("bank_bodies");
    f.succeeds(&[
        "learn",
        "human.pcad",
        "-n",
        "30",
        "--features",
        "keypoints",
        "-o",
        "human.bank",
        "--quiet",
    ]);
    let bank = Bank::open(&f.path().join("human.bank")).unwrap();
    let Features::Keypoints { names } = &bank.header().features else {
        panic!("{:?}", bank.header())
    };
    assert!(names.iter().any(|n| n == "nose") && names.len() > 10, "{names:?}");
    for i in [0, 7, 29] {
        let features = bank.features(i).unwrap();
        assert_eq!(features.len(), 2 * names.len());
        let pixels = |x: f32| f64::from(x) * 64.0 + 32.0;
        let point = |(n, at): (&String, &[f32])| {
            Keypoint::new(n.as_str(), [pixels(at[0]), pixels(at[1])], 0.8)
        };
        let seen: Vec<Keypoint> =
            names.iter().zip(features.chunks(2)).map(point).step_by(2).collect();
        let seen = Value::object(KeypointsValue(Keypoints::new(seen).unwrap()));
        let photo = Value::object(ImageValue::contours(line(), None));
        let program =
            Program::open("human.pcad").unwrap().observe("photo", photo).observe("points", seen);
        let m = program.compile().unwrap();
        bank.check(m.hash()).unwrap();
        let query = Observed::of(&m).query(&bank.header().features, None).unwrap();
        assert_eq!(bank.nearest(&query, 5).unwrap()[0].0, i);
        let strange = Features::Keypoints { names: vec!["trunk".into()] };
        assert!(matches!(Observed::of(&m).query(&strange, None), Err(BankError::Observed(_))));
        let contours = Observed::of(&m).query(&Features::Contours { size: 64 }, None).unwrap();
        assert!(matches!(bank.nearest(&contours, 5), Err(BankError::Command(_))));
    }
    let bare = Program::open("human.pcad").unwrap().without_data().compile().unwrap();
    assert!(matches!(
        Observed::of(&bare).query(&bank.header().features, None),
        Err(BankError::Observed(_))
    ));
}

/// Errors in a kernel's arguments are reported before a chain begins, with their
/// position.
#[test]
fn a_bank_that_is_not_there_is_an_error_at_the_kernel() {
    let error = |kernel: &str, banks: Option<Arc<dyn Banks>>| {
        let text = format!(
            "assume x ~ normal(0, 1); observe normal(x, 1) = 0; let k = 0;
             infer {{ warmup 1 {{ drift(@x); }} repeat 10 {{ {kernel}; collect x; }} }}"
        );
        let options = RunOptions { banks, ..RunOptions::default() };
        Model::from_text(&text).unwrap().run(&options, 1, 1).err().map(|e| e.to_string())
    };
    let none = || -> Option<Arc<dyn Banks>> { Some(Arc::new(Neighbours::default())) };
    let missing = error("knn(@**, bank = \"b\")", None).unwrap();
    assert!(
        missing.contains("\"b\" is not known to this run") && missing.contains("knn(@**"),
        "{missing}"
    );
    assert!(
        error("knn(@**, bank = \"b\", k = 0)", none()).unwrap().contains("whole number from 1")
    );
    assert!(
        error("knn(@**, bank = \"b\", k = k)", none()).unwrap().contains("whole number from 1")
    );
    assert!(error("knn(@**, bank = k)", none()).unwrap().contains("must be a string"));
    assert_eq!(
        error("knn(@**, bank = \"b\")", none()),
        None,
        "no neighbours: draws from the prior"
    );
}

#[test]
fn parts_drawn_apart_are_joined_to_the_same_bank() {
    let f = small("bank-parts");
    let learn = |options: &[&str]| {
        let all = [&["learn", "small.pcad", "--features-size", "64"], options].concat();
        f.succeeds(&all);
    };
    learn(&["-n", "12", "-o", "whole.bank"]);
    learn(&["-n", "5", "-o", "a.bank"]);
    learn(&["-n", "7", "--first", "5", "-o", "b.bank"]);
    learn(&["--join", "a.bank", "b.bank", "-o", "joined.bank"]);
    let bytes = |name: &str| std::fs::read(f.path().join(name)).unwrap();
    assert_eq!(bytes("joined.bank"), bytes("whole.bank"));
    f.refuses(
        &["learn", "small.pcad", "--join", "a.bank", "none.bank", "-o", "joined.bank"],
        "none.bank",
    );
}
