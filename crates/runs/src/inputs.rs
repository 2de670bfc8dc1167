//! Everything that a run reads: its program, and the data, photographs, keypoints, detectors and
//! networks of its command line.

use crate::args::{Inputs, Job};
use crate::failure::{Failure, plain};
use crate::files;
use pcadlang_detectors::people::{PeopleFinder, networks};
use pcadlang_engine::lang::builtins::data::Options;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Limits as Bounds;
use pcadlang_library::scene::camera_file::{NamedCamera, kind_options};
use pcadlang_library::scene::{self, DetectorValue, ImageValue};
use pcadlang_library::{Model, Program, standard};
use pcadlang_scene::cameras::CameraFile;
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::{self, ContourMap, Photo};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// A compiled program with its observed data.
pub struct Ready {
    /// The program with its data.
    pub model: Model,
    /// The name and value of the photograph.
    pub named_image: Option<(String, Value)>,
    /// The program has a param `person`, which selects a person in the
    /// photograph.
    pub chooses: bool,
    /// When the run's time began.
    pub begun: Instant,
}

impl Ready {
    /// Returns the width and height of the photograph, if there is one.
    pub fn size(&self) -> Option<(u32, u32)> {
        self.photo().map(|p| (p.width(), p.height()))
    }

    /// Returns the photograph, if there is one.
    pub fn photo(&self) -> Option<&Photo> {
        self.image()?.as_photo()
    }

    /// Returns the photograph with its detections, or a contour map without a photograph,
    /// if there is one.
    pub fn image(&self) -> Option<&ImageValue> {
        self.named_image.as_ref()?.1.downcast::<ImageValue>()
    }
}

/// Reads and compiles a program; the time of a run begins here.
pub fn prepare(job: &Job, quiet: bool) -> Result<Ready, Failure> {
    let begun = Instant::now();
    let program = program_of(job, quiet)?;
    let photo = picture_of(&program, job);
    let ready = prepare_program(program, job, begun)?;
    if !quiet {
        camera_notes(&ready, photo.as_deref(), job)?;
    }
    Ok(ready)
}

/// Says what a user should know of the run's camera.
fn camera_notes(ready: &Ready, photo: Option<&str>, job: &Job) -> Result<(), Failure> {
    let stated = ready.photo().and_then(|p| Some((p, p.focal()?)));
    if let (None, Some((photo, focal))) = (&job.inputs.camera, stated) {
        let Camera { eye, .. } = Camera::default_by(photo.width(), photo.height(), focal);
        error_line!(
            "note: by its Exif data the photograph has a lens of {focal:.2} times its longer side; the \
             default view is from distance {:.2}, not 8",
            eye.z
        );
    }
    if let Some(spec) = &job.inputs.camera {
        let file = camera(spec, None, photo)?;
        for remark in &file.remarks {
            error_line!("note: {}: {remark}", spec.display());
        }
        if file.seen(None).is_ok_and(|s| s.lens.is_some()) {
            error_line!(
                "note: pictures, masks, depths and keypoints are undistorted; results are of the \
                 undistorted photograph"
            );
        }
    }
    Ok(())
}

/// Compiles a program that was read for a job; the time of a run began at `begun`.
pub fn prepare_program(program: Program, job: &Job, begun: Instant) -> Result<Ready, Failure> {
    let (program, image) = observe(program, job)?;
    let image = match image {
        Some((name, value)) => {
            let adapted = program.adapted(&name)?.unwrap_or(value);
            Some((name, adapted))
        }
        None => None,
    };
    let chooses = program.interface().params.iter().any(|p| p.name == "person");
    Ok(Ready { model: program.compile()?, named_image: image, chooses, begun })
}

/// The name of a program that comes from the standard input.
pub const STDIN: &str = "-";

/// Reads a program from the standard input. It may read files below the current folder.
fn typed(allowed: &[PathBuf]) -> Result<Program, Failure> {
    let text = std::io::read_to_string(std::io::stdin())
        .map_err(|e| plain(format!("cannot read the standard input: {e}")))?;
    let program = Program::named("<stdin>", &text)?;
    Ok(allowed.iter().try_fold(program, |p, folder| p.allow_read(folder))?)
}

/// Opens the program of a job. In a camera file of several pictures, the photograph's path
/// selects one.
pub fn program_of(job: &Job, quiet: bool) -> Result<Program, Failure> {
    let program = without_camera(&job.inputs, quiet)?;
    let photo = picture_of(&program, job);
    with_camera(program, &job.inputs, photo.as_deref())
}

