//! The kinds of data that the scene brings: photographs, maps, bodies, meshes, keypoints,
//! detectors.

mod armature;
mod options;

use super::{DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue, SolidValue};
use pcadlang_engine::lang::builtins::data::{
    DataFormat, FILE, Literal, Options, Siblings, kind, unreadable,
};
use pcadlang_engine::lang::builtins::{Arg, Row, Type, arg, opt};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::{FileFrame, GeomError, Solid, gltf, obj};
use pcadlang_scene::vision::keypoints::{self, Keypoints, People};
use pcadlang_scene::vision::{
    ContourMap, FileDetector, Limits, VisionError, depth, mask, npy, photo,
};
use std::sync::Arc;

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

pub(super) const TABLE: &[Row] = &[
    kind(
        "image",
        FILE,
        Type::Object("an image"),
        "A photograph, PNG or JPEG; its contours are detected when a likelihood needs them.",
        || Arc::new(Plain(image)),
    ),
    kind(
        "contours",
        FILE,
        Type::Object("an image"),
        "A contour map: bright pixels are contour.",
        || Arc::new(Plain(contours)),
    ),
    kind("mask", FILE, Type::Object("a mask"), "A mask: bright pixels are the object.", || {
        Arc::new(Plain(mask))
    }),
    kind(
        "depth",
        FILE,
        Type::Object("a depth map"),
        "A depth map: `.npy`, or a 16-bit PNG in thousandths of a scene unit.",
        || Arc::new(Plain(depth)),
    ),
    kind(
        "detector",
        NETWORK,
        Type::Object("a detector"),
        "A contour detector for photographs, for `scene.edges`: an OpenCV structured forest \
         (`model.yml.gz`), or a network (`.onnx`; only in builds with the feature `onnx`), to \
         which the options apply; without a file, the built-in detector. See `docs/howto/detectors.md`.",
        || Arc::new(DetectorFile),
    ),
    kind(
        "armature",
        SHAPE,
        Type::Object("an armature"),
        "A body: a glTF file (`.glb`, `.gltf`) with a skin, or a JSON rig file, with its mesh and \
         morphs in the same folder: see `docs/howto/bodies.md`. `up` and `unit` apply to glTF.",
        || {
            Arc::new(Shape {
                load: armature::load,
                example: "armature(\"file.glb\", up = \"z\", unit = 0.01)",
            })
        },
    ),
    kind(
        "keypoints",
        &[opt(
            "file",
            Type::Str,
            "none",
            "The path, relative to the program's folder; a suffix `#ID` selects a person.",
        )],
        Type::Object("keypoints"),
        "A person's joints from a pose detector, JSON in the program's own layout, COCO's or \
         MediaPipe's; without a file, no joints.",
        || Arc::new(KeypointsFile),
    ),
    kind(
        "mesh",
        SHAPE,
        Type::Object("a solid"),
        "A Wavefront OBJ mesh, each object or group a part, or the default scene of a glTF file \
         (`.glb`, `.gltf`), each node with a mesh a part.",
        || Arc::new(Shape { load: mesh, example: "mesh(\"file.glb\", up = \"z\", unit = 0.01)" }),
    ),
];

/// A format that needs nothing but the bytes.
#[derive(Debug)]
struct Plain(fn(&[u8], &Limits) -> Result<Value, VisionError>);

impl DataFormat for Plain {
    fn load(&self, file: &str, bytes: &[u8], _: &Options, _: &Siblings) -> Result<Value, Fault> {
        (self.0)(bytes, &Limits::default()).map_err(|e| unreadable(file, &e.to_string()))
    }
}

fn image(bytes: &[u8], limits: &Limits) -> Result<Value, VisionError> {
    photo::decode(bytes, limits).map(|p| Value::object(ImageValue::photo(p)))
}

fn contours(bytes: &[u8], limits: &Limits) -> Result<Value, VisionError> {
    photo::decode(bytes, limits)
        .map(|p| Value::object(ImageValue::contours(ContourMap::from_photo(&p), None)))
}

