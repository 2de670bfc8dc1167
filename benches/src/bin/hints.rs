//! Measures how well objects of real photographs are found by what the user points out:
//! nothing, a click, a box, an axis, eight clicks around the outline, a mask.
//!
//!     cargo run --release -p pcadlang-benches --bin hints -- FOLDER [kinds=none,at,box,axis,outline,mask]
//!         [seeds=1,2,3] [time=5s] [out=DIR] [program=lathe.pcad] [cases=NAME,…] [set:NAME=VALUE]
//!
//! A subfolder of FOLDER holds `image.png` and the true `mask.png`. Hints are derived from
//! the true mask with noise, which depends on the folder's name only: the sides of a box
//! are off by up to 8 % of its width or height (uniform); foot, top and width of an axis
//! by 3 % of its length (normal); eight clicks around the outline, at equal arc lengths,
//! by 2 % of the longer side of its box (normal); a click is about the mask's centroid, by 10 %
//! of its width and height (normal), on the mask. The release binary
//! of the command runs each case.
//!
//! Prints for each case the median intersection over union of the fitted and the true mask
//! over the seeds, whether the top is towards (+) or away from the camera (-) in each, and
//! what the run says about having found it (with its fit, the overlap of outlines, and of chains);
//! then the mean and the median of the cases and how many reach 0.8.

use pcadlang_library::scene::ImageValue;
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};
use pcadlang_scene::vision::candidates::CandidateOptions;
use pcadlang_scene::vision::segmentation::from_mask;
use pcadlang_scene::vision::{Hint, Limits, Mask, mask, photo};
use std::path::{Path, PathBuf};
use std::process::Command;

const KINDS: [&str; 6] = ["none", "at", "box", "axis", "outline", "mask"];
/// Noise of hints: uniform for boxes, otherwise the standard deviation of a normal one.
const BOX: f64 = 0.08;
const AXIS: f64 = 0.03;
const OUTLINE: f64 = 0.02;
const CLICK: f64 = 0.1;
const CLICKS: usize = 8;

/// What is measured.
struct Settings {
    folder: PathBuf,
    kinds: Vec<String>,
    seeds: Vec<u64>,
    time: String,
    out: PathBuf,
    program: String,
    cases: Vec<String>,
    sets: Vec<String>,
}

fn settings() -> Result<Settings, String> {
    let mut s = Settings {
        folder: PathBuf::new(),
        kinds: KINDS.map(String::from).to_vec(),
        seeds: vec![1, 2, 3],
        time: "5s".into(),
        out: std::env::temp_dir().join("pcadlang-hints"),
        program: "lathe.pcad".into(),
        cases: Vec::new(),
        sets: Vec::new(),
    };
    let list = |text: &str| text.split(',').map(String::from).collect::<Vec<_>>();
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            Some(("kinds", v)) => s.kinds = list(v),
            Some(("seeds", v)) => s.seeds = list(v).iter().filter_map(|x| x.parse().ok()).collect(),
            Some(("time", v)) => s.time = v.into(),
            Some(("out", v)) => s.out = v.into(),
            Some(("program", v)) => s.program = v.into(),
            Some(("cases", v)) => s.cases = list(v),
            Some((name, v)) if name.starts_with("set:") => {
                s.sets.push(format!("{}={v}", &name[4..]))
            }
            _ => s.folder = argument.into(),
        }
    }
    match s.folder.is_dir() {
        true => Ok(s),
        false => Err("usage: hints FOLDER [kinds=…] [seeds=…] [time=…] [out=…]".into()),
    }
}

/// A picture with its true mask.
struct Case {
    name: String,
    image: PathBuf,
    truth: PathBuf,
    mask: Mask,
}

