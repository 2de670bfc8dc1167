//! Formatting only changes spaces, line ends and commas before closing brackets.

use super::generator::Generator;
use super::{bare, program, shown};
use crate::common::snapshots;
use pcadlang_syntax::{SyntaxErrorKind, WIDTH, format, parse, print, span::FileId};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

/// Returns the formatted text, after checking that it has the same meaning and that
/// formatting is idempotent.
fn formatted(text: &str) -> String {
    let once = format(text).unwrap_or_else(|errors| panic!("{}\n{text}", shown(text, errors)));
    let (again, errors) = parse(&once, FileId(0));
    assert!(errors.is_empty(), "{}\n{text}\n-----\n{once}", shown(&once, errors));
    assert_eq!(bare(&again), bare(&program(text)), "{text}\n-----\n{once}");
    assert_eq!(format(&once).unwrap(), once, "twice is not once:\n{text}");
    assert!(
        once.lines().all(|line| line.starts_with("//") || line == line.trim_end()),
        "spaces at a line's end:\n{once}"
    );
    once
}

/// Collects every `.pcad` file in a folder and its subfolders.
fn programs(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            programs(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "pcad") {
            found.push(path);
        }
    }
}

#[test]
fn programs_mean_what_they_meant() {
    let mut found = Vec::new();
    for folder in ["programs", "tests/syntax", "tests/posteriordb", "benches/peers"] {
        programs(Path::new(folder), &mut found);
    }
    let mut count = 0;
    for path in found {
        let text = std::fs::read_to_string(path).unwrap();
        if parse(&text, FileId(0)).1.is_empty() {
            let once = formatted(&text);
            let comments = |text: &str| text.lines().filter(|line| line.contains("//")).count();
            assert_eq!(comments(&text), comments(&once), "{once}");
            count += 1;
        }
    }
    assert!(count > 40, "{count}");
}

#[test]
fn shipped_programs_are_formatted() {
    let mut found = Vec::new();
    programs(Path::new("programs"), &mut found);
    let errors = Path::new("programs/errors");
    for path in found.iter().filter(|path| !path.starts_with(errors)) {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(
            format(&text).unwrap() == text,
            "{0}: cargo run --release -- fmt {0}",
            path.display()
        );
    }
}

#[test]
fn what_does_not_parse_is_left_alone() {
    assert!(format("let a = ;").is_err_and(|errors| errors.len() == 1));
    assert!(format("/* no end").is_err());
}

#[test]
fn files_of_other_systems() {
    assert_eq!(format("").unwrap(), "");
    assert_eq!(format("\n\n// alone").unwrap(), "// alone\n");
    assert_eq!(format("\u{feff}let a=1;").unwrap(), "let a = 1;\n");
    assert_eq!(
        format("let a=1; // one\r\n\r\n\r\nb;\r\n").unwrap(),
        "let a = 1; // one\r\n\r\nb;\r\n"
    );
    assert_eq!(
        format("fn f() {\n\tx ~ normal(0, 1);\n\tx\n}").unwrap(),
        "fn f() {\n  x ~ normal(0, 1);\n  x\n}\n"
    );
}

#[test]
fn difficult_texts() {
    snapshots::settings("").bind(|| {
        insta::glob!("../../format", "*.pcad", |path| {
            insta::assert_snapshot!("format", formatted(&std::fs::read_to_string(path).unwrap()));
        });
    });
}

/// Returns a canonical text with changed spaces and numbered comments, and the number of
/// comments.
fn scattered(text: &str, bytes: &[u8]) -> (String, usize) {
    let (mut out, mut comments) = (String::new(), 0);
    let mut bytes = bytes.iter().cycle();
    let (mut in_string, mut in_key) = (false, 0_usize);
    let mut last = ' ';
    for c in text.chars() {
        in_string ^= c == '"' && last != '\\';
        // Keys of addresses stay on their line.
        match c {
            '{' if !in_string && (in_key > 0 || last == '[') => in_key += 1,
            '}' if !in_string && in_key > 0 => in_key -= 1,
            _ => {}
        }
        last = if last == '\\' && c == '\\' { ' ' } else { c };
        if !matches!(c, ' ' | '\n') || in_string || in_key > 0 {
            out.push(c);
            continue;
        }
        let n = comments;
        comments += 1;
        match bytes.next().unwrap_or(&0) % 24 {
            0 => out += &format!(" /* {n}. */ "),
            1 => out += &format!("   // {n}.\n"),
            2 => out += &format!("\n// {n}.\n"),
            3 => out += &format!(" /* {n}.\n */"),
            4 => out += &format!("\n\n  /* {n}. */\n\n"),
            other => {
                comments -= 1;
                match other {
                    5..8 => out.push('\n'),
                    8 => out += "\n\n\n",
                    9 => out += "   ",
                    _ => out.push(c),
                }
            }
        }
    }
    (out, comments)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, max_shrink_iters: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn random_programs_mean_what_they_meant(
        tree in prop::collection::vec(any::<u8>(), 0..300),
        spaces in prop::collection::vec(any::<u8>(), 1..100),
    ) {
        let canonical = print(&Generator::new(&tree).program());
        prop_assume!(!parse(&canonical, FileId(0)).1.iter().any(|e| e.kind == SyntaxErrorKind::TooDeep));
        for spaces in [&[23][..], &spaces] {
            let (text, comments) = scattered(&canonical, spaces);
            let once = formatted(&text);
            for n in 0..comments {
                for mark in [format!(" {n}. "), format!(" {n}.\n")] {
                    prop_assert_eq!(text.matches(&mark).count(), once.matches(&mark).count(), "{}\n{}\n-----\n{}", mark, text, once);
                }
            }
        }
    }

    #[test]
    fn lines_are_as_short_as_they_can_be(n in 1_usize..60, depth in 0_usize..4) {
        let items: Vec<String> = (0..n).map(|i| format!("name_{i}")).collect();
        let mut call = format!("f({})", items.join(", "));
        for _ in 0..depth {
            call = format!("g(first, {call}, last = [{}])", items.join(", "));
        }
        let once = formatted(&format!("observe {call} = photo as name; collect_all({});", items.join(" + ")));
        prop_assert!(once.lines().all(|line| line.len() <= WIDTH), "{}", once);
    }
}
