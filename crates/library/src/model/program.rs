//! Programs before they become models: loading, parameters and data, compilation.

use super::{Error, Model};
use crate::{shipped, standard};
use indexmap::IndexMap;
use pcadlang_engine::lang::builtins::data::Options;
use pcadlang_engine::lang::builtins::{Defaults, Table};
use pcadlang_engine::lang::code::Eager;
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::load::{Loaded, Loader, beside, load, load_text, read, reason};
use pcadlang_engine::lang::lower::{Inputs, Interface, compile, inspect};
use pcadlang_engine::lang::reach::{Outside, Reach, folder_of, read_file};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Limits;
use pcadlang_inference::host::Host;
use pcadlang_report::{bytes_hash, text_hash};
use pcadlang_syntax::diag::{Diagnostic, Severity, SourceMap};
use rustc_hash::FxHashMap;
use std::cell::RefCell;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The data files that a program has read, with their hashes, by kind, path and reading
/// options.
pub(super) type Files = Arc<Mutex<FxHashMap<(String, String, String), (Value, String)>>>;

/// A loaded program, before it is compiled to a [`Model`] with its inputs. Clones are
/// independent, except that they share the data files that were read.
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
    pub(super) defaults: Defaults,
    pub(super) needs_data: bool,
    pub(super) eager: Eager,
    pub(super) builtins: Arc<Table>,
    pub(super) files: Files,
}

impl Program {
    /// Loads a program by path; the shipped programs are available in any folder. The
    /// program and the files that it names may be read in and below its own folder only.
    ///
    /// # Errors
    /// If a file is missing, may not be read, or does not parse.
    pub fn open(path: &str) -> Result<Program, Error> {
        Program::open_allowing::<&str>(path, &[])
    }

    /// Like [`Program::open`], but allows reading below these folders, too.
    ///
    /// # Errors
    /// As [`Program::open`], and if one of them is not a folder.
    pub fn open_allowing<P: AsRef<Path>>(path: &str, folders: &[P]) -> Result<Program, Error> {
        let mut reach = shipped::reach().of(path);
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

    /// Parses a program from its text. It can include only shipped programs, and cannot
    /// read files.
    ///
    /// # Errors
    /// If it does not parse.
    pub fn parse(text: &str) -> Result<Program, Error> {
        Program::read("<program>", text, shipped::reach())
    }

    /// Parses a program from its text as if it were the file with this name: included and
    /// read files are resolved relative to it.
    ///
    /// # Errors
    /// As [`Program::open`].
    #[doc(hidden)]
    pub fn named(name: &str, text: &str) -> Result<Program, Error> {
        Program::read(name, text, shipped::reach().of(name))
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
            defaults: Defaults::default(),
            needs_data: true,
            eager: Eager::default(),
            builtins: standard::table(),
            files: Files::default(),
        }
    }

    /// Returns its syntax trees, and the texts that they are from.
    #[doc(hidden)]
    pub fn loaded(&self) -> (&Loaded, &SourceMap) {
        (&self.loaded, &self.sources)
    }

    /// Returns its parameters and data.
    pub fn interface(&self) -> Interface {
        inspect(&self.loaded, &self.builtins)
    }

    /// Returns the name of its main file.
    #[doc(hidden)]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the text of its main file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the names of the `data` items that have neither a value nor a default.
    #[doc(hidden)]
    pub fn missing_data(&self) -> Vec<String> {
        let open = self
            .interface()
            .data
            .into_iter()
            .filter(|d| !d.has_default && !self.data.contains_key(&d.name));
        open.map(|d| d.name).collect()
    }

    /// Returns a hash of its text, of the files that it includes, and of the parameters
    /// set so far. The compiled model has the same hash.
    pub fn hash(&self) -> String {
        hash_of(&self.loaded, &self.sources, &self.sets)
    }

    /// Returns the names of shipped files that were used because no file of that name was
    /// found.
    #[doc(hidden)]
    pub fn embedded(&self) -> &[String] {
        &self.loaded.embedded
    }

    /// Sets a `param` to a value written as in a program.
    #[must_use]
    pub fn set(mut self, name: &str, value: &str) -> Program {
        self.sets.retain(|(n, _)| n != name);
        self.sets.push((name.into(), value.into()));
        self
    }

