//! The kinds of data that the scene brings: photographs, maps, bodies, meshes, keypoints,
//! detectors.

use super::{
    ArmatureValue, DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue, SolidValue,
    left_out,
};
use pcadlang_engine::lang::builtins::data::{
    DataFormat, FILE, Literal, Options, ReadRelative, kind, unreadable,
};
use pcadlang_engine::lang::builtins::{Arg, Default, Row, Type, arg, flag, num, opt, word};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::armature::{Armature, morphs_from_json, rig_from_json};
use pcadlang_scene::geom::{FileFrame, GeomError, MeshFile, Solid, UpAxis, gltf, not_an_armature};
use pcadlang_scene::vision::keypoints::{self, Keypoints, People};
use pcadlang_scene::vision::{ContourMap, Limits, VisionError, depth, mask, photo};
use std::sync::Arc;

const PATH: Arg = arg("file", Type::Str, "The path, relative to the program's folder.");

const UP: Arg = word("up", &["y", "x", "z"], "The file's up axis; it is rotated to +y.");

const UNIT: Arg =
    num("unit", 1.0, "The length of the file's unit in scene units: 0.01 for centimetres.")
        .unit("m");

const BODY_POSE: Arg = word(
    "pose",
    &["bind", "file"],
    "The rest pose of a glTF file: that in which its mesh was bound to the joints, or that of \
     its nodes.",
);

const MESH_POSE: Arg = word(
    "pose",
    &["file", "bind"],
    "The pose of a glTF file with a skin: that of its nodes, as viewers show it, or that in \
     which the mesh was bound to the joints.",
);

/// The frame of a camera's file.
pub(super) const FRAME_OPTIONS: [Arg; 2] = [
    word(
        "up",
        &["y", "x", "z", "-y"],
        "The up axis of the file's world; it is rotated to +y. A camera's own frame has \"-y\" up.",
    ),
    UNIT,
];

const NETWORK: &[Arg] = &[
    opt("file", Type::Str, "none", "The path, relative to the program's folder."),
    word("colours", &["rgb", "bgr"], "The order of the network's input channels."),
    num(
        "white",
        1.0,
        "The value of white, above 0; the network's input is (value - mean) / spread.",
    ),
    arg("mean", Type::Any, "The mean to subtract: a number, or one per channel.")
        .or(Default::Num(0.0)),
    arg("spread", Type::Any, "The divisor: a number, or one per channel.").or(Default::Num(1.0)),
    opt(
        "output",
        Type::Any,
        "the last",
        "The output to use as the map: its name, or its number from 1.",
    ),
    flag("logits", "Whether the map holds log odds instead of probabilities."),
    word("shows", &["contours", "objects"], "What the map shows."),
];

