//! What an editor is told of a program, against the compiler: every name is resolved, and
//! a program whose names are changed everywhere still compiles to the same code.

use pcadlang::Program;
use pcadlang_library::standard;
use pcadlang_syntax::diag::{FileId, Span};
use pcadlang_workbench::editor::{Analysis, BindingKind, CandidateKind, PieceKind};
use std::path::{Path, PathBuf};

/// The shipped programs and the examples that have no mistakes.
fn programs() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all: Vec<PathBuf> = Vec::new();
    for folder in ["programs", "examples"] {
        let listed = std::fs::read_dir(root.join(folder)).unwrap();
        all.extend(listed.map(|e| e.unwrap().path()));
    }
    all.retain(|p| p.extension().is_some_and(|e| e == "pcad"));
    all.sort();
    assert!(all.len() > 10);
    let read = |p: PathBuf| (p.to_str().unwrap().to_owned(), std::fs::read_to_string(&p).unwrap());
    all.into_iter().map(read).collect()
}

fn byte(text: &str, piece: &str) -> u32 {
    text.find(piece).unwrap_or_else(|| panic!("no {piece:?}")) as u32
}

fn words(text: &str, spans: Vec<Span>) -> Vec<(u32, &str)> {
    spans.into_iter().map(|s| (s.start, &text[s.start as usize..s.end as usize])).collect()
}

#[test]
fn every_name_of_the_shipped_programs_is_resolved() {
    let table = standard::table();
    let is_built_in = |name: &str| {
        table.iter().any(|b| b.full_name() == name)
            || table.constants().iter().any(|c| c.name == name)
    };
    for (name, text) in programs() {
        let a = Analysis::of(&name, &text);
        assert!(a.diagnostics.is_empty(), "{name}: {:?}", a.diagnostics);
        for (span, other) in a.names.others.iter().filter(|(s, _)| s.file == FileId(0)) {
            assert!(is_built_in(other), "{}: {other} is not resolved", a.sources.locate(*span));
        }
        for o in &a.names.occurrences {
            let bound = &a.names.bindings[o.binding];
            assert_eq!(a.sources.slice(o.span), &*bound.name, "{}", a.sources.locate(o.span));
        }
    }
}

/// Renames everything that can be renamed, one name at a time.
#[test]
fn renamed_programs_are_the_same_programs() {
    let (mut renamed, mut refused) = (0, 0);
    for (name, text) in programs() {
        let a = Analysis::of(&name, &text);
        let size = |text: &str| {
            let model = Program::named(&name, text).unwrap().without_data().compile();
            let model = model.unwrap_or_else(|e| panic!("{name}: {e}\n{text}"));
            let code = model.code();
            (code.ops.len(), code.blocks.len(), code.sites.len(), code.consts.len())
        };
        let before = size(&text);
        for b in a.names.bindings.iter().filter(|b| b.span.file == FileId(0)) {
            let places = match a.rename(b.span.start, "renamed_here") {
                Ok(places) => places,
                Err(e) => {
                    assert!(e.to_string().contains("by hand"), "{name}: {e}");
                    refused += 1;
                    continue;
                }
            };
            let mut changed = text.clone();
            for s in places.iter().rev().filter(|s| s.file == FileId(0)) {
                changed.replace_range(s.start as usize..s.end as usize, "renamed_here");
            }
            assert_eq!(size(&changed), before, "{name}: {} renamed", b.name);
            renamed += 1;
        }
    }
    assert!(renamed > 300 && refused * 10 < renamed, "{renamed} renamed, {refused} refused");
}

const TEXT: &str = r#"param most = 3 "the most";
fn twice(x, by = 2) { let y = x * by; y }
assume a ~ normal(twice(1, by = most), 1) #tag:most;
for i in 0 .. 3 { b[i] ~ normal(a, 1); observe normal(b[i], 1) = i as seen; }
let c = fn(a) { a + b[0] };
kernel k(step) { propose u ~ normal(0, step); propose @a = value(@a) + u; }
infer { repeat 10 { k(step = 0.1); mh(@b[0]); mh(one(@seen)); } }
"#;

