//! Whom a run finds in a photograph, and what it says and writes where there is nobody.

use crate::common::folder::{Folder, png};
use serde_json::Value;

const SKIER: &str = "examples/images/skier.jpg";
/// Few steps; the first of `modes` searches for the pose.
const SHORT: [&str; 6] = ["--steps", "20", "--warmup", "40", "--chains", "2"];

/// The skier to the right of as much snow, and the width of either half.
fn with_snow(f: &Folder) -> u32 {
    let skier = image::open(SKIER).unwrap().to_rgb8();
    let (width, height) = skier.dimensions();
    let snow = *skier.get_pixel(5, height - 5);
    let pixel = |x: u32, y| if x < width { snow } else { *skier.get_pixel(x - width, y) };
    f.write("snow.png", png(image::RgbImage::from_fn(2 * width, height, pixel)));
    width
}

fn json(f: &Folder, name: &str) -> Value {
    serde_json::from_str(&f.read(name)).unwrap()
}

#[test]
fn what_was_found_is_the_first_line() {
    let f = Folder::new("people_found");
    std::fs::copy(SKIER, f.path().join("skier.jpg")).unwrap();
    let run = ["run", "human.pcad", "--observe", "skier.jpg", "--out", "o"];
    let done = f.run(&[&run[..], &SHORT].concat());
    assert!(done.code == 0 && done.out.starts_with("found: "), "{}{}", done.out, done.err);
    let (joints, record) = (json(&f, "o/keypoints.json"), json(&f, "o/run.json"));
    assert_eq!(joints["found"], record["found"]);
    assert_eq!(record["found"]["verdict"], "found");
    let [sure, fit] = ["sure", "fit"].map(|name| record["found"][name].as_f64().unwrap());
    assert!((0.5..=1.0).contains(&sure) && (0.55..=1.0).contains(&fit), "{sure} {fit}");
}

/// The pixels of compressed run lengths, row by row.
fn pixels(segmentation: &Value) -> Vec<bool> {
    let [height, width] = [0, 1].map(|i| segmentation["size"][i].as_u64().unwrap() as usize);
    let (mut runs, mut columns): (Vec<i64>, Vec<bool>) = (Vec::new(), Vec::new());
    let mut bytes = segmentation["counts"].as_str().unwrap().bytes().map(|b| i64::from(b) - 48);
    while let Some(mut group) = bytes.next() {
        let (mut run, mut bits) = (group & 31, 5);
        while group & 32 != 0 {
            group = bytes.next().unwrap();
            run |= (group & 31) << bits;
            bits += 5;
        }
        if group & 16 != 0 {
            run -= 1 << bits;
        }
        if runs.len() > 2 {
            run += runs[runs.len() - 2];
        }
        columns.extend(std::iter::repeat_n(runs.len() % 2 == 1, run as usize));
        runs.push(run);
    }
    assert_eq!(columns.len(), width * height);
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| columns[x * height + y])
        .collect()
}

#[test]
fn a_body_is_left_to_other_programs() {
    let f = Folder::new("people_left");
    std::fs::copy(SKIER, f.path().join("skier.jpg")).unwrap();
    let run = ["run", "human.pcad", "--observe", "skier.jpg", "--out", "o", "--image-id", "7"];
    f.succeeds(&[&run[..], &["--steps", "2", "--warmup", "2", "--chains", "1"]].concat());
    let (joints, mask) = (json(&f, "o/keypoints.coco.json"), json(&f, "o/mask.coco.json"));
    assert_eq!((&joints[0]["image_id"], &mask[0]["image_id"]), (&Value::from(7), &Value::from(7)));
    assert_eq!(joints[0]["segmentation"], mask[0]["segmentation"]);
    let picture = image::open(f.path().join("o/mask.png")).unwrap().to_luma8();
    let covered: Vec<bool> = picture.pixels().map(|p| p[0] > 0).collect();
    assert!(covered.contains(&true) && pixels(&mask[0]["segmentation"]) == covered);
    // In metres: a person is as tall as one.
    let metre = json(&f, "o/run.json")["metre"].as_f64().unwrap();
    let text = f.read("o/best.obj");
    let points = || text.lines().filter_map(|l| l.strip_prefix("v "));
    let number = |word: Option<&str>| word.unwrap().parse::<f64>().unwrap();
    let range = |axis: usize| {
        let all = points().map(|p| number(p.split(' ').nth(axis)));
        all.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)])
    };
    let longest = (0..3).map(range).map(|[low, high]| high - low).fold(0.0, f64::max);
    assert!((0.7..2.2).contains(&longest) && metre > 0.1, "{longest} {metre}");
    assert!(text.starts_with("o object\n") && text.contains("\ng thigh_l\n"));
    // Joints, in the same unit and place.
    let pose = json(&f, "o/pose.json");
    let body = &pose["bodies"][0];
    assert_eq!((&pose["unit"], body["joints"].as_array().unwrap().len()), (&"metre".into(), 22));
    let root = body["joints"][0]["head"].as_array().unwrap();
    assert!((0..3).all(|axis| {
        let ([low, high], at) = (range(axis), root[axis].as_f64().unwrap());
        (low..high).contains(&at)
    }));
    let landmarks = body["pose_world_landmarks"].as_array().unwrap();
    assert_eq!((landmarks.len(), body["smpl"]["pose"].as_array().unwrap().len()), (33, 24));
    assert!(f.read("o/pose.bvh").starts_with("HIERARCHY\nROOT pelvis\n"));
}

