//! Programs: text on its way to a model.

use crate::errors::{plain, raised};
use crate::host::Host;
use crate::model::Model;
use crate::python_code::Failure;
use crate::values::{from_python, json};
use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pcadlang::Value;
use pcadlang_library::scene::camera_file::NamedCamera;
use pcadlang_library::scene::{ImageValue, data};
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::{AxisHint, Hint, Limits, Mask, Photo, mask};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use serde_json::json as object;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A program with its parameters and data, before it is compiled. Programs do not change: every
/// method returns a new one.
#[pyclass(frozen, module = "pcadlang")]
pub struct Program {
    program: pcadlang::Program,
    /// Where the hosts that were added keep their exceptions.
    failures: Vec<Arc<Failure>>,
}

impl Program {
    fn new(program: pcadlang::Program) -> Program {
        Program { program, failures: Vec::new() }
    }

    fn changed(&self, program: pcadlang::Program) -> Program {
        Program { program, failures: self.failures.clone() }
    }
}

#[pymethods]
impl Program {
    /// Opens a program by its path; the shipped ones (`human.pcad`, `lathe.pcad`, …) are found in
    /// any folder. It may read files below its own folder, and below those in `allow_read`.
    #[staticmethod]
    #[pyo3(signature = (path, *, allow_read = Vec::new()))]
    fn open(path: PathBuf, allow_read: Vec<PathBuf>) -> PyResult<Program> {
        let path = path.to_string_lossy();
        pcadlang::Program::open_allowing(&path, &allow_read).map(Program::new).map_err(raised)
    }

    /// Parses a program from its text. It can include shipped programs, and reads no files.
    #[staticmethod]
    fn parse(text: &str) -> PyResult<Program> {
        pcadlang::Program::parse(text).map(Program::new).map_err(raised)
    }

    /// Sets parameters, by name.
    #[pyo3(signature = (**params))]
    fn set(&self, params: Option<&Bound<'_, PyDict>>) -> PyResult<Program> {
        let mut program = self.program.clone();
        for (name, value) in params.into_iter().flatten() {
            let name = name.extract::<String>()?;
            program = program.set(&name, &written(&value)?);
        }
        Ok(self.changed(program))
    }

    /// Gives data items their values, by name: numbers, lists, dictionaries and arrays as they
    /// are; a path for a file to be read as the item's kind; for an image also a picture of PIL,
    /// or an array of height x width x 3 bytes (height x width for grey), for keypoints also a
    /// dictionary. A program's only image is also called `photo`, its only keypoints `keypoints`.
    #[pyo3(signature = (**data))]
    fn observe(&self, data: Option<&Bound<'_, PyDict>>) -> PyResult<Program> {
        let mut program = self.program.clone();
        // The person in a file of keypoints may have the photograph's name.
        let mut picture = None;
        let mut later = Vec::new();
        for (name, value) in data.into_iter().flatten() {
            let (name, kind) = named(&program, &name.extract::<String>()?)?;
            let path = value.extract::<PathBuf>().ok();
            match (kind.as_deref(), path) {
                (Some("keypoints"), path) => later.push((name, path, value)),
                (Some("image"), Some(path)) => {
                    picture = path.file_stem().map(|s| s.to_string_lossy().into_owned());
                    let path = path.to_string_lossy();
                    program = program.observe_file(&name, &path).map_err(raised)?;
                }
                (Some("image"), None) => program = program.observe(&name, image(&value)?),
                (Some(_), Some(path)) => {
                    let path = path.to_string_lossy();
                    program = program.observe_file(&name, &path).map_err(raised)?;
                }
                _ => program = program.observe(&name, from_python(&value)?),
            }
        }
        for (name, path, value) in later {
            program = program.observe(&name, keypoints(path, &value, picture.as_deref())?);
        }
        Ok(self.changed(program))
    }