/// Opens the program, with its parameters and camera.
pub fn program(inputs: &Inputs, quiet: bool) -> Result<Program, Failure> {
    with_camera(without_camera(inputs, quiet)?, inputs, None)
}

fn with_camera(program: Program, inputs: &Inputs, photo: Option<&str>) -> Result<Program, Failure> {
    match &inputs.camera {
        Some(spec) => Ok(program.camera_file(camera(spec, None, photo)?)),
        None => Ok(program),
    }
}

/// Reads the camera of `FILE[#PICTURE][, OPTION = VALUE, …]`, of a picture, or else that of a
/// photograph by its path.
pub fn camera(
    spec: &Path,
    picture: Option<&str>,
    photo: Option<&str>,
) -> Result<CameraFile, Failure> {
    let read = NamedCamera::parse(spec).and_then(|named| named.of(picture).read(photo));
    read.map_err(|f| Failure::Plain(f.message, f.hint))
}

/// Returns what a camera of the command line depends on: the bytes of its files, and the options.
pub fn camera_bytes(spec: &Path) -> Vec<u8> {
    NamedCamera::parse(spec).map_or_else(|_| Vec::new(), |named| named.bytes())
}

/// The path of the first picture that a job observes.
fn picture_of(program: &Program, job: &Job) -> Option<String> {
    let data = program.interface().data;
    let is_picture = |name: &str| {
        let kind = data.iter().find(|d| d.name == name).and_then(|d| d.ty.as_deref());
        matches!(kind, Some("image" | "mask" | "depth"))
    };
    let mut all = job.observe.iter().filter_map(|spec| named(program, spec).ok());
    all.find(|(name, _)| is_picture(name)).map(|(_, path)| path)
}

/// Opens the program, with its parameters.
pub fn without_camera(inputs: &Inputs, quiet: bool) -> Result<Program, Failure> {
    let mut program = match &*inputs.program {
        STDIN => typed(&inputs.allowed.allow_read)?,
        path => Program::open_allowing(path, &inputs.allowed.allow_read)?,
    };
    if !quiet {
        for path in
            program.embedded().iter().filter(|p| p.ends_with(".pcad") && !p.starts_with("std/"))
        {
            error_line!("note: using the shipped {path}");
        }
    }
    let limits =
        inputs.allowed.limits.iter().try_fold(Bounds::default(), |l, (name, n)| l.with(name, *n));
    program = program.limits(limits.map_err(plain)?);
    if let Some(folder) = &inputs.who.models {
        networks::choose(finder(Some(folder))?);
    }
    if let Some(n) = inputs.who.person {
        program = program.set("person", &n.to_string());
    }
    for (name, value) in &inputs.sets {
        program = program.set(name, value);
    }
    if let Some(spec) = &inputs.edges {
        program = program.detector(detector(spec)?);
    }
    Ok(program)
}

/// Reads a photograph.
pub fn photo(path: &Path) -> Result<Photo, Failure> {
    let bytes = files::read(path)?;
    vision::photo::decode(&bytes, &vision::Limits::default())
        .map_err(|e| plain(format!("{}: {e}", path.display())))
}

