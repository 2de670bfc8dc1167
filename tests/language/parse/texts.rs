//! Lexemes: numbers, strings, comments, names, addresses, tags.

use super::{bare, expr, program};
use pcadlang_syntax::ast::{ExprKind, Key, SegmentName};
use pcadlang_syntax::{SyntaxErrorKind, parse, parse_expr, print_expr, span::FileId};

fn errors(text: &str) -> Vec<SyntaxErrorKind> {
    parse(text, FileId(0)).1.into_iter().map(|e| e.kind).collect()
}

#[test]
fn numbers() {
    let value = |text| match expr(text).kind {
        ExprKind::Num(x) => x,
        other => panic!("{other:?}"),
    };
    let all = [
        ("0", 0.0),
        ("007", 7.0),
        ("1.5", 1.5),
        ("2e3", 2000.0),
        ("2E-3", 0.002),
        ("1.25e+2", 125.0),
    ];
    for (text, x) in all {
        assert_eq!(value(text), x);
    }
    // Correctly rounded at the edges of the type.
    assert_eq!(value("1.7976931348623157e308"), f64::MAX);
    assert_eq!(value("5e-324"), f64::from_bits(1));
    assert_eq!(value("1e-999"), 0.0);
    assert_eq!(value("0.1000000000000000055511151231257827"), 0.1);
    for wrong in [".5", "1.", "1.2.3", "1e", "1_000", "0x10", "2x", "1e999", "1..", "٣"] {
        assert!(parse_expr(wrong, FileId(0)).is_err(), "{wrong}");
    }
}

#[test]
fn numbers_print_as_the_shortest_text_that_reads_the_same() {
    for x in [
        0.0,
        1.0,
        0.1,
        1e21,
        1e22,
        1.5e-7,
        f64::MAX,
        f64::MIN_POSITIVE,
        f64::from_bits(1),
        123456789.0,
        1e16,
    ] {
        let text = print_expr(&expr(&format!("{x:?}")));
        assert!(matches!(expr(&text).kind, ExprKind::Num(y) if y == x), "{text}");
        assert!(text.len() <= 24, "{text}");
    }
    assert_eq!(print_expr(&expr("10.0")), "10");
}