/// Contour detectors from files, which the crate `contour_detectors` reads.
pub const DETECTOR: Row = kind(
    "detector",
    NETWORK,
    Type::Object("a detector"),
    "A contour detector for photographs, for `scene.edges`: an OpenCV structured forest \
     (`model.yml.gz`), or a network (`.onnx`), to which the options apply; files need a build \
     with the feature `contour_detectors`. Without a file, the built-in detector. See \
     `docs/howto/detectors.md`.",
    || Arc::new(NoFiles),
);

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
    kind(
        "mask",
        &[
            PATH,
            opt(
                "label",
                Type::Int,
                "none",
                "The grey value, number or palette entry of the object.",
            ),
        ],
        Type::Object("a mask"),
        "A mask, a picture or `.npy`: bright pixels are the object; if there are none, those that \
         are not 0, as in a palette (where 255 is \"void\" beside other entries).",
        || Arc::new(MaskFile),
    ),
    kind(
        "depth",
        &[
            PATH,
            num(
                "missing",
                0.0,
                "The number that means \"not measured\", before scaling, like NaN.",
            ),
            opt(
                "scale",
                Type::Num,
                "1000 for whole numbers, 1 for others",
                "How much of a number is one scene unit: 1000 for millimetres (Kinect, RealSense), \
                 5000 for TUM's, 1000 over `depth_scale` for BOP's, in metres.",
            ),
        ],
        Type::Object("a depth map"),
        "A depth map: `.npy`, or a grey picture of 16 bits or more, PNG, TIFF or OpenEXR. 0 is not measured; `inf` is background, and \
         so are negative numbers, and 0 if another number is `missing`.",
        || Arc::new(DepthFile),
    ),
    DETECTOR,
    super::camera_file::ROW,
    kind(
        "armature",
        &[PATH, UP, UNIT, BODY_POSE],
        Type::Object("an armature"),
        "A body: a glTF file (`.glb`, `.gltf`) with a skin, or a JSON rig file, with its mesh and \
         morphs in the same folder: see `docs/howto/bodies.md`. The options apply to glTF.",
        || {
            Arc::new(Shape {
                load: armature,
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
        "A person's joints from a pose detector: OpenPose, MMPose, AlphaPose, Ultralytics, RTMLib, \
         MediaPipe, DeepLabCut, SLEAP, COCO's layout or the program's own (see \
         `docs/reference/formats.md`); without a file, no joints.",
        || Arc::new(KeypointsFile),
    ),
    kind(
        "mesh",
        &[PATH, UP, UNIT, MESH_POSE],
        Type::Object("a solid"),
        "A mesh: OBJ, each object or group a part; STL; PLY; or the default scene of a glTF file \
         (`.glb`, `.gltf`), each node with a mesh a part. Closed bodies that are inside out are \
         turned over, and said.",
        || Arc::new(Shape { load: mesh, example: "mesh(\"file.stl\", up = \"z\", unit = 0.001)" }),
    ),
];

/// A format that needs nothing but the bytes.
#[derive(Debug)]
struct Plain(fn(&[u8], &Limits) -> Result<Value, VisionError>);

impl DataFormat for Plain {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        _: &Options,
        _: &ReadRelative,
    ) -> Result<Value, Fault> {
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

/// A mask, of one label or of all.
#[derive(Debug)]
struct MaskFile;

impl DataFormat for MaskFile {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        _: &ReadRelative,
    ) -> Result<Value, Fault> {
        let label = number(options, "label").map(|n| n as u32);
        mask::decode(bytes, label, &Limits::default())
            .map(|m| Value::object(MaskValue::new(m)))
            .map_err(|e| unreadable(file, &e.to_string()))
    }

    fn check_option(&self, _: &str, value: &Literal) -> Result<(), String> {
        match value {
            Literal::Num(n) if *n >= 0.0 && n.fract() == 0.0 && *n <= f64::from(u32::MAX) => Ok(()),
            _ => Err("`label` must be a whole number of at least 0".into()),
        }
    }

    fn example(&self) -> Option<&'static str> {
        Some("mask(\"file.png\", label = 3)")
    }
}

/// Depths, and the number that means that one was not measured.
#[derive(Debug)]
struct DepthFile;

impl DataFormat for DepthFile {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        _: &ReadRelative,
    ) -> Result<Value, Fault> {
        let scale = number(options, "scale");
        let missing = number(options, "missing").unwrap_or(0.0);
        depth::decode(bytes, scale, missing, &Limits::default())
            .map(|d| Value::object(DepthValue::new(d)))
            .map_err(|e| unreadable(file, &e.to_string()))
    }

    fn check_option(&self, name: &str, value: &Literal) -> Result<(), String> {
        match (name, value) {
            ("scale", Literal::Num(x)) if *x > 0.0 && x.is_finite() => Ok(()),
            ("scale", _) => Err("`scale` must be a positive number".into()),
            (_, Literal::Num(_)) => Ok(()),
            _ => Err(format!("`{name}` must be a number")),
        }
    }

    fn example(&self) -> Option<&'static str> {
        Some("depth(\"file.png\", missing = 0, scale = 1000)")
    }
}

/// The option of this name, if it is a number.
fn number(options: &Options, name: &str) -> Option<f64> {
    match options.get(name) {
        Some(Literal::Num(x)) => Some(*x),
        _ => None,
    }
}

/// Contour detectors of builds that read none from files.
#[derive(Debug)]
struct NoFiles;

impl DataFormat for NoFiles {
    fn load(&self, file: &str, _: &[u8], _: &Options, _: &ReadRelative) -> Result<Value, Fault> {
        Err(left_out(&format!("{file}: contour detectors from files"), "contour_detectors"))
    }

    fn without_file(&self) -> Option<Value> {
        Some(Value::object(DetectorValue::default()))
    }
}

/// How a file of a mesh or an armature is to be read.
pub(super) struct As {
    pub(super) frame: FileFrame,
    /// The pose, if the program says which.
    pose: Option<gltf::Pose>,
}

/// A mesh or an armature, in a frame of its own.
#[derive(Debug)]
struct Shape {
    load: fn(&str, &[u8], &As, &ReadRelative) -> Result<Value, GeomError>,
    example: &'static str,
}

impl DataFormat for Shape {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        beside: &ReadRelative,
    ) -> Result<Value, Fault> {
        let how = how(options).map_err(|why| unreadable(file, &why))?;
        (self.load)(file, bytes, &how, beside).map_err(|e| unreadable(file, &e.to_string()))
    }

    fn check_option(&self, name: &str, value: &Literal) -> Result<(), String> {
        how(&Options::single(name, value.clone())).map(|_| ())
    }

    fn example(&self) -> Option<&'static str> {
        Some(self.example)
    }
}