#[test]
fn a_photograph_without_people_gets_no_body() {
    let f = Folder::new("people_none");
    std::fs::copy("examples/images/coffee_cup.png", f.path().join("cup.png")).unwrap();
    let run = ["run", "human.pcad", "--observe", "cup.png", "--out", "o"];
    let done = f.run(&[&run[..], &SHORT].concat());
    let said = done.err.contains("not found: no person is seen in `photo`");
    assert!(done.code == 1 && said && done.err.contains("--anyway"), "{}", done.err);
    assert_eq!(json(&f, "o/keypoints.json")["found"]["verdict"], "not found");
    assert!(!f.path().join("o/best.obj").exists());
    f.succeeds(&[&run[..], &["--anyway", "--steps", "1", "--warmup", "1"]].concat());
    assert!(f.path().join("o/best.obj").exists());
}

#[test]
fn a_box_is_the_only_place_looked_at() {
    let f = Folder::new("people_box");
    let width = with_snow(&f);
    let run = ["run", "human.pcad", "--observe", "snow.png", "--out", "o", "--box"];
    let done = f.run(&[&run[..], &[&format!("0,0,{width},300")], &SHORT].concat());
    let said = done.err.contains("no person fills the box");
    assert!(done.code == 1 && said && !done.err.contains("R-hat"), "{}", done.err);
    let found = |bounds: &str| {
        let done = f.succeeds(&["detect", "snow.png", "--box", bounds, "-o", "people.json"]);
        (done.out.lines().next().unwrap_or_default().to_owned(), json(&f, "people.json"))
    };
    assert_eq!(found(&format!("0,0,{width},300")).0, "no people were found");
    let (said, people) = found(&format!("{width},0,{width},420"));
    assert_eq!(said, "1 person");
    assert!(people["annotations"][0]["bbox"][0].as_f64().unwrap() > f64::from(width));
}

/// Two skiers beside each other: both are found at once, and each stands where the networks see
/// them; on one plane, they are of about one size.
#[test]
fn people_are_where_they_are_seen_on_one_ground() {
    let f = Folder::new("people_two");
    let skier = image::open(SKIER).unwrap().to_rgb8();
    let (width, height) = skier.dimensions();
    let twice = |x: u32, y| *skier.get_pixel(x % width, y);
    f.write("two.png", png(image::RgbImage::from_fn(2 * width, height, twice)));
    let run = ["run", "people.pcad", "--observe", "two.png", "--set", "ground=true", "--out", "o"];
    f.succeeds(&[&run[..], &["--steps", "20", "--warmup", "20", "--chains", "1"]].concat());
    let trace = json(&f, "o/best.trace.json").to_string();
    assert!(trace.contains("floor/plane/height"), "{trace}");
    let mask = image::open(f.path().join("o/mask.png")).unwrap().to_luma8();
    let covered = |of: std::ops::Range<u32>| {
        let on = mask.enumerate_pixels().filter(|(x, _, p)| of.contains(x) && p.0[0] > 127);
        on.count() as f64
    };
    let (left, right) = (covered(0..mask.width() / 2), covered(mask.width() / 2..mask.width()));
    let all = f64::from(mask.width() * mask.height());
    assert!(left > 0.03 * all && right > 0.03 * all, "{left} {right} of {all}");
    assert!((left / right).ln().abs() < 0.4, "{left} {right}");
}
