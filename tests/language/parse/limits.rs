//! Texts designed to exhaust the stack, memory or time of a parser.

use pcadlang_syntax::diag::MAX_SOURCE_BYTES;
use pcadlang_syntax::{
    MAX_DEPTH, MAX_NESTING, MAX_TOKENS, SyntaxErrorKind, parse, parse_expr, print, span::FileId,
};

const MANY: usize = 100_000;
/// Many, where each is an error to recover from.
const SOME: usize = 10_000;

/// Parses, prints, clones, compares and drops a text on a small stack, and returns the
/// errors.
fn on_small_stack(text: String) -> Vec<SyntaxErrorKind> {
    let work = move || {
        let (program, errors) = parse(&text, FileId(0));
        assert!(program.clone() == program);
        assert!(print(&program).len() < 10_000_000);
        errors.into_iter().map(|e| e.kind).collect()
    };
    std::thread::Builder::new().stack_size(512 << 10).spawn(work).unwrap().join().unwrap()
}

fn nested(open: &str, inner: &str, close: &str, times: usize) -> String {
    format!("{}{inner}{}", open.repeat(times), close.repeat(times))
}

/// Returns texts with a construct nested `n` deep.
fn towers(n: usize) -> Vec<(&'static str, String)> {
    let value = |text: String| format!("let x = {text};");
    vec![
        ("parentheses", value(nested("(", "1", ")", n))),
        ("arrays", value(nested("[", "1", "]", n))),
        ("records", value(nested("{ a: ", "1", "}", n))),
        ("calls", value(nested("f(", "1", ")", n))),
        ("indices", value(nested("a[", "1", "]", n))),
        ("functions", value(nested("fn() { ", "1", "}", n))),
        ("loops", nested("for i in x { ", "", "}", n)),
        ("plans", format!("infer {{ {} }}", nested("repeat 2 { ", "", "}", n))),
        ("kernels", format!("infer {{ mix {{ 1 => {}; }} }}", nested("f(k = ", "1", ")", n))),
        ("ifs", value(nested("if a { ", "1", " } else { 2 }", n))),
        ("elses", value(nested("if a { 1 } else { ", "1", " }", n))),
        ("conditions", value(format!("{} 1 {}", "if (".repeat(n), ") { 1 } else { 2 }".repeat(n)))),
        ("minuses", value(format!("{}1", "-".repeat(n)))),
        ("nots", value(format!("{}true", "not ".repeat(n)))),
        ("sum", value(format!("1{}", "+1".repeat(n)))),
        ("difference", value(format!("a{}", " - a".repeat(n)))),
        ("ors", value(format!("a{}", " or a".repeat(n)))),
        ("powers", value(format!("1{}", " ** 1".repeat(n)))),
        ("else ifs", value(format!("if a {{ 1 }}{} else {{ 3 }}", " else if b { 2 }".repeat(n)))),
        ("else ifs without else", format!("if a {{ f(); }}{}", " else if b { f(); }".repeat(n))),
        ("calls of calls", value(format!("f{}", "()".repeat(n)))),
        ("elements of elements", value(format!("a{}", "[0]".repeat(n)))),
        ("fields of fields", value(format!("a{}", ".b".repeat(n)))),
        ("keys in keys", value(nested("@a[{", "1", "}]", n))),
        ("defaults", value(nested("fn(a = ", "1", ") { 1 }", n))),
    ]
}

#[test]
fn towers_are_errors() {
    for (what, text) in towers(MANY) {
        let errors = on_small_stack(text);
        let deep = |e: &SyntaxErrorKind| {
            matches!(e, SyntaxErrorKind::TooDeep | SyntaxErrorKind::TooNested)
        };
        assert_eq!(errors.len(), 1, "{what}: {errors:?}");
        assert!(errors.iter().all(deep), "{what}: {errors:?}");
    }
}

#[test]
fn small_towers_are_not() {
    for (what, text) in towers(7) {
        assert_eq!(on_small_stack(text), [], "{what}");
    }
}

#[test]
fn towers_without_a_roof_are_errors_too() {
    for (what, text) in towers(SOME) {
        for part in [text.len() / 2 - 1, text.len() - 1] {
            let errors = on_small_stack(text[..part].to_owned());
            assert!((1..=21).contains(&errors.len()), "{what}: {errors:?}");
        }
    }
    for open in [
        "(", "[", "{", "f(", "fn() {", "- (", "@a[{", "/*", "\"", "if a {", "infer {", "{ a: ",
        ")", "}", "]", ")(",
    ] {
        let errors = on_small_stack(open.repeat(SOME));
        assert!((1..=21).contains(&errors.len()), "{open}: {errors:?}");
    }
}

#[test]
fn the_limits_are_where_they_are_said_to_be() {
    let chain = |terms: usize| parse_expr(&format!("1{}", "+1".repeat(terms - 1)), FileId(0));
    assert!(chain(MAX_DEPTH as usize).is_ok());
    assert_eq!(chain(MAX_DEPTH as usize + 1).unwrap_err()[0].kind, SyntaxErrorKind::TooDeep);
    let brackets = |n| parse_expr(&nested("(", "1", ")", n), FileId(0));
    assert!(brackets(MAX_NESTING).is_ok());
    assert_eq!(brackets(MAX_NESTING + 1).unwrap_err()[0].kind, SyntaxErrorKind::TooNested);
    let keys = |n| parse_expr(&nested("@a[{", "1", "}]", n), FileId(0));
    assert!(keys(8).is_ok());
    assert_eq!(keys(9).unwrap_err()[0].kind, SyntaxErrorKind::TooDeep);
}

#[test]
fn depth_adds_up_through_brackets() {
    // Sums nested inside parentheses, each alone below both limits.
    let mut text = "1".to_owned();
    for _ in 0..100 {
        text = format!("({text}){}", "+1".repeat(100));
    }
    assert_eq!(on_small_stack(format!("let x = {text};")), [SyntaxErrorKind::TooDeep]);
}

#[test]
fn long_is_not_deep() {
    let array = format!("let x = [{}];", "1, ".repeat(MANY));
    assert_eq!(on_small_stack(array), []);
    assert_eq!(on_small_stack("let x = 1;\n".repeat(MANY)), []);
    assert_eq!(on_small_stack(format!("x ~ d{};", " #tag".repeat(MANY))), []);
    assert_eq!(on_small_stack(format!("let a = @a{};", "/b".repeat(MANY))), []);
    assert_eq!(on_small_stack(format!("let a = \"{}\";", "\\u{41}".repeat(MANY))), []);
}

#[test]
fn large_texts_are_refused() {
    let errors =
        |text: &str| parse(text, FileId(0)).1.into_iter().map(|e| e.kind).collect::<Vec<_>>();
    assert_eq!(errors(&" ".repeat(MAX_SOURCE_BYTES)), []);
    let size = MAX_SOURCE_BYTES + 1;
    assert_eq!(errors(&" ".repeat(size)), [SyntaxErrorKind::TooLarge(size)]);
    assert!(parse_expr(&" ".repeat(size), FileId(0)).is_err());
    assert_eq!(errors(&"a;".repeat(MAX_TOKENS / 2)), []);
    assert_eq!(errors(&"a;".repeat(MAX_TOKENS / 2 + 1)), [SyntaxErrorKind::TooManyTokens]);
}
