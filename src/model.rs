//! Embedding: a program compiled with its data, run to a posterior, in a few calls.
//!
//! ```
//! use pcadlang::{Model, RunOptions};
//! let model = Model::from_text("assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;")?;
//! let posterior = model.run(&RunOptions { steps: Some(2000), ..RunOptions::default() }, 2, 2)?;
//! let x = &posterior.quantity("x").unwrap().summary;
//! assert!((x.mean - 1.6).abs() < 0.2);
//! # Ok::<(), pcadlang::Error>(())
//! ```

mod edited;

use crate::diag::{Diagnostic, IntoDiagnostic, Severity, SourceMap, render};
use crate::host::Host;
use crate::infer::draws::Sink;
use crate::infer::{ChainError, ChainResult, Progress, RunOptions, default_plan, run_chains};
use crate::lang::builtins::data::Options;
use crate::lang::builtins::scene::{CameraValue, DepthValue, ImageValue, KeypointsValue, MaskValue};
use crate::lang::builtins::{Table, data};
use crate::lang::code::{Code, Eager};
use crate::lang::error::{Fault, FaultKind, RunError};
use crate::lang::load::{Loaded, Loader, beside, load, load_text, read, reason};
use crate::lang::lower::{Compiled, Export, Inputs, Interface, Report, compile, inspect};
use crate::lang::reach::{Outside, Reach, folder_of, read_file};
use crate::lang::value::Value;
use crate::platform::clock;
use crate::render::Camera;
use crate::report::{ChainDraws, Memory, Quantity, bytes_hash, quantities, text_hash};
use crate::rng::{Purpose, StreamKey};
use crate::syntax::ast::{ItemKind, KStmt};
use crate::syntax::parse;
use crate::trace::{Draws, Limits, Trace};
use indexmap::IndexMap;
use rustc_hash::FxHashMap;
use std::cell::RefCell;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// What is wrong with a program, its data, or a run of it: messages with their places.
#[derive(Clone)]
pub struct Error {
    /// The messages.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts they point into.
    pub sources: SourceMap,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&render(&self.sources, &self.diagnostics, false))
    }
}

/// As it is shown: what a `main` that returns it prints is for people too.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {}

impl IntoDiagnostic for RunError {
    fn into_diagnostic(self) -> Diagnostic {
        let mut d = Diagnostic::error(self.message, self.span, "");
        if !self.address.segments.is_empty() {
            d = d.note(format!("while running {}", self.address.shortened()));
        }
        let calls: Vec<&str> = self.calls.iter().map(|(f, _)| &**f).collect();
        match calls.len() {
            0 => {}
            1..=8 => d = d.note(format!("called through {}", calls.join(" -> "))),
            n => {
                let (first, last) = (calls[..4].join(" -> "), calls[n - 3..].join(" -> "));
                d = d.note(format!("called through {first} -> … {} more … -> {last}", n - 7));
            }
        }
        d.hints.extend(self.hint);
        d
    }
}

/// The argument that the run's camera stands in for.
const RENDER: (&str, &str) = ("scene.render", "camera");

/// Files of data that a program has read, with their hashes, by kind, path and how they were read.
type Files = Arc<Mutex<FxHashMap<(String, String, String), (Value, String)>>>;

/// A program on its way to a [`Model`]: loaded, its inputs not yet given. A clone can go another way: both keep what they read.
#[derive(Clone)]
pub struct Program {
    loaded: Loaded,
    sources: SourceMap,
    reach: Reach,
    limits: Limits,
    name: String,
    text: String,
    sets: Vec<(String, String)>,
    data: IndexMap<String, Value>,
    defaults: FxHashMap<(String, String), Value>,
    needs_data: bool,
    eager: Eager,
    builtins: Arc<Table>,
    files: Files,
}

impl Program {
    /// Loads a program by path; the shipped programs are found in any folder. It, and the files that it names, may be read below
    /// its own folder and nowhere else.
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
        let mut sources = SourceMap::new();
        // A program that is not there has no folder; loading says so.
        let mut reach = Reach::of_program(path).unwrap_or_default();
        for folder in folders {
            reach = widened(reach, folder.as_ref(), &sources)?;
        }
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

