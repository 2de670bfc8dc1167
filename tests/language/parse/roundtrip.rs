//! Printing followed by parsing is the identity, and all printed parentheses are
//! necessary.

use super::generator::Generator;
use super::{bare, shown};
use pcadlang_syntax::{SyntaxErrorKind, parse, parse_expr, print, print_expr, span::FileId};
use proptest::prelude::*;

/// A configuration without a file of past failures, since each failure should become a
/// test.
fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        max_shrink_iters: 20_000,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn parsing_undoes_printing(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let program = Generator::new(&bytes).program();
        let text = print(&program);
        let (again, errors) = parse(&text, FileId(0));
        prop_assume!(!errors.iter().any(|e| e.kind == SyntaxErrorKind::TooDeep));
        prop_assert!(errors.is_empty(), "{}\n{text}", shown(&text, errors));
        prop_assert_eq!(bare(&again), bare(&program), "{}", text);
        prop_assert_eq!(print(&again), text);
    }
}

#[test]
fn the_generator_reaches_every_kind_of_node() {
    let mut bytes = 1_u64;
    let mut seen = String::new();
    for _ in 0..300 {
        let random = std::iter::repeat_with(|| {
            bytes = bytes.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (bytes >> 56) as u8
        });
        let source: Vec<u8> = random.take(300).collect();
        seen += &bare(&Generator::new(&source).program());
    }
    let kinds = [
        "Include",
        "Param",
        "Data",
        "Fn(",
        "Kernel",
        "Infer",
        "Report",
        "Export",
        "Assume",
        "Draw",
        "Let",
        "Observe",
        "Predict",
        "Factor",
        "Force",
        "Freeze",
        "Forget",
        "Sample",
        "For ",
        "Warmup",
        "Repeat",
        "Every",
        "Mix",
        "StopWhen",
        "Collect",
        "Propose",
        "Address",
        "TagSel",
        "Array",
        "Record",
        "Call",
        "Index",
        "Field",
        "Neg",
        "Not",
        "If ",
        "Lambda",
        "Intersect",
        "Deep",
        "Any",
        "Range",
    ];
    for kind in kinds {
        assert!(seen.contains(kind), "{kind}");
    }
}

#[test]
fn no_parentheses_in_vain() {
    let exact = [
        "a + b * c",
        "(a + b) * c",
        "a - (b - c)",
        "a - b - c",
        "-(a + b)",
        "-a ** b",
        "(-a) ** b",
        "a ** -b",
        "(a ** b) ** c",
        "a ** b ** c",
        "not (a and b)",
        "not a == b",
        "(not a) == b",
        "(a == b) == c",
        "a == (b == c)",
        "(a .. b) .. c",
        "1 .. n + 1",
        "(1 .. n) + 1",
        "(a or b) and c",
        "a or b and c",
        "a or (b or c)",
        "--a",
        "not not a",
        "-(-a) ** b",
        "(fn(x) { x })(1)",
        "f(fn(x) { x })",
        "(if a { b } else { c }) + 1",
        "[if a { b } else { c }]",
        "(a + b)[0].c",
        "if (if a { b } else { c }) { d } else { e }",
        "(@a)[0]",
        "(@a).b",
        "$a.b",
        "@a(1)",
        "a & b - c",
        "a & (b - c)",
        "{ a: 1 }.a",
        "(-1)[0]",
        "f(-1)",
        "(not a)(b)",
        "a * -b",
        "(a * b) ** c",
    ];
    for text in exact {
        let expr = parse_expr(text, FileId(0)).unwrap();
        assert_eq!(print_expr(&expr), text);
        // Removing any pair of parentheses changes the meaning.
        for (open, _) in text.match_indices('(') {
            let call = text[..open].ends_with(|c: char| c.is_alphanumeric() || c == ')')
                && !text[..open].ends_with("if");
            let mut depth = 0;
            let close = text[open..].find(|c| {
                depth += i32::from(c == '(') - i32::from(c == ')');
                depth == 0
            });
            let close = open + close.unwrap();
            let without =
                format!("{}{}{}", &text[..open], &text[open + 1..close], &text[close + 1..]);
            if let Ok(other) = parse_expr(&without, FileId(0)) {
                assert!(call || bare(&other) != bare(&expr), "{text}: {without}");
            }
        }
    }
}
