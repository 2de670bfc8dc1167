//! `docs/reference/kernels.json` and `kernels.md` beside it list which tests run which
//! kernels; they are generated from the lists that the tests read
//! (`tests/common/kernels.rs`).
//!
//! `REGENERATE=1 cargo test --release --test inference -- kernels::` rewrites both.

use crate::common::kernels::PROOFS;
use pcadlang_library::standard;
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// Returns the kernels of the language, in the order of its reference.
fn kernels() -> Vec<String> {
    let table = standard::table();
    let kernels = table.iter().filter(|b| b.section == "Kernels");
    kernels.map(|b| b.full_name()).collect()
}

fn machine_readable() -> String {
    let row = |kernel: &String| {
        let proofs: Map<String, Value> =
            PROOFS.iter().map(|p| (p.name.to_owned(), json!(p.runs(kernel)))).collect();
        json!({ "kernel": kernel, "tests": proofs })
    };
    let tests = PROOFS
        .iter()
        .map(|p| (p.name.to_owned(), json!({ "shows": p.shows, "file": p.file })))
        .collect();
    let all = json!({ "tests": Value::Object(tests), "kernels": kernels().iter().map(row).collect::<Vec<_>>() });
    serde_json::to_string_pretty(&all).unwrap() + "\n"
}

fn readable() -> String {
    let mut s = "# Which tests run which kernels\n\n\
        Made from the lists that the tests read, by `REGENERATE=1 cargo test --release --test inference -- kernels::`; the same as data is in\n\
        [kernels.json](kernels.json). How to check a program of your own: [validation](../howto/validation.md).\n\n"
        .to_owned();
    let names: Vec<&str> = PROOFS.iter().map(|p| p.name).collect();
    let _ = writeln!(s, "| kernel | {} |", names.join(" | "));
    let _ = writeln!(s, "| --- |{}", " --- |".repeat(names.len()));
    for kernel in &kernels() {
        let cells: Vec<&str> =
            PROOFS.iter().map(|p| if p.runs(kernel) { "✓" } else { "" }).collect();
        let _ = writeln!(s, "| `{kernel}` | {} |", cells.join(" | "));
    }
    s.push_str("\n## What the tests show\n\n");
    for p in PROOFS {
        let _ = writeln!(s, "* **{}** (`{}`): {}.", p.name, p.file, p.shows);
    }
    s
}

fn up_to_date(name: &str, expected: &str) {
    let path = format!("{}/docs/reference/{name}", env!("CARGO_MANIFEST_DIR"));
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&path, expected).unwrap();
        return;
    }
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        text == expected,
        "docs/reference/{name} is out of date: REGENERATE=1 cargo test --release --test inference -- kernels::"
    );
}

#[test]
fn the_table_says_what_the_tests_run() {
    up_to_date("kernels.json", &machine_readable());
    up_to_date("kernels.md", &readable());
}

#[test]
fn every_kernel_is_proved_in_two_ways_at_least() {
    for kernel in kernels() {
        let by: Vec<&str> = PROOFS.iter().filter(|p| p.runs(&kernel)).map(|p| p.name).collect();
        assert!(
            by.len() >= 2,
            "{kernel} is in {by:?} only: add it to lists of tests/common/kernels.rs"
        );
    }
    assert!(!PROOFS.iter().any(|p| p.runs("h") || p.runs("nothing")), "names are whole words");
}