    /// A program from its text, which stands for a file of this name: what it includes and reads is found from there.
    ///
    /// # Errors
    /// As [`Program::open`].
    #[doc(hidden)]
    pub fn named(name: &str, text: &str) -> Result<Program, Error> {
        Program::read(name, text, Reach::of_program(name).unwrap_or_default())
    }

    fn read(name: &str, text: &str, reach: Reach) -> Result<Program, Error> {
        let mut sources = SourceMap::new();
        match load_text(name, text, &reach, &mut sources) {
            Ok(loaded) => Ok(Program::new(name, loaded, sources, reach)),
            Err(diagnostics) => Err(Error { diagnostics, sources }),
        }
    }

    fn new(name: &str, loaded: Loaded, sources: SourceMap, reach: Reach) -> Program {
        let text =
            loaded.units.first().and_then(|u| sources.get(u.file)).map_or(String::new(), |f| f.text().to_string());
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
        let open = self.interface().data.into_iter().filter(|d| !d.has_default && !self.data.contains_key(&d.name));
        open.map(|d| d.name).collect()
    }

    /// A hash of its text, that of the files it includes, and the parameters set so far: that of the model it gives.
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

    /// Lets its `data` items and kernels read files below a folder; what it includes was read when it was
    /// [opened](Program::open_allowing).
    ///
    /// # Errors
    /// If there is no such folder.
    pub fn allow_read(mut self, folder: impl AsRef<Path>) -> Result<Program, Error> {
        self.reach = widened(self.reach, folder.as_ref(), &self.sources)?;
        Ok(self)
    }

    /// Bounds on what the program may build when it is not run but looked at: one draw, the plan. Runs have their own
    /// ([`RunOptions::limits`]).
    #[must_use]
    pub fn limits(self, limits: Limits) -> Program {
        Program { limits, ..self }
    }