/// Binds the files of `--observe`, `--keypoints` and `--observe-contours`, and points out
/// what the command line does in the photograph. Returns the name and the value of the
/// photograph, if one is among them.
pub fn observe(
    mut program: Program,
    job: &Job,
) -> Result<(Program, Option<(String, Value)>), Failure> {
    let mut image: Option<(String, Value)> = None;
    let mut stem: Option<String> = None;
    let mut detected: Vec<(String, String)> = Vec::new();
    for spec in &job.observe {
        let (name, path) = named(&program, spec)?;
        let kind =
            program.interface().data.iter().find(|d| d.name == name).and_then(|d| d.ty.clone());
        match kind.as_deref() {
            Some("image") => {
                let photo = Value::object(ImageValue::photo(photo(Path::new(&path))?));
                program = program.observe(&name, photo.clone());
                stem = Path::new(&path).file_stem().and_then(|s| s.to_str()).map(str::to_owned);
                image = Some((name, photo));
            }
            // The entry of the file may depend on the photograph, which may come later.
            Some("keypoints") => detected.push((name, path)),
            other => {
                program = match entry(&path) {
                    Some((file, id)) => {
                        let value = part(other.unwrap_or("json"), &path, file, id)?;
                        program.observe(&name, value)
                    }
                    None => program.observe_file(&name, &path)?,
                }
            }
        }
    }
    if let Some(path) = &job.keypoints {
        detected.push((only(&program, "keypoints", "--keypoints")?, path.clone()));
    }
    for (name, path) in detected {
        let bytes = files::read(Path::new(standard::table().path_of("keypoints", &path)))?;
        let found = scene::data::load_keypoints(&path, &bytes, stem.as_deref());
        program = program.observe(&name, found.map_err(|f| Failure::Plain(f.message, f.hint))?);
    }
    if let Some(path) = &job.observe_contours {
        let map = ContourMap::from_photo(&photo(path)?);
        let name = match &image {
            Some((name, _)) => name.clone(),
            None => only(&program, "image", "--observe")?,
        };
        let photo =
            image.as_ref().and_then(|(_, i)| i.downcast::<ImageValue>()?.as_photo().cloned());
        let contours = Value::object(ImageValue::contours(map, photo));
        program = program.observe(&name, contours.clone());
        image = image.map(|(name, _)| (name, contours));
    }
    if let Some(option) = job.inputs.hint.option() {
        let Some((name, _)) = image else {
            return Err(plain(format!("{option} needs a photograph: --observe FILE")));
        };
        let hinted = program.hint(job.inputs.hint.read()?);
        program = hinted.map_err(|f| Failure::Plain(f.message, f.hint))?;
        let value = program.observed().find(|(n, _)| *n == name).map(|(_, v)| v.clone());
        image = value.map(|v| (name, v));
    }
    Ok((program, image))
}

/// Splits `FILE#ID` into file and entry. If a file with the whole name exists, it is
/// meant.
fn entry(path: &str) -> Option<(&str, &str)> {
    path.rsplit_once('#')
        .filter(|(file, id)| !file.is_empty() && !id.is_empty() && !Path::new(path).exists())
}

/// Returns the file of `[NAME=]FILE[#ID]`.
pub fn file_of(spec: &str) -> &str {
    let path = match spec.split_once('=') {
        Some((name, path)) if is_name(name) => path,
        _ => spec,
    };
    entry(path).map_or(path, |(file, _)| file)
}

/// Loads one entry of a JSON object as data of a kind.
fn part(kind: &str, called: &str, file: &str, id: &str) -> Result<Value, Failure> {
    let all: serde_json::Value = serde_json::from_slice(&files::read(Path::new(file))?)
        .map_err(|e| plain(format!("{file}: {e}")))?;
    let found = all.get(id).ok_or_else(|| plain(format!("{file}: no entry {id:?}")))?;
    let alone = |other: &str| {
        Err(format!(
            "{called} refers to {other}, but an entry of a JSON file cannot refer to other files"
        ))
    };
    standard::table()
        .load(kind, called, found.to_string().as_bytes(), &Options::default(), &alone)
        .map_err(|e| Failure::Plain(e.message, e.hint))
}

/// Returns whether a text can be the name of a `data` item.
fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '/')
}

/// Returns the name and path of `NAME=FILE`; the name may be omitted if only one item
/// fits.
pub fn named(program: &Program, spec: &str) -> Result<(String, String), Failure> {
    if let Some((name, path)) = spec.split_once('=')
        && is_name(name)
    {
        return Ok((name.to_owned(), path.to_owned()));
    }
    let data = program.interface().data;
    let open: Vec<_> = data.iter().filter(|d| !d.has_default).collect();
    if let [one] = open[..] {
        return Ok((one.name.clone(), spec.to_owned()));
    }
    only(program, "image", "--observe").map(|name| (name, spec.to_owned()))
}

/// Returns the only `data` item of a kind, for an option without a name.
fn only(program: &Program, kind: &str, option: &str) -> Result<String, Failure> {
    let data = program.interface().data;
    let fit: Vec<&str> =
        data.iter().filter(|d| d.ty.as_deref() == Some(kind)).map(|d| d.name.as_str()).collect();
    let (one, many) = if kind == "image" { ("image", "images") } else { (kind, kind) };
    match fit[..] {
        [one] => Ok(one.to_owned()),
        [] if data.is_empty() => {
            Err(plain(format!("the program has no `data` items; omit {option}")))
        }
        [] => {
            let names: Vec<&str> = data.iter().map(|d| d.name.as_str()).collect();
            let hint = match kind {
                "keypoints" => "declare one: data points = keypoints();".to_owned(),
                _ => format!("name the item: --observe NAME=FILE, one of {}", names.join(", ")),
            };
            Err(Failure::Plain(format!("the program observes no {one}"), Some(hint)))
        }
        _ => Err(Failure::Plain(
            format!("the program observes several {many}"),
            Some(format!("name the item: --observe NAME=FILE, one of {}", fit.join(", "))),
        )),
    }
}

