//! The best state of a run as files: its trace, depth, normals, mask, pictures, meshes,
//! exports.
//!
//! The run itself is in `job`.

use crate::args::Job;
use crate::failure::{Failure, plain};
use crate::files::{do_all, write_in};
use crate::inputs::Ready;
use crate::people;
use crate::pose::write_poses;
use crate::progress::Ending;
use crate::reopening::page::{self, PagePicture};
use crate::reopening::seen::{show_contours, show_joints, show_photo};
use crate::scene;
use crate::verdict::Judgement;
use crate::watched::Watched;
use image::GrayImage;
use pcadlang_engine::lang::value::Located;
use pcadlang_engine::trace::Trace;
use pcadlang_inference::draws::SiteStats;
use pcadlang_inference::{BestSoFar, BestState, ChainResult, stuck_structure, stuck_together};
use pcadlang_library::Model;
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_report::RunDir;
use pcadlang_report::pictures::{self, png};
use pcadlang_scene::geom::{Object, Solid, glb, obj};
use pcadlang_scene::render::{Camera, Frame, View};
use pcadlang_scene::vision::{Mask, Photo, npy};
use pcadlang_workbench::session::{detected, exported, exported_operand, over};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The time until the best state is written first.
const FIRST: Duration = Duration::from_millis(200);

/// The facts about the best state that its rendering gives.
#[derive(Default)]
pub struct Shown {
    /// Its view.
    pub view: Option<ViewValue>,
    /// Its joints beside those that were found in the photograph.
    pub located: Vec<Located>,
    /// Its pixels.
    pub mask: Option<Mask>,
    /// The width and height of its mask, depth and normals.
    pub size: Option<[u32; 2]>,
    /// The fraction of the mesh's vertices that are in the picture.
    pub inside: Option<f64>,
    /// The length of a metre in scene units, if the program knows it.
    pub metre: Option<f64>,
    /// How far the chains' last states cover the same pixels: the number of pixels that
    /// all of them cover, divided by that of pixels that any of them covers.
    pub agreement: Option<f64>,
    /// Pictures as they are on the page.
    pub pictures: Vec<PagePicture>,
}

/// Rebuilds the state with the highest log joint density of all chains, saves it, and
/// renders it if it has a view.
pub fn show_best(
    dir: &RunDir,
    seed: u64,
    model: &Model,
    best: Option<&BestState>,
    chains: &[ChainResult],
    image: Option<&ImageValue>,
    full_size: bool,
) -> Result<Shown, Failure> {
    let Some(best) = best else { return Ok(Shown::default()) };
    let draws = scene::predictive(seed, 0);
    let mut trace = scene::rebuilt(model, &best.choices, draws)?;
    let saved = serde_json::to_vec(&trace.save(model.hash())).unwrap_or_default();
    write_in(dir, "best.trace.json", &saved)?;
    let mut shown = Shown::default();
    if let Some(view) = scene::view(&mut trace, draws, None) {
        let located = trace.located();
        let photo = image.and_then(ImageValue::as_photo);
        let most = if full_size { u32::MAX } else { ImageValue::SHOWN };
        let size = bounded(extent(&view, photo), most);
        let seen = image.map(|image| (image, bounded(image.size(), most)));
        let photo = if full_size { photo } else { image.and_then(ImageValue::shown) };
        draw(dir, &view, &located, (chains, seed), (photo, size), seen, &mut shown)?;
        shown.view = Some(ViewValue(view));
        shown.located = located;
    }
    for x in model.exports() {
        export(dir, model, &mut trace, x, seed)?;
    }
    Ok(shown)
}

/// Writes the best state so far as `best.trace.json` while the chains run: at increasing
/// intervals, but at least as often as checkpoints (`most`). Errors are ignored here, as
/// they are reported at the end of the run.
pub fn keep_best(dir: &RunDir, model: &Model, best: &BestSoFar, ending: &Ending, most: Duration) {
    let (begun, mut written) = (Instant::now(), f64::NEG_INFINITY);
    while !ending.within((begun.elapsed() / 2).clamp(FIRST.min(most), most)) {
        let Some(state) = best.state().filter(|s| s.log_joint > written) else { continue };
        if let Ok(trace) = scene::rebuilt(model, &state.choices, scene::predictive(0, 0))
            && let Ok(saved) = serde_json::to_vec(&trace.save(model.hash()))
            && dir.write("best.trace.json", &saved).is_ok()
        {
            written = state.log_joint;
        }
    }
}

