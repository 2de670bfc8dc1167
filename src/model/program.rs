//! Programs on their way to models: loaded, given parameters and data, compiled.

use super::error::plain_error;
use super::{Error, Model};
use crate::diag::SourceMap;
use crate::host::Host;
use crate::lang::builtins::data::Options;
use crate::lang::builtins::scene::{
    CameraValue, DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue,
};
use crate::lang::builtins::{Table, data};
use crate::lang::code::Eager;
use crate::lang::error::{Fault, FaultKind};
use crate::lang::load::{Loaded, Loader, beside, load, load_text, read, reason};
use crate::lang::lower::{Inputs, Interface, compile, inspect};
use crate::lang::reach::{Outside, Reach, folder_of, read_file};
use crate::lang::value::Value;
use crate::render::Camera;
use crate::report::{bytes_hash, text_hash};
use crate::trace::Limits;
use indexmap::IndexMap;
use rustc_hash::FxHashMap;
use std::cell::RefCell;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// The arguments that the run's camera stands in for.
const CAMERAS: [(&str, &str); 2] = [("scene.render", "camera"), ("scene.candidates", "camera")];

/// Files of data that a program has read, with their hashes, by kind, path and how they
/// were read.
pub(super) type Files = Arc<Mutex<FxHashMap<(String, String, String), (Value, String)>>>;

/// A program on its way to a [`Model`]: loaded, its inputs not yet given. A clone can go
/// another way: both keep what they read.
#[derive(Clone)]
pub struct Program {
    pub(super) loaded: Loaded,
    pub(super) sources: SourceMap,
    pub(super) reach: Reach,
    pub(super) limits: Limits,
    pub(super) name: String,
    pub(super) text: String,
    pub(super) sets: Vec<(String, String)>,
    pub(super) data: IndexMap<String, Value>,
    pub(super) defaults: FxHashMap<(String, String), Value>,
    pub(super) needs_data: bool,
    pub(super) eager: Eager,
    pub(super) builtins: Arc<Table>,
    pub(super) files: Files,
}

impl Program {
    /// Loads a program by path; the shipped programs are found in any folder. It, and the
    /// files that it names, may be read below its own folder and nowhere else.
    ///
    /// # Errors
    /// If a file is missing or may not be read, or does not parse.
    pub fn open(path: &str) -> Result<Program, Error> {
        Program::open_allowing::<&str>(path, &[])
    }

    /// As [`Program::open`], and may read below these folders, too.
    ///
    /// # Errors
    /// As [`Program::open`], and if one of them is no folder.
    pub fn open_allowing<P: AsRef<Path>>(path: &str, folders: &[P]) -> Result<Program, Error> {
        let mut reach = Reach::default().of(path);
        for folder in folders {
            reach = widened(reach, folder.as_ref(), &SourceMap::new())?;
        }
        Program::open_within(path, reach)
    }

    pub(super) fn open_within(path: &str, reach: Reach) -> Result<Program, Error> {
        let mut sources = SourceMap::new();
        match load(path, &reach, &mut sources) {
            Ok(loaded) => Ok(Program::new(path, loaded, sources, reach)),
            Err(diagnostics) => Err(Error { diagnostics, sources }),
        }
    }

    /// A program from its text; it can include only what is built in, and reads no files.
    ///
    /// # Errors
    /// If it does not parse.
    pub fn parse(text: &str) -> Result<Program, Error> {
        Program::read("<program>", text, Reach::default())
    }

    /// A program from its text, which stands for a file of this name: what it includes
    /// and reads is found from there.
    ///
    /// # Errors
    /// As [`Program::open`].
    #[doc(hidden)]
    pub fn named(name: &str, text: &str) -> Result<Program, Error> {
        Program::read(name, text, Reach::default().of(name))
    }

    pub(super) fn read(name: &str, text: &str, reach: Reach) -> Result<Program, Error> {
        let mut sources = SourceMap::new();
        match load_text(name, text, &reach, &mut sources) {
            Ok(loaded) => Ok(Program::new(name, loaded, sources, reach)),
            Err(diagnostics) => Err(Error { diagnostics, sources }),
        }
    }

    fn new(name: &str, loaded: Loaded, sources: SourceMap, reach: Reach) -> Program {
        let text = loaded
            .units
            .first()
            .and_then(|u| sources.get(u.file))
            .map_or(String::new(), |f| f.text().to_string());
        Program {
            loaded,
            sources,
            reach,
            limits: Limits::default(),
            name: name.to_owned(),
            text,
            sets: Vec::new(),
            data: IndexMap::new(),
            defaults: FxHashMap::default(),
            needs_data: true,
            eager: Eager::default(),
            builtins: Arc::new(Table::default()),
            files: Files::default(),
        }
    }

    /// Its parameters and data.
    pub fn interface(&self) -> Interface {
        inspect(&self.loaded)
    }