#[test]
fn names_are_found_in_their_scopes() {
    let a = Analysis::of("names.pcad", TEXT);
    let references = |piece: &str| {
        let all = words(TEXT, a.references(byte(TEXT, piece)));
        all.iter().map(|(at, _)| TEXT[..*at as usize].matches('\n').count()).collect::<Vec<_>>()
    };
    assert_eq!(references("most"), [0, 2, 2]);
    assert_eq!(references("by = 2"), [1, 1, 2]);
    assert_eq!(references("x, by"), [1, 1]);
    // The choice is not the parameter of the same name.
    assert_eq!(references("a ~ normal(twice"), [2, 3, 5, 5]);
    assert_eq!(references("a) { a +"), [4, 4]);
    assert_eq!(references("b[i] ~"), [3, 3, 4, 6]);
    assert_eq!(references("step) {"), [5, 5, 6]);
    assert_eq!(references("seen;"), [3, 6]);
    assert_eq!(references("u ~"), [5, 5]);
    assert!(references("normal").is_empty());
    // Right after a name counts as well.
    assert_eq!(a.definition(byte(TEXT, "most") + 4).unwrap().start, byte(TEXT, "most"));
}

#[test]
fn what_cannot_be_renamed_says_why() {
    let a = Analysis::of("names.pcad", TEXT);
    let says = |piece: &str, new: &str| a.rename(byte(TEXT, piece), new).unwrap_err().to_string();
    assert_eq!(says("normal", "x"), "there is no name of this program here");
    assert_eq!(says("most", "let"), "`let` is not a name: letters, digits and `_`, no keyword");
    assert_eq!(says("most", "a b"), "`a b` is not a name: letters, digits and `_`, no keyword");
    assert_eq!(says("c = fn", "a"), "`a` is bound already");
    let text = "fn f() { z ~ normal(0, 1); z } let y = f(); assume z = 1; infer { mh(@y/z); }";
    let a = Analysis::of("names.pcad", text);
    let says = a.rename(byte(text, "z ~"), "w").unwrap_err().to_string();
    assert!(says.contains("`z` below another name"), "{says}");
    let text = "include \"std/scene.pcad\" as scene; let a = scene.affine_prior();";
    let a = Analysis::of("names.pcad", text);
    let says = a.rename(byte(text, "affine"), "w").unwrap_err().to_string();
    assert!(says.contains("`affine_prior` is bound in std/scene.pcad"), "{says}");
}

#[test]
fn texts_with_mistakes_keep_what_is_right() {
    let text = "let one = 1;\nlet two = one +;\nlet three = one;\nassume x ~ norml(one, 1);\n";
    let a = Analysis::of("half.pcad", text);
    assert!(!a.diagnostics.is_empty());
    assert!(a.references(byte(text, "one")).len() >= 3);
    assert!(a.hints().is_empty());
    let names: Vec<&str> = a.outline().iter().map(|b| &*b.name).collect();
    assert!(names.contains(&"one") && names.contains(&"x"), "{names:?}");
    // No text is too odd.
    for text in ["", "@", "let", "fn f(", "for i in", "\"", "é ~ ~", "x[0][1] ~ y[", "}}}}"] {
        let a = Analysis::of("odd.pcad", text);
        for at in 0..=text.len() {
            let _ = (a.hover(at as u32), a.references(at as u32), a.complete(at, Path::new("")));
        }
        let _ = (a.pieces(), a.outline(), a.hints());
    }
}

#[test]
fn completions_fit_the_place() {
    let complete = |text: &str| {
        let (start, found) =
            Analysis::of("c.pcad", text).complete(text.len(), Path::new("programs"));
        (start, found.into_iter().map(|c| (c.word, c.kind)).collect::<Vec<_>>())
    };
    let words = |text: &str| complete(text).1.into_iter().map(|(w, _)| w).collect::<Vec<_>>();
    assert_eq!(words("let width = 1; let y = wid"), ["width"]);
    assert_eq!(words("let norms = 1; assume x ~ nor"), ["normal", "norms"]);
    assert!(words("let y = nor").contains(&"norm".to_owned()));
    assert!(words("assume x ~ normal(0, s").contains(&"sd = ".to_owned()));
    assert!(
        words("fn f(first, second) { first }\nlet y = f(sec").contains(&"second = ".to_owned())
    );
    assert!(words("fn f(first) { fir").contains(&"first".to_owned()));
    assert!(!words("fn f(first) { first }\nlet y = fir").contains(&"first".to_owned()));
    assert_eq!(words("assume x ~ flip(0.5);\ninfer { mh(@"), ["@x"]);
    assert!(words("infer { mh($f").contains(&"$finite".to_owned()));
    assert!(words("include \"l").contains(&"lathe.pcad".to_owned()));
    assert!(words("// nor").is_empty() && words("let x = 12").is_empty());
    let (start, found) = complete("obs");
    assert_eq!((start, found[0].1), (0, CandidateKind::Keyword));
}