/// Writes depth, normals, mask and meshes, and the overlay, contours and mask frequency as
/// pictures, of this size, and what was observed, of its own.
fn draw(
    dir: &RunDir,
    view: &Arc<View>,
    located: &[Located],
    (chains, seed): (&[ChainResult], u64),
    (photo, (width, height)): (Option<&Photo>, (u32, u32)),
    seen: Option<(&ImageValue, (u32, u32))>,
    shown: &mut Shown,
) -> Result<(), Failure> {
    let camera = view.camera();
    let size = width.max(height);
    let frame = view.frame(size);
    shown.size = Some([frame.width, frame.height]);
    shown.mask = covered(&frame);
    let (spread, agreement) = frequency(chains.iter().map(|c| c.last.clone()), seed);
    shown.agreement = agreement;
    let objects = objects(&view.solid_in_files());
    let photo = photo.map(Photo::rgb);
    let encode = |p: Result<Vec<u8>, image::ImageError>| p.map_err(|e| plain(e.to_string()));
    let on_page = Mutex::new(Vec::new());
    let on_page = || on_page.lock().unwrap_or_else(PoisonError::into_inner);
    // What takes longest first.
    do_all(&[
        &|| {
            let mut over = over(view, photo, (width, height));
            detected(&mut over, located, (width, height));
            let file = encode(png(&over))?;
            write_in(dir, "overlay.png", &file)?;
            let drawn = page::on_page(&over, file);
            on_page().push(("overlay.png", drawn));
            Ok(())
        },
        &|| photo.map_or(Ok(()), |photo| show_photo(dir, photo)),
        &|| {
            // Joints are cut out of the photograph as it was given.
            let photo = seen.and_then(|(image, _)| image.as_photo());
            let joints = photo.map(|p| show_joints(dir, p.rgb(), located)).transpose()?;
            on_page().extend(joints.flatten());
            Ok(())
        },
        &|| seen.map_or(Ok(()), |(image, size)| show_contours(dir, image, size)),
        &|| {
            let shape = [frame.height as usize, frame.width as usize];
            write_in(dir, "depth.npy", &npy::f32_array(&shape, frame.depth.iter().copied()))?;
            let [rows, columns] = shape;
            let normals = frame.normal.iter().flatten().copied();
            write_in(dir, "normals.npy", &npy::f32_array(&[rows, columns, 3], normals))?;
            let bytes = frame.mask().map(|m| if m { 255 } else { 0 }).collect();
            let mask = GrayImage::from_raw(frame.width, frame.height, bytes);
            mask.map_or(Ok(()), |mask| write_in(dir, "mask.png", &encode(png(&mask))?))
        },
        &|| {
            let lines = view.contours(size);
            let lines = pictures::contours(frame.width, frame.height, &lines.slice());
            write_in(dir, "contours.png", &encode(png(&lines))?)?;
            write_in(dir, "uncertainty.png", &encode(png(&spread))?)
        },
        &|| {
            let Some(objects) = &objects else { return Ok(()) };
            write_in(dir, "best.obj", obj::write(objects).as_bytes())?;
            write_in(dir, "best.glb", &glb::write(objects))
        },
    ])?;
    shown.pictures = std::mem::take(&mut *on_page());
    shown.inside = inside(view.solid(), camera);
    shown.metre = view.metre();
    write_poses(dir, view)
}

/// Returns the fraction of a solid's vertices that are in the picture and in front of the
/// camera.
fn inside(solid: &Solid, camera: &Camera) -> Option<f64> {
    let within = |p: &glam::DVec3| {
        let (x, y, depth) = camera.project(*p);
        let on = |v: f64, size: u32| (0.0..=f64::from(size)).contains(&v);
        depth > 0.0 && on(x, camera.width) && on(y, camera.height)
    };
    let all = solid.vertex_count();
    (all > 0).then(|| solid.vertices().filter(within).count() as f64 / all as f64)
}

/// Warns if less than half of the scene is in the picture.
pub fn outside(shown: &Shown) -> Option<String> {
    let inside = shown.inside.filter(|inside| *inside < 0.5)?;
    Some(format!(
        "most of the best scene is outside the picture ({:.0}% of its mesh is inside); the rest \
         is determined by the prior alone",
        100.0 * inside
    ))
}

/// Returns the objects of a solid. A solid too far away or too small for single precision
/// has none, which must not fail the run.
fn objects(solid: &Solid) -> Option<Vec<Object>> {
    match solid.objects() {
        Ok(objects) => Some(objects),
        Err(e) => {
            error_line!("warning: cannot write the mesh: {e}");
            None
        }
    }
}

/// Returns width and height of the picture in which a view is: those of the photograph, if any.
fn extent(view: &View, photo: Option<&Photo>) -> (u32, u32) {
    let camera = view.camera();
    photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()))
}

/// Scales a size down to a longer side of at most `most`.
fn bounded((width, height): (u32, u32), most: u32) -> (u32, u32) {
    let scale = (f64::from(most) / f64::from(width.max(height).max(1))).min(1.0);
    let [width, height] = [width, height].map(|n| (f64::from(n) * scale).round().max(1.0) as u32);
    (width, height)
}

/// Returns the pixels that the object covers.
fn covered(frame: &Frame) -> Option<Mask> {
    Mask::new(frame.width, frame.height, frame.mask().collect()).ok()
}

/// Returns the pixels that a view covers, at the size of the photograph, if any.
pub fn whole_mask(view: &View, size: Option<(u32, u32)>) -> Option<Mask> {
    let (width, height) = size.unwrap_or((view.camera().width, view.camera().height));
    let frame = view.depth(width.max(height));
    let mask = covered(&frame)?;
    let same = (frame.width, frame.height) == (width, height);
    Some(if same { mask } else { mask.resized(width, height) })
}