    /// The name of its main file.
    #[doc(hidden)]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text of its main file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The `data` items that have no value yet.
    #[doc(hidden)]
    pub fn missing_data(&self) -> Vec<String> {
        let open = self
            .interface()
            .data
            .into_iter()
            .filter(|d| !d.has_default && !self.data.contains_key(&d.name));
        open.map(|d| d.name).collect()
    }

    /// A hash of its text, that of the files it includes, and the parameters set so far:
    /// that of the model it gives.
    pub fn hash(&self) -> String {
        hash_of(&self.loaded, &self.sources, &self.sets)
    }

    /// Names of built-in files that stood in for files of the user's own.
    #[doc(hidden)]
    pub fn embedded(&self) -> &[String] {
        &self.loaded.embedded
    }

    /// Sets a `param`, its value written as in a program.
    #[must_use]
    pub fn set(mut self, name: &str, value: &str) -> Program {
        self.sets.retain(|(n, _)| n != name);
        self.sets.push((name.into(), value.into()));
        self
    }

    /// Whether a `param` was set.
    #[doc(hidden)]
    pub fn is_set(&self, name: &str) -> bool {
        self.sets.iter().any(|(n, _)| n == name)
    }

    /// Gives a `data` item.
    #[must_use]
    pub fn observe(mut self, name: &str, value: Value) -> Program {
        self.data.insert(name.into(), value);
        self
    }

    /// Lets its `data` items and kernels read files below a folder; what it includes was
    /// read when it was [opened](Program::open_allowing).
    ///
    /// # Errors
    /// If there is no such folder.
    pub fn allow_read(mut self, folder: impl AsRef<Path>) -> Result<Program, Error> {
        self.reach = widened(self.reach, folder.as_ref(), &self.sources)?;
        Ok(self)
    }

    /// Bounds on what the program may build when it is not run but looked at: one draw,
    /// the plan. Runs have their own ([`crate::RunOptions::limits`]).
    #[must_use]
    pub fn limits(self, limits: Limits) -> Program {
        Program { limits, ..self }
    }

    /// Reads a file for a `data` item as its declared kind, with the options of its
    /// default. What that file names is read below its own folder and where the program
    /// may read.
    ///
    /// # Errors
    /// If the program has no such item, or the file cannot be read as that.
    pub fn observe_file(self, name: &str, path: &str) -> Result<Program, Error> {
        let item = self.interface().data.into_iter().find(|d| d.name == name);
        let (kind, options) = item.map_or((None, Options::default()), |d| (d.ty, d.options));
        let kind = kind.unwrap_or_else(|| "image".into());
        let file = data::path_of(&kind, path);
        let folder = folder_of(Path::new(file));
        let reach = self.reach.clone().allow(folder).unwrap_or_else(|_| self.reach.clone());
        let loaded = match read_file(Path::new(file)) {
            Ok(bytes) => {
                data::load(&kind, path, &bytes, &options, &|other| sibling(&reach, path, other))
            }
            Err(e) => {
                Err(Fault::new(FaultKind::Other, format!("cannot read {file}: {}", reason(&e))))
            }
        };
        match loaded {
            Ok(value) => Ok(self.observe(name, value)),
            Err(f) => Err(plain_error(f, &self.sources)),
        }
    }

    /// The value of an argument wherever a program leaves it out: of a built-in by full
    /// name, an argument by name.
    #[must_use]
    pub fn default_argument(mut self, function: &str, argument: &str, value: Value) -> Program {
        self.defaults.insert((function.into(), argument.into()), value);
        self
    }

    /// What the program calls may be the host's too.
    ///
    /// # Errors
    /// If the host brings a name of the language without saying that it replaces it, or
    /// something is wrong with what it brings.
    pub fn host(mut self, host: &Host) -> Result<Program, Error> {
        self.builtins = host.table()?;
        Ok(self)
    }

    /// Compiles also when `data` items are not given, to check the rest.
    #[must_use]
    pub fn without_data(mut self) -> Program {
        self.needs_data = false;
        self
    }

    /// Says what is to run although nothing asks for it.
    #[must_use]
    #[doc(hidden)]
    pub fn eager(mut self, eager: Eager) -> Program {
        self.eager = eager;
        self
    }

    /// The camera of views that name none.
    #[must_use]
    pub fn camera(self, camera: Camera) -> Program {
        CAMERAS.iter().fold(self, |p, (of, name)| {
            p.default_argument(of, name, Value::object(CameraValue(camera)))
        })
    }

    /// Contours of photographs are found by a detector wherever the program says nothing
    /// of it: a value as of `data d = detector("file");`, `None` for the detector that is
    /// built in.
    #[must_use]
    #[doc(hidden)]
    pub fn detector(self, detector: DetectorValue) -> Program {
        self.default_argument("scene.edges", "detector", Value::object(detector))
    }

    /// The detector that was chosen for the program.
    fn chosen_detector(&self) -> Option<DetectorValue> {
        let chosen = self.defaults.get(&("scene.edges".to_owned(), "detector".to_owned()))?;
        chosen.downcast::<DetectorValue>().cloned()
    }

