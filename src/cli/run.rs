//! `pcadlang run`: chains, their draws as they come, then pictures, tables and a page.

use super::args::Run;
use super::keypoints::Joints;
use super::{Failure, given, plain, progress, scene};
use image::GrayImage;
use pcadlang::geom::{Mesh, Solid, glb, obj};
use pcadlang::infer::draws::{KernelStats, Sink};
use pcadlang::infer::{ChainResult, Progress, Watch};
use pcadlang::lang::builtins::scene::{SolidValue, ViewValue};
use pcadlang::render::View;
use pcadlang::report::html::{MeshData, Page, page};
use pcadlang::report::pictures::{self, png};
use pcadlang::report::{ChainDraws, Memory, Quantity, RunDir, Tee, csv::CsvSink, npy, quantities, seconds, table};
use pcadlang::trace::{Limits, Trace};
use pcadlang::vision::Photo;
use pcadlang::{Model, RunOptions};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Runs a program and leaves its folder.
pub fn run(a: &Run) -> Result<(), Failure> {
    let begun = Instant::now();
    let (program, photo) = given::observe(given::program(&a.given, a.quiet)?, a)?;
    let model = program.compile()?;
    let (_, default_plan) = model.plan()?;
    if let (Some(text), false) = (&default_plan, a.quiet) {
        eprintln!("note: the program has no `infer` block; this plan is used, copy and edit it:\n{text}");
    }
    let dir = match &a.out {
        Some(path) => RunDir::create(path),
        None => RunDir::fresh(Path::new("runs"), stem(&a.given.program)),
    };
    let dir = dir.map_err(|e| plain(e.to_string()))?;
    let options = RunOptions {
        seed: a.seed,
        steps: a.steps,
        warmup: a.warmup,
        // What is left of the time after compiling.
        time: a.time.map(|t| t.saturating_sub(begun.elapsed())),
        incremental: !a.no_incremental,
        ..RunOptions::default()
    };
    let threads = a.threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), |n| n as usize);
    let record = |state: &str, more: serde_json::Value| write_run(&dir, a, &model, state, more);
    record("running", json!({}))?;

    let memories: Vec<Memory> = (0..a.chains).map(|_| Memory::default()).collect();
    let sinks = sinks(&dir, a, &model, &memories)?;
    let joints = Joints::new(a.chains, photo.as_ref().map(|p| (p.width(), p.height())));
    let watch = Some(Box::new(joints.clone()) as Box<dyn Watch>);
    let (progress, done) = (Arc::new(Progress { watch, ..Progress::default() }), AtomicBool::new(false));
    let cancel = Arc::clone(&progress);
    // A second handler cannot be set; then the system's own stays.
    let _ = ctrlc::set_handler(move || cancel.cancelled.store(true, Ordering::Relaxed));
    let results = std::thread::scope(|s| {
        s.spawn(|| progress::watch(&progress, &done, options.time, a.quiet || a.json));
        let results = model.run_into(&options, threads, &progress, sinks);
        done.store(true, Ordering::Relaxed);
        results
    })?;
    let interrupted = progress.cancelled.load(Ordering::Relaxed);

    let draws: Vec<ChainDraws> = memories.iter().map(Memory::draws).collect();
    let mut chains = Vec::new();
    let mut failure = None;
    for r in results {
        match r {
            Ok(c) => chains.push(c),
            Err(e) => failure = failure.or(Some(model.chain_error(e))),
        }
    }
    if let Some(e) = failure {
        record("failed", json!({ "error": e.to_string() }))?;
        return Err(e.into());
    }
    let quantities = quantities(&draws);
    let kernels = table::merged(chains.iter().map(|c| &c.kernels[..]));
    let warnings = table::warnings(&quantities, &kernels, chains.len());
    write_summary(&dir, &quantities, &kernels, &warnings)?;
    let drawn = best_draw(&dir, a, &model, &chains, photo.as_ref())?;
    let found = drawn.view.as_ref().and_then(|v| joints.report(v, begun.elapsed().as_secs_f64()));
    if let Some(found) = found {
        write(&dir, "keypoints.json", &serde_json::to_vec_pretty(&found).unwrap_or_default())?;
    }
    let steps: Vec<_> = chains
        .iter()
        .map(|c| json!({ "steps": c.steps, "warmup": c.warmup, "draws": c.draws, "seconds": c.seconds }))
        .collect();
    let elapsed = begun.elapsed().as_secs_f64();
    record(if interrupted { "interrupted" } else { "done" }, json!({ "chains": steps, "seconds": elapsed }))?;
    let html = page(&Page {
        title: &a.given.program,
        settings: settings(a, &model, elapsed),
        pictures: drawn.pictures,
        quantities: &quantities,
        kernels: &kernels,
        warnings: &warnings,
        mesh: drawn.mesh.as_ref().map(|m| MeshData { positions: &drawn.positions, triangles: &m.topology.triangles }),
        program: model.text(),
    });
    write(&dir, "report.html", html.as_bytes())?;
    show(a, &dir, &model, &quantities, &kernels, &warnings, &chains, elapsed, interrupted);
    if interrupted { Err(Failure::Interrupted) } else { Ok(()) }
}