/// Judges a run under way by its best state and, for the chains' last states, the latest
/// ones that are kept: steps lie between them, at most an eighth of all.
pub fn judged_so_far(job: &Job, ready: &Ready, watched: &Watched) -> Option<Judgement> {
    let places = ready.image()?.known_places();
    let (best, draws) = (watched.best.state()?, scene::predictive(0, 0));
    let mut trace = scene::rebuilt(&ready.model, &best.choices, draws).ok()?;
    let view = scene::view(&mut trace, draws, None)?;
    let (width, height) = bounded(extent(&view, ready.photo()), ImageValue::SHOWN);
    let object = covered(&view.frame(width.max(height)))?;
    let Some(places) = places else { return people::judged(job, ready, &object) };
    let chains = 0..watched.memories.len();
    let states = chains.filter_map(|chain| watched.trajectory.of_chain(chain).pop());
    let last = states.filter_map(|state| scene::loaded(&ready.model, &state.trace).ok());
    Judgement::of(&object, &places, frequency(last, 0).1)
}

/// The resolution at which the agreement of chains is measured: pixels along the longer side.
const AGREEMENT: u32 = 128;

/// Counts how many of the chains' last states cover each pixel, and returns how far
/// several states cover the same pixels.
fn frequency(last: impl Iterator<Item = Trace>, seed: u64) -> (GrayImage, Option<f64>) {
    let mut counts: Vec<u32> = Vec::new();
    let (mut width, mut height, mut of) = (1, 1, 0);
    for mut trace in last {
        let Some(view) = scene::view(&mut trace, scene::predictive(seed, 1), None) else {
            continue;
        };
        let frame = view.frame(AGREEMENT);
        (width, height) = (frame.width, frame.height);
        counts.resize((width * height) as usize, 0);
        counts.iter_mut().zip(frame.mask()).for_each(|(n, m)| *n += u32::from(m));
        of += 1;
    }
    let covered = |by: u32| counts.iter().filter(|n| **n >= by.max(1)).count() as f64;
    let agreement = (of > 1 && covered(1) > 0.0).then(|| covered(of) / covered(1));
    (pictures::frequency(width, height, &counts, of), agreement)
}

/// Chains that agree on less than this fraction of pixels may not all have found the
/// object: in 102 runs of `lathe.pcad` on pictures of known shape it was found in 95 % of
/// the runs above the threshold, and in 45 % of those below
/// (docs/measurements/objects.md).
const AGREE: f64 = 0.9;

/// Warns of chains that disagree on which pixels are covered.
pub fn disagreement(shown: &Shown) -> Option<String> {
    let agreement = shown.agreement.filter(|a| *a < AGREE)?;
    Some(format!(
        "the chains' last states agree on only {:.0}% of the pixels they cover: the object may \
         not have been found (see uncertainty.png)",
        100.0 * agreement
    ))
}

/// Writes the file of an export such as `export best(view) to "file.obj"`.
fn export(
    dir: &RunDir,
    model: &Model,
    trace: &mut Trace,
    x: &pcadlang_engine::lang::lower::Export,
    seed: u64,
) -> Result<(), Failure> {
    let Some(operand) = exported_operand(model.code(), x) else { return Ok(()) };
    let values = trace
        .query(&[operand], scene::predictive(seed, 2))
        .map_err(|e| Failure::from(model.run_error(*e)))?;
    let Some(value) = values.first() else { return Ok(()) };
    let name = x.file.trim_start_matches(['/', '.']).replace('/', "_");
    match exported(value, &name) {
        Ok(bytes) => write_in(dir, &name, &bytes),
        Err(e) => {
            error_line!("warning: cannot write the mesh: {e}");
            Ok(())
        }
    }
}

/// Warns of choices that determine which others exist, and hardly ever move.
pub fn structure_warning(state: &Trace, sites: &[SiteStats]) -> Option<String> {
    let stuck = stuck_structure(state, sites);
    let (address, rate) = stuck.first()?;
    let more =
        if stuck.len() > 1 { format!(" (and {} others)", stuck.len() - 1) } else { String::new() };
    Some(format!(
        "{address}{more} decides which other choices exist, and {:.1}% of its proposals were accepted, so \
         the number of components hardly changes; marginalise their labels, as in `observe mixture(map(fn(m) {{ 1 / k }}, mu), \
         map(fn(m) {{ normal(m, sd) }}, mu)) = ys;` (guide, chapter 7)",
        100.0 * rate
    ))
}

/// Warns of choices that never moved in any chain and may hold each other in place.
pub fn stuck_warning(state: &Trace, sites: &[SiteStats]) -> Option<String> {
    let stuck = stuck_together(state, sites);
    let others = stuck.len().checked_sub(1)?;
    Some(format!(
        "{} and {others} others that it depends on never moved in any chain, although other values \
         are possible: the chains may not be able to leave the modes in which they began; draw \
         such choices together, with exact($finite) or block(…)",
        stuck.first()?
    ))
}