/// The detector that was read last, with its argument, so that a command that runs a
/// program many times reads it once.
static LAST: Mutex<Option<(String, DetectorValue)>> = Mutex::new(None);

/// Splits `FILE[, OPTION = VALUE, …]` into the file and the options. If a file with the
/// whole name exists, it is meant.
fn detector_parts(spec: &str) -> (&str, &str) {
    match spec.split_once(',') {
        Some((file, options)) if !Path::new(spec).exists() => (file.trim(), options.trim()),
        _ => (spec, ""),
    }
}

/// Returns the file of `FILE[, OPTION = VALUE, …]`.
pub fn detector_file(spec: &str) -> &Path {
    Path::new(detector_parts(spec).0)
}

/// Loads the detector of `FILE[, OPTION = VALUE, …]`; the options are those of `detector`
/// in a program.
pub fn detector(spec: &str) -> Result<DetectorValue, Failure> {
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, known)) = last.as_ref().filter(|(s, _)| s == spec) {
        return Ok(known.clone());
    }
    let (file, text) = detector_parts(spec);
    let options = detector_options(text)?;
    let bytes = files::read(Path::new(file))?;
    let alone = |other: &str| {
        Err(format!("{file} refers to {other}, but a detector must be a single file"))
    };
    let loaded = standard::table().load("detector", file, &bytes, &options, &alone);
    let loaded = loaded.map_err(|f| Failure::Plain(f.message, f.hint))?;
    let detector = loaded.downcast::<DetectorValue>().cloned().unwrap_or_default();
    *last = Some((spec.to_owned(), detector.clone()));
    Ok(detector)
}

/// Parses options such as `colours = "bgr", white = 255` as the arguments of a call.
fn detector_options(text: &str) -> Result<Options, Failure> {
    kind_options("detector", text).map_err(|f| {
        let hint = f.hint.or_else(|| {
            Some("for example --edges 'network.onnx, colours = \"bgr\", white = 255'".into())
        });
        Failure::Plain(format!("--edges: {} (`{text}`)", f.message), hint)
    })
}

/// Returns what contours depend on besides the picture: the bytes of the file, and the
/// options.
pub fn detector_bytes(spec: Option<&str>) -> Result<Vec<u8>, Failure> {
    let Some(spec) = spec else { return Ok(Vec::new()) };
    let mut all = files::read(detector_file(spec))?;
    all.extend(detector_parts(spec).1.as_bytes());
    Ok(all)
}

/// Landmark networks in a folder, the best first.
const LANDMARKS: [&str; 3] =
    ["pose_landmark_heavy.tflite", "pose_landmark_full.tflite", "pose_landmark_lite.tflite"];
const DETECTION: &str = "pose_detection.tflite";

/// Reads a file that is kept as long as the process runs.
fn kept(path: &Path) -> Result<&'static [u8], Failure> {
    Ok(files::read(path)?.leak())
}

/// Loads the networks of a folder, or else the built-in ones.
pub fn finder(folder: Option<&Path>) -> Result<PeopleFinder, Failure> {
    let (detection, landmarks, from) = match folder {
        None => {
            let (detection, landmarks) = networks::files();
            (detection, landmarks, "the program's own".to_owned())
        }
        Some(folder) => {
            let best =
                LANDMARKS.iter().map(|n| folder.join(n)).find(|p| p.exists()).ok_or_else(|| {
                    plain(format!(
                        "{}: none of {} was found",
                        folder.display(),
                        LANDMARKS.join(", ")
                    ))
                })?;
            // The detection network is the same for all landmark networks.
            let path = folder.join(DETECTION);
            let detection = match path.exists() {
                true => kept(&path)?,
                false => networks::files().0,
            };
            (detection, kept(&best)?, folder.display().to_string())
        }
    };
    PeopleFinder::new(detection, landmarks).map_err(|e| plain(format!("{from}: {e}")))
}