fn cases(s: &Settings) -> Result<Vec<Case>, String> {
    let text = |e: std::io::Error| e.to_string();
    let mut all = Vec::new();
    for entry in std::fs::read_dir(&s.folder).map_err(text)? {
        let folder = entry.map_err(text)?.path();
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (image, truth) = (folder.join("image.png"), folder.join("mask.png"));
        let wanted = s.cases.is_empty() || s.cases.contains(&name);
        if wanted && image.exists() && truth.exists() {
            let mask = read_mask(&truth)?;
            all.push(Case { name, image, truth, mask });
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

fn read_mask(path: &Path) -> Result<Mask, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    mask::decode(&bytes, None, &Limits::default()).map_err(|e| e.to_string())
}

/// The outline of the component of the first pixel of a mask: the corners between pixels,
/// with the object on the right.
fn outline(m: &Mask) -> Vec<[f64; 2]> {
    let (w, h) = (m.width() as i64, m.height() as i64);
    let on = |x: i64, y: i64| x >= 0 && y >= 0 && x < w && y < h && m.data()[(y * w + x) as usize];
    let Some(first) = m.data().iter().position(|on| *on) else { return Vec::new() };
    let start = [first as i64 % w, first as i64 / w];
    let (mut at, mut step, mut corners) = (start, [1, 0], Vec::new());
    loop {
        corners.push(at.map(|x| x as f64));
        at = [at[0] + step[0], at[1] + step[1]];
        // The pixels ahead on the left and on the right.
        let ahead = |side: i64| {
            let x = 2 * at[0] + step[0] - side * step[1] - 1;
            let y = 2 * at[1] + step[1] + side * step[0] - 1;
            on(x.div_euclid(2), y.div_euclid(2))
        };
        step = match (ahead(-1), ahead(1)) {
            (true, _) => [step[1], -step[0]],
            (false, true) => step,
            (false, false) => [-step[1], step[0]],
        };
        if at == start {
            return corners;
        }
    }
}

/// The arguments of a hint.
fn hint(kind: &str, case: &Case) -> Result<Vec<String>, String> {
    let site = case.name.bytes().fold(7, |h: u64, b| h.wrapping_mul(31).wrapping_add(b.into()));
    let mut rng: Stream = StreamKey::new(1, 0, Purpose::TRUTH).stream(0, site, 0);
    let m = &case.mask;
    let [x, y, right, bottom] = m.bounds().ok_or("an empty mask")?;
    let (w, h) = (right - x, bottom - y);
    let point = |[x, y]: [f64; 2]| format!("{x:.1},{y:.1}");
    Ok(match kind {
        "none" => Vec::new(),
        "mask" => vec!["--mask".into(), case.truth.display().to_string()],
        "box" => {
            let mut off = |side: f64| BOX * side * (2.0 * rng.uniform() - 1.0);
            let [l, t, r, b] = [x + off(w), y + off(h), x + w + off(w), y + h + off(h)];
            let (most_x, most_y) = (f64::from(m.width()), f64::from(m.height()));
            let ([l, t], [r, b]) = ([l.max(0.0), t.max(0.0)], [r.min(most_x), b.min(most_y)]);
            vec!["--box".into(), format!("{l:.1},{t:.1},{:.1},{:.1}", r - l, b - t)]
        }
        "at" => {
            let on: Vec<usize> = (0..m.data().len()).filter(|i| m.data()[*i]).collect();
            let mean = |of: &dyn Fn(usize) -> usize| {
                on.iter().map(|i| of(*i) as f64 + 0.5).sum::<f64>() / on.len() as f64
            };
            let (w0, h0) = (m.width() as usize, m.height() as usize);
            let (cx, cy) = (mean(&|i| i % w0), mean(&|i| i / w0));
            loop {
                let at = [
                    cx + CLICK * w * rng.standard_normal(),
                    cy + CLICK * h * rng.standard_normal(),
                ];
                let (i, j) = (at[0] as usize, at[1] as usize);
                if at.iter().all(|x| *x >= 0.0) && i < w0 && j < h0 && m.data()[j * w0 + i] {
                    break vec!["--at".into(), point(at)];
                }
            }
        }
        "outline" => {
            let corners = outline(m);
            let first = rng.index(corners.len());
            let mut arguments = vec!["--outline".into()];
            for k in 0..CLICKS {
                let [cx, cy] = corners[(first + k * corners.len() / CLICKS) % corners.len()];
                let mut off = || OUTLINE * w.max(h) * rng.standard_normal();
                arguments.push(point([cx + off(), cy + off()]));
            }
            arguments
        }
        "axis" => {
            let bytes = std::fs::read(&case.image).map_err(|e| e.to_string())?;
            let photo = photo::decode(&bytes, &Limits::default()).map_err(|e| e.to_string())?;
            let axes = from_mask(&photo, m);
            // Of nearly equally good axes, the more upright one is the user's.
            let best = axes.iter().map(|a| a.symmetry).fold(0.0, f64::max);
            let lean = |a: &&pcadlang_scene::vision::candidates::Axis| {
                ((a.top[0] - a.foot[0]) / (a.foot[1] - a.top[1])).abs()
            };
            let good = axes.iter().filter(|a| a.symmetry > best - 0.12);
            let axis = good.min_by(|a, b| lean(a).total_cmp(&lean(b))).ok_or("no axis")?;
            let length = f64::hypot(axis.top[0] - axis.foot[0], axis.top[1] - axis.foot[1]);
            let mut off = || AXIS * length * rng.standard_normal();
            let width = 2.0 * axis.widths.iter().copied().fold(0.0, f64::max) + off();
            let [foot, top] = [axis.foot, axis.top].map(|p| point([p[0] + off(), p[1] + off()]));
            vec!["--axis".into(), foot, top, format!("{width:.1}")]
        }
        _ => return Err(format!("{kind} is none of {}", KINDS.join(", "))),
    })
}

/// Runs a case, and returns the overlap and the component of the axis towards the camera.
fn run(s: &Settings, kind: &str, case: &Case, seed: u64) -> Result<(f64, f64, String), String> {
    let binary = std::env::current_exe().map_err(|e| e.to_string())?.with_file_name("pcadlang");
    let out = s.out.join(format!("{kind}-{seed}")).join(&case.name);
    let sets = s.sets.iter().flat_map(|set| ["--set".to_owned(), set.clone()]);
    let ran = Command::new(binary)
        .args(["run", &s.program, "--quiet", "--quality", "own", "--time", &s.time])
        .args(["--seed", &seed.to_string(), "--threads", "2"])
        .arg("--observe")
        .arg(&case.image)
        .arg("--out")
        .arg(&out)
        .args(sets)
        .args(hint(kind, case)?)
        .output()
        .map_err(|e| e.to_string())?;
    if !ran.status.success() {
        return Err(format!("{}: {}", case.name, String::from_utf8_lossy(&ran.stderr)));
    }
    let fit = read_mask(&out.join("mask.png"))?;
    Ok((case.mask.overlap(&fit), toward(&out).unwrap_or(0.0), judged(&out).unwrap_or_default()))
}

/// The axis of the best state towards the camera.
fn toward(out: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(out.join("best.trace.json")).ok()?;
    let trace: serde_json::Value = serde_json::from_str(&text).ok()?;
    let choices = trace["choices"].as_array()?;
    let tilt = choices.iter().find(|c| c["address"] == "@S_L/place/r[x]")?;
    tilt["value"].as_f64()
}

/// What the run says about having found the object.
fn judged(out: &Path) -> Option<String> {
    let text = std::fs::read_to_string(out.join("run.json")).ok()?;
    let found = serde_json::from_str::<serde_json::Value>(&text).ok()?["found"].clone();
    let number = |name: &str| found[name].as_f64().unwrap_or(f64::NAN);
    let [fit, outlines, chains] = ["fit", "outlines", "chains"].map(number);
    let verdict = found["verdict"].as_str()?;
    Some(format!("{verdict} ({fit:.2} {outlines:.2} {chains:.2})"))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// Prints the places of a case, with the overlap of each outline and the truth.
fn show_places(case: &Case, kind: &str) -> Result<(), String> {
    let bytes = std::fs::read(&case.image).map_err(|e| e.to_string())?;
    let photo = photo::decode(&bytes, &Limits::default()).map_err(|e| e.to_string())?;
    let image = ImageValue::photo(photo);
    let mut wanted = Hint::default();
    if let [_, at] = &hint(kind, case)?[..] {
        let numbers: Vec<f64> = at.split(',').filter_map(|x| x.parse().ok()).collect();
        match numbers[..] {
            [x, y] => wanted.at = vec![[x, y]],
            [x, y, w, h] => wanted.bounds = Some([x, y, w, h]),
            _ => {}
        }
    }
    let places = image.places(&CandidateOptions::default(), &wanted);
    println!("{}: box {:.0?}, {wanted:?}", case.name, case.mask.bounds());
    for p in places.map_err(|e| e.message)?.iter().take(24) {
        let truth = |m: &Mask| m.overlap(&case.mask);
        let overlaps: Vec<f64> = p.masks.iter().map(truth).collect();
        let apart = match &p.masks[..] {
            [a, b, ..] => a.overlap(b),
            _ => 1.0,
        };
        println!("  {:12} {:.3} {overlaps:.2?} {apart:.2} {:.0?}", p.source, p.score, p.bounds);
    }
    Ok(())
}

fn main() -> Result<(), String> {
    let s = settings()?;
    let cases = cases(&s)?;
    if let [first, kind] = &s.kinds[..]
        && first == "places"
    {
        return cases.iter().try_for_each(|c| show_places(c, kind));
    }
    for kind in &s.kinds {
        let mut medians = Vec::new();
        for case in &cases {
            let runs = s.seeds.iter().map(|seed| run(&s, kind, case, *seed));
            let runs = runs.collect::<Result<Vec<_>, String>>()?;
            let signs: String =
                runs.iter().map(|(_, t, _)| if *t > 0.0 { '+' } else { '-' }).collect();
            let mut overlaps: Vec<f64> = runs.iter().map(|(overlap, ..)| *overlap).collect();
            let shown: Vec<String> = overlaps.iter().map(|v| format!("{v:.2}")).collect();
            let middle = median(&mut overlaps);
            let said: Vec<&str> = runs.iter().map(|(.., said)| said.as_str()).collect();
            let (shown, said) = (shown.join(" "), said.join(", "));
            println!("{kind:8} {:28} {middle:.3}  {shown}  {signs}  {said}", case.name);
            medians.push(middle);
        }
        let found = medians.iter().filter(|v| **v >= 0.8).count();
        let mean = medians.iter().sum::<f64>() / medians.len().max(1) as f64;
        let middle = median(&mut medians.clone());
        println!(
            "{kind}: mean {mean:.3}, median {middle:.2}, {found} of {} found (0.8)",
            medians.len()
        );
    }
    Ok(())
}
