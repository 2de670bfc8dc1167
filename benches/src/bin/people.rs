//! Measures how many people of whole photographs are found, and how well.
//!
//!     cargo run --release -p pcadlang-benches --bin people -- PEOPLE.json FOLDER [ids=even|odd|all] [least=0.3,0.4]
//!
//! PEOPLE.json has people as COCO annotates them (`images`, `annotations` with `keypoints`), FOLDER
//! the photographs. Asked for are people who are at least a sixth of the picture's height and
//! have three labelled joints of the limbs. One is found if the median distance of these
//! from the detected ones is at most half a torso (from shoulder to the opposite hip, or 0.3 of the
//! longer side of the box); of those found, joints within 0.2 of a torso are right (PCKt@0.2).
//! A detection whose box overlaps no annotated one by 0.2 is where nobody is; another one that
//! finds none of those asked for is a second one, or someone small.
//! Only people with a confidence of `least` or more count, for each of these.

use pcadlang_detectors::boxes::overlap;
use pcadlang_detectors::objects::{ObjectFinder, ObjectOptions};
use pcadlang_detectors::people::{FindOptions, Person, Search, VIEWS_OF_PEOPLE, networks};
use pcadlang_scene::vision::{Limits, photo};
use serde_json::Value;
use std::path::Path;

/// The limbs in COCO's order of joints: shoulders, elbows, wrists, hips, knees, ankles.
const LIMBS: std::ops::Range<usize> = 5..17;

/// Someone annotated.
struct Truth {
    bounds: [f64; 4],
    /// Positions of limb joints, by index, that are labelled.
    joints: Vec<(usize, [f64; 2])>,
    torso: f64,
    crowd: bool,
}