    /// Says where the object is in the photograph that was observed, in its pixels: `mask`, a path
    /// or an array of height x width truth values; `outline`, at least three positions [x, y], from
    /// six on joined by a smooth curve; `box`, [x, y, width, height]; `axis`, (foot, top, width) with
    /// two ends [x, y]; `at` and `not_`, positions [x, y] on it and beside it. What is left out is
    /// not pointed out.
    #[pyo3(signature = (
        *, mask = None, outline = Vec::new(), r#box = None, axis = None, at = Vec::new(), not_ = Vec::new()
    ))]
    fn hint(
        &self,
        mask: Option<&Bound<'_, PyAny>>,
        outline: Vec<[f64; 2]>,
        r#box: Option<[f64; 4]>,
        axis: Option<([f64; 2], [f64; 2], f64)>,
        at: Vec<[f64; 2]>,
        not_: Vec<[f64; 2]>,
    ) -> PyResult<Program> {
        let axis = axis.map(|(foot, top, width)| AxisHint { foot, top, width });
        let mask = mask.map(drawn).transpose()?;
        let hint = Hint { mask, outline, bounds: r#box, axis, at, not: not_ };
        let hinted = self.program.clone().hint(hint);
        hinted.map(|p| self.changed(p)).map_err(|f| PyValueError::new_err(f.message))
    }

    /// Sets the camera of views that have none: a dictionary as in camera files, or the path of
    /// one, as `--camera` takes it. What is observed is undistorted by its lens.
    fn camera(&self, camera: &Bound<'_, PyAny>) -> PyResult<Program> {
        let named = match camera.extract::<PathBuf>() {
            Ok(path) => NamedCamera::parse(&path).and_then(|named| named.read(None)),
            Err(_) => {
                let camera = Camera::from_json(&dumps(camera)?).map_err(plain)?;
                return Ok(self.changed(self.program.clone().camera(camera)));
            }
        };
        let file = named.map_err(|f| plain(f.message))?;
        Ok(self.changed(self.program.clone().camera_file(file)))
    }

    /// Lets the program call what a host brings.
    fn host(&self, host: PyRef<'_, Host>) -> PyResult<Program> {
        let (host, failure) = host.parts();
        let program = self.program.clone().host(&host).map_err(raised)?;
        let failures = self.failures.iter().cloned().chain([failure]).collect();
        Ok(Program { program, failures })
    }

    /// Compiles the program with its data.
    #[pyo3(signature = (*, without_data = false))]
    fn compile(&self, py: Python<'_>, without_data: bool) -> PyResult<Model> {
        let program = self.program.clone();
        let program = if without_data { program.without_data() } else { program };
        let failures = self.failures.clone();
        py.detach(|| Model::new(program, failures))
    }

    /// The text of its main file.
    #[getter]
    fn text(&self) -> &str {
        self.program.text()
    }

    /// The name of its main file.
    #[getter]
    fn name(&self) -> &str {
        self.program.name()
    }

    /// A hash of its text, of what it includes and of the parameters set.
    #[getter]
    fn hash(&self) -> String {
        self.program.hash()
    }

    /// Its parameters by name: dictionaries of `type`, `default` and `help`.
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all = self.program.interface().params.into_iter();
        let all =
            all.map(|p| (p.name, object!({ "type": p.ty, "default": p.default, "help": p.help })));
        json(py, &serde_json::Value::Object(all.collect()))
    }

    /// Its data by name: dictionaries of `type`, `optional` and `help`.
    #[getter]
    fn data<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all = self.program.interface().data.into_iter();
        let all = all.map(|d| {
            (d.name, object!({ "type": d.ty, "optional": d.has_default, "help": d.help }))
        });
        json(py, &serde_json::Value::Object(all.collect()))
    }

    fn __repr__(&self) -> String {
        format!("<pcadlang.Program {:?}>", self.program.name())
    }
}

/// The data item that a name means, with its kind.
///
/// # Errors
/// If the program has no such item.
fn named(program: &pcadlang::Program, name: &str) -> PyResult<(String, Option<String>)> {
    let data = program.interface().data;
    let known = data.iter().find(|d| d.name == name).or_else(|| {
        let kind = if name == "photo" { "image" } else { name };
        let mut fit = data.iter().filter(|d| d.ty.as_deref() == Some(kind));
        fit.next().filter(|_| fit.next().is_none())
    });
    match known {
        Some(item) => Ok((item.name.clone(), item.ty.clone())),
        None => {
            let all: Vec<&str> = data.iter().map(|d| d.name.as_str()).collect();
            let all = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
            Err(plain(format!("the program has no data item `{name}`; it has: {all}")))
        }
    }
}

