//! What a user points out in a photograph on the command line: it reaches the program, is
//! recorded with the run, and is refused where it cannot be.

use crate::common::folder::{Folder, disc, png};
use serde_json::Value;

/// A program that collects the numbers of its hint.
const PROGRAM: &str = "include \"std/scene.pcad\" as scene;
    data photo: image;
    let h = scene.hint(photo);
    let flat = fn(all) { fold(fn(sum, p) { concat(sum, p) }, [], all) };
    let axis = if len(h.axis) > 0 { concat(h.axis.foot, h.axis.top, [h.axis.width]) } else { [] };
    let drawn = if h.drawn { 1 } else { 0 };
    assume x ~ normal(0, 1);
    observe normal(x, 1) = 0;
    infer { repeat 4 { mh(@x); collect x, drawn, len(h.outline), h.box, axis, flat(h.at), flat(h.not); } }
";

fn folder() -> Folder {
    let f = Folder::new("hints");
    f.write("p.pcad", PROGRAM).write("disc.png", png(disc(60, 40, 30.0, 20.0, 12.0)));
    f
}

const RUN: [&str; 8] =
    ["run", "p.pcad", "--chains", "1", "--quiet", "--observe", "disc.png", "--out"];

/// Returns the names and numbers of the first draw that are not of `x`.
fn collected(f: &Folder, out: &str) -> Vec<(String, f64)> {
    let text = f.read(&format!("{out}/chain-1.csv"));
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let (names, first) = (lines.next().unwrap(), lines.next().unwrap());
    let all = names.split(',').zip(first.split(','));
    let all = all.map(|(n, x)| (n.to_owned(), x.parse::<f64>().unwrap()));
    all.filter(|(n, _)| n != "x" && !n.ends_with("__") && !n.starts_with("log_lik")).collect()
}

#[test]
fn a_program_gets_what_was_pointed_out() {
    let f = folder();
    f.write("mask.png", png(disc(30, 20, 15.0, 10.0, 6.0)));
    let bools: Vec<u8> = (0..600).map(|i| u8::from(i % 30 > 20)).collect();
    let head = "{'descr': '|b1', 'fortran_order': False, 'shape': (20, 30), }";
    let head = format!("{head:<117}\n");
    f.write("mask.npy", [b"\x93NUMPY\x01\x00\x76\x00", head.as_bytes(), &bools].concat());
    let seen = |hint: &[&str]| {
        f.succeeds(&[&RUN[..], &["out"], hint].concat());
        let found = collected(&f, "out");
        std::fs::remove_dir_all(f.path().join("out")).unwrap();
        found.into_iter().map(|(_, x)| x).collect::<Vec<f64>>()
    };
    assert_eq!(seen(&[]), [0.0, 0.0]);
    assert_eq!(seen(&["--mask", "mask.png"]), [1.0, 0.0]);
    assert_eq!(seen(&["--mask", "mask.npy"]), [1.0, 0.0]);
    assert_eq!(seen(&["--outline", "1,1", "50,1", "50,30"]), [1.0, 3.0]);
    assert_eq!(seen(&["--outline", "1,1 50,1 50,30 1,30"]), [1.0, 4.0]);
    assert_eq!(seen(&["--box", "-3,4,20,30.5"]), [0.0, 0.0, -3.0, 4.0, 20.0, 30.5]);
    assert_eq!(seen(&["--axis", "30,33", "31,-2", "24"]), [0.0, 0.0, 30.0, 33.0, 31.0, -2.0, 24.0]);
    assert_eq!(
        seen(&["--at", "1,2", "--at", "3,4", "--not", "50,6"]),
        [0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 50.0, 6.0]
    );
}

