//! The layers of `docs/explanation/architecture.md` (those between crates are kept by the compiler):
//! dependencies between modules go one way, and only the command prints.

use std::path::{Path, PathBuf};

pub(super) fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

fn files(module: &str) -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    if root.join(module).is_dir() {
        sources(&root.join(module), &mut paths);
    }
    paths.extend(Some(root.join(format!("{module}.rs"))).filter(|p| p.exists()));
    paths.into_iter().map(|p| (p.clone(), std::fs::read_to_string(p).unwrap())).collect()
}

/// Returns the text of a file without its unit tests, which may use anything.
pub(super) fn without_tests(text: &str) -> &str {
    text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text)
}

/// Whether a file has nothing but tests.
pub(super) fn is_test(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    stem.ends_with("tests") || path.components().any(|c| c.as_os_str() == "tests")
}

#[test]
fn modules_depend_one_way() {
    let below = ["num", "platform", "rng"];
    let scene = ["geom", "render", "vision", "nn", "people"];
    let lang = ["lang", "syntax", "diag", "dist"];
    let allowed: [(&str, &[&[&str]]); 15] = [
        ("syntax", &[&["syntax", "diag"]]),
        ("diag", &[&["diag", "syntax"]]),
        ("lang", &[&lang, &below]),
        ("trace", &[&["trace"], &lang, &below]),
        ("infer", &[&["infer", "trace"], &lang, &below]),
        ("host", &[&["host", "infer"], &lang, &below]),
        ("scene", &[&["scene", "host"], &lang, &below, &scene]),
        ("standard", &[&["standard", "host", "scene"], &lang]),
        ("report", &[&["report", "infer", "geom", "render", "vision"], &below]),
        ("score", &[&["score"]]),
        ("tradeoff", &[&["tradeoff", "report"], &below]),
        (
            "model",
            &[
                &[
                    "model",
                    "Model",
                    "RunOptions",
                    "standard",
                    "host",
                    "scene",
                    "render",
                    "report",
                    "infer",
                    "trace",
                ],
                &lang,
                &below,
            ],
        ),
        ("editor", &[&["editor", "Model", "Program", "standard"], &lang]),
        ("bank", &[&["bank", "Model", "scene", "report", "infer", "trace"], &lang, &below, &scene]),
        (
            "session",
            &[
                &[
                    "session", "bank", "editor", "Model", "model", "scene", "report", "infer",
                    "trace",
                ],
                &lang,
                &below,
                &scene,
            ],
        ),
    ];
    let mut seen = 0;
    for (module, may) in allowed {
        for (path, text) in &files(module) {
            if is_test(path) {
                continue;
            }
            for part in without_tests(text).split("crate::").skip(1) {
                let used: String =
                    part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                assert!(
                    used.is_empty() || may.iter().any(|may| may.contains(&&*used)),
                    "{}: {module} must not use {used}",
                    path.display()
                );
                seen += 1;
            }
        }
    }
    assert!(seen > 300, "only {seen} uses were found");
}

#[test]
fn only_the_command_prints_and_no_file_is_long() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    sources(&root, &mut paths);
    for member in ["numerics", "scene", "detectors"] {
        sources(&root.with_file_name("crates").join(member).join("src"), &mut paths);
    }
    let tests = root.with_file_name("tests");
    sources(&tests, &mut paths);
    assert!(paths.len() > 400);
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.lines().count() <= 600,
            "{} has {} lines",
            path.display(),
            text.lines().count()
        );
        assert!(text.starts_with("//!"), "{} does not say what it is", path.display());
        if path.starts_with(&tests) {
            continue;
        }
        let is_command = path.starts_with(root.join("cli")) || path.ends_with("main.rs");
        for print in ["println!(", "eprintln!(", "print!(", "dbg!("] {
            assert!(
                is_command || !without_tests(&text).contains(print),
                "{} prints",
                path.display()
            );
        }
    }
}
