//! Random text: no text makes the parser panic, and all of its errors can be displayed.

use super::{bare, shown};
use pcadlang_syntax::{MAX_ERRORS, parse, parse_expr, print, span::FileId};
use proptest::prelude::*;

/// Checks the properties that hold for every text.
fn check(text: &str) {
    let (program, errors) = parse(text, FileId(0));
    assert!(errors.len() <= MAX_ERRORS + 1, "{} errors", errors.len());
    let mut last = 0;
    for error in &errors {
        let (start, end) = (error.span.start as usize, error.span.end as usize);
        assert!(text.get(start..end).is_some(), "{start}..{end}: {:?}", error.kind);
        assert!(start >= last, "out of order: {:?}", error.kind);
        last = start;
    }
    let hole = format!("{program:?}").contains("kind: Error");
    assert!(!errors.is_empty() || !hole, "a hole without an error");
    assert_eq!(errors.is_empty(), shown(text, errors.clone()).is_empty());
    if errors.is_empty() {
        let printed = print(&program);
        let (again, errors) = parse(&printed, FileId(0));
        assert!(errors.is_empty(), "{}", shown(&printed, errors));
        assert_eq!(bare(&again), bare(&program), "{printed}");
    }
    let _ = parse_expr(text, FileId(0));
}

/// Every kind of token of the language, and some that are invalid.
#[rustfmt::skip]
const PIECES: [&str; 104] = [
    "include", "param", "data", "fn", "kernel", "infer", "report", "export", "as", "to", "assume", "let", "observe", "with",
    "coarse", "predict", "factor", "force", "freeze", "forget", "sample", "for", "in", "if", "else", "warmup", "repeat",
    "every", "mix", "stop", "when", "collect", "propose", "or", "and", "not", "true", "false", "(", ")", "[", "]", "{", "}",
    ",", ";", ":", ".", "#", "=", "~", "=>", "..", "==", "!=", "<", "<=", ">", ">=", "+", "-", "*", "/", "%", "**", "&", "x",
    "yy", "1", "2.5", "\"s\"", "@a", "@a/b[k]", "@a[{", "}]", "@a[{x}]", "@", "$", "$t", "$t:v", "$t:\"", "\n", "\n  ", "\n\n",
    "//", "/*", "*/", "\"", "'", "“", "<-", "->", "&&", "|", "!", "^", "1.2.3", "\0", "é", "\u{a0}", "\\", "\r\n", "return", "elif",
];

const SAMPLES: [&str; 5] = [
    include_str!("../../syntax/all.pcad"),
    include_str!("../../syntax/human.pcad"),
    include_str!("../../syntax/lathe.pcad"),
    include_str!("../../syntax/linreg.pcad"),
    include_str!("../../syntax/geometric.pcad"),
];

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn any_text(text in any::<String>()) {
        check(&text);
    }

    #[test]
    fn any_ascii(text in "[ -~\n]{0,200}") {
        check(&text);
    }

    #[test]
    fn any_pieces(pieces in prop::collection::vec((0..PIECES.len(), any::<bool>()), 0..80)) {
        let text: String = pieces.iter().flat_map(|(i, space)| [PIECES[*i], if *space { " " } else { "" }]).collect();
        check(&text);
    }

    /// A sample with some of its bytes removed, doubled or replaced by a piece.
    #[test]
    fn broken_samples(sample in 0..SAMPLES.len(), edits in prop::collection::vec((any::<u16>(), 0..12_usize, 0..PIECES.len(), 0..3), 1..6)) {
        let mut text = SAMPLES[sample].to_owned();
        for (at, length, piece, how) in edits {
            let boundary = |mut i: usize| {
                i = i.min(text.len());
                while !text.is_char_boundary(i) {
                    i -= 1;
                }
                i
            };
            let start = boundary(usize::from(at) % (text.len() + 1));
            let end = boundary(start + length).max(start);
            match how {
                0 => text.replace_range(start..end, ""),
                1 => text.insert_str(start, PIECES[piece]),
                _ => {
                    let twice = text[start..end].to_owned();
                    text.insert_str(start, &twice);
                }
            }
        }
        check(&text);
    }
}

#[test]
fn every_prefix_and_suffix_of_the_samples() {
    for sample in SAMPLES {
        for (i, _) in sample.char_indices() {
            check(&sample[..i]);
            check(&sample[i..]);
        }
    }
}
