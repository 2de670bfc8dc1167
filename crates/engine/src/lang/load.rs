//! Loads the files of a program: the main one and those it includes, each parsed once per
//! `include`.
//!
//! Files come from a [`Loader`], usually a [`Reach`](super::reach::Reach). It may ship
//! files, which work in any folder; a user's file takes precedence over a shipped one of
//! the same name.

pub use super::reach::{Loader, Shipped, shipped_file};

use super::reach::Outside;
use pcadlang_syntax::ast::{ItemKind, Program};
use pcadlang_syntax::diag::{Diagnostic, IntoDiagnostic, SourceMap};
use pcadlang_syntax::parse;
use pcadlang_syntax::span::{FileId, Span};
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

/// Returns a file's contents, and whether they are shipped.
///
/// # Errors
/// If the loader fails and ships no file of that name.
pub fn read(loader: &dyn Loader, path: &str) -> io::Result<(Vec<u8>, bool)> {
    match loader.read(path) {
        Ok(bytes) => Ok((bytes, false)),
        Err(e) => match shipped_file(loader.shipped(), path) {
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
                pcadlang_syntax::diag::Severity::Error,
                format!("cannot read {path}: {}", reason(&e)),
            );
            // The ending is not part of the comparison.
            let stem = |path: &'static str| path.strip_suffix(PCAD).unwrap_or(path);
            let wanted = path.strip_suffix(PCAD).unwrap_or(path);
            let near = pcadlang_syntax::diag::nearest(
                wanted,
                shipped_programs(loader.shipped()).map(stem),
            );
            return Err(vec![match near {
                Some(n) => d.hint(format!("did you mean the shipped program {n}{PCAD}?")),
                None => d.hint(format!(
                    "shipped programs are {}",
                    shipped_programs(loader.shipped()).collect::<Vec<_>>().join(", ")
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

/// Returns the names of the programs among shipped files.
pub fn shipped_programs(files: Shipped) -> impl Iterator<Item = &'static str> {
    files.iter().map(|(n, _)| *n).filter(|n| n.ends_with(".pcad") && !n.contains('/'))
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
                let near = pcadlang_syntax::diag::nearest(
                    path,
                    self.loader.shipped().iter().map(|(n, _)| *n),
                );
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
