//! The fuzz targets, one function each: any bytes give a result or an error without a
//! panic, and a result can be used.
//!
//! `tests/fuzz/main.rs` also compiles these functions, and runs them on seeds and on
//! every input that failed before.

#[allow(dead_code)]
#[path = "../../crates/studio/src/protocol.rs"]
mod protocol;

use pcadlang::{Model, Program, RunOptions};
use pcadlang_detectors::nn::{Network, NetworkError};
use pcadlang_engine::lang::builtins::data::Options;
use pcadlang_engine::trace::{Limits, SavedTrace, Trace};
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use pcadlang_inference::{Checkpoint, Progress};
use pcadlang_numerics::num::fnv1a;
use pcadlang_report::checkpoint::SavedChain;
use pcadlang_scene::cameras::{Asked, CameraFile, Seen, Standpoint};
use pcadlang_scene::geom::{
    FileFrame, MeshFile, UpAxis, gltf as gltf_file, obj as obj_file, ply as ply_file,
    stl as stl_file,
};
use pcadlang_scene::vision::features::Query;
use pcadlang_scene::vision::keypoints::People;
use pcadlang_scene::vision::{Limits as Pixels, depth, mask, npy, photo};
use pcadlang_syntax::diag::{IntoDiagnostic, SourceMap, render};
use pcadlang_syntax::{parse, print, span::FileId};
use pcadlang_workbench::bank::Bank;
use std::io;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// Limits on pictures, so that many can be tried per second.
const PIXELS: Pixels = Pixels { max_side: 512, max_pixels: 1 << 16 };

/// Reads data as a program does. Every file that it requests has the contents `beside`.
fn data(kind: &str, file: &str, bytes: &[u8], beside: &[u8]) -> bool {
    pcadlang_library::standard::table()
        .load(kind, file, bytes, &Options::default(), &|_| Ok(beside.to_vec()))
        .is_ok()
}

/// Tests the text of a program: every error can be rendered, and a program without errors
/// is printed and read back the same.
pub fn program_text(bytes: &[u8]) {
    let mut sources = SourceMap::new();
    let Ok(file) = sources.add_bytes("fuzz.pcad", bytes) else { return };
    let text = sources.get(file).map(|f| f.text().to_string()).unwrap_or_default();
    let (program, errors) = parse(&text, FileId(0));
    if errors.is_empty() {
        let printed = print(&program);
        let (again, errors) = parse(&printed, FileId(0));
        assert!(errors.is_empty(), "{printed}");
        assert_eq!(print(&again), printed);
    }
    let all: Vec<_> = errors.into_iter().map(IntoDiagnostic::into_diagnostic).collect();
    assert_eq!(all.is_empty(), render(&sources, &all, false).is_empty());
}

/// Tests a whole program: compiles it, and runs a few steps within small limits.
pub fn program(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let program = match Program::parse(text) {
        Ok(program) => program,
        Err(e) => return assert!(!e.to_string().is_empty()),
    };
    match program.limits(small()).compile() {
        Ok(model) => run(&model),
        Err(e) => assert!(!e.to_string().is_empty()),
    }
}

fn run(model: &Model) {
    let time = Some(Duration::from_millis(100));
    let options = RunOptions {
        steps: Some(20),
        warmup: Some(10),
        time,
        limits: small(),
        ..RunOptions::default()
    };
    match model.run(&options, 1, 1) {
        Ok(posterior) => {
            let last = &posterior.chains[0].last;
            assert!(!last.log_joint().is_nan());
            reload(model, &last.save(model.hash()));
        }
        Err(e) => assert!(!e.to_string().is_empty()),
    }
}

/// Returns limits under which a program takes a fraction of a second.
fn small() -> Limits {
    Limits {
        depth: 200,
        nodes: 20_000,
        elements: 1_000_000,
        operations: 100_000,
        ..Limits::default()
    }
}

/// Loads a saved trace and checks the result of saving it again.
fn reload(model: &Model, saved: &SavedTrace) {
    if let Ok(trace) = Trace::load(Arc::clone(model.code()), model.hash(), saved, small()) {
        let again = trace.save(model.hash());
        let reloaded = Trace::load(Arc::clone(model.code()), model.hash(), &again, small());
        let twice = reloaded.map(|trace| trace.save(model.hash())).ok();
        let text = |s: &SavedTrace| serde_json::to_string(s).unwrap_or_default();
        assert_eq!(twice.as_ref().map(text), Some(text(&again)));
    }
}

