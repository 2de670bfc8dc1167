//! The page of a run, `report.html`; `pcadlang report` rebuilds it from the run's folder.

use crate::args::Report;
use crate::embedded::SCENE;
use crate::failure::{Failure, plain};
use crate::files::write_in;
use crate::reopening::reopened::readable;
use crate::reopening::reopened::{PROGRAM, quoted};
use crate::verdict::sentence;
use crate::watched::ROOM;
use crate::{files, places, resume};
use image::RgbImage;
use pcadlang_inference::draws::KernelStats;
use pcadlang_report::html::{Figure, Page, page};
use pcadlang_report::pictures::{jpeg, png};
use pcadlang_report::{
    Mode, Quantity, RunDir, mark_categories, modes, quantities, rename, reread, seconds, warnings,
};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::PathBuf;

/// The page's file.
pub const PAGE: &str = "report.html";
/// The maximum longer side of a picture on the page, in pixels.
const LARGEST: u32 = 1024;
/// The quality of JPEG files on the page.
const QUALITY: u8 = 88;

/// The pictures of a folder: file name, caption, and whether it has bright lines on
/// black.
const PHOTO: (&str, &str, bool) = ("photo.jpg", "the photograph", false);
const OVER: (&str, &str, bool) = ("overlay.png", "the best state over it", false);
const JOINTS: (&str, &str, bool) = (
    "joints.png",
    "detected joints (blue), each joined to its position in the best state (yellow)",
    false,
);
const EDGES: (&str, &str, bool) = ("photo_contours.png", "the contours of the photograph", true);
const CONTOURS: (&str, &str, bool) = ("contours.png", "the contours of the best state", true);
const COVERED: (&str, &str, bool) =
    ("uncertainty.png", "the fraction of the chains' last draws that cover each pixel", false);
/// For runs that did not write a picture of each mode.
const MODES: (&str, &str, bool) = (
    "modes.png",
    "the modes found by the chains: number of chains, estimated probability, log joint density of the best state",
    false,
);

