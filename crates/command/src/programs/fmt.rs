//! `pcadlang fmt`.

use crate::args::Fmt;
use pcadlang_engine::lang::load::reason;
use pcadlang_report::write_file;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files;
use pcadlang_runs::term::has_colors;
use pcadlang_syntax::diag::{IntoDiagnostic, SourceMap, render};
use pcadlang_syntax::format;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Formats files, or standard input. Programs that do not parse are unchanged.
pub fn fmt(a: &Fmt) -> Result<(), Failure> {
    if a.stdin {
        return standard_input(a.check);
    }
    let mut programs = Vec::new();
    for path in &a.paths {
        find(path, true, &mut programs)?;
    }
    let (mut changed, mut failed) = (0, 0);
    for path in &programs {
        let name = path.display().to_string();
        match formatted(&name, &files::read(path)?) {
            Err(message) => {
                error_text!("{message}");
                failed += 1;
            }
            Ok(None) => {}
            Ok(Some(_)) if a.check => {
                print_line!("{name}");
                changed += 1;
            }
            Ok(Some(text)) => {
                replace(path, text.as_bytes())
                    .map_err(|e| plain(format!("cannot write {name}: {}", reason(&e))))?;
                print_line!("{name}: formatted");
            }
        }
    }
    let all = programs.len();
    match (failed, changed) {
        (0, 0) => Ok(()),
        (0, n) => Err(Failure::Plain(
            format!("{n} of {all} programs would change"),
            Some("`pcadlang fmt` without --check formats them".into()),
        )),
        (n, _) => Err(plain(format!("{n} of {all} programs do not parse and are unchanged"))),
    }
}

fn standard_input(check: bool) -> Result<(), Failure> {
    let mut bytes = Vec::new();
    std::io::stdin()
        .read_to_end(&mut bytes)
        .map_err(|e| plain(format!("cannot read standard input: {e}")))?;
    match formatted("<stdin>", &bytes) {
        Err(message) => {
            error_text!("{message}");
            Err(plain("the program does not parse"))
        }
        Ok(Some(_)) if check => Err(plain("the program would change")),
        Ok(_) if check => Ok(()),
        Ok(text) => {
            let bytes = text.map_or(bytes, String::into_bytes);
            std::io::stdout().write_all(&bytes).map_err(|e| plain(format!("cannot write: {e}")))
        }
    }
}

/// Formats a program; `None` if it is formatted already.
///
/// # Errors
/// The syntax errors, with their locations.
fn formatted(name: &str, bytes: &[u8]) -> Result<Option<String>, String> {
    let mut sources = SourceMap::new();
    let shown = |sources: &SourceMap, d: Vec<_>| render(sources, &d, has_colors());
    let file = sources.add_bytes(name, bytes).map_err(|d| shown(&sources, vec![d]));
    let text =
        file.map(|file| sources.get(file).map(|f| f.text().to_string()).unwrap_or_default())?;
    match format(&text) {
        Ok(new) => Ok((new.as_bytes() != bytes).then_some(new)),
        Err(errors) => {
            Err(shown(&sources, errors.into_iter().map(IntoDiagnostic::into_diagnostic).collect()))
        }
    }
}

/// Adds a program, or the programs in a folder and its subfolders. Names that begin with
/// a dot are hidden.
fn find(path: &Path, inputs: bool, programs: &mut Vec<PathBuf>) -> Result<(), Failure> {
    if !path.is_dir() {
        if inputs || path.extension().is_some_and(|extension| extension == "pcad") {
            programs.push(path.to_owned());
        }
        return Ok(());
    }
    let unreadable =
        |e: std::io::Error| plain(format!("cannot read {}: {}", path.display(), reason(&e)));
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(path).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        // Links to folders may form cycles.
        let link = entry.file_type().is_ok_and(|kind| kind.is_symlink()) && entry.path().is_dir();
        if !link && !entry.file_name().to_string_lossy().starts_with('.') {
            entries.push(entry.path());
        }
    }
    entries.sort();
    entries.iter().try_for_each(|entry| find(entry, false, programs))
}

/// Replaces the contents of a file atomically; of a link, those of its target.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    write_file(&path.canonicalize()?, bytes)
}