/// Tests a mesh in Wavefront OBJ: a mesh that was read can be written and read again.
pub fn obj(bytes: &[u8]) {
    let frame = FileFrame::new(UpAxis::Z, 0.01).unwrap_or_default();
    let _ = obj_file::load_in(bytes, &frame);
    let indexed = obj_file::indexed(bytes);
    if let Ok(mesh) = obj_file::load(bytes) {
        assert!(indexed.is_ok_and(|i| i.triangles.len() >= mesh.topology.triangles.len()));
        let triangles = mesh.topology.triangles.len();
        let again = obj_file::load(obj_file::write(&[mesh.into()]).as_bytes());
        assert!(again.is_ok_and(|m| m.topology.triangles.len() == triangles));
        data("mesh", "x.obj", bytes, &[]);
    }
}

/// Tests a mesh in STL, binary or as text.
pub fn stl(bytes: &[u8]) {
    mesh_file(stl_file::indexed(bytes).ok());
    data("mesh", "x.stl", bytes, &[]);
}

/// Tests a mesh in PLY, binary or as text.
pub fn ply(bytes: &[u8]) {
    mesh_file(ply_file::indexed(bytes).ok());
    data("mesh", "x.ply", bytes, &[]);
}

/// Tests that what was read is sound, and stays so when what is inside out is turned over.
fn mesh_file(file: Option<MeshFile>) {
    let Some(file) = file else { return };
    assert!(file.triangles.iter().flatten().all(|v| (*v as usize) < file.positions.len()));
    assert_eq!(file.parts.len(), file.triangles.len());
    let again = file.outward().outward();
    assert!(again.remarks.len() <= 1);
    let _ = again.mesh();
}

/// Tests a glTF file in either form; every file beside it is one small buffer.
pub fn gltf(bytes: &[u8]) {
    let beside = [0u8; 256];
    let read = |_: &str| Ok(beside.to_vec());
    for pose in [gltf_file::Pose::Bind, gltf_file::Pose::File] {
        if let Ok(loaded) = gltf_file::load(bytes, &FileFrame::default(), pose, &read) {
            assert!(
                loaded.triangles.iter().flatten().all(|v| (*v as usize) < loaded.positions.len())
            );
            let _ = loaded.clone().mesh();
            let _ = loaded.armature();
        }
    }
    data("mesh", "x.gltf", bytes, &beside);
    data("armature", "x.gltf", bytes, &beside);
}

/// Tests a rig file, then a zero byte, then the contents of the files beside it (its mesh
/// and its morphs).
pub fn rig(bytes: &[u8]) {
    let (rig, beside) = match bytes.iter().position(|b| *b == 0) {
        Some(i) => (&bytes[..i], &bytes[i + 1..]),
        None => (bytes, CORNER),
    };
    data("armature", "x.rig.json", rig, beside);
    if let Ok(file) = pcadlang_scene::geom::armature::rig_from_json(rig) {
        let _ = pcadlang_scene::geom::armature::morphs_from_json(beside, &file.rig);
    }
}

/// A mesh of one triangle.
const CORNER: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Tests a picture, PNG or JPEG, as a photograph, mask, and depth map.
pub fn image(bytes: &[u8]) {
    if let Ok(photo) = photo::decode(bytes, &PIXELS) {
        assert!(photo.width() > 0 && photo.height() > 0);
        assert!(u64::from(photo.width()) * u64::from(photo.height()) <= PIXELS.max_pixels);
        let small = photo.shrunk(32);
        assert!(small.width() <= 32 && small.height() <= 32);
        let _ = mask::decode(bytes, None, &PIXELS);
        let _ = depth::decode(bytes, None, 0.0, &PIXELS);
    }
}

/// Tests an array in numpy's format, as a mask and depth map.
pub fn array(bytes: &[u8]) {
    if let Ok(array) = npy::parse(bytes) {
        let count: usize = array.shape.iter().product();
        assert_eq!(array.clone().into_f32().len(), count);
    }
    if let Ok(mask) = mask::decode(bytes, None, &PIXELS) {
        assert_eq!(mask.data().len() as u64, u64::from(mask.width()) * u64::from(mask.height()));
        let _ = mask.resized(8, 8);
    }
    if let Ok(depth) = depth::decode(bytes, Some(1.0), 0.0, &PIXELS) {
        assert_eq!(depth.data().len() as u64, u64::from(depth.width()) * u64::from(depth.height()));
        let _ = depth.resized(8, 8);
    }
}