/// The name of a picture in a folder, and its file as it is on the page.
pub type PagePicture = (&'static str, Vec<u8>);

/// Writes the page of a folder. `run` and `summary` are the contents of `run.json` and
/// `summary.json`, which need not be written yet; `drawn` are pictures that need not be read.
pub fn write_page(
    dir: &RunDir,
    run: &Value,
    summary: &Value,
    quantities: &[Quantity],
    drawn: Vec<PagePicture>,
) -> Result<(), Failure> {
    let modes: Vec<Mode> = list(&summary["modes"]);
    let mode_pictures: Vec<_> =
        (1..=modes.len()).map(|n| sized(std::fs::read(dir.file(&places::name(n))).ok()?)).collect();
    let kernels: Vec<KernelStats> = list(&summary["kernels"]);
    let mut warnings: Vec<String> = state(run).into_iter().collect();
    warnings.extend(list::<String>(&summary["warnings"]));
    let scene = std::fs::read_to_string(dir.file(SCENE)).ok();
    let program = std::fs::read(dir.file(PROGRAM)).unwrap_or_default();
    let html = page(&Page {
        title: text(&run["program"]),
        found: sentence(run),
        facts: facts(run),
        command: &command(run),
        settings: settings(run),
        pictures: pictures(
            dir,
            modes.len() > 1 && mode_pictures.iter().all(Option::is_none),
            drawn,
        ),
        quantities,
        modes: &modes,
        mode_pictures,
        kernels: &kernels,
        warnings: &warnings,
        approximate: &list::<String>(&summary["approximate"]),
        scene: scene.as_deref(),
        program: &String::from_utf8_lossy(&program),
    });
    write_in(dir, PAGE, html.as_bytes())
}

fn text(v: &Value) -> &str {
    v.as_str().unwrap_or_default()
}

/// Parses a list; any other value gives an empty list.
fn list<T: DeserializeOwned>(v: &Value) -> Vec<T> {
    serde_json::from_value(v.clone()).unwrap_or_default()
}

/// Formats a number or a text without quotes.
fn plainly(v: &Value) -> String {
    v.as_str().map_or_else(|| v.to_string(), str::to_owned)
}

/// Describes the state of a run that was not completed.
fn state(run: &Value) -> Option<String> {
    match text(&run["state"]) {
        "done" => None,
        "interrupted" => Some("the run was interrupted: this is what it had drawn".into()),
        "failed" => Some(format!("the run failed: {}", text(&run["error"]))),
        _ => {
            Some("the run has not ended: this is what it had written when the page was made".into())
        }
    }
}

/// Returns the command of the run; empty if it was not recorded.
fn command(run: &Value) -> String {
    let arguments: Vec<String> = list(&run["arguments"]);
    if arguments.is_empty() {
        String::new()
    } else {
        format!("pcadlang run {}", quoted(&arguments))
    }
}

/// Returns the date, duration, number of chains and seed.
fn facts(run: &Value) -> Vec<String> {
    let mut all: Vec<String> = run["begun"].as_str().map(readable).into_iter().collect();
    all.extend(run["seconds"].as_f64().map(|s| format!("{} in all", seconds(s))));
    all.extend(
        run["settings"]["chains"]
            .as_u64()
            .map(|n| format!("{n} chain{}", if n == 1 { "" } else { "s" })),
    );
    all.extend(run["seed"].as_u64().map(|n| format!("seed {n}")));
    all
}

fn settings(run: &Value) -> Vec<(&'static str, String)> {
    let known = |(name, v): (&'static str, &Value)| (!v.is_null()).then(|| (name, plainly(v)));
    let time = |(name, v): (&'static str, &Value)| Some((name, seconds(v.as_f64()?)));
    let before = [
        ("version", &run["version"]),
        ("program hash", &run["program_hash"]),
        ("seed", &run["seed"]),
    ];
    let mut all: Vec<(&str, String)> = before.into_iter().filter_map(known).collect();
    all.extend(known(("chains", &run["settings"]["chains"])));
    all.extend(run["begun"].as_str().map(|date| ("begun", readable(date))));
    all.extend(
        [("time", &run["seconds"]), ("sampling time", &run["sampling_seconds"])]
            .into_iter()
            .filter_map(time),
    );
    let sets = run["set"].as_object().into_iter().flatten();
    all.extend(sets.map(|(k, v)| ("set", format!("{k} = {}", plainly(v)))));
    all.extend(list::<String>(&run["observe"]).into_iter().map(|o| ("observe", o)));
    all.extend(run["edges"].as_str().map(|e| ("edges", e.to_owned())));
    all
}

/// Returns the pictures in a folder, grouped by what is to be compared side by side.
fn pictures(dir: &RunDir, modes: bool, mut drawn: Vec<PagePicture>) -> Vec<Vec<Figure<'static>>> {
    let mut groups =
        vec![vec![PHOTO], vec![OVER], vec![JOINTS], vec![COVERED], vec![EDGES, CONTOURS]];
    groups.extend(modes.then(|| vec![MODES]));
    let mut of = |(name, caption, lines): (&str, &'static str, bool)| {
        if let Some(i) = drawn.iter().position(|(drawn, _)| *drawn == name) {
            return Some(Figure { caption, file: drawn.swap_remove(i).1, lines });
        }
        let file = std::fs::read(dir.file(name)).ok()?;
        // Lines stay sharp, everything else is a photograph or lies over one.
        let file = if lines { fitted(file)? } else { sized(file)? };
        Some(Figure { caption, file, lines })
    };
    let found =
        groups.into_iter().map(|group| group.into_iter().filter_map(&mut of).collect::<Vec<_>>());
    found.filter(|group| !group.is_empty()).collect()
}

/// Scales a picture down to the maximum size of a page; `None` if the file is not a
/// picture.
fn fitted(file: Vec<u8>) -> Option<Vec<u8>> {
    let reader = image::ImageReader::new(std::io::Cursor::new(&file)).with_guessed_format().ok()?;
    let (width, height) = reader.into_dimensions().ok()?;
    if width.max(height) <= LARGEST {
        return Some(file);
    }
    let large: RgbImage = image::load_from_memory(&file).ok()?.to_rgb8();
    png(&places::sized(&large, LARGEST)).ok()
}

/// As [`fitted`], as a JPEG file if that is smaller.
fn sized(file: Vec<u8>) -> Option<Vec<u8>> {
    if file.starts_with(b"\xff\xd8") {
        return fitted(file);
    }
    let picture = image::load_from_memory(&file).ok()?.to_rgb8();
    Some(on_page(&picture, file))
}

/// Returns the file of a picture as it is on a page: of at most its maximum size, as a JPEG file
/// if that is smaller: pictures over a photograph then take a fifth of the space.
pub fn on_page(picture: &RgbImage, file: Vec<u8>) -> Vec<u8> {
    let large = picture.width().max(picture.height()) > LARGEST;
    let small = large.then(|| places::sized(picture, LARGEST));
    match jpeg(small.as_ref().unwrap_or(picture), QUALITY) {
        Ok(bytes) if large || bytes.len() < file.len() => bytes,
        _ => file,
    }
}

/// Rebuilds the page of a run.
pub fn report(a: &Report) -> Result<(), Failure> {
    let page = written(a)?;
    print_line!("{}", page.display());
    Ok(())
}

/// Writes the page of a run, and returns its path.
pub fn written(a: &Report) -> Result<PathBuf, Failure> {
    let run = resume::run(&a.run)?;
    let dir = RunDir::open(&a.run).map_err(|e| plain(e.to_string()))?;
    let draws = reread(&dir, ROOM).map_err(|e| plain(e.to_string()))?;
    if draws.iter().all(|d| d.rows.is_empty()) {
        let hint = run["error"].as_str().map(|e| format!("the run failed: {e}"));
        return Err(Failure::Plain(format!("{} holds no draws to report", a.run.display()), hint));
    }
    let mut quantities = quantities(&draws);
    let summary = match dir.file("summary.json") {
        path if path.is_file() => {
            let summary = serde_json::from_slice(&files::read(&path)?);
            summary.map_err(|e| plain(format!("{}: {e}", path.display())))?
        }
        // The run has not ended, or was killed.
        _ => so_far(&quantities, draws.len()),
    };
    let names: Vec<&String> =
        summary["quantities"].as_object().into_iter().flat_map(|q| q.keys()).collect();
    rename(&mut quantities, names.into_iter().map(String::as_str));
    let known = &summary["quantities"];
    mark_categories(&mut quantities, |name| known[name]["most_frequent"].is_object());
    write_page(&dir, &run, &summary, &quantities, Vec::new())?;
    Ok(dir.file(PAGE))
}

/// Makes a summary from the draws alone.
fn so_far(quantities: &[Quantity], chains: usize) -> Value {
    let modes = modes(quantities, None);
    json!({ "modes": modes, "warnings": warnings(quantities, &modes, &[], chains) })
}
