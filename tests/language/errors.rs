//! Each program in `programs/errors/<phase>/` has one kind of mistake; its messages are
//! in `tests/snapshots`.
//!
//! A new file becomes a test automatically.
//! `INSTA_UPDATE=always cargo test --release --test language -- errors::` accepts the
//! present messages: read them first as the author of that program would.
//!
//! `parse` has programs that the grammar rejects, `name` and `type` those that do not
//! compile, and `runtime` those that fail in a short run of one chain. Programs in
//! subfolders are there to be included.

use crate::common::snapshots;
use pcadlang::{Error, Program, RunOptions};
use pcadlang_syntax::diag::{Diagnostic, IntoDiagnostic, SourceMap, render};
use pcadlang_syntax::parse;
use std::collections::HashSet;
use std::path::Path;

/// Returns the errors of the program at a path in some phase.
type Diagnose = fn(&Path) -> Error;

/// Returns the path relative to the crate's root, so that messages do not depend on where
/// the crate is.
fn relative(path: &Path) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = root.canonicalize().unwrap();
    path.canonicalize().unwrap().strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/")
}

/// Returns the messages of the parser alone.
fn parsing(path: &Path) -> Error {
    let text = std::fs::read_to_string(path).unwrap();
    let mut sources = SourceMap::new();
    let id = sources.add(&path.file_name().unwrap().to_string_lossy(), &text);
    let diagnostics: Vec<Diagnostic> =
        parse(&text, id).1.into_iter().map(IntoDiagnostic::into_diagnostic).collect();
    Error { diagnostics, sources }
}

/// Returns the errors of loading and compiling; data may be missing.
fn compiling(path: &Path) -> Error {
    match Program::open(&relative(path)).and_then(|p| p.without_data().compile()) {
        Ok(_) => panic!("{} is taken for correct", path.display()),
        Err(e) => e,
    }
}

/// Returns the error of a short run of a program that compiles.
fn running(path: &Path) -> Error {
    let model = match Program::open(&relative(path)).and_then(|p| p.without_data().compile()) {
        Ok(model) => model,
        Err(e) => panic!("{} does not compile: {e}", path.display()),
    };
    let options = RunOptions { steps: Some(50), warmup: Some(50), ..RunOptions::default() };
    match model.run(&options, 1, 1) {
        Ok(_) => panic!("{} is taken for correct", path.display()),
        Err(e) => e,
    }
}

/// Returns the messages for the program at a path, rendered without colours.
fn message(path: &Path, diagnose: Diagnose) -> String {
    let Error { diagnostics, sources } = diagnose(path);
    assert!(!diagnostics.is_empty(), "{} is taken for correct", path.display());
    for diagnostic in &diagnostics {
        assert!(
            diagnostic.labels.iter().any(|l| l.primary),
            "{}: no place: {}",
            path.display(),
            diagnostic.message
        );
    }
    render(&sources, &diagnostics, false)
}

/// Defines a test of the programs of one phase.
macro_rules! phase {
    ($name:ident, $glob:literal, $diagnose:expr) => {
        #[test]
        fn $name() {
            snapshots::settings("").bind(|| {
                insta::glob!("../../programs/errors", $glob, |path| {
                    insta::assert_snapshot!(stringify!($name), message(path, $diagnose));
                });
            });
        }
    };
}

phase!(parse_errors, "parse/*.pcad", parsing);
phase!(name_errors, "name/*.pcad", compiling);
phase!(type_errors, "type/*.pcad", compiling);
phase!(runtime_errors, "runtime/*.pcad", running);

const PHASES: [(&str, &str, Diagnose); 4] = [
    ("parse", "Syntax errors", parsing),
    ("name", "Names, arguments, and misplaced statements", compiling),
    ("type", "Type errors", compiling),
    ("runtime", "Errors during a run", running),
];

/// Of each kind of mistake the first message with its hint; of those during a run, which
/// depend on the program, the message alone. `tests/snapshots` has the complete messages.
#[test]
fn the_page_of_messages_is_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut text = String::from(
        "# Mistakes and their messages\n\n\
         What `pcadlang` says of each kind of mistake, before a run with its hint. The programs\n\
         are in `programs/errors`, the complete messages with their places in `tests/snapshots`.\n\
         `REGENERATE=1 cargo test --release --test language -- errors::` writes this page.\n",
    );
    for (phase, title, diagnose) in PHASES {
        text += &format!("\n## {title}\n\n");
        let mut programs: Vec<_> = std::fs::read_dir(root.join("programs/errors").join(phase))
            .unwrap()
            .map(|f| f.unwrap().path())
            .filter(|p| p.extension().is_some_and(|e| e == "pcad"))
            .collect();
        programs.sort();
        let mut written = HashSet::new();
        for path in programs {
            let first = diagnose(&path).diagnostics.swap_remove(0);
            let hint = first.hints.first().filter(|_| phase != "runtime");
            if written.insert(first.message.clone()) {
                let hint = hint.map_or(String::new(), |h| format!(" {h}"));
                text += &format!("- **{}**{hint}\n", first.message);
            }
        }
    }
    let path = root.join("docs/reference/mistakes.md");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(path, &text).unwrap();
        return;
    }
    let there = std::fs::read_to_string(path).unwrap();
    assert!(
        there == text,
        "docs/reference/mistakes.md is out of date: REGENERATE=1 cargo test --release --test language -- errors::"
    );
}
