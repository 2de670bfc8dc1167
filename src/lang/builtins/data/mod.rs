//! Data: the types of a `data` item, and the loaders that read them from a file's bytes.
//!
//! The names are built-ins so that they are documented and checked like any other; a
//! program cannot call them on computed values, because the files of a run must be known
//! before it starts. The host decides which files may be read and where they are: this
//! module only receives bytes.

mod armature;
mod csv;
mod json;
mod options;

pub use options::{Options, has_options};

use super::scene::{DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue, SolidValue};
use super::{Arg, Args, Row, Type, arg, function, opt};
use crate::geom::{GeomError, Solid, gltf, obj};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use crate::vision::keypoints::{self, Keypoints, People};
use crate::vision::{ContourMap, FileDetector, Limits, VisionError, depth, mask, npy, photo};

const SECTION: &str = "Data files";

/// Reads a file by its path relative to that of another file, or returns an error
/// message.
pub type Beside<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

const FILE: &[Arg] = &[arg("file", Type::Str, "The path, relative to the program's folder.")];

const SHAPE: &[Arg] = &[
    arg("file", Type::Str, "The path, relative to the program's folder."),
    opt(
        "up",
        Type::Str,
        "\"y\"",
        "The file's up axis: \"x\", \"y\" or \"z\"; it is rotated to +y.",
    ),
    opt(
        "unit",
        Type::Num,
        "1",
        "The length of the file's unit in scene units: 0.01 for centimetres.",
    )
    .unit("m"),
];

const NETWORK: &[Arg] = &[
    opt("file", Type::Str, "none", "The path, relative to the program's folder."),
    opt(
        "colours",
        Type::Str,
        "\"rgb\"",
        "The order of the network's input channels, \"rgb\" or \"bgr\".",
    ),
    opt(
        "white",
        Type::Num,
        "1",
        "The value of white, above 0; the network's input is (value - mean) / spread.",
    ),
    opt("mean", Type::Any, "0", "The mean to subtract: a number, or one per channel."),
    opt("spread", Type::Any, "1", "The divisor: a number, or one per channel."),
    opt(
        "output",
        Type::Any,
        "the last",
        "The output to use as the map: its name, or its number from 1.",
    ),
    opt("logits", Type::Bool, "false", "Whether the map holds log odds instead of probabilities."),
    opt("shows", Type::Str, "\"contours\"", "What the map shows, \"contours\" or \"objects\"."),
];

const fn kind(name: &'static str, returns: Type, doc: &'static str) -> Row {
    function(name, SECTION, FILE, returns, doc, not_an_expression)
}

pub(super) const TABLE: &[Row] = &[
    kind(
        "csv",
        Type::Record,
        "A table with a header line: a record of columns, numbers, bools or strings.",
    ),
    kind("json", Type::Any, "JSON: objects are records, null is nothing."),
    kind(
        "image",
        Type::Object("an image"),
        "A photograph, PNG or JPEG; its contours are detected when a likelihood needs them.",
    ),
    kind("contours", Type::Object("an image"), "A contour map: bright pixels are contour."),
    kind("mask", Type::Object("a mask"), "A mask: bright pixels are the object."),
    kind(
        "depth",
        Type::Object("a depth map"),
        "A depth map: `.npy`, or a 16-bit PNG in thousandths of a scene unit.",
    ),
    function(
        "detector",
        SECTION,
        NETWORK,
        Type::Object("a detector"),
        "A contour detector for photographs, for `scene.edges`: an OpenCV structured forest \
         (`model.yml.gz`), or a network (`.onnx`; only in builds with the feature `onnx`), to \
         which the options apply; without a file, the built-in detector. See `docs/detectors.md`.",
        not_an_expression,
    ),
    function(
        "armature",
        SECTION,
        SHAPE,
        Type::Object("an armature"),
        "A body: a glTF file (`.glb`, `.gltf`) with a skin, or a JSON rig file, with its mesh and \
         morphs in the same folder: see `docs/bodies.md`. `up` and `unit` apply to glTF.",
        not_an_expression,
    ),
    function(
        "keypoints",
        SECTION,
        &[opt(
            "file",
            Type::Str,
            "none",
            "The path, relative to the program's folder; a suffix `#ID` selects a person.",
        )],
        Type::Object("keypoints"),
        "A person's joints from a pose detector, JSON in the program's own layout, COCO's or \
         MediaPipe's; without a file, no joints.",
        not_an_expression,
    ),
    function(
        "mesh",
        SECTION,
        SHAPE,
        Type::Object("a solid"),
        "A Wavefront OBJ mesh, each object or group a part, or the default scene of a glTF file \
         (`.glb`, `.gltf`), each node with a mesh a part.",
        not_an_expression,
    ),
];

