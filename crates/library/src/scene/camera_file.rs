//! Camera files: the kind of data `camera`, and `--camera FILE[#PICTURE][, OPTION = VALUE, …]`.

use super::data::{FRAME_OPTIONS, how};
use crate::standard;
use pcadlang_engine::lang::builtins::data::{
    DataFormat, Literal, Options, ReadRelative, kind, unreadable,
};
use pcadlang_engine::lang::builtins::{Arg, Row, Type, arg, opt};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::reach::read_file;
use pcadlang_engine::lang::value::{Object, Value};
use pcadlang_scene::cameras::{Asked, CameraFile, Standpoint};
use pcadlang_syntax::ast::{ExprKind, ItemKind};
use pcadlang_syntax::parse;
use pcadlang_syntax::span::FileId;
use std::any::Any;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const ARGS: &[Arg] = &[
    arg(
        "file",
        Type::Str,
        "The path, relative to the program's folder; a suffix `#PICTURE` selects one of several.",
    ),
    FRAME_OPTIONS[0],
    FRAME_OPTIONS[1],
    opt(
        "at",
        Type::Str,
        "\"file\" if the file has a position, or else \"view\"",
        "Where the camera stands: where the file says, or else at the origin of its own frame \
         (\"file\"), or on the z axis, where the picture's longer side shows 4.4 units (\"view\").",
    ),
];

pub(super) const ROW: Row = kind(
    "camera",
    ARGS,
    Type::Object("a camera"),
    "A camera of OpenCV, ROS, COLMAP, NeRF, BOP, Open3D, RealSense, Kinect, glTF, of a photograph's \
     Exif data, or of this program: see `docs/reference/formats.md`. A lens that distorts must be \
     the run's (`--camera`), by which photographs are undistorted.",
    || Arc::new(Format),
);

/// A camera as a file describes it, before the size of the picture is known.
#[derive(Clone, Debug)]
pub struct CameraFileValue(pub CameraFile);

impl Object for CameraFileValue {
    fn type_name(&self) -> &'static str {
        "a camera"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn remark(&self) -> Option<String> {
        (!self.0.remarks.is_empty()).then(|| self.0.remarks.join("; "))
    }
}

#[derive(Debug)]
struct Format;

impl DataFormat for Format {
    fn load(
        &self,
        file: &str,
        bytes: &[u8],
        options: &Options,
        beside: &ReadRelative,
    ) -> Result<Value, Fault> {
        let (path, picture) = parts(file);
        let read = CameraFile::read(path, bytes, &asked(picture, None, options)?, beside);
        let camera = read.map_err(|e| unreadable(path, &e.to_string()))?;
        if camera.seen(None).is_ok_and(|s| s.lens.is_some()) {
            let why =
                "its lens distorts, or its fx and fy differ, and only a run's camera undistorts";
            let fault = unreadable(path, why);
            return Err(fault.with_hint(format!("give it to the run: --camera {path}")));
        }
        Ok(Value::object(CameraFileValue(camera)))
    }

    fn path_of<'a>(&self, path: &'a str) -> &'a str {
        parts(path).0
    }

    fn check_option(&self, name: &str, value: &Literal) -> Result<(), String> {
        asked(None, None, &Options::single(name, value.clone())).map(|_| ()).map_err(|f| f.message)
    }

    fn example(&self) -> Option<&'static str> {
        Some("camera(\"cameras.txt#photo.jpg\", up = \"z\")")
    }
}

fn asked<'a>(
    picture: Option<&'a str>,
    photo: Option<&'a str>,
    options: &Options,
) -> Result<Asked<'a>, Fault> {
    let at = match options.get("at") {
        None => None,
        Some(Literal::Str(at)) if &**at == "file" => Some(Standpoint::File),
        Some(Literal::Str(at)) if &**at == "view" => Some(Standpoint::View),
        Some(_) => return Err(Fault::type_error("`at` must be \"file\" or \"view\"".to_owned())),
    };
    Ok(Asked { picture, photo, world: how(options).map_err(Fault::type_error)?.frame, at })
}

/// Splits `FILE#PICTURE`; a file of the whole name is preferred.
fn parts(path: &str) -> (&str, Option<&str>) {
    match path.rsplit_once('#') {
        Some((file, picture)) if !file.is_empty() && !Path::new(path).exists() => {
            (file, Some(picture))
        }
        _ => (path, None),
    }
}

/// A camera that was named on a command line.
pub struct NamedCamera {
    file: PathBuf,
    picture: Option<String>,
    options: Options,
}