/// The name of a program without folder and ending.
fn stem(path: &str) -> &str {
    Path::new(path).file_stem().and_then(|s| s.to_str()).unwrap_or("run")
}

fn write(dir: &RunDir, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    dir.write(name, bytes).map_err(|e| plain(format!("{e}; what was written before is kept")))
}

/// One file of draws a chain, and the draws in memory for the summary.
fn sinks(dir: &RunDir, a: &Run, model: &Model, memories: &[Memory]) -> Result<Vec<Box<dyn Sink>>, Failure> {
    let comments =
        [("program", a.given.program.clone()), ("program_hash", model.hash().to_owned()), ("seed", a.seed.to_string())];
    let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
    for (i, memory) in memories.iter().enumerate() {
        let path = dir.file(&format!("chain-{}.csv", i + 1));
        let csv = CsvSink::create(&path, i as u32, &comments).map_err(|e| plain(format!("{}: {e}", path.display())))?;
        sinks.push(Box::new(Tee(vec![Box::new(csv), Box::new(memory.clone())])));
    }
    Ok(sinks)
}

/// What is given to observe, as `--observe` has it.
fn observed(a: &Run) -> impl Iterator<Item = String> {
    a.observe.iter().cloned().chain(a.keypoints.iter().map(|k| format!("keypoints={k}")))
}

fn settings(a: &Run, model: &Model, elapsed: f64) -> Vec<(&'static str, String)> {
    let mut all = vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("program hash", model.hash().to_owned()),
        ("seed", a.seed.to_string()),
        ("chains", a.chains.to_string()),
        ("time", seconds(elapsed)),
    ];
    all.extend(a.given.sets.iter().map(|(k, v)| ("set", format!("{k} = {v}"))));
    all.extend(observed(a).map(|o| ("observe", o)));
    all
}

/// `run.json`.
fn write_run(dir: &RunDir, a: &Run, model: &Model, state: &str, more: serde_json::Value) -> Result<(), Failure> {
    let mut run = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "state": state,
        "program": a.given.program,
        "program_hash": model.hash(),
        "seed": a.seed,
        "observe": observed(a).collect::<Vec<_>>(),
        "set": a.given.sets.iter().map(|(k, v)| (k.clone(), json!(v))).collect::<serde_json::Map<_, _>>(),
        "settings": {
            "chains": a.chains, "steps": a.steps, "warmup": a.warmup,
            "time": a.time.map(|t| t.as_secs_f64()), "incremental": !a.no_incremental,
        },
    });
    if let (Some(run), serde_json::Value::Object(more)) = (run.as_object_mut(), more) {
        run.extend(more);
    }
    write(dir, "run.json", &serde_json::to_vec_pretty(&run).unwrap_or_default())
}