#[test]
fn strings() {
    let value = |text: &str| match expr(text).kind {
        ExprKind::Str(s) => s.to_string(),
        other => panic!("{other:?}"),
    };
    assert_eq!(value(r#""""#), "");
    assert_eq!(value(r#""a // b /* c ; } é""#), "a // b /* c ; } é");
    assert_eq!(value(r#""\n\t\r\"\\\u{1f600}\u{41}""#), "\n\t\r\"\\\u{1f600}A");
    let escapes = |text: &str| parse_expr(text, FileId(0)).unwrap_err().len();
    assert_eq!(escapes(r#""\q \x41 \' \u41 \u{} \u{110000} \u{d800} \u{1234567}""#), 8);
    for open in ["\"", "\"abc", "\"abc\\", "\"abc\\\"", "\"abc\ndef\"", "\"\\u{"] {
        let errors = errors(&format!("let a = {open}"));
        assert!(errors.contains(&SyntaxErrorKind::UnterminatedString), "{open:?}: {errors:?}");
    }
}

#[test]
fn an_open_string_ends_with_its_line() {
    let text = "let a = \"abc;\nlet b = ;\nlet c = 3;";
    assert_eq!(errors(text).len(), 2);
}

#[test]
fn comments() {
    assert_eq!(program("// nothing").items.len(), 0);
    assert_eq!(program("a; // b; \n/* c; \n // */ d; /**/ /***/ e;").items.len(), 3);
    assert_eq!(program("a /* in */ + /* between */ b;").items.len(), 1);
    assert_eq!(errors("a; /* b; //"), [SyntaxErrorKind::UnterminatedComment]);
    assert_eq!(program("a; //").items.len(), 1);
}

#[test]
fn keywords_may_be_fields_and_tags_but_no_names() {
    let words = "include param data fn kernel infer report export as assume let observe with predict factor force freeze \
                 forget sample for in if else warmup repeat every mix stop collect propose or and not true false";
    for word in words.split_whitespace() {
        program(&format!("x.{word}; {{ {word}: 1 }}; y ~ d #{word};"));
        assert!(!errors(&format!("let {word} = 1;")).is_empty(), "{word}");
    }
    for word in ["to", "when", "coarse", "_", "_1", "lets", "x2", "dataset", "Infer"] {
        program(&format!(
            "let {word} = {word}; fn {word}({word}) {{ {word} }} y.{word}; z ~ {word}({word} = {word});"
        ));
    }
}

#[test]
fn addresses() {
    let address = |text: &str| match expr(text).kind {
        ExprKind::Address(a) => a,
        other => panic!("{other:?}"),
    };
    let a = address("@a#2[1][-2.5e1][w][\"a \\\"]\"][*][{1}]/*/**/b_1");
    assert_eq!(a.segments.len(), 4);
    assert_eq!(a.segments[0].occurrence, 2);
    assert_eq!(
        a.segments[0].keys[..5],
        [Key::Num(1.0), Key::Num(-25.0), Key::Str("w".into()), Key::Str("a \"]".into()), Key::Any]
    );
    assert!(matches!(&a.segments[0].keys[5], Key::Expr(e) if matches!(e.kind, ExprKind::Num(1.0))));
    assert_eq!(a.segments[1].name, SegmentName::Any);
    assert_eq!(a.segments[2].name, SegmentName::Deep);
    assert_eq!(a.segments[3].occurrence, 1);
    assert_eq!(bare(&expr("@a[k]#2/b")), bare(&expr("@a#2[k]/b")));
    assert_eq!(bare(&expr("@a.b")), bare(&expr("@a/b")));
    assert!(matches!(expr("@a..b").kind, ExprKind::Binary { .. }));
    assert!(matches!(expr("@a//b\n").kind, ExprKind::Address(_)));
    let wrong = [
        "@",
        "@ a",
        "@1",
        "@a#0",
        "@a#99999999999",
        "@a[",
        "@a[]",
        "@a[b",
        "@a[1.]",
        "@a[.5]",
        "@a[+1]",
        "@a[3d]",
        "@a[b c]",
        "@a[{}]",
        "@a[{",
        "@a[{1}",
        "@a[\"b]",
        "@a[1e999]",
    ];
    for text in wrong {
        assert!(parse_expr(text, FileId(0)).is_err(), "{text}");
    }
}

#[test]
fn tag_selections() {
    let parts = |text: &str| match expr(text).kind {
        ExprKind::TagSel { name, value } => (name.to_string(), value.map(|v| v.to_string())),
        other => panic!("{other:?}"),
    };
    assert_eq!(parts("$rot"), ("rot".to_owned(), None));
    assert_eq!(parts("$bone:arm_l"), ("bone".to_owned(), Some("arm_l".to_owned())));
    assert_eq!(parts("$level:3"), ("level".to_owned(), Some("3".to_owned())));
    assert_eq!(parts("$bone:\"arm l\""), ("bone".to_owned(), Some("arm l".to_owned())));
    assert_eq!(parts("$data"), ("data".to_owned(), None));
    for text in ["$", "$ a", "$1", "$a:", "$a:\"b", "$a:-1"] {
        assert!(parse_expr(text, FileId(0)).is_err(), "{text}");
    }
}

#[test]
fn texts_that_are_none() {
    assert!(program("").items.is_empty());
    assert!(program(" \t\r\n\u{c}").items.is_empty());
    assert!(program("\u{feff}").items.is_empty());
    assert!(parse_expr("", FileId(0)).is_err());
    assert_eq!(errors("\0"), [SyntaxErrorKind::UnknownCharacter('\0')]);
    assert_eq!(
        errors("let a\0\0\0 = 1;"),
        [SyntaxErrorKind::UnknownCharacter('\0')],
        "a run is one error"
    );
    assert!(parse_expr("1; 2", FileId(0)).is_err());
    assert!(parse_expr("let a = 1;", FileId(0)).is_err());
}
