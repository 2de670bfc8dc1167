//! The layers of `docs/architecture.md`: dependencies between modules go one way, and
//! only the command prints.

use std::path::{Path, PathBuf};

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
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
fn without_tests(text: &str) -> &str {
    text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text)
}

#[test]
fn modules_depend_one_way() {
    let allowed: &[(&str, &[&str])] = &[
        ("platform", &["platform"]),
        ("num", &["num"]),
        ("rng", &["rng"]),
        ("syntax", &["syntax", "diag"]),
        ("diag", &["diag", "syntax"]),
        ("dist", &["dist", "num", "rng"]),
        ("geom", &["geom", "num"]),
        ("render", &["render", "geom", "num", "platform"]),
        ("nn", &["nn", "num"]),
        ("vision", &["vision", "nn", "num", "platform", "rng"]),
        ("lang", &["lang", "syntax", "diag", "dist", "geom", "render", "vision", "num", "rng"]),
        ("trace", &["trace", "lang", "syntax", "diag", "dist", "num", "platform", "rng"]),
        ("infer", &["infer", "trace", "lang", "syntax", "diag", "dist", "num", "platform", "rng"]),
        ("host", &["host", "infer", "lang", "syntax", "diag", "dist", "render", "rng", "Error"]),
        ("report", &["report", "infer", "num"]),
        ("score", &["score"]),
        ("tradeoff", &["tradeoff", "rng"]),
        (
            "session",
            &[
                "session", "bank", "Model", "model", "report", "infer", "trace", "lang", "syntax",
                "diag", "geom", "platform", "render", "rng",
            ],
        ),
        (
            "bank",
            &[
                "bank", "Model", "report", "infer", "trace", "lang", "dist", "render", "vision",
                "num", "rng",
            ],
        ),
    ];
    let mut seen = 0;
    for (module, may) in allowed {
        for (path, text) in files(module) {
            for part in without_tests(&text).split("crate::").skip(1) {
                let used: String =
                    part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                assert!(
                    used.is_empty() || may.contains(&&*used),
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
    assert!(paths.len() > 100);
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.lines().count() <= 600,
            "{} has {} lines",
            path.display(),
            text.lines().count()
        );
        assert!(text.starts_with("//!"), "{} does not say what it is", path.display());
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
