//! Precedence and associativity of operators.

use super::{bare, expr, program};
use pcadlang_syntax::ast::{BinaryOp, ExprKind, ItemKind, StmtKind, UnaryOp};
use pcadlang_syntax::{parse_expr, print, print_expr, span::FileId};

/// Asserts that both texts have the same meaning.
fn same(text: &str, with_parentheses: &str) {
    assert_eq!(bare(&expr(text)), bare(&expr(with_parentheses)), "{text}");
}

fn rejected(text: &str) {
    assert!(parse_expr(text, FileId(0)).is_err(), "{text}");
}

#[test]
fn levels_from_loose_to_tight() {
    same("a or b and c", "a or (b and c)");
    same("not a and b", "(not a) and b");
    same("not a == b", "not (a == b)");
    same("a < b .. c", "a < (b .. c)");
    same("a .. b + c", "a .. (b + c)");
    same("a + b * c", "a + (b * c)");
    same("a - b & c", "a - (b & c)");
    same("-a * b", "(-a) * b");
    same("a * -b", "a * (-b)");
    same("-a ** b", "-(a ** b)");
    same("a ** -b ** c", "a ** (-(b ** c))");
    same("a ** b(c)[d].e", "a ** (((b(c))[d]).e)");
    same("-f(x)", "-(f(x))");
}

#[test]
fn chains_associate() {
    for op in ["or", "and", "+", "-", "*", "/", "%", "&"] {
        same(&format!("a {op} b {op} c"), &format!("(a {op} b) {op} c"));
        let ExprKind::Binary { right, .. } = expr(&format!("a {op} (b {op} c)")).kind else {
            panic!()
        };
        assert!(matches!(right.kind, ExprKind::Binary { .. }), "{op}: parentheses count");
    }
    same("a - b + c", "(a - b) + c");
    same("a / b * c", "(a / b) * c");
    same("a ** b ** c", "a ** (b ** c)");
    same("- - a", "-(-a)");
    same("not not a", "not (not a)");
    for op in ["==", "!=", "<", "<=", ">", ">=", ".."] {
        rejected(&format!("a {op} b {op} c"));
    }
}

#[test]
fn operators_are_told_apart() {
    let op = |text: &str| match expr(text).kind {
        ExprKind::Binary { op, .. } => op,
        other => panic!("{text}: {other:?}"),
    };
    use BinaryOp::*;
    let all = [
        ("+", Add),
        ("-", Sub),
        ("*", Mul),
        ("/", Div),
        ("%", Rem),
        ("**", Pow),
        ("&", Intersect),
        ("==", Eq),
        ("!=", Ne),
        ("<", Lt),
        ("<=", Le),
        (">", Gt),
        (">=", Ge),
        ("and", And),
        ("or", Or),
        ("..", Range),
    ];
    for (text, expected) in all {
        assert_eq!(op(&format!("a {text} b")), expected);
        assert_eq!(op(&format!("(a){text}(b)")), expected, "without spaces");
    }
    assert!(matches!(expr("-a").kind, ExprKind::Unary { op: UnaryOp::Neg, .. }));
    assert!(matches!(expr("not a").kind, ExprKind::Unary { op: UnaryOp::Not, .. }));
    assert_eq!(op("x<3"), Lt);
    assert_eq!(op("1..2"), Range);
    assert_eq!(op("1.5..2.5"), Range);
    assert_eq!(op("@a / b"), Div);
    assert_eq!(op("a*-b"), Mul);
}

#[test]
fn whole_expressions_are_no_operands() {
    rejected("1 + if a { 1 } else { 2 }");
    rejected("not fn(x) { x }");
    rejected("a == not b");
    same("(if a { 1 } else { 2 }) + 1", "((if a { 1 } else { 2 })) + 1");
    rejected("if a { 1 } else { 2 } + 1");
}

/// Returns the number of statements of a body, and whether it has a value.
fn body(text: &str) -> (usize, bool) {
    let tree = program(&format!("fn f(c) {{ {text} }}"));
    let ItemKind::Fn(f) = &tree.items[0].kind else { panic!() };
    (f.lambda.body.stmts.len(), f.lambda.body.result.is_some())
}

#[test]
fn the_last_expression_is_the_value() {
    assert_eq!(body(""), (0, false));
    assert_eq!(body("c"), (0, true));
    assert_eq!(body("c;"), (1, false));
    assert_eq!(body("x ~ flip(c); x"), (1, true));
    assert_eq!(body("if c { 1 } else { 2 }"), (0, true));
    assert_eq!(body("if c { 1 } else { 2 };"), (1, false));
    assert_eq!(body("if c { 1 } else { 2 } c"), (1, true));
    assert_eq!(body("if c { f(1); }"), (1, false), "without else it is no value");
    assert_eq!(body("if c { f(1); } else if c { f(2); }"), (1, false));
    assert_eq!(body("if c { f(1); } else if c { f(2); } else { }"), (0, true));
    assert_eq!(body("for i in c { } c"), (1, true));
    assert_eq!(body("{ a: 1 }"), (0, true));
}

#[test]
fn else_if_is_a_body_that_holds_an_if() {
    let tree = expr("if a { 1 } else if b { 2 } else { 3 }");
    assert_eq!(bare(&tree), bare(&expr("if a { 1 } else { if b { 2 } else { 3 } }")));
    assert_eq!(print_expr(&tree), "if a { 1 } else if b { 2 } else { 3 }");
}

#[test]
fn statements_and_items_are_told_apart() {
    let kinds = |text: &str| match &program(text).items[0].kind {
        ItemKind::Stmt(stmt) => stmt.kind.clone(),
        other => panic!("{other:?}"),
    };
    assert!(matches!(kinds("x ~ d;"), StmtKind::Draw { .. }));
    assert!(matches!(kinds("x[1][k] ~ d;"), StmtKind::Draw { .. }));
    assert!(matches!(kinds("x(1);"), StmtKind::Expr(_)));
    assert!(matches!(kinds("fn(x) { x };"), StmtKind::Expr(_)));
    assert!(matches!(kinds("if a { f(); }"), StmtKind::Expr(_)));
    assert!(matches!(program("fn f(x) { x }").items[0].kind, ItemKind::Fn(_)));
    assert!(matches!(program("infer { }").items[0].kind, ItemKind::Infer { name: None, .. }));
    assert!(matches!(program("export to to \"x\";").items[0].kind, ItemKind::Export { .. }));
    assert_eq!(print(&program("a;")), "a;\n");
}