    /// Returns whether a `param` was set.
    #[doc(hidden)]
    pub fn is_set(&self, name: &str) -> bool {
        self.sets.iter().any(|(n, _)| n == name)
    }

    /// Sets the value of a `data` item.
    #[must_use]
    pub fn observe(mut self, name: &str, value: Value) -> Program {
        self.data.insert(name.into(), value);
        self
    }

    /// Returns the names and values of the `data` items that were set, in the order of setting.
    #[doc(hidden)]
    pub fn observed(&self) -> impl Iterator<Item = (&str, &Value)> {
        self.data.iter().map(|(name, v)| (&**name, v))
    }

    /// Allows its `data` items and kernels to read files below a folder. For included
    /// files, see [`Program::open_allowing`]: they were read when the program was opened.
    ///
    /// # Errors
    /// If there is no such folder.
    pub fn allow_read(mut self, folder: impl AsRef<Path>) -> Result<Program, Error> {
        self.reach = widened(self.reach, folder.as_ref(), &self.sources)?;
        Ok(self)
    }

    /// Sets the limits for evaluations outside of runs, such as a single draw or making
    /// the plan. Runs have separate limits ([`pcadlang_inference::RunOptions::limits`]).
    #[must_use]
    pub fn limits(self, limits: Limits) -> Program {
        Program { limits, ..self }
    }

    /// Reads a file for a `data` item as its declared kind, with the options of its
    /// default. Files that it refers to may be in or below its own folder, or wherever
    /// the program may read.
    ///
    /// # Errors
    /// If the program has no such item, or the file cannot be read as that kind.
    pub fn observe_file(self, name: &str, path: &str) -> Result<Program, Error> {
        let item = self.interface().data.into_iter().find(|d| d.name == name);
        let (kind, options) = item.map_or((None, Options::default()), |d| (d.ty, d.options));
        let kind = kind.unwrap_or_else(|| "image".into());
        let file = self.builtins.path_of(&kind, path);
        let folder = folder_of(Path::new(file));
        let reach = self.reach.clone().allow(folder).unwrap_or_else(|_| self.reach.clone());
        let loaded = match read_file(Path::new(file)) {
            Ok(bytes) => self
                .builtins
                .load(&kind, path, &bytes, &options, &|other| sibling(&reach, path, other)),
            Err(e) => {
                Err(Fault::new(FaultKind::Other, format!("cannot read {file}: {}", reason(&e))))
            }
        };
        match loaded {
            Ok(value) => Ok(self.observe(name, value)),
            Err(f) => Err(plain_error(f, &self.sources)),
        }
    }

    /// Sets a default for an argument that a program omits. The built-in is given by its
    /// full name, the argument by its name.
    #[must_use]
    pub fn default_argument(mut self, function: &str, argument: &str, value: Value) -> Program {
        self.defaults.insert((function.into(), argument.into()), value);
        self
    }

    /// Allows compilation with missing `data` items, to check the rest of the program.
    #[must_use]
    pub fn without_data(mut self) -> Program {
        self.needs_data = false;
        self
    }

    /// Sets what is evaluated even if nothing depends on it.
    #[must_use]
    #[doc(hidden)]
    pub fn eager(mut self, eager: Eager) -> Program {
        self.eager = eager;
        self
    }

    /// Lets hosts complete and adapt what was given, once.
    fn prepare(&mut self) -> Result<(), Error> {
        let builtins = Arc::clone(&self.builtins);
        for hook in &builtins.hooks {
            let prepared = hook.prepare(&mut self.data, &mut self.defaults);
            prepared.map_err(|f| plain_error(f, &self.sources))?;
        }
        let adapted =
            |v: &Value| builtins.hooks.iter().fold(v.clone(), |v, h| h.adapt(v, &self.defaults));
        self.data.values_mut().for_each(|v| *v = adapted(v));
        Ok(())
    }

    /// Returns a `data` item that was set as the compiled model has it.
    ///
    /// # Errors
    /// As [`Program::compile`], of what was set.
    #[doc(hidden)]
    pub fn adapted(&self, name: &str) -> Result<Option<Value>, Error> {
        let mut all = self.clone();
        all.prepare()?;
        Ok(all.data.get(name).cloned())
    }