fn write_summary(
    dir: &RunDir,
    quantities: &[Quantity],
    kernels: &[KernelStats],
    warnings: &[String],
) -> Result<(), Failure> {
    let all: serde_json::Map<_, _> = quantities.iter().map(|q| (q.name.clone(), json!(q.summary))).collect();
    let summary = json!({ "quantities": all, "kernels": kernels, "warnings": warnings });
    write(dir, "summary.json", &serde_json::to_vec_pretty(&summary).unwrap_or_default())
}

/// What the page shows of the best draw.
#[derive(Default)]
struct Shown {
    pictures: Vec<(&'static str, Vec<u8>)>,
    positions: Vec<[f32; 3]>,
    mesh: Option<Mesh>,
    view: Option<ViewValue>,
}

/// Rebuilds the draw with the highest log joint density, saves it, and draws it if it has a view.
fn best_draw(
    dir: &RunDir,
    a: &Run,
    model: &Model,
    chains: &[ChainResult],
    photo: Option<&Photo>,
) -> Result<Shown, Failure> {
    let best = chains.iter().filter_map(|c| c.best.as_ref()).max_by(|x, y| x.0.total_cmp(&y.0));
    let Some((_, choices)) = best else { return Ok(Shown::default()) };
    let draws = scene::predictive(a.seed, 0);
    let built = Trace::generate(Arc::clone(model.code()), choices.iter().cloned(), draws, Limits::default());
    let (mut trace, _) = built.map_err(|e| Failure::from(model.run_error(*e)))?;
    let saved = serde_json::to_vec(&trace.save(model.hash())).unwrap_or_default();
    write(dir, "best.trace.json", &saved)?;
    let mut shown = Shown::default();
    if let Some(view) = scene::view(&mut trace, draws, None) {
        draw(dir, &view, chains, a, photo, &mut shown)?;
        shown.view = Some(ViewValue(view));
    }
    for x in model.exports() {
        export(dir, model, &mut trace, x, a)?;
    }
    Ok(shown)
}

/// Depth, normals, mask and meshes at the input's resolution; overlay, contours and mask frequency as pictures.
fn draw(
    dir: &RunDir,
    view: &Arc<View>,
    chains: &[ChainResult],
    a: &Run,
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
    let large = pictures::picture_size(width, height);
    let (contours, picture) = (view.contours(size), view.frame(large.0.max(large.1)));
    let (strokes, drawn) = (scene::strokes(&contours), scene::drawn(&picture));
    let mut over = pictures::overlay(photo.map(Photo::rgb), &drawn, &strokes);
    let marked = ViewValue(Arc::clone(view));
    let joints: Vec<[f64; 2]> = marked.landmarks(width, height).filter_map(|(_, at)| at).collect();
    pictures::dots(&mut over, (width, height), &joints);
    let overlay = encode(png(&over))?;
    let lines = encode(png(&pictures::contours(frame.width, frame.height, &strokes)))?;
    write(dir, "overlay.png", &overlay)?;
    write(dir, "contours.png", &lines)?;
    if let Some(p) = photo {
        let resized = image::imageops::resize(p.rgb(), large.0, large.1, image::imageops::FilterType::Triangle);
        shown.pictures.push(("the photograph", encode(png(&resized))?));
    }
    shown.pictures.push(("the best draw over it", overlay));
    let spread = encode(png(&frequency(chains, a, 128)))?;
    write(dir, "uncertainty.png", &spread)?;
    shown.pictures.push(("how often the last draws of the chains cover a pixel", spread));
    if let Some(mesh) = mesh(view.solid()) {
        write(dir, "best.obj", obj::write(&mesh).as_bytes())?;
        write(dir, "best.glb", &glb::write(&mesh))?;
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.to_array()).collect();
        shown.positions = positions;
        shown.mesh = Some(mesh);
    }
    Ok(())
}

/// The mesh of a solid; a solid too far away or too small for single precision has none, which is no reason to lose the run.
fn mesh(solid: &Solid) -> Option<Mesh> {
    match solid.to_mesh() {
        Ok(mesh) => Some(mesh),
        Err(e) => {
            eprintln!("warning: no mesh is written: {e}");
            None
        }
    }
}