#[test]
fn it_belongs_to_the_run() {
    let f = folder();
    let hint =
        ["--outline=-1,1 50,1 50,30", "--box", "-3,4,20,30", "--axis", "30,33", "31,2", "24"];
    let hint = [&hint[..], &["--at", "1,2", "--at", "3,4", "--not", "50,6"]].concat();
    let command = [&RUN[..], &["out"], &hint].concat();
    f.succeeds(&command);
    let before = collected(&f, "out");
    assert_eq!(before.len(), 17);
    let run: Value = serde_json::from_str(&f.read("out/run.json")).unwrap();
    let arguments: Vec<&str> =
        run["arguments"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(arguments.ends_with(&hint), "{arguments:?}");
    let more = |steps: &'static str| ["--resume", "--steps", steps];
    f.succeeds(&[&command[..], &more("8")].concat());
    assert_eq!(collected(&f, "out"), before);
    // The folder alone is enough to open the run again.
    f.succeeds(&["show", "out"]);
    // Another hint is another run.
    let other = [&RUN[..], &["out", "--at", "1,2"], &more("9")].concat();
    f.refuses(&other, "different picture, hint, camera or keypoints");
}

#[test]
fn the_bytes_of_a_mask_belong_to_the_run() {
    let f = folder();
    f.write("mask.png", png(disc(30, 20, 15.0, 10.0, 6.0)));
    let command = [&RUN[..], &["out", "--mask", "mask.png"]].concat();
    f.succeeds(&command);
    let again = [&command[..], &["--resume", "--steps", "8"]].concat();
    f.succeeds(&again);
    f.write("mask.png", png(disc(30, 20, 12.0, 10.0, 6.0)));
    f.refuses(&again, "different picture, hint, camera or keypoints");
}

#[test]
fn what_cannot_be_there_is_refused() {
    let f = folder();
    f.write("tall.png", png(disc(40, 60, 20.0, 30.0, 12.0)))
        .write("dark.png", png(image::GrayImage::new(60, 40)));
    let says = |hint: &[&str], says: &str| {
        f.refuses(&[&RUN[..], &["out"], hint].concat(), says);
    };
    says(&["--mask", "tall.png"], "the mask of 40 x 60 pixels does not have the proportions");
    says(&["--mask", "dark.png"], "the mask is empty");
    says(&["--mask", "p.pcad"], "p.pcad: not a picture");
    says(&["--mask", "none.png"], "cannot read none.png");
    says(&["--outline", "1,1 2,2"], "at least 3 corners, not 2");
    says(&["--outline", "90,1 99,1 99,9"], "no pixel of the photograph of 60 x 40 pixels");
    says(&["--box", "60,0,5,5"], "outside the photograph of 60 x 40 pixels");
    says(&["--axis", "9,9", "9,9", "3"], "two different ends");
    says(&["--axis", "9,9", "9,20", "-3"], "a width above 0");
    says(&["--axis", "9,9", "9", "3"], "--axis 100,220 104,40 80");
    says(&["--axis", "90,9", "90,20", "3"], "outside the photograph of 60 x 40 pixels");
    says(&["--at", "-1,5"], "the position [-1, 5] is outside the photograph of 60 x 40");
    says(&["--not", "5,41"], "outside the photograph of 60 x 40 pixels");
    for (hint, says) in [
        (&["--box", "1,2,3"][..], "expected four numbers X,Y,W,H"),
        (&["--box", "1,2,-3,4"], "expected four numbers X,Y,W,H"),
        (&["--at", "1,nan"], "expected a position X,Y"),
        (&["--outline", "1,1", "2,x"], "expected a position X,Y"),
        (&["--axis", "1,1", "2,2"], "3 values required"),
    ] {
        let done = f.run(&[&RUN[..], &["out"], hint].concat());
        assert!(done.code == 2 && done.err.contains(says), "{hint:?}: {}", done.err);
    }
}

#[test]
fn records_of_programs_are_checked() {
    let f = folder();
    let says = |call: &str, says: [&str; 2]| {
        let program = format!(
            "include \"std/scene.pcad\" as scene; data photo: image;
             let people = scene.people(photo, {call}); assume x ~ normal(len(people), 1);
             infer {{ mh(@x); }}"
        );
        f.write("own.pcad", program);
        let done = f.run(&["run", "own.pcad", "--observe", "disc.png", "--out", "out"]);
        let all = says.iter().all(|said| done.err.contains(said));
        assert!(done.code == 1 && all, "{}", done.err);
    };
    let now = "use `hint = { box: [x, y, width, height] }`";
    says("near = [1, 2, 3, 4]", ["has no argument `near` any more", now]);
    let near = "did you mean `box`?";
    says("hint = { bax: [1, 2, 3, 4] }", ["a hint has no field `bax`", near]);
    says("hint = { box: [90, 2, 3, 4] }", ["outside the photograph of", "60 x 40 pixels"]);
    says("hint = { at: [1, 2] }", ["`at` must be positions [[x, y], …]", "got [1, 2]"]);
}

#[test]
fn it_needs_one_photograph() {
    let f = folder();
    let no =
        "data y = [1]; assume x ~ normal(0, 1); observe normal(x, 1) = y[0]; infer { mh(@x); }";
    f.write("no.pcad", no);
    f.refuses(&["run", "no.pcad", "--box", "1,2,3,4"], "--box needs a photograph: --observe FILE");
    f.refuses(&["sample", "p.pcad", "--at", "1,2"], "`sample` cannot use it");
    f.write("two.pcad", format!("data other: image;\n{PROGRAM}"));
    let two = ["run", "two.pcad", "--observe", "photo=disc.png", "--observe", "other=disc.png"];
    f.refuses(&[&two[..], &["--at", "1,2"]].concat(), "several are observed: photo, other");
}

/// The same person twice, side by side.
#[test]
fn it_chooses_the_person() {
    let f = Folder::new("hints_people");
    let skier = image::open("examples/images/skier.jpg").unwrap().to_rgb8();
    let (width, height) = skier.dimensions();
    let two = image::RgbImage::from_fn(2 * width, height, |x, y| *skier.get_pixel(x % width, y));
    let program = "include \"std/scene.pcad\" as scene;
        data photo: image;
        let middle = fn(p) { p.box[0] + p.box[2] / 2 };
        let first = middle(scene.people(photo)[0]);
        let other = middle(scene.people(photo, hint = { at: [[first, PLACE]] })[0]);
        assume x ~ normal(0, 1);
        observe normal(x, 1) = 0;
        infer { repeat 4 { mh(@x); collect x, first, other; } }";
    let keypoints: Value = serde_json::from_str(
        &std::fs::read_to_string("examples/images/skier.keypoints.json").unwrap(),
    )
    .unwrap();
    let hip = &keypoints.get("keypoints").unwrap_or(&keypoints)["l_hip"];
    let (x, y) = (hip[0].as_f64().unwrap(), hip[1].as_f64().unwrap());
    f.write("two.pcad", program.replace("PLACE", &y.to_string())).write("two.png", png(two));
    let left = |hint: &[&str]| {
        let run =
            ["run", "two.pcad", "--observe", "two.png", "--chains", "1", "--quiet", "--out", "o"];
        f.succeeds(&[&run[..], hint].concat());
        let found = collected(&f, "o");
        std::fs::remove_dir_all(f.path().join("o")).unwrap();
        // Whoever is in a box was looked for there only.
        assert!((found[0].1 - found[1].1).abs() < 20.0, "the hint of the program is its own");
        found[0].1 < f64::from(width)
    };
    let (here, there) = (format!("{x},{y}"), format!("{},{y}", x + f64::from(width)));
    assert!(left(&["--at", &here]) && !left(&["--at", &there]));
    assert!(left(&["--not", &there]) && !left(&["--not", &here]));
    let half = |from: u32| format!("{from},0,{width},{height}");
    assert!(left(&["--box", &half(0)]) && !left(&["--box", &half(width)]));
    let beside = format!("{width},0 {},0 {},{height} {width},{height}", 2 * width, 2 * width);
    assert!(!left(&["--outline", &beside]));
}