    /// Checks and lowers the program.
    ///
    /// # Errors
    /// All errors in the program.
    pub fn compile(mut self) -> Result<Model, Error> {
        let builtins = Arc::clone(&self.builtins);
        self.prepare()?;
        let adapted =
            |v: Value| builtins.hooks.iter().fold(v, |v, hook| hook.adapt(v, &self.defaults));
        let (reach, files) = (&self.reach, &*self.files);
        let data_hash = RefCell::new(String::new());
        let read_data = |kind: &str, path: &str, folder: &str, options: &Options| {
            let beside = beside(folder, path);
            let key = (kind.to_owned(), beside.clone(), format!("{options:?}"));
            let mut files = files.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((value, hash)) = files.get(&key) {
                data_hash.borrow_mut().push_str(hash);
                return Ok(adapted(value.clone()));
            }
            let file = builtins.path_of(kind, &beside);
            // As for `include`, a shipped file is found from any folder.
            let shipped =
                || shipped::file(builtins.path_of(kind, path)).map(|text| text.as_bytes());
            let (bytes, beside) = match (read(reach, file), shipped()) {
                (Ok((bytes, _)), _) => (bytes, beside),
                (Err(e), Some(bytes)) if e.kind() == std::io::ErrorKind::NotFound => {
                    (bytes.to_vec(), path.to_owned())
                }
                (Err(e), _) => {
                    let said = format!("cannot read {file}: {}", reason(&e));
                    let fault = Fault::new(FaultKind::Other, said);
                    return Err(Outside::hint(&e).into_iter().fold(fault, Fault::with_hint));
                }
            };
            let value = builtins
                .load(kind, &beside, &bytes, options, &|other| sibling(reach, &beside, other))?;
            let hash = bytes_hash(&bytes);
            data_hash.borrow_mut().push_str(&hash);
            files.insert(key, (value.clone(), hash));
            Ok(adapted(value))
        };
        let inputs = Inputs {
            builtins: Arc::clone(&self.builtins),
            sets: &self.sets,
            data: self.data,
            read: &read_data,
            needs_data: self.needs_data,
            defaults: self.defaults.clone(),
            eager: self.eager,
        };
        match compile(&self.loaded, inputs, &mut self.sources) {
            Ok(compiled) => {
                let hash = hash_of(&self.loaded, &self.sources, &self.sets);
                let source_hash = hash_of(&self.loaded, &self.sources, &[]);
                let (reach, limits, data_hash) = (self.reach, self.limits, data_hash.into_inner());
                let (sources, text, default_plan) = (self.sources, self.text, OnceLock::new());
                let model = Model {
                    compiled,
                    sources,
                    text,
                    hash,
                    source_hash,
                    data_hash,
                    reach,
                    limits,
                    default_plan,
                };
                model.uses_no_missing_entry().map(|()| model)
            }
            Err(diagnostics) => Err(Error { diagnostics, sources: self.sources }),
        }
    }

    /// Lets the program call what a host brings.
    ///
    /// # Errors
    /// If the host brings a name of the language without saying that it replaces it, or
    /// something is wrong with what it brings.
    pub fn host(mut self, host: &Host) -> Result<Program, Error> {
        self.builtins = host.table(&standard::table())?;
        Ok(self)
    }
}

/// Reads a file that is named relative to another one.
fn sibling(loader: &dyn Loader, file: &str, other: &str) -> Result<Vec<u8>, String> {
    let folder = file.rfind(['/', '\\']).map_or("", |i| &file[..=i]);
    let path = beside(folder, other);
    read(loader, &path).map(|(bytes, _)| bytes).map_err(|e| {
        let hint = Outside::hint(&e).map_or(String::new(), |h| format!("; {h}"));
        format!("cannot read {path}: {}{hint}", reason(&e))
    })
}

/// Extends the folders that may be read by one more.
fn widened(reach: Reach, folder: &Path, sources: &SourceMap) -> Result<Reach, Error> {
    reach.allow(folder).map_err(|e| {
        let message = format!("cannot read {}: {}", folder.display(), reason(&e));
        plain_error(Fault::new(FaultKind::Other, message), sources)
    })
}

/// Hashes all source texts and settings of a program, to check that a saved trace belongs
/// to it; without settings, its source alone.
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

/// Creates an error without a source location.
fn plain_error(f: Fault, sources: &SourceMap) -> Error {
    let mut d = Diagnostic::new(Severity::Error, f.message);
    d.hints.extend(f.hint);
    Error { diagnostics: vec![d], sources: sources.clone() }
}