impl NamedCamera {
    /// Parses `FILE[#PICTURE][, OPTION = VALUE, …]`. Of a folder, COLMAP's files are meant, in it or
    /// in `sparse/0`.
    ///
    /// # Errors
    /// If an option is not one of the kind `camera`.
    pub fn parse(spec: &Path) -> Result<NamedCamera, Fault> {
        let whole =
            || NamedCamera { file: spec.into(), picture: None, options: Options::default() };
        let (Some(text), false) = (spec.to_str(), spec.is_file()) else { return Ok(whole()) };
        let (path, options) = match text.split_once(',') {
            Some((path, options)) => (path.trim(), kind_options("camera", options)?),
            None => (text, Options::default()),
        };
        let (path, picture) = parts(path);
        let mut file = PathBuf::from(path);
        if file.is_dir() {
            let within = ["", "sparse/0"].map(|f| file.join(f));
            let names = ["cameras.bin", "cameras.txt", "transforms.json"];
            let all = within.iter().flat_map(|f| names.map(|n| f.join(n)));
            file = all.into_iter().find(|f| f.is_file()).unwrap_or(file);
        }
        Ok(NamedCamera { file, picture: picture.map(str::to_owned), options })
    }

    /// The same file, of another picture if one is named.
    #[must_use]
    pub fn of(self, picture: Option<&str>) -> NamedCamera {
        let picture = picture.map(str::to_owned).or(self.picture);
        NamedCamera { picture, ..self }
    }

    /// Reads it; the photograph's path selects the picture if none is named.
    ///
    /// # Errors
    /// As [`CameraFile::read`], and if a file cannot be read; with the file's name.
    pub fn read(&self, photo: Option<&str>) -> Result<CameraFile, Fault> {
        let name = self.file.display().to_string();
        let fault = |why: String| Fault::new(FaultKind::Other, why);
        let cannot = |e: std::io::Error| fault(format!("cannot read {name}: {e}"));
        let bytes = read_file(&self.file).map_err(cannot)?;
        let beside = |other: &str| {
            read_file(&self.file.with_file_name(other))
                .map_err(|e| format!("cannot read {other}: {e}"))
        };
        let asked = asked(self.picture.as_deref(), photo, &self.options)?;
        CameraFile::read(&name, &bytes, &asked, &beside).map_err(|e| fault(format!("{name}: {e}")))
    }

    /// The bytes that it depends on: its files, and how they are read.
    pub fn bytes(&self) -> Vec<u8> {
        let read = |file: &Path| read_file(file).unwrap_or_default();
        let mut all = read(&self.file);
        // COLMAP's other file.
        let name = self.file.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        for (own, other) in [("cameras", "images"), ("images", "cameras")] {
            if name.starts_with(own) {
                all.extend(read(&self.file.with_file_name(name.replacen(own, other, 1))));
            }
        }
        if self.picture.is_some() || self.options != Options::default() {
            all.extend(format!("{:?}{:?}", self.picture, self.options).into_bytes());
        }
        all
    }
}

/// Parses options such as `colours = "bgr", white = 255` as the arguments of a kind of data.
///
/// # Errors
/// A text that is not a list of such options.
pub fn kind_options(kind: &str, text: &str) -> Result<Options, Fault> {
    if text.trim().is_empty() {
        return Ok(Options::default());
    }
    let (program, errors) = parse(&format!("data d = {kind}({text});"), FileId(0));
    let args = match program.items.first().map(|i| &i.kind) {
        Some(ItemKind::Data(d)) if errors.is_empty() && program.items.len() == 1 => {
            match d.default.as_ref().map(|e| &e.kind) {
                Some(ExprKind::Call { args, .. }) => Some(args),
                _ => None,
            }
        }
        _ => None,
    };
    let args = args.ok_or_else(|| {
        Fault::type_error(format!("expected the options of a {kind} after the file name"))
    })?;
    standard::table().options(kind, args).map_err(|(_, f)| f)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_a_picture_and_options() {
        let of = |spec: &str| NamedCamera::parse(Path::new(spec));
        let named =
            of("no/such/cameras.txt#a b.jpg, up = \"z\", unit = 0.001, at = \"view\"").unwrap();
        assert_eq!(named.file, Path::new("no/such/cameras.txt"));
        assert_eq!(named.picture.as_deref(), Some("a b.jpg"));
        assert_eq!(named.options.iter().count(), 3);
        for (spec, why) in [
            ("x.json, up = \"w\"", "`up` must be"),
            ("x.json, at = \"here\"", "`at` must be"),
            ("x.json, axis = 1", "no option `axis`"),
            ("x.json, (", "expected the options"),
        ] {
            let said = of(spec).err().unwrap().message;
            assert!(said.contains(why), "{spec}: {said}");
        }
        let said = of("missing.json").unwrap().read(None).unwrap_err().message;
        assert!(said.starts_with("cannot read missing.json"), "{said}");
    }
}
