//! Loads the files of a program: the main one and those it includes, each parsed once per
//! `include`.
//!
//! Files come from a [`Loader`], usually a [`Reach`](super::reach::Reach); `std/…` and
//! the shipped programs are embedded, so that they work in any folder. A user's file
//! takes precedence over an embedded one of the same name.

pub use super::reach::Loader;

use super::reach::Outside;
use crate::diag::{Diagnostic, IntoDiagnostic, SourceMap};
use crate::syntax::ast::{ItemKind, Program};
use crate::syntax::parse;
use crate::syntax::span::{FileId, Span};
use std::io;
use std::path::Path;

/// A loader without files: only embedded ones are found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nowhere;

impl Loader for Nowhere {
    fn read(&self, _path: &str) -> io::Result<Vec<u8>> {
        Err(io::ErrorKind::NotFound.into())
    }
}

/// The shipped programs and the files they read, by the name that a user gives.
pub const EMBEDDED: &[(&str, &str)] = &[
    ("coin.pcad", include_str!("../../programs/coin.pcad")),
    ("linreg.pcad", include_str!("../../programs/linreg.pcad")),
    ("linreg.settings.json", include_str!("../../programs/linreg.settings.json")),
    ("mixture.pcad", include_str!("../../programs/mixture.pcad")),
    ("crp.pcad", include_str!("../../programs/crp.pcad")),
    ("geometric.pcad", include_str!("../../programs/geometric.pcad")),
    ("human.pcad", include_str!("../../programs/human.pcad")),
    ("human.quality.json", include_str!("../../programs/human.quality.json")),
    ("human.settings.json", include_str!("../../programs/human.settings.json")),
    ("human_kth.pcad", include_str!("../../programs/human_kth.pcad")),
    ("human_paper.pcad", include_str!("../../programs/human_paper.pcad")),
    ("two_people.pcad", include_str!("../../programs/two_people.pcad")),
    ("autorig.pcad", include_str!("../../programs/autorig.pcad")),
    ("lathe.pcad", include_str!("../../programs/lathe.pcad")),
    ("lathe.quality.json", include_str!("../../programs/lathe.quality.json")),
    ("lathe.settings.json", include_str!("../../programs/lathe.settings.json")),
    ("lathe_parts.pcad", include_str!("../../programs/lathe_parts.pcad")),
    ("lathe_paper.pcad", include_str!("../../programs/lathe_paper.pcad")),
    ("scene.pcad", include_str!("../../programs/scene.pcad")),
    ("std/scene.pcad", include_str!("../../programs/std/scene.pcad")),
    ("std/human/human.obj", include_str!("../../programs/std/human/human.obj")),
    ("std/human/human.rig.json", include_str!("../../programs/std/human/human.rig.json")),
    ("std/human/human.morphs.json", include_str!("../../programs/std/human/human.morphs.json")),
    ("std/human/human.lod1.obj", include_str!("../../programs/std/human/human.lod1.obj")),
    ("std/human/human.lod1.rig.json", include_str!("../../programs/std/human/human.lod1.rig.json")),
    (
        "std/human/human.lod1.morphs.json",
        include_str!("../../programs/std/human/human.lod1.morphs.json"),
    ),
    ("std/human/human.lod2.obj", include_str!("../../programs/std/human/human.lod2.obj")),
    ("std/human/human.lod2.rig.json", include_str!("../../programs/std/human/human.lod2.rig.json")),
    (
        "std/human/human.lod2.morphs.json",
        include_str!("../../programs/std/human/human.lod2.morphs.json"),
    ),
    ("std/human/pose_prior.json", include_str!("../../programs/std/human/pose_prior.json")),
    ("data/dog.obj", include_str!("../../programs/data/dog.obj")),
    ("data/line.csv", include_str!("../../programs/data/line.csv")),
    ("data/groups.csv", include_str!("../../programs/data/groups.csv")),
];

/// Returns an embedded file.
pub fn embedded(path: &str) -> Option<&'static str> {
    EMBEDDED.iter().find(|(name, _)| *name == path).map(|(_, text)| *text)
}

