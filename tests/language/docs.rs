//! `docs/reference/builtins.md` is generated from the table of built-ins, and the
//! README's program runs.
//!
//! `REGENERATE=1 cargo test --release --test language -- docs::` rewrites the reference.

use pcadlang::{Model, RunOptions};
use pcadlang_engine::lang::builtins::doc;
use pcadlang_library::standard;

const START: &str = "<!-- reference: generated from the table of built-ins -->\n";

#[test]
fn the_reference_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference/builtins.md");
    let text = std::fs::read_to_string(path).unwrap();
    let head = text.split(START).next().unwrap().trim_end();
    let expected = format!("{head}\n\n{START}\n{}", doc::reference(&standard::table()));
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(path, &expected).unwrap();
        return;
    }
    assert!(
        text == expected,
        "docs/reference/builtins.md is out of date: REGENERATE=1 cargo test --release --test language -- docs::"
    );
}

#[test]
fn the_programs_of_the_readme_run() {
    let readme =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let start = readme.find("    // line.pcad").expect("the README shows line.pcad");
    let program: String = readme[start..]
        .lines()
        .take_while(|l| l.starts_with("    "))
        .map(|l| format!("{}\n", &l[4..]))
        .collect();
    let model = Model::from_text(&program).unwrap_or_else(|e| panic!("{e}"));
    let posterior = model
        .run(&RunOptions { seed: 1, ..RunOptions::default() }, 2, 2)
        .unwrap_or_else(|e| panic!("{e}"));
    let slope = posterior.quantity("slope").unwrap().summary;
    assert!((slope.mean - 1.98).abs() < 0.1, "{}", slope.mean);
}
