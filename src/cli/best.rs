//! The best state of a run as files: its trace, depth, normals, mask, pictures, meshes,
//! exports.
//!
//! Not the run (`job`), and not what is printed.

use super::job::write;
use super::progress::Ending;
use super::seen::show_seen;
use super::{Failure, plain, scene};
use image::GrayImage;
use pcadlang::Model;
use pcadlang::geom::{Mesh, Solid, glb, obj};
use pcadlang::infer::{BestSoFar, BestState, ChainResult};
use pcadlang::lang::builtins::scene::{ImageValue, ViewValue};
use pcadlang::lang::value::Located;
use pcadlang::render::{Camera, View};
use pcadlang::report::pictures::{self, png};
use pcadlang::report::{RunDir, npy};
use pcadlang::session::{detected, exported, exported_operand, over, strokes};
use pcadlang::trace::Trace;
use pcadlang::vision::Photo;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// When the best state is written for the first time.
const FIRST: Duration = Duration::from_millis(200);

/// What is known of the best state once it was drawn.
#[derive(Default)]
pub struct Shown {
    /// What is seen.
    pub view: Option<ViewValue>,
    /// The share of the mesh's corners that is in the picture.
    pub inside: Option<f64>,
    /// How far the chains' last states cover the same pixels: those that all cover, as a
    /// share of those that any does.
    pub agreement: Option<f64>,
}

/// Rebuilds the state with the highest log joint density that any chain was in, saves it,
/// and draws it if it has a view.
pub fn show_best(
    dir: &RunDir,
    seed: u64,
    model: &Model,
    best: Option<&BestState>,
    chains: &[ChainResult],
    image: Option<&ImageValue>,
) -> Result<Shown, Failure> {
    let Some(best) = best else { return Ok(Shown::default()) };
    let draws = scene::predictive(seed, 0);
    let mut trace = scene::rebuilt(model, &best.choices, draws)?;
    let saved = serde_json::to_vec(&trace.save(model.hash())).unwrap_or_default();
    write(dir, "best.trace.json", &saved)?;
    let mut shown = Shown::default();
    if let Some(view) = scene::view(&mut trace, draws, None) {
        let located = trace.located();
        draw(dir, &view, &located, chains, seed, image.and_then(ImageValue::as_photo), &mut shown)?;
        image.map_or(Ok(()), |image| show_seen(dir, image, &located))?;
        shown.view = Some(ViewValue(view));
    }
    for x in model.exports() {
        export(dir, model, &mut trace, x, seed)?;
    }
    Ok(shown)
}

/// Writes the best state so far as `best.trace.json` while the chains run, until they
/// end: ever less often, but as often as checkpoints are kept. What cannot be written is
/// said at the end.
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

/// Depth, normals, mask and meshes at the input's resolution; overlay, contours and mask
/// frequency as pictures.
fn draw(
    dir: &RunDir,
    view: &Arc<View>,
    located: &[Located],
    chains: &[ChainResult],
    seed: u64,
    photo: Option<&Photo>,
    shown: &mut Shown,
) -> Result<(), Failure> {
    let camera = view.camera();
    let (width, height) = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
    let size = width.max(height);
    let frame = view.frame(size);
    let shape = [frame.height as usize, frame.width as usize];
    write(dir, "depth.npy", &npy::f32_array(&shape, frame.depth.iter().copied()))?;
    let normals = npy::f32_array(&[shape[0], shape[1], 3], frame.normal.iter().flatten().copied());
    write(dir, "normals.npy", &normals)?;
    let bytes = frame.mask().map(|m| if m { 255 } else { 0 }).collect();
    let encode = |p: Result<Vec<u8>, image::ImageError>| p.map_err(|e| plain(e.to_string()));
    if let Some(mask) = GrayImage::from_raw(frame.width, frame.height, bytes) {
        write(dir, "mask.png", &encode(png(&mask))?)?;
    }
    let mut over = over(view, photo.map(Photo::rgb), (width, height));
    detected(&mut over, located, (width, height));
    let lines = pictures::contours(frame.width, frame.height, &strokes(&view.contours(size)));
    write(dir, "overlay.png", &encode(png(&over))?)?;
    write(dir, "contours.png", &encode(png(&lines))?)?;
    let (spread, agreement) = frequency(chains, seed, 128);
    shown.agreement = agreement;
    write(dir, "uncertainty.png", &encode(png(&spread))?)?;
    if let Some(mesh) = mesh(view.solid()) {
        write(dir, "best.obj", obj::write(&mesh).as_bytes())?;
        write(dir, "best.glb", &glb::write(&mesh))?;
        shown.inside = inside(&mesh, camera);
    }
    Ok(())
}