    /// Reads a file for a `data` item as its declared kind, with the options of its default. What that file names is read below
    /// its own folder and where the program may read.
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
            Ok(bytes) => data::load(&kind, path, &bytes, &options, &|other| sibling(&reach, path, other)),
            Err(e) => Err(Fault::new(FaultKind::Other, format!("cannot read {file}: {}", reason(&e)))),
        };
        match loaded {
            Ok(value) => Ok(self.observe(name, value)),
            Err(f) => Err(plain_error(f, &self.sources)),
        }
    }

    /// The value of an argument wherever a program leaves it out: of a built-in by full name, an argument by name.
    #[must_use]
    pub fn default_argument(mut self, function: &str, argument: &str, value: Value) -> Program {
        self.defaults.insert((function.into(), argument.into()), value);
        self
    }

    /// What the program calls may be the host's too.
    ///
    /// # Errors
    /// If the host brings a name of the language without saying that it replaces it, or something is wrong with what it brings.
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
        self.default_argument(RENDER.0, RENDER.1, Value::object(CameraValue(camera)))
    }

    /// Without a camera, the default view in the shape of the first picture given, or of that of keypoints. Keypoints that do
    /// not say which picture they belong to belong to the first one.
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
        let render = (RENDER.0.to_owned(), RENDER.1.to_owned());
        if self.defaults.contains_key(&render) {
            return;
        }
        let keypoints = || self.data.values().find_map(|v| v.downcast::<KeypointsValue>().and_then(|k| k.0.size()));
        if let Some((width, height)) = picture.or_else(keypoints) {
            let camera = CameraValue(Camera::default_for(width, height));
            self.defaults.insert(render, Value::object(camera));
        }
    }

    /// Checks and lowers the program.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn compile(mut self) -> Result<Model, Error> {
        self.default_camera();
        let (reach, files) = (&self.reach, &*self.files);
        let data_hash = RefCell::new(String::new());
        let read_data = |kind: &str, path: &str, folder: &str, options: &Options| {
            let beside = beside(folder, path);
            let key = (kind.to_owned(), beside.clone(), format!("{options:?}"));
            let mut files = files.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((value, hash)) = files.get(&key) {
                data_hash.borrow_mut().push_str(hash);
                return Ok(value.clone());
            }
            let file = data::path_of(kind, &beside);
            let (bytes, _) = read(reach, file).map_err(|e| {
                let fault = Fault::new(FaultKind::Other, format!("cannot read {file}: {}", reason(&e)));
                Outside::hint(&e).into_iter().fold(fault, Fault::with_hint)
            })?;
            let value = data::load(kind, &beside, &bytes, options, &|other| sibling(reach, &beside, other))?;
            let hash = bytes_hash(&bytes);
            data_hash.borrow_mut().push_str(&hash);
            files.insert(key, (value.clone(), hash));
            Ok(value)
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
                Ok(Model { compiled, sources: self.sources, text: self.text, hash, data_hash, reach, limits })
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

fn plain_error(f: Fault, sources: &SourceMap) -> Error {
    let mut d = Diagnostic::new(Severity::Error, f.message);
    d.hints.extend(f.hint);
    Error { diagnostics: vec![d], sources: sources.clone() }
}

/// A compiled program with its data.
#[derive(Debug)]
pub struct Model {
    compiled: Compiled,
    sources: SourceMap,
    text: String,
    hash: String,
    data_hash: String,
    reach: Reach,
    limits: Limits,
}

impl Model {
    /// Compiles a program given as text, with its defaults.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn from_text(text: &str) -> Result<Model, Error> {
        Program::parse(text)?.compile()
    }

    /// The lowered program, for work on [traces](crate::trace).
    pub fn code(&self) -> &Arc<Code> {
        &self.compiled.code
    }

    /// A hash of the program's text and settings.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// A hash of the files that the program reads by itself: the defaults of its `data` items.
    pub fn data_hash(&self) -> &str {
        &self.data_hash
    }

    /// The text of the main file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What it may read while it runs.
    #[doc(hidden)]
    pub fn reach(&self) -> &Reach {
        &self.reach
    }

    /// Bounds on what it may build when it is not run but looked at.
    #[doc(hidden)]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The texts that errors point into.
    pub fn sources(&self) -> &SourceMap {
        &self.sources
    }

    /// The program's exports.
    #[doc(hidden)]
    pub fn exports(&self) -> &[Export] {
        &self.compiled.exports
    }

    /// The program's reports.
    #[doc(hidden)]
    pub fn reports(&self) -> &[Report] {
        &self.compiled.reports
    }

    /// One draw from the prior, conditioned on nothing: observations are scored, not simulated.
    ///
    /// # Errors
    /// What the program does wrong.
    pub fn simulate(&self, seed: u64, index: u64) -> Result<Trace, Error> {
        let draws = Draws { key: StreamKey::new(seed, 0, Purpose::START), step: index, lane: 0 };
        Trace::simulate(Arc::clone(self.code()), draws, self.limits.clone()).map_err(|e| self.run_error(*e))
    }

    /// Turns a failure while running into messages.
    pub fn run_error(&self, e: RunError) -> Error {
        Error { diagnostics: vec![e.into_diagnostic()], sources: self.sources.clone() }
    }

    /// Turns the failure of a chain into messages.
    pub fn chain_error(&self, e: ChainError) -> Error {
        use crate::infer::StartError;
        let plain = |message: String| Diagnostic::new(Severity::Error, message);
        let d = match e {
            ChainError::Run(e) | ChainError::Start(StartError::Run(e)) => e.into_diagnostic(),
            ChainError::Start(StartError::Impossible(zero)) => {
                let mut d = plain(format!("no chain can start: {zero}"));
                for (i, term) in zero.terms.iter().take(5).enumerate() {
                    d = match i {
                        0 => d.primary(term.span, format!("the log density of {} is -inf", term.address)),
                        _ => d.secondary(term.span, format!("so is that of {}", term.address)),
                    };
                }
                if zero.terms.len() > 5 {
                    d = d.note(format!("and {} more", zero.terms.len() - 5));
                }
                if !zero.drawn.is_empty() {
                    let drawn: Vec<String> = zero.drawn.iter().map(|(a, v)| format!("{a} = {v}")).collect();
                    d = d.note(format!("in the last of them {}", drawn.join(", ")));
                }
                d.hint("widen the prior or the spread of what is observed; a factor of -inf rules a state out")
            }
            ChainError::Sink(e) => plain(format!("draws cannot be written: {e}")),
            ChainError::Checkpoint(e) => plain(format!("a chain cannot go on: {e}")),
        };
        Error { diagnostics: vec![d], sources: self.sources.clone() }
    }

    /// The plan of inference: the program's first `infer` block, or the default plan; the second part is the text of the
    /// default plan where that is used.
    ///
    /// # Errors
    /// If the program cannot be run once, to see what choices it makes.
    #[doc(hidden)]
    pub fn plan(&self) -> Result<(Arc<[KStmt]>, Option<String>), Error> {
        if let Some(p) = self.compiled.plans.first() {
            return Ok((Arc::clone(&p.body), None));
        }
        let mut trace = self.simulate(0, 0)?;
        let text = default_plan(&mut trace);
        let mut sources = self.sources.clone();
        let file = sources.add("<default plan>", &text);
        let (program, _) = parse(&text, file);
        let body = program.items.into_iter().find_map(|i| match i.kind {
            ItemKind::Infer { body, .. } => Some(body),
            _ => None,
        });
        Ok((body.unwrap_or_default().into(), Some(text)))
    }

    /// Runs chains and keeps their draws in memory. Draws depend on the seed, never on the number of threads.
    ///
    /// # Errors
    /// If a chain cannot start or the program fails.
    pub fn run(&self, options: &RunOptions, chains: usize, threads: usize) -> Result<Posterior, Error> {
        let memories: Vec<Memory> = (0..chains.max(1)).map(|_| Memory::default()).collect();
        let sinks = memories.iter().map(|m| Box::new(m.clone()) as Box<dyn Sink>).collect();
        let results = self.run_into(options, threads, &Progress::default(), sinks)?;
        let results = results.into_iter().collect::<Result<Vec<_>, _>>().map_err(|e| self.chain_error(e))?;
        Ok(Posterior { draws: memories.iter().map(Memory::draws).collect(), chains: results })
    }

    /// Runs one chain a sink. A chain that fails does not stop the others.
    ///
    /// # Errors
    /// As [`Model::plan`].
    pub fn run_into(
        &self,
        options: &RunOptions,
        threads: usize,
        progress: &Progress,
        sinks: Vec<Box<dyn Sink>>,
    ) -> Result<Vec<Result<ChainResult, ChainError>>, Error> {
        if options.time.is_some() && !clock::RUNS {
            let d = Diagnostic::new(Severity::Error, "there is no clock on this platform, so a run cannot end by time");
            return Err(Error { diagnostics: vec![d.hint("bound it by `steps`")], sources: self.sources.clone() });
        }
        let (plan, _) = self.plan()?;
        Ok(run_chains(self.code(), &plan, options, threads, progress, sinks))
    }
}

/// Draws from a posterior, and the chains that made them.
#[derive(Debug)]
pub struct Posterior {
    /// The draws of each chain.
    pub draws: Vec<ChainDraws>,
    /// The last state of each chain, its kernels, its counts.
    pub chains: Vec<ChainResult>,
}

impl Posterior {
    /// Every scalar quantity with its summary; elements of vectors are `name[i]`.
    pub fn quantities(&self) -> Vec<Quantity> {
        quantities(&self.draws)
    }

    /// One of them.
    pub fn quantity(&self, name: &str) -> Option<Quantity> {
        self.quantities().into_iter().find(|q| q.name == name)
    }

    /// The draws of every scalar quantity, all chains one after the other.
    pub fn scalars(&self) -> Vec<(String, Vec<f64>)> {
        self.quantities().into_iter().map(|q| (q.name, q.chains.concat())).collect()
    }
}