#[test]
fn hints_have_addresses_and_supports() {
    let text = "fn part() { s ~ gamma(2, 2); s }
        assume a ~ normal(0, 1); let p = part();
        for i in 0 .. 3 { b[i] ~ flip(0.5); } let d = beta(1, 2); c ~ d; m ~ mv_normal([0], cov = [[1]]);";
    let hints = Analysis::of("h.pcad", text).hints();
    let found: Vec<(&str, &str)> =
        hints.iter().map(|h| (&*h.address, h.support.split(';').next().unwrap())).collect();
    let expected = [
        ("@…/s", "x > 0"),
        ("@a", "all numbers"),
        ("@b[…]", "false, true"),
        ("@c", "0 <= x <= 1"),
        ("@m", "arrays as long as the mean"),
    ];
    assert_eq!(found, expected);
}

#[test]
fn pieces_have_the_class_of_what_they_mean() {
    let text = "let f = fn(x) { abs(x) }; // end\ninfer { mh(@a); }";
    let a = Analysis::of("p.pcad", text);
    let found = |piece: &str| {
        let at = byte(text, piece) as usize;
        a.pieces().into_iter().find(|p| p.range.start == at).unwrap().kind
    };
    assert_eq!(found("f ="), PieceKind::Bound(BindingKind::Value));
    assert_eq!(found("x) {"), PieceKind::Bound(BindingKind::Argument));
    assert_eq!((found("abs"), found("mh")), (PieceKind::Function, PieceKind::Kernel));
}

#[test]
fn hovering_explains() {
    let text = "param width = 2 \"in metres\";\nassume x ~ normal(width, 1);";
    let a = Analysis::of("h.pcad", text);
    let says = |piece: &str| a.hover(byte(text, piece)).unwrap().1;
    assert!(says("width, 1").contains("param width = 2 \"in metres\";"));
    assert!(
        says("normal").contains("The normal distribution.") && says("assume").contains("Example")
    );
    assert!(a.hover(byte(text, "2 \"")).is_none());
}

/// The grammars by which editors and notebooks colour programs without the server.
#[test]
fn all_grammars_have_the_keywords_of_the_language() {
    use pcadlang_syntax::KEYWORDS;
    let text = include_str!("../../editors/vscode/syntaxes/pcad.tmLanguage.json");
    let grammar: serde_json::Value = serde_json::from_str(text).unwrap();
    let patterns = grammar["repository"]["words"]["patterns"].as_array().unwrap();
    let scopes = [
        ("constant", "constant.language.pcad"),
        ("operator", "keyword.operator.word.pcad"),
        ("control", "keyword.control.pcad"),
        ("declaration", "keyword.other.pcad"),
    ];
    let pygments = include_str!("../../python/src/pcadlang/notebook/words.py");
    let highlights = include_str!("../../editors/tree-sitter-pcad/queries/highlights.scm");
    let sorted = |mut words: Vec<&str>| {
        words.sort_unstable();
        words.join(" ")
    };
    for (class, words) in KEYWORDS {
        let expected = sorted(words.split(' ').collect());
        let scope = scopes.iter().find(|(c, _)| *c == class).unwrap().1;
        let rule = patterns.iter().find(|p| p["name"] == scope).unwrap();
        let listed = rule["match"].as_str().unwrap();
        let listed = listed.strip_prefix("\\b(?:").and_then(|l| l.strip_suffix(")\\b")).unwrap();
        assert_eq!(sorted(listed.split('|').collect()), expected, "TextMate: {class}");
        let list = format!("\n{}S = [", class.to_uppercase());
        let list = if class == "control" { "\nCONTROL = [" } else { &list };
        let list = pygments.split(list).nth(1).and_then(|l| l.split(']').next()).unwrap();
        let listed = list.split('"').skip(1).step_by(2).collect();
        assert_eq!(sorted(listed), expected, "Pygments: {class}");
        for word in words.split(' ').filter(|_| class != "constant") {
            assert!(highlights.contains(&format!("\"{word}\"")), "tree-sitter: {word}");
        }
    }
}