/// Tests a camera: the first byte tells the file's name, the next two the length of the file beside
/// it (COLMAP's other one), which comes before it. The axes of a camera that was read are a rotation,
/// and its lens has a finite inverse.
pub fn camera(bytes: &[u8]) {
    let [kind, low, high, rest @ ..] = bytes else { return };
    let names = ["camera", "cameras.txt", "images.txt", "cameras.bin", "images.bin"];
    let name = names[usize::from(*kind) % names.len()];
    let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
    let (other, own) = rest.split_at(length);
    let plain = Asked::default();
    let world = FileFrame::new(UpAxis::Z, 0.5).unwrap_or_default();
    let first = Asked { picture: Some("1"), world, at: Some(Standpoint::File), ..plain };
    for asked in
        [plain, first, Asked { photo: Some("a/1.png"), at: Some(Standpoint::View), ..plain }]
    {
        let file = match CameraFile::read(name, own, &asked, &|_| Ok(other.to_vec())) {
            Ok(file) => file,
            Err(e) => {
                assert!(!e.to_string().is_empty());
                continue;
            }
        };
        for size in [None, Some((64, 48))] {
            let Ok(Seen { camera, lens }) = file.seen(size) else { continue };
            let axes = [camera.right, camera.up, camera.forward];
            assert!(camera.eye.is_finite() && axes.iter().all(|v| (v.length() - 1.0).abs() < 1e-6));
            assert!((camera.right.cross(camera.up) + camera.forward).length() < 1e-6, "{camera:?}");
            if let Some(lens) = lens.and_then(|l| l.scaled((64, 48))) {
                let seen = lens.undistorted([10.0, 10.0]);
                assert!(seen.is_none_or(|p| p.iter().all(|x| x.is_finite())), "{lens:?}");
                let mask =
                    mask::Mask::new(64, 48, vec![true; 64 * 48]).map(|m| m.undistorted(&lens));
                assert!(mask.is_ok_and(|m| m.is_ok()));
            }
        }
    }
}

/// The program for saved traces.
const TRACED: &str = "fn f(n) { s ~ flip(0.5); if s and n < 5 { 1 + f(n + 1) } else { 0 } }
assume n = f(0); assume k ~ poisson(3); for i in 0 .. 3 { x[i] ~ normal(0, 1); }
assume w ~ dirichlet([1, 2, 3]); assume c ~ categorical(w); assume v ~ mv_normal([0, 0], [[2, 1], [1, 2]]);
observe normal(n + k + c + sum(v) + x[0] + x[1] + x[2], 1) = 2;";

/// Returns the program of [`trace`], compiled once.
///
/// # Panics
/// If it does not compile.
pub fn traced() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| Model::from_text(TRACED).unwrap_or_else(|e| panic!("{e}")))
}

/// Tests a saved trace, as one of the program above, whatever program it names.
pub fn trace(bytes: &[u8]) {
    let Ok(mut saved) = serde_json::from_slice::<SavedTrace>(bytes) else { return };
    saved.program = traced().hash().to_owned();
    saved.version = 1;
    reload(traced(), &saved);
}

/// The program whose chains resume from checkpoints: kernels with much state, and nested
/// statements.
const BROKEN_OFF: &str = "
assume m ~ normal(0, 5); assume s ~ half_normal(2); assume c ~ flip(0.5);
assume d = if c { e ~ normal(0, 1); e } else { 0 };
for i in 0 .. 3 { z[i] ~ flip(0.5); observe normal(m + d + (if z[i] { 2 } else { 0 }), s) = i as y; }
kernel both(n) { drift(@m, n); mh(one(@**)); }
infer {
    init(best_of(3, keep = 2));
    warmup 6 { anneal(10); drift(@m + @s); slice(@s); }
    for w in [0.1, 1] {
        repeat 4 {
            let t = w + abs(m);
            mix { 1 => nuts(@m + @s, max_depth = 2); 1 => temper(drift(@m), levels = 2); 1 => both(t); }
            gibbs(each(@z)); collect m, z;
        }
    }
}";

/// Returns the program of [`checkpoint`], compiled once.
///
/// # Panics
/// If it does not compile.
pub fn broken_off() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| Model::from_text(BROKEN_OFF).unwrap_or_else(|e| panic!("{e}")))
}

/// Resumes from a checkpoint, and keeps the checkpoints that are made.
struct GoingOn {
    from: Option<Checkpoint>,
    kept: Arc<Mutex<Vec<Vec<u8>>>>,
    progress: Arc<Progress>,
}

impl Sink for GoingOn {
    fn columns(&mut self, _: &[Column]) -> io::Result<()> {
        Ok(())
    }

    fn draw(&mut self, _: &DrawRow) -> io::Result<()> {
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }

    fn resume(&mut self) -> io::Result<Option<Checkpoint>> {
        Ok(self.from.take())
    }