/// A parameter as a program has it.
fn written(value: &Bound<'_, PyAny>) -> PyResult<String> {
    fn write(value: &Value) -> Option<String> {
        Some(match value {
            Value::Num(x) if x.is_finite() => format!("{x}"),
            Value::Bool(b) => format!("{b}"),
            Value::Str(s) => serde_json::Value::from(&**s).to_string(),
            Value::Array(_) | Value::List(_) => {
                let n = value.len().unwrap_or(0);
                let all: Option<Vec<String>> =
                    (0..n).map(|i| write(&value.element(i).unwrap_or_default())).collect();
                format!("[{}]", all?.join(", "))
            }
            _ => return None,
        })
    }
    let found = from_python(value)?;
    write(&found).ok_or_else(|| {
        PyTypeError::new_err(format!(
            "a parameter cannot be {found}: use numbers, truth values, strings and lists"
        ))
    })
}

/// A picture of PIL, or an array of bytes.
fn image(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    let py = value.py();
    let picture = match value.hasattr("convert")? && value.hasattr("tobytes")? {
        true => value.call_method1("convert", ("RGB",))?,
        false => value.clone(),
    };
    let array = py.import("numpy")?.call_method1("asarray", (picture,))?;
    let Ok(array) = array.cast_into::<PyArrayDyn<u8>>() else {
        return Err(PyTypeError::new_err(
            "an image is a path, a picture of PIL, or an array of bytes (numpy.uint8) from 0 to 255",
        ));
    };
    let (height, width, channels) = match *array.shape() {
        [height, width] => (height, width, 1),
        [height, width, channels @ (3 | 4)] => (height, width, channels),
        _ => {
            let shape = array.shape();
            let what = "an image has the shape (height, width), or (height, width, 3 or 4)";
            return Err(PyValueError::new_err(format!("{what}, not {shape:?}")));
        }
    };
    let read = array.try_readonly().map_err(|e| PyValueError::new_err(e.to_string()))?;
    let mut bytes = Vec::with_capacity(3 * height * width);
    let all: Vec<u8> = read.as_array().iter().copied().collect();
    for pixel in all.chunks_exact(channels) {
        match pixel {
            [grey] => bytes.extend([*grey; 3]),
            _ => bytes.extend(&pixel[..3]),
        }
    }
    let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
        return Err(PyValueError::new_err("the image is too large"));
    };
    let rgb = image::RgbImage::from_raw(width, height, bytes);
    let rgb = rgb.ok_or_else(|| PyValueError::new_err("the image is too large"))?;
    Ok(Value::object(ImageValue::photo(Photo::from_rgb(rgb).map_err(plain)?)))
}

/// A mask of a file or an array.
fn drawn(value: &Bound<'_, PyAny>) -> PyResult<Mask> {
    if let Ok(path) = value.extract::<PathBuf>() {
        return mask::decode(&std::fs::read(path)?, None, &Limits::default()).map_err(plain);
    }
    let array = value.py().import("numpy")?.call_method1("asarray", (value,))?;
    let Ok(array) = array.cast_into::<PyArrayDyn<bool>>() else {
        return Err(PyTypeError::new_err("a mask is a path, or an array of truth values"));
    };
    let &[height, width] = array.shape() else {
        let shape = array.shape();
        return Err(PyValueError::new_err(format!("a mask is height x width, not {shape:?}")));
    };
    let read = array.try_readonly().map_err(|e| PyValueError::new_err(e.to_string()))?;
    let side =
        |n: usize| u32::try_from(n).map_err(|_| PyValueError::new_err("the mask is too large"));
    Mask::new(side(width)?, side(height)?, read.as_array().iter().copied().collect()).map_err(plain)
}

/// Keypoints of a file or dictionary.
fn keypoints(
    path: Option<PathBuf>,
    value: &Bound<'_, PyAny>,
    picture: Option<&str>,
) -> PyResult<Value> {
    let (name, bytes) = match path {
        Some(path) => {
            let name = path.to_string_lossy().into_owned();
            // `#ID` at the end of the path names a person.
            let file = match name.rsplit_once('#') {
                Some((file, _)) if !path.exists() => Path::new(file),
                _ => &path,
            };
            (name.clone(), std::fs::read(file)?)
        }
        None => ("<keypoints>".to_owned(), dumps(value)?.into_bytes()),
    };
    data::load_keypoints(&name, &bytes, picture).map_err(|f| plain(f.message))
}

fn dumps(value: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = value.py().import("json")?.call_method1("dumps", (value,))?;
    text.cast_into::<PyString>()?.extract()
}