/// The share of a mesh's corners that is seen within the picture, in front of the camera.
fn inside(mesh: &Mesh, camera: &Camera) -> Option<f64> {
    let within = |p: &glam::Vec3| {
        let (x, y, depth) = camera.project(p.as_dvec3());
        let on = |v: f64, size: u32| (0.0..=f64::from(size)).contains(&v);
        depth > 0.0 && on(x, camera.width) && on(y, camera.height)
    };
    let all = mesh.positions.len();
    (all > 0).then(|| mesh.positions.iter().filter(|p| within(p)).count() as f64 / all as f64)
}

/// What to say of a scene of which less than half is in the picture.
pub fn outside(shown: &Shown) -> Option<String> {
    let inside = shown.inside.filter(|inside| *inside < 0.5)?;
    Some(format!(
        "most of the best scene is outside the picture ({:.0}% of its mesh is inside); the rest \
         is determined by the prior alone",
        100.0 * inside
    ))
}

/// The mesh of a solid; a solid too far away or too small for single precision has none,
/// which is no reason to lose the run.
fn mesh(solid: &Solid) -> Option<Mesh> {
    match solid.to_mesh() {
        Ok(mesh) => Some(mesh),
        Err(e) => {
            error_line!("warning: cannot write the mesh: {e}");
            None
        }
    }
}

/// How many of the chains' last states cover each pixel, and how far several cover the
/// same ones.
fn frequency(chains: &[ChainResult], seed: u64, size: u32) -> (GrayImage, Option<f64>) {
    let mut counts: Vec<u32> = Vec::new();
    let (mut width, mut height, mut of) = (1, 1, 0);
    for c in chains {
        let mut trace = c.last.clone();
        let Some(view) = scene::view(&mut trace, scene::predictive(seed, 1), None) else {
            continue;
        };
        let frame = view.frame(size);
        (width, height) = (frame.width, frame.height);
        counts.resize((width * height) as usize, 0);
        counts.iter_mut().zip(frame.mask()).for_each(|(n, m)| *n += u32::from(m));
        of += 1;
    }
    let covered = |by: u32| counts.iter().filter(|n| **n >= by.max(1)).count() as f64;
    let agreement = (of > 1 && covered(1) > 0.0).then(|| covered(of) / covered(1));
    (pictures::frequency(width, height, &counts, of), agreement)
}

/// Chains that cover the same pixels to less than this have not all found the same thing:
/// of 102 runs of `lathe.pcad` on pictures of known shape the object was found in 95 % of
/// those above, in 45 % of those below (docs/objects.md).
const AGREE: f64 = 0.9;

/// What to say of chains that do not agree on what is seen where.
pub fn disagreement(shown: &Shown) -> Option<String> {
    let agreement = shown.agreement.filter(|a| *a < AGREE)?;
    Some(format!(
        "the chains' last states agree on only {:.0}% of the pixels they cover: the object may \
         not have been found (see uncertainty.png)",
        100.0 * agreement
    ))
}

/// `export best(view) to "file.obj"`.
fn export(
    dir: &RunDir,
    model: &Model,
    trace: &mut Trace,
    x: &pcadlang::lang::lower::Export,
    seed: u64,
) -> Result<(), Failure> {
    let Some(operand) = exported_operand(model.code(), x) else { return Ok(()) };
    let values = trace
        .query(&[operand], scene::predictive(seed, 2))
        .map_err(|e| Failure::from(model.run_error(*e)))?;
    let Some(value) = values.first() else { return Ok(()) };
    let name = x.file.trim_start_matches(['/', '.']).replace('/', "_");
    match exported(value, &name) {
        Ok(bytes) => write(dir, &name, &bytes),
        Err(e) => {
            error_line!("warning: cannot write the mesh: {e}");
            Ok(())
        }
    }
}