fn not_an_expression(a: &Args) -> Result<Value, Fault> {
    let name = &a.builtin.name;
    let message = format!("{name}: only `data` items can read files");
    Err(Fault::new(FaultKind::Other, message)
        .with_hint(format!("write `data d = {name}(\"file\");` at the top level")))
}

/// Returns the kinds of data that [`load`] reads: the names allowed after the colon of
/// `data d: kind;`.
pub fn kinds() -> impl Iterator<Item = &'static str> + Clone {
    TABLE.iter().map(|b| b.name)
}

/// Returns the value of a data item without a file, for the kinds that allow it: empty
/// keypoints, the built-in detector.
pub fn without_file(kind: &str) -> Option<Value> {
    match kind {
        "keypoints" => Some(Value::object(KeypointsValue(Keypoints::default()))),
        "detector" => Some(Value::object(DetectorValue::default())),
        _ => None,
    }
}

/// Returns the path of the file to read: for keypoints, without the `#ID` that selects a
/// person.
pub fn path_of<'a>(kind: &str, file: &'a str) -> &'a str {
    if kind == "keypoints" { keypoints::split_id(file).0 } else { file }
}

/// Reads keypoints from the bytes of a file: of the person selected by `#ID` at the end
/// of `file`, or else by `picture`, the name of the picture's file, or else of the only
/// person.
///
/// # Errors
/// Those of [`People::parse`] and [`People::pick`], with the file's name.
pub fn load_keypoints(file: &str, bytes: &[u8], picture: Option<&str>) -> Result<Value, Fault> {
    let (path, id) = keypoints::split_id(file);
    let found = People::parse(bytes).and_then(|people| people.pick(id, picture));
    found.map(|k| Value::object(KeypointsValue(k))).map_err(|e| {
        let fault = Fault::new(FaultKind::Other, format!("{path}: {}", e.message));
        e.hint.into_iter().fold(fault, Fault::with_hint)
    })
}

/// Reads data of a kind from the bytes of a file. `file` is its name in messages,
/// `beside` reads files by paths relative to it, and `options` come from the item's
/// default call.
///
/// # Errors
/// An unknown kind, or bytes that are not of that kind: a message with the line number if
/// the format has lines.
pub fn load(
    kind: &str,
    file: &str,
    bytes: &[u8],
    options: &Options,
    beside: &Beside,
) -> Result<Value, Fault> {
    let limits = Limits::default();
    let text = |e: VisionError| e.to_string();
    let loaded = match kind {
        "csv" => csv::parse(bytes),
        "json" => json::parse(bytes),
        "image" => {
            photo::decode(bytes, &limits).map(|p| Value::object(ImageValue::photo(p))).map_err(text)
        }
        "contours" => photo::decode(bytes, &limits)
            .map(|p| ContourMap::from_image(&image::DynamicImage::from(p.rgb().clone()).to_luma8()))
            .map(|m| Value::object(ImageValue::contours(m, None)))
            .map_err(text),
        "mask" => {
            mask::decode(bytes, &limits).map(|m| Value::object(MaskValue::new(m))).map_err(text)
        }
        "depth" => {
            // A NumPy array holds depths; the integers of a picture are thousandths of a
            // scene unit.
            let scale = if npy::is_npy(bytes) { 1.0 } else { 1000.0 };
            depth::decode(bytes, scale, &limits)
                .map(|d| Value::object(DepthValue::new(d)))
                .map_err(text)
        }
        "detector" => FileDetector::read(bytes, options.network())
            .map(|d| Value::object(DetectorValue(Some(d.into()))))
            .map_err(text),
        "armature" => armature::load(file, bytes, options, beside),
        "keypoints" => return load_keypoints(file, bytes, None),
        "mesh" => {
            let mesh = if gltf::is_gltf(file, bytes) {
                gltf::load(bytes, &options.frame(), beside).and_then(gltf::Loaded::mesh)
            } else {
                obj::load_in(bytes, &options.frame())
            };
            mesh.map(|m| Value::object(SolidValue(Solid::lasting(m))))
                .map_err(|e: GeomError| e.to_string())
        }
        _ => {
            let fault = Fault::type_error(format!("there is no data of type `{kind}`"));
            return Err(fault.with_nearest(kind, "there are", kinds()));
        }
    };
    loaded.map_err(|why| Fault::new(FaultKind::Other, format!("{file}: {why}")))
}