/// Returns a file's contents, and whether they are embedded.
///
/// # Errors
/// If the loader fails and there is no embedded file of that name.
pub fn read(loader: &dyn Loader, path: &str) -> io::Result<(Vec<u8>, bool)> {
    match loader.read(path) {
        Ok(bytes) => Ok((bytes, false)),
        Err(e) => match embedded(path) {
            Some(text) => Ok((text.as_bytes().to_vec(), true)),
            None => Err(e),
        },
    }
}

/// One parsed file.
#[derive(Clone, Debug)]
pub struct Unit {
    /// Its number in the source map.
    pub file: FileId,
    /// The folder its paths are relative to: empty, or ending in `/`.
    pub folder: String,
    /// Its path.
    pub path: String,
    /// Its syntax tree.
    pub program: Program,
    /// By item: the unit that an `include` loads.
    pub includes: Vec<Option<usize>>,
}

/// A program with all its includes; unit 0 is the main file.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The files.
    pub units: Vec<Unit>,
    /// Notes: embedded files that were used.
    pub embedded: Vec<String>,
}

/// The ending of the names of programs.
const PCAD: &str = ".pcad";

/// The maximum number of includes, nested ones counted.
const MAX_INCLUDES: usize = 256;

/// Loads a program given by path. Sources are added to `map` even if there are errors.
///
/// # Errors
/// Every syntax error of every file, missing files, circular includes.
pub fn load(
    path: &str,
    loader: &dyn Loader,
    map: &mut SourceMap,
) -> Result<Loaded, Vec<Diagnostic>> {
    let (bytes, inside) = match read(loader, path) {
        Ok(found) => found,
        Err(e) => {
            let d = Diagnostic::new(
                crate::diag::Severity::Error,
                format!("cannot read {path}: {}", reason(&e)),
            );
            // The ending is not part of the comparison.
            let stem = |path: &'static str| path.strip_suffix(PCAD).unwrap_or(path);
            let wanted = path.strip_suffix(PCAD).unwrap_or(path);
            let near = crate::diag::nearest(wanted, shipped().map(stem));
            return Err(vec![match near {
                Some(n) => d.hint(format!("did you mean the shipped program {n}{PCAD}?")),
                None => d.hint(format!(
                    "shipped programs are {}",
                    shipped().collect::<Vec<_>>().join(", ")
                )),
            }]);
        }
    };
    let mut loading =
        Loading { loader, map, loaded: Loaded::default(), errors: Vec::new(), stack: Vec::new() };
    loading.unit(tidy(path), &bytes, inside);
    loading.finish()
}

/// Loads a program given as text.
///
/// # Errors
/// As [`load`].
pub fn load_text(
    name: &str,
    text: &str,
    loader: &dyn Loader,
    map: &mut SourceMap,
) -> Result<Loaded, Vec<Diagnostic>> {
    match load_partly(name, text, loader, map) {
        (loaded, errors) if errors.is_empty() => Ok(loaded),
        (_, errors) => Err(errors),
    }
}

/// Loads what can be loaded of a program given as text, with the errors of the rest.
pub fn load_partly(
    name: &str,
    text: &str,
    loader: &dyn Loader,
    map: &mut SourceMap,
) -> (Loaded, Vec<Diagnostic>) {
    let mut loading =
        Loading { loader, map, loaded: Loaded::default(), errors: Vec::new(), stack: Vec::new() };
    loading.unit(tidy(name), text.as_bytes(), false);
    (loading.loaded, loading.errors)
}

/// Returns the names of the programs that come with the binary.
pub fn shipped() -> impl Iterator<Item = &'static str> {
    EMBEDDED.iter().map(|(n, _)| *n).filter(|n| n.ends_with(".pcad") && !n.contains('/'))
}

/// Returns why a file could not be read, without the error number of the operating
/// system.
pub fn reason(e: &io::Error) -> String {
    match e.kind() {
        io::ErrorKind::NotFound => "no such file".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::IsADirectory => "it is a folder".into(),
        _ => e.to_string(),
    }
}