    fn takes_checkpoints(&self) -> bool {
        true
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).push(checkpoint.to_bytes());
        self.progress.checkpoints.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

/// Returns the checkpoints of a chain at each of its steps.
pub fn checkpoints(from: Option<Checkpoint>) -> Vec<Vec<u8>> {
    let (kept, progress) = (Arc::<Mutex<Vec<_>>>::default(), Arc::new(Progress::default()));
    progress.checkpoints.store(1, Ordering::Relaxed);
    let sink = GoingOn { from, kept: Arc::clone(&kept), progress: Arc::clone(&progress) };
    let time = Some(Duration::from_millis(300));
    let options = RunOptions { seed: 1, time, limits: small(), ..RunOptions::default() };
    match broken_off().run_into(&options, 1, &progress, vec![Box::new(sink)]) {
        Ok(mut done) => {
            if let Some(Ok(chain)) = done.pop() {
                assert!(!chain.last.log_joint().is_nan());
            }
        }
        Err(e) => assert!(!e.to_string().is_empty()),
    }
    std::mem::take(&mut *kept.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Tests the contents of a checkpoint of the program above, and the reader of checkpoint
/// files.
pub fn checkpoint(bytes: &[u8]) {
    let _ = SavedChain::read(bytes, "");
    if let Ok(checkpoint) = Checkpoint::from_bytes(bytes) {
        checkpoints(Some(checkpoint));
    }
}

/// Tests a bank: its header, every kind of entry, and a search. The hash of the header is
/// corrected first; otherwise hardly any input would pass it.
pub fn bank(bytes: &[u8]) {
    let mut bytes = bytes.to_vec();
    let header = bytes
        .get(40..48)
        .and_then(|w| w.try_into().ok())
        .map_or(usize::MAX, |w| u64::from_le_bytes(w) as usize);
    if let Some(hash) = bytes.get(header..).map(fnv1a)
        && let Some(place) = bytes.get_mut(48..56)
    {
        place.copy_from_slice(&hash.to_le_bytes());
    }
    let path = std::env::temp_dir().join(format!("pcadlang-fuzz-{}.bank", std::process::id()));
    if std::fs::write(&path, &bytes).is_err() {
        return;
    }
    if let Ok(bank) = Bank::open(&path) {
        let last = bank.len().saturating_sub(1);
        for i in [0, last / 2, last, bank.len()] {
            let _ = bank.latents(i);
        }
        if let Ok(features) = bank.features(0) {
            let near = bank.nearest(&Query::new(features.clone()), 3);
            assert!(near.map_or(0, |n| n.len()) <= 3);
            let _ = bank.neighbours(&Query::new(features), 3);
        }
        let _ = bank.check("another");
    }
    let _ = std::fs::remove_file(&path);
}

/// Tests the output of a pose detector.
pub fn keypoints(bytes: &[u8]) {
    match People::parse(bytes) {
        Ok(people) => {
            let ids: Vec<String> = people.ids().map(str::to_owned).collect();
            let _ = people.pick(None, Some("000001"));
            for id in ids.iter().take(3) {
                if let Ok(found) = people.pick(Some(id), None) {
                    let found = found.in_image(64, 48);
                    for p in found.points() {
                        assert!(found.position(p, (64, 48)).iter().all(|x| !x.is_nan()));
                    }
                }
            }
        }
        Err(e) => assert!(!e.message.is_empty()),
    }
}

/// Tests a table: the first byte selects CSV or JSON.
pub fn table(bytes: &[u8]) {
    let Some((kind, rest)) = bytes.split_first() else { return };
    data(if kind % 2 == 0 { "json" } else { "csv" }, "x", rest, &[]);
}

/// Tests a network: one that was read can run, unless that takes too long.
pub fn network(bytes: &[u8]) {
    runs(Network::read(bytes));
}

fn runs(read: Result<Network, NetworkError>) {
    match read {
        Ok(network) if network.work() < 1 << 20 => {
            let input = vec![0.5; network.input_shape().iter().product()];
            let outputs = network.run(input).map(|all| all.len());
            assert_eq!(outputs, Ok(network.output_shapes().len()));
        }
        Ok(_) => {}
        Err(e) => assert!(!e.to_string().is_empty()),
    }
}

/// Tests a graph model: JSON, a zero byte, weights.
pub fn graph_model(bytes: &[u8]) {
    let at = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let weights = bytes.get(at + 1..).unwrap_or_default();
    for image in [None, Some([64, 32])] {
        runs(Network::read_graph_model(&bytes[..at], weights, image));
    }
}

/// Tests a text frame of the studio: it is read or answered, and the answer is JSON.
pub fn studio(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let answer = match protocol::Request::read(text) {
        Ok(request) => {
            assert!(!format!("{:?}", request.call).is_empty());
            protocol::result(request.id, &serde_json::json!({}))
        }
        Err(m) => protocol::error(m.id, &m.message, m.hint.as_deref(), serde_json::json!([])),
    };
    assert!(serde_json::from_str::<serde_json::Value>(&answer).is_ok());
}