fn mesh(file: &str, bytes: &[u8], how: &As, beside: &ReadRelative) -> Result<Value, GeomError> {
    let value =
        |mesh, remarks| Value::object(SolidValue::read(Solid::new(Arc::new(mesh)), remarks));
    if gltf::is_gltf(file, bytes) {
        let pose = how.pose.unwrap_or(gltf::Pose::File);
        let mut loaded = gltf::load(bytes, &how.frame, pose, beside)?.outward();
        let remarks = std::mem::take(&mut loaded.remarks);
        return Ok(value(loaded.mesh()?, remarks));
    }
    let mut read = MeshFile::read(file, bytes)?.placed(&how.frame).outward();
    let remarks = std::mem::take(&mut read.remarks);
    Ok(value(read.mesh()?, remarks))
}

/// Reads a glTF file, or a rig, its mesh, and its morphs if it names some.
fn armature(file: &str, bytes: &[u8], how: &As, beside: &ReadRelative) -> Result<Value, GeomError> {
    let invalid = |why: &str| GeomError::Invalid(why.to_owned());
    let value = |body: Armature, remarks| Value::object(ArmatureValue::read(body, remarks));
    if gltf::is_gltf(file, bytes) {
        let pose = how.pose.unwrap_or_default();
        let mut loaded = gltf::load(bytes, &how.frame, pose, beside)?.outward();
        if loaded.rig.is_none() {
            return Err(invalid(
                "the glTF file has no skin, so it does not define which joint moves which \
                 vertices; read it with mesh(…) and rig it with scene.autorig",
            ));
        }
        let remarks = std::mem::take(&mut loaded.remarks);
        return Ok(value(loaded.armature()?, remarks));
    }
    if let Some(why) = not_an_armature(file, bytes) {
        return Err(GeomError::Invalid(why));
    }
    if how.frame != FileFrame::default() || how.pose.is_some() {
        return Err(invalid(
            "`up`, `unit` and `pose` are for glTF files; a rig file is in the scene's axes and \
             units",
        ));
    }
    let file = rig_from_json(bytes)?;
    let within = |path: &str, e: GeomError| GeomError::Invalid(format!("{path}: {e}"));
    let read = |path: &str| beside(path).map_err(GeomError::Invalid);
    let mesh = MeshFile::read(&file.mesh, &read(&file.mesh)?).map_err(|e| within(&file.mesh, e))?;
    let mesh = mesh.outward();
    let rig = file.rig.clone();
    let mut body = Armature::new(file.rig, mesh.positions, mesh.triangles, file.influences)?;
    if let Some(path) = &file.morphs {
        let morphs = morphs_from_json(&read(path)?, &rig).map_err(|e| within(path, e))?;
        body = body.with_morphs(morphs).map_err(|e| within(path, e))?;
    }
    Ok(value(body, mesh.remarks))
}

/// A person's joints; `#ID` after the path selects the person.
#[derive(Debug)]
struct KeypointsFile;

impl DataFormat for KeypointsFile {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        _: &Options,
        _: &ReadRelative,
    ) -> Result<Value, Fault> {
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

/// The axes, the unit and the pose of a mesh file.
///
/// # Errors
/// A value that does not fit: a message for the user.
pub(super) fn how(options: &Options) -> Result<As, String> {
    let (mut up, mut unit, mut pose) = (UpAxis::default(), 1.0, None);
    for (name, value) in options.iter() {
        match (name, value) {
            ("up", Literal::Str(axis)) => {
                up = match &**axis {
                    "x" => UpAxis::X,
                    "y" => UpAxis::Y,
                    "z" => UpAxis::Z,
                    "-y" => UpAxis::MinusY,
                    other => {
                        return Err(format!("`up` must be \"x\", \"y\" or \"z\", not \"{other}\""));
                    }
                };
            }
            ("up", _) => return Err("`up` must be an axis in quotes".into()),
            ("unit", Literal::Num(x)) => unit = *x,
            ("unit", _) => return Err("`unit` must be a literal number".into()),
            ("pose", Literal::Str(s)) if **s == *"bind" => pose = Some(gltf::Pose::Bind),
            ("pose", Literal::Str(s)) if **s == *"file" => pose = Some(gltf::Pose::File),
            ("pose", _) => return Err("`pose` must be \"bind\" or \"file\"".into()),
            _ => {}
        }
    }
    FileFrame::new(up, unit).map(|frame| As { frame, pose }).map_err(|e| e.to_string())
}