    /// Without a camera, the default view in the shape of the first picture given, or of
    /// that of keypoints. Keypoints that do not say which picture they belong to belong
    /// to the first one.
    fn default_camera(&mut self) {
        let picture = self.data.values().find_map(|v| {
            let image = v.downcast::<ImageValue>().map(ImageValue::size);
            let mask = || v.downcast::<MaskValue>().map(|m| (m.mask.width(), m.mask.height()));
            let depth = || v.downcast::<DepthValue>().map(|d| (d.depth.width(), d.depth.height()));
            image.or_else(mask).or_else(depth)
        });
        if let Some((width, height)) = picture {
            for v in self.data.values_mut() {
                if let Some(KeypointsValue(k)) = v.downcast::<KeypointsValue>() {
                    *v = Value::object(KeypointsValue(k.clone().in_image(width, height)));
                }
            }
        }
        let cameras = CAMERAS.map(|(of, name)| (of.to_owned(), name.to_owned()));
        if self.defaults.contains_key(&cameras[0]) {
            return;
        }
        let keypoints = || {
            self.data.values().find_map(|v| v.downcast::<KeypointsValue>().and_then(|k| k.0.size()))
        };
        if let Some((width, height)) = picture.or_else(keypoints) {
            let camera = CameraValue(Camera::default_for(width, height));
            for of in cameras {
                self.defaults.insert(of, Value::object(CameraValue(camera.0)));
            }
        }
    }

    /// Checks and lowers the program.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn compile(mut self) -> Result<Model, Error> {
        self.default_camera();
        let detector = self.chosen_detector();
        let detecting = |v: Value| {
            detector.as_ref().map_or_else(|| v.clone(), |d| ImageValue::detecting(&v, d))
        };
        self.data.values_mut().for_each(|v| *v = detecting(v.clone()));
        let (reach, files) = (&self.reach, &*self.files);
        let data_hash = RefCell::new(String::new());
        let read_data = |kind: &str, path: &str, folder: &str, options: &Options| {
            let beside = beside(folder, path);
            let key = (kind.to_owned(), beside.clone(), format!("{options:?}"));
            let mut files = files.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((value, hash)) = files.get(&key) {
                data_hash.borrow_mut().push_str(hash);
                return Ok(detecting(value.clone()));
            }
            let file = data::path_of(kind, &beside);
            let (bytes, _) = read(reach, file).map_err(|e| {
                let fault =
                    Fault::new(FaultKind::Other, format!("cannot read {file}: {}", reason(&e)));
                Outside::hint(&e).into_iter().fold(fault, Fault::with_hint)
            })?;
            let value = data::load(kind, &beside, &bytes, options, &|other| {
                sibling(reach, &beside, other)
            })?;
            let hash = bytes_hash(&bytes);
            data_hash.borrow_mut().push_str(&hash);
            files.insert(key, (value.clone(), hash));
            Ok(detecting(value))
        };
        let inputs = Inputs {
            builtins: Arc::clone(&self.builtins),
            sets: &self.sets,
            data: self.data,
            read: &read_data,
            needs_data: self.needs_data,
            defaults: self.defaults,
            eager: self.eager,
        };
        match compile(&self.loaded, inputs, &mut self.sources) {
            Ok(compiled) => {
                let hash = hash_of(&self.loaded, &self.sources, &self.sets);
                let (reach, limits, data_hash) = (self.reach, self.limits, data_hash.into_inner());
                Ok(Model {
                    compiled,
                    sources: self.sources,
                    text: self.text,
                    hash,
                    data_hash,
                    reach,
                    limits,
                })
            }
            Err(diagnostics) => Err(Error { diagnostics, sources: self.sources }),
        }
    }
}

/// The contents of a file named relative to another.
fn sibling(loader: &dyn Loader, file: &str, other: &str) -> Result<Vec<u8>, String> {
    let folder = file.rfind(['/', '\\']).map_or("", |i| &file[..=i]);
    let path = beside(folder, other);
    read(loader, &path).map(|(bytes, _)| bytes).map_err(|e| {
        let hint = Outside::hint(&e).map_or(String::new(), |h| format!("; {h}"));
        format!("cannot read {path}: {}{hint}", reason(&e))
    })
}

/// What may be read, and below one more folder.
fn widened(reach: Reach, folder: &Path, sources: &SourceMap) -> Result<Reach, Error> {
    reach.allow(folder).map_err(|e| {
        let message = format!("cannot read {}: {}", folder.display(), reason(&e));
        plain_error(Fault::new(FaultKind::Other, message), sources)
    })
}

/// A hash of all a program's text and settings: a saved trace belongs to it.
fn hash_of(loaded: &Loaded, sources: &SourceMap, sets: &[(String, String)]) -> String {
    let mut all = String::new();
    for u in &loaded.units {
        if let Some(f) = sources.get(u.file) {
            all.push_str(f.text());
            all.push('\0');
        }
    }
    for (k, v) in sets {
        all.push_str(&format!("{k}={v}\0"));
    }
    text_hash(&all)
}
