//! Each mistake gives one error, and the surrounding statements are kept.

use super::shown;
use pcadlang_syntax::ast::{Expr, ExprKind, Item, ItemKind, Program, Stmt, StmtKind};
use pcadlang_syntax::{MAX_ERRORS, SyntaxErrorKind, parse, print, span::FileId};

/// Returns the program in canonical form, with invalid statements as `<error>`, and the
/// number of errors.
fn recover(text: &str) -> (String, usize) {
    let (program, errors) = parse(text, FileId(0));
    (print(&program), errors.len())
}

#[test]
fn a_bad_statement_hides_nothing() {
    let text = "let a = 1;\nlet b = +;\nlet c = 3;\nlet d = (4;\nlet e = 5\nlet f = 6;\ng g g;\nlet h = 8;";
    let (program, errors) = recover(text);
    // `d` and `e` are repaired, so that they are still declared.
    assert_eq!(
        program,
        "let a = 1;\n<error>;\nlet c = 3;\nlet d = 4;\nlet e = 5;\nlet f = 6;\n<error>;\nlet h = 8;\n"
    );
    assert_eq!(errors, 4);
}

#[test]
fn blocks_survive_a_bad_statement_inside() {
    let text = "fn f(x) { let a = ; a ~ normal(x, 1); if a { b b; c } else { d } }\n\
                infer { repeat 10 { mh(@x; mix { 1 => a; 2 = b; 3 => c; } collect a } }\nlet z = 1;";
    let (program, errors) = parse(text, FileId(0));
    assert_eq!(errors.len(), 5, "{}", shown(text, errors));
    let text = print(&program);
    for part in [
        "fn f(x) {",
        "a ~ normal(x, 1);",
        "c\n",
        "} else { d }",
        "repeat 10 {",
        "mh(@x);",
        "1 => a;",
        "3 => c;",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    assert!(text.contains("collect a;") && text.ends_with("let z = 1;\n"), "{text}");
    assert_eq!(text.matches("<error>;").count(), 3, "two statements and an arm\n{text}");
}

#[test]
fn one_mistake_is_one_error() {
    let good = "fn f(x) {\n  let y = g(x, [1, 2], { a: 1 });\n  for k in y {\n    t[k] ~ normal(x, 1) #tag;\n  }\n  \
                if y { t } else { [] }\n}\nassume z = f(2);\nobserve normal(z, 1) = 3;\n\
                infer {\n  repeat 10 {\n    mh(@z);\n  }\n}\nreport z;\n";
    assert_eq!(recover(good).1, 0);
    let mistakes = [
        ("g(x,", "g(x"),
        ("[1, 2]", "[1, 2"),
        ("a: 1 }", "a: 1"),
        ("});", "}));"),
        ("k in y", "k y"),
        ("in y {", "in y"),
        ("#tag;", "#tag"),
        ("  }\n  if", "  if"),
        ("{ t }", "t"),
        ("[] }\n}", "[] }\n"),
        ("f(2);", "f(2)"),
        ("= 3;", "== 3;"),
        ("mh(@z);", "mh(@z)"),
        ("mh(@z);", "mh(@);"),
        ("    mh(@z);\n  }", "    mh(@z);"),
        ("report z;", "report ;"),
        ("assume z", "assume"),
        ("fn f", "f"),
        ("(x) {", "(x)"),
        ("(x) {", "(x {"),
        ("let y", "y"),
        ("normal(x, 1)", "normal(x 1)"),
        ("repeat 10", "repeat"),
        ("observe", "obs erve"),
        ("z;\n", "z"),
        ("else", "otherwise"),
    ];
    for (from, to) in mistakes {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let (_, errors) = parse(&text, FileId(0));
        assert_eq!(errors.len(), 1, "{from} -> {to}\n{}", shown(&text, errors));
    }
}

#[test]
fn there_is_an_end_to_errors() {
    for text in [
        "let = 1;\n",
        "a b;\n",
        "\u{1} ;\n",
        ")",
        "x = 1;\n",
        "fn f() { a b; }\n",
        "\"\n",
        "@ ",
        "1.2.3;\n",
    ] {
        let (_, errors) = parse(&text.repeat(1000), FileId(0));
        assert_eq!(errors.len(), MAX_ERRORS + 1, "{text}");
        assert_eq!(errors.last().unwrap().kind, SyntaxErrorKind::TooManyErrors, "{text}");
    }
}

#[test]
fn unfinished_texts_are_told_from_wrong_ones() {
    let incomplete = |text: &str| parse(text, FileId(0)).1.iter().any(|e| e.is_incomplete());
    for text in [
        "infer {",
        "let x = f(1,",
        "let x =",
        "let x",
        "let x = 1",
        "/* a",
        "fn f(x) { let y = [1,",
        "if c { 1 } else",
    ] {
        assert!(incomplete(text), "{text}");
    }
    for text in ["let x = 1;", "let x = ;", "x)", "let x = \"a", "fn f(x) { b b; }", ""] {
        assert!(!incomplete(text), "{text}");
    }
}

/// Whether a statement of a program is a hole.
fn has_hole(program: &Program) -> bool {
    let hole =
        |stmt: &Stmt| matches!(&stmt.kind, StmtKind::Expr(Expr { kind: ExprKind::Error, .. }));
    program.items.iter().any(|item: &Item| matches!(&item.kind, ItemKind::Stmt(stmt) if hole(stmt)))
}

#[test]
fn holes_have_the_place_of_what_they_replace() {
    let text = "let a = 1;\n  b b b;\nlet c = 2;";
    let (program, _) = parse(text, FileId(0));
    assert!(has_hole(&program));
    let span = program.items[1].span;
    assert_eq!((span.start, &text[span.start as usize..span.end as usize]), (13, "b b b;"));
}