/// Resolves a path given in a file of `folder`, which is empty or ends in `/`.
pub fn beside(folder: &str, path: &str) -> String {
    if Path::new(path).is_absolute() { path.to_owned() } else { format!("{folder}{path}") }
}

/// Removes `./` from the start of a path, so that a file has one name here and cycles are
/// detected.
fn tidy(mut path: &str) -> &str {
    while let Some(rest) = path.strip_prefix("./") {
        path = rest.trim_start_matches('/');
    }
    path
}

struct Loading<'a> {
    loader: &'a dyn Loader,
    map: &'a mut SourceMap,
    loaded: Loaded,
    errors: Vec<Diagnostic>,
    /// The paths being loaded, outermost first.
    stack: Vec<String>,
}

impl Loading<'_> {
    fn finish(self) -> Result<Loaded, Vec<Diagnostic>> {
        if self.errors.is_empty() { Ok(self.loaded) } else { Err(self.errors) }
    }

    fn unit(&mut self, path: &str, bytes: &[u8], inside: bool) -> usize {
        let index = self.loaded.units.len();
        let (program, file) = match self.map.add_bytes(path, bytes) {
            Ok(file) => {
                let text = self.map.get(file).map(|f| f.text().clone()).unwrap_or_default();
                let (program, errors) = parse(&text, file);
                self.errors.extend(errors.into_iter().map(IntoDiagnostic::into_diagnostic));
                (program, file)
            }
            Err(d) => {
                let file = d.labels.first().map_or(FileId(0), |l| l.span.file);
                self.errors.push(d);
                (Program::default(), file)
            }
        };
        if inside {
            self.loaded.embedded.push(path.to_owned());
        }
        let folder = path.rfind('/').map_or("", |i| &path[..=i]).to_owned();
        let wanted: Vec<Option<(String, Span)>> = program
            .items
            .iter()
            .map(|item| match &item.kind {
                ItemKind::Include { path, .. } => Some((path.node.to_string(), path.span)),
                _ => None,
            })
            .collect();
        self.loaded.units.push(Unit {
            file,
            folder: folder.clone(),
            path: path.to_owned(),
            program,
            includes: Vec::new(),
        });
        self.stack.push(path.to_owned());
        let includes = wanted
            .into_iter()
            .map(|w| w.and_then(|(p, span)| self.include(&folder, &p, span)))
            .collect();
        self.stack.pop();
        self.loaded.units[index].includes = includes;
        index
    }

    fn include(&mut self, folder: &str, path: &str, span: Span) -> Option<usize> {
        let path = tidy(path);
        let beside = beside(folder, path);
        let found = read(self.loader, &beside).map(|f| (f, beside.clone()));
        let found =
            found.or_else(|e| read(self.loader, path).map(|f| (f, path.to_owned())).map_err(|_| e));
        let ((bytes, inside), path) = match found {
            Ok(f) => f,
            Err(e) => {
                let d = Diagnostic::error(format!("cannot read {beside}"), span, reason(&e));
                let near = crate::diag::nearest(path, EMBEDDED.iter().map(|(n, _)| *n));
                self.errors.push(match (Outside::hint(&e), near) {
                    (Some(hint), _) => d.hint(hint),
                    (None, Some(n)) => d.hint(format!("did you mean \"{n}\"?")),
                    (None, None) => {
                        d.hint("paths are relative to the file that includes; `std/…` is built in")
                    }
                });
                return None;
            }
        };
        if let Some(i) = self.stack.iter().position(|p| *p == path) {
            let way = self.stack[i..].join(" -> ");
            let d = Diagnostic::error(
                "files include each other in a cycle",
                span,
                format!("{path} is being loaded"),
            );
            self.errors.push(d.note(format!("{way} -> {path}")));
            return None;
        }
        if self.loaded.units.len() >= MAX_INCLUDES {
            self.errors.push(Diagnostic::error(
                "too many included files",
                span,
                format!("more than {MAX_INCLUDES}"),
            ));
            return None;
        }
        Some(self.unit(&path, &bytes, inside))
    }
}
