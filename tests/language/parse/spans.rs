//! The positions of nodes and errors.

use super::program;
use pcadlang_syntax::ast::{ExprKind, ItemKind, Key, StmtKind};
use pcadlang_syntax::diag::SourceMap;
use pcadlang_syntax::span::{FileId, Span};
use pcadlang_syntax::{SyntaxErrorKind, parse, parse_expr};

fn at(text: &str, span: Span) -> &str {
    &text[span.start as usize..span.end as usize]
}

#[test]
fn statements_include_their_semicolon() {
    let text = "let a = 1 ; // comment\n\n if a { f(); }  a;";
    let spans: Vec<&str> = program(text).items.iter().map(|item| at(text, item.span)).collect();
    assert_eq!(spans, ["let a = 1 ;", "if a { f(); }", "a;"]);
}

#[test]
fn expressions_and_their_parts() {
    let text = "  f( (a + b) , k = -c )[0].d ";
    let expr = parse_expr(text, FileId(3)).unwrap();
    assert_eq!(at(text, expr.span), "f( (a + b) , k = -c )[0].d");
    assert_eq!(expr.span.file, FileId(3));
    let ExprKind::Field { base, field } = expr.kind else { panic!() };
    assert_eq!(at(text, field.span), "d");
    let ExprKind::Index { base, index } = base.kind else { panic!() };
    assert_eq!(at(text, index.span), "0");
    let ExprKind::Call { args, .. } = base.kind else { panic!() };
    assert_eq!(at(text, args[0].value.span), "a + b");
    assert_eq!(at(text, args[1].name.as_ref().unwrap().span), "k");
    assert_eq!(at(text, args[1].value.span), "-c");
}

#[test]
fn binary_spans_cover_parentheses() {
    let text = "(a) + (b * c)";
    let expr = parse_expr(text, FileId(0)).unwrap();
    assert_eq!(at(text, expr.span), text);
}

#[test]
fn computed_keys_have_the_places_of_the_file() {
    let text = "/* é */ freeze @pose[{ é_ + f(\"}\") }]/rot;";
    let text = &text.replace("é_", "k");
    let tree = program(text);
    let ItemKind::Stmt(stmt) = &tree.items[0].kind else { panic!() };
    let StmtKind::Freeze(expr) = &stmt.kind else { panic!() };
    let ExprKind::Address(address) = &expr.kind else { panic!() };
    let Key::Expr(key) = &address.segments[0].keys[0] else { panic!() };
    assert_eq!(at(text, key.span), "k + f(\"}\")");
    assert_eq!(at(text, expr.span), "@pose[{ k + f(\"}\") }]/rot");
}

#[test]
fn errors_in_computed_keys_too() {
    let text = "freeze @a[{1 + * 2}];\nfreeze @b[{@c[{2 2}]}];";
    let (_, errors) = parse(text, FileId(0));
    let places: Vec<_> = errors.iter().map(|e| (e.span.start, at(text, e.span))).collect();
    assert_eq!(places, [(15, "*"), (39, "2")]);
}

#[test]
fn byte_order_mark_and_line_ends_count_as_bytes() {
    let text = "\u{feff}let a = 1;\r\nlet b = ;\r\n";
    let (program, errors) = parse(text, FileId(0));
    assert_eq!(program.items.len(), 2);
    assert_eq!(program.items[0].span.start, 3);
    let mut map = SourceMap::new();
    map.add("crlf.pcad", text);
    assert_eq!(map.locate(errors[0].span), "crlf.pcad:2:9");
    let (_, errors) = parse("let a = 1;\u{feff}", FileId(0));
    assert!(
        matches!(errors[0].kind, SyntaxErrorKind::UnknownCharacter('\u{feff}')),
        "only at the start"
    );
}
