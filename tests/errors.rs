//! Each program in `programs/errors/<phase>/` holds one kind of mistake; what the user is told is in `tests/snapshots`.
//!
//! A new file becomes a test by itself. `INSTA_UPDATE=always cargo test --test errors` accepts the messages as they are:
//! read them first as someone would who wrote that program.

use pcadlang::diag::{Diagnostic, IntoDiagnostic, SourceMap, render};
use pcadlang::syntax::parse;
use pcadlang::syntax::span::FileId;

/// What a phase says about a program.
type Diagnose = fn(&str, FileId) -> Vec<Diagnostic>;

/// The message for the program at a path, as shown without colours.
fn message(path: &std::path::Path, diagnose: Diagnose) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let mut map = SourceMap::new();
    let id = map.add(&path.file_name().unwrap().to_string_lossy(), &text);
    let diagnostics = diagnose(&text, id);
    assert!(!diagnostics.is_empty(), "{} is taken for correct", path.display());
    for diagnostic in &diagnostics {
        assert!(diagnostic.labels.iter().any(|l| l.primary), "{}: no place: {}", path.display(), diagnostic.message);
    }
    render(&map, &diagnostics, false)
}

/// A test of the programs of one phase.
macro_rules! phase {
    ($name:ident, $glob:literal, $diagnose:expr) => {
        #[test]
        fn $name() {
            let mut settings = insta::Settings::clone_current();
            settings.set_prepend_module_to_snapshot(false);
            settings.set_omit_expression(true);
            settings.bind(|| {
                insta::glob!("../programs/errors", $glob, |path| {
                    insta::assert_snapshot!(stringify!($name), message(path, $diagnose));
                });
            });
        }
    };
}

phase!(parse_errors, "parse/*.pcad", |text, file| {
    parse(text, file).1.into_iter().map(IntoDiagnostic::into_diagnostic).collect()
});