fn mask(bytes: &[u8], limits: &Limits) -> Result<Value, VisionError> {
    mask::decode(bytes, limits).map(|m| Value::object(MaskValue::new(m)))
}

fn depth(bytes: &[u8], limits: &Limits) -> Result<Value, VisionError> {
    // An array holds depths; a picture's whole numbers are thousandths.
    let scale = if npy::is_npy(bytes) { 1.0 } else { 1000.0 };
    depth::decode(bytes, scale, limits).map(|d| Value::object(DepthValue::new(d)))
}

/// A contour detector.
#[derive(Debug)]
struct DetectorFile;

impl DataFormat for DetectorFile {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        _: &Siblings,
    ) -> Result<Value, Fault> {
        let network = options::network(options).map_err(|why| unreadable(file, &why))?;
        FileDetector::read(bytes, &network)
            .map(|d| Value::object(DetectorValue(Some(d.into()))))
            .map_err(|e| unreadable(file, &e.to_string()))
    }

    fn without_file(&self) -> Option<Value> {
        Some(Value::object(DetectorValue::default()))
    }

    fn check_option(&self, name: &str, value: &Literal) -> Result<(), String> {
        options::network(&Options::single(name, value.clone())).map(|_| ())
    }

    fn example(&self) -> Option<&'static str> {
        Some("detector(\"network.onnx\", colours = \"bgr\", white = 255, logits = true)")
    }
}

/// A mesh or an armature, in a frame of its own.
#[derive(Debug)]
struct Shape {
    load: fn(&str, &[u8], &FileFrame, &Siblings) -> Result<Value, String>,
    example: &'static str,
}

impl DataFormat for Shape {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        beside: &Siblings,
    ) -> Result<Value, Fault> {
        options::frame(options)
            .and_then(|frame| (self.load)(file, bytes, &frame, beside))
            .map_err(|why| unreadable(file, &why))
    }

    fn check_option(&self, name: &str, value: &Literal) -> Result<(), String> {
        options::frame(&Options::single(name, value.clone())).map(|_| ())
    }

    fn example(&self) -> Option<&'static str> {
        Some(self.example)
    }
}

fn mesh(file: &str, bytes: &[u8], frame: &FileFrame, beside: &Siblings) -> Result<Value, String> {
    let mesh = match gltf::is_gltf(file, bytes) {
        true => gltf::load(bytes, frame, beside).and_then(gltf::Loaded::mesh),
        false => obj::load_in(bytes, frame),
    };
    mesh.map(|m| Value::object(SolidValue(Solid::lasting(m)))).map_err(|e: GeomError| e.to_string())
}

/// A person's joints; `#ID` after the path selects the person.
#[derive(Debug)]
struct KeypointsFile;

impl DataFormat for KeypointsFile {
    fn load(&self, file: &str, bytes: &[u8], _: &Options, _: &Siblings) -> Result<Value, Fault> {
        load_keypoints(file, bytes, None)
    }

    fn without_file(&self) -> Option<Value> {
        Some(Value::object(KeypointsValue(Keypoints::default())))
    }

    fn path_of<'a>(&self, path: &'a str) -> &'a str {
        keypoints::split_id(path).0
    }
}

/// Reads keypoints from the bytes of a file: those of the person whom `#ID` at the end of
/// `file` names, or else of the person with the name of the picture, or else of the only
/// person.
///
/// # Errors
/// As [`People::parse`] and [`People::pick`], with the file's name.
pub fn load_keypoints(file: &str, bytes: &[u8], picture: Option<&str>) -> Result<Value, Fault> {
    let (path, id) = keypoints::split_id(file);
    let found = People::parse(bytes).and_then(|people| people.pick(id, picture));
    found.map(|k| Value::object(KeypointsValue(k))).map_err(|e| {
        let fault = Fault::new(FaultKind::Other, format!("{path}: {}", e.message));
        e.hint.into_iter().fold(fault, Fault::with_hint)
    })
}