fn truth(a: &Value) -> Truth {
    let number = |v: &Value| v.as_f64().unwrap_or(0.0);
    let [x, y, w, h] = [0, 1, 2, 3].map(|k| number(&a["bbox"][k]));
    let all = &a["keypoints"];
    let joint = |i: usize| {
        let [x, y, seen] = [0, 1, 2].map(|k| number(&all[3 * i + k]));
        (seen > 0.0).then_some([x, y])
    };
    let between = |(i, j)| Some(distance(joint(i)?, joint(j)?));
    let torsos: Vec<f64> = [(5, 12), (6, 11)].into_iter().filter_map(between).collect();
    let mean = torsos.iter().sum::<f64>() / torsos.len() as f64;
    Truth {
        bounds: [x, y, x + w, y + h],
        joints: LIMBS.filter_map(|i| Some((i, joint(i)?))).collect(),
        torso: if torsos.is_empty() { 0.3 * w.max(h) } else { mean },
        crowd: a["iscrowd"] == 1,
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    f64::hypot(a[0] - b[0], a[1] - b[1])
}

/// The distances of a detected person's joints from the labelled ones, in torsos, sorted.
fn errors(t: &Truth, p: &Person) -> Vec<f64> {
    let names = pcadlang_scene::vision::keypoints::COCO;
    let error =
        |(i, at): &(usize, [f64; 2])| p.landmark(names[*i]).map(|l| distance(l.at, *at) / t.torso);
    let mut all: Vec<f64> = t.joints.iter().filter_map(error).collect();
    all.sort_by(f64::total_cmp);
    all
}

#[derive(Default)]
struct Sums {
    pictures: usize,
    asked: usize,
    found: usize,
    joints: usize,
    right: usize,
    nobody: usize,
    others: usize,
    empty: usize,
    filled: usize,
}

impl Sums {
    fn add(&mut self, all: &[Truth], height: f64, people: &[Person]) {
        self.pictures += 1;
        if all.is_empty() {
            self.empty += 1;
            self.filled += usize::from(!people.is_empty());
        }
        let mut used = vec![false; people.len()];
        for t in all.iter().filter(|t| !t.crowd && t.joints.len() >= 3) {
            if t.bounds[3] - t.bounds[1] < height / 6.0 {
                continue;
            }
            self.asked += 1;
            let free = (0..people.len()).filter(|i| !used[*i]);
            let each = free.map(|i| (i, errors(t, &people[i])));
            let best = each.min_by(|a, b| a.1[a.1.len() / 2].total_cmp(&b.1[b.1.len() / 2]));
            if let Some((i, errors)) = best.filter(|(_, e)| e[e.len() / 2] <= 0.5) {
                used[i] = true;
                self.found += 1;
                self.joints += errors.len();
                self.right += errors.iter().filter(|e| **e <= 0.2).count();
            }
        }
        for (p, _) in people.iter().zip(&used).filter(|(_, used)| !**used) {
            let over = |t: &Truth| match t.crowd {
                true => overlap(p.bounds, t.bounds) > 0.0,
                false => overlap(p.bounds, t.bounds) > 0.2,
            };
            let somebody = all.iter().any(over);
            self.others += usize::from(somebody);
            self.nobody += usize::from(!somebody);
        }
    }
}

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, folder, rest @ ..] = &arguments[..] else {
        return Err("usage: people PEOPLE.json FOLDER [ids=even|odd|all] [least=0.3,0.4]".into());
    };
    let (mut ids, mut least) = ("all", vec![FindOptions::default().sure]);
    for argument in rest {
        match argument.split_once('=') {
            Some(("ids", v)) => ids = v,
            Some(("least", v)) => {
                let all: Result<_, _> = v.split(',').map(str::parse).collect();
                least = all.map_err(|_| "least needs numbers")?;
            }
            _ => return Err(format!("{argument} is no option")),
        }
    }
    let text = std::fs::read_to_string(file).map_err(|e| e.to_string())?;
    let data: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let finder = networks::finder()?;
    let mut sums: Vec<(f64, Sums)> = least.into_iter().map(|l| (l, Sums::default())).collect();
    let sure = sums.iter().map(|(l, _)| *l).fold(1.0, f64::min);
    for image in data["images"].as_array().ok_or("no images")? {
        let id = image["id"].as_u64().unwrap_or(0);
        if ids != "all" && (ids == "even") != id.is_multiple_of(2) {
            continue;
        }
        let path = Path::new(folder).join(image["file_name"].as_str().unwrap_or_default());
        let bytes = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let photo = photo::decode(&bytes, &Limits::default()).map_err(|e| e.to_string())?;
        let wide = ObjectOptions { least: 0.05, most: usize::MAX };
        let seen = ObjectFinder::included().find_in_views(&photo, VIEWS_OF_PEOPLE, &wide);
        let seen = seen.map_err(|e| e.to_string())?;
        let options = FindOptions { most: 20, sure, ..FindOptions::default() };
        let people = finder.find(&photo, Search::Everywhere(&seen), &options, 0);
        let annotations = data["annotations"].as_array().ok_or("no annotations")?;
        let all: Vec<Truth> =
            annotations.iter().filter(|a| a["image_id"] == image["id"]).map(truth).collect();
        for (least, sums) in &mut sums {
            let sure: Vec<Person> = match people.iter().any(|p| p.sure >= *least) {
                true => people.iter().filter(|p| p.sure >= 0.75 * *least).cloned().collect(),
                false => Vec::new(),
            };
            sums.add(&all, f64::from(photo.height()), &sure);
        }
        let sure: Vec<String> = people.iter().map(|p| format!("{:.2}", p.sure)).collect();
        println!("{}: {} annotated, {}", path.display(), all.len(), sure.join(" "));
    }
    let part = |a: usize, b: usize| 100.0 * a as f64 / b.max(1) as f64;
    for (least, s) in &sums {
        println!(
            "{least}: {} pictures: {} of {} people found ({:.0}%), {:.1}% of their joints right; {} \
             detections where nobody is, {} others; somebody in {} of {} pictures without people",
            s.pictures,
            s.found,
            s.asked,
            part(s.found, s.asked),
            part(s.right, s.joints),
            s.nobody,
            s.others,
            s.filled,
            s.empty
        );
    }
    Ok(())
}