/// How many of the chains' last states cover each pixel.
fn frequency(chains: &[ChainResult], a: &Run, size: u32) -> GrayImage {
    let mut counts: Vec<u32> = Vec::new();
    let (mut width, mut height, mut of) = (1, 1, 0);
    for c in chains {
        let mut trace = c.last.clone();
        let Some(view) = scene::view(&mut trace, scene::predictive(a.seed, 1), None) else { continue };
        let frame = view.frame(size);
        (width, height) = (frame.width, frame.height);
        counts.resize((width * height) as usize, 0);
        counts.iter_mut().zip(frame.mask()).for_each(|(n, m)| *n += u32::from(m));
        of += 1;
    }
    pictures::frequency(width, height, &counts, of)
}

/// `export best(view) to "file.obj"`.
fn export(
    dir: &RunDir,
    model: &Model,
    trace: &mut Trace,
    x: &pcadlang::lang::lower::Export,
    a: &Run,
) -> Result<(), Failure> {
    use pcadlang::syntax::ast::ExprKind;
    let expr = match &x.expr.kind {
        ExprKind::Call { args, .. } if args.len() == 1 => &args[0].value,
        _ => &x.expr,
    };
    let Some(operand) = model.code().queries.get(&expr.span).or_else(|| model.code().queries.get(&x.expr.span)) else {
        return Ok(());
    };
    let values =
        trace.query(&[*operand], scene::predictive(a.seed, 2)).map_err(|e| Failure::from(model.run_error(*e)))?;
    let Some(value) = values.first() else { return Ok(()) };
    let solid = value.downcast::<ViewValue>().map(|v| v.0.solid().clone());
    let solid = solid.or_else(|| value.downcast::<SolidValue>().map(|s| s.0.clone()));
    let name = x.file.trim_start_matches(['/', '.']);
    match solid {
        Some(solid) => {
            let Some(mesh) = mesh(&solid) else { return Ok(()) };
            let bytes = if name.ends_with(".glb") { glb::write(&mesh) } else { obj::write(&mesh).into_bytes() };
            write(dir, &name.replace('/', "_"), &bytes)
        }
        None => write(dir, &name.replace('/', "_"), value.to_string().as_bytes()),
    }
}

/// The end of a run on the terminal.
#[allow(clippy::too_many_arguments)]
fn show(
    a: &Run,
    dir: &RunDir,
    model: &Model,
    quantities: &[Quantity],
    kernels: &[KernelStats],
    warnings: &[String],
    chains: &[ChainResult],
    elapsed: f64,
    interrupted: bool,
) {
    if a.json {
        let all: serde_json::Map<_, _> = quantities.iter().map(|q| (q.name.clone(), json!(q.summary))).collect();
        println!(
            "{}",
            json!({ "out": dir.path(), "seed": a.seed, "quantities": all, "kernels": kernels, "warnings": warnings })
        );
        return;
    }
    if a.quiet {
        return;
    }
    print!("{}\n{}", table::quantities(quantities), table::kernels(kernels));
    for w in warnings {
        println!("warning: {w}");
    }
    if chains.first().is_some_and(|c| c.last.is_pseudo()) {
        println!(
            "note: a likelihood is no density over its data, so intervals depend on its scale (a pseudo-posterior)"
        );
    }
    let steps: u64 = chains.iter().map(|c| c.steps + c.warmup).sum();
    let most = chains.iter().map(|c| (c.steps, c.warmup)).max().unwrap_or_default();
    println!("seed {}, {} chains, {steps} steps in {}", a.seed, chains.len(), seconds(elapsed));
    if a.time.is_some() {
        println!("the longest chain again: --steps {} --warmup {}", most.0, most.1);
    }
    if interrupted {
        println!("interrupted: every draw so far is kept");
    }
    let _ = model;
    println!("{}", dir.path().display());
}
