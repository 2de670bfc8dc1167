//! Rendering of diagnostics as text, with codespan-reporting.

use super::diagnostic::{Diagnostic, Severity};
use super::excerpt::Excerpts;
use super::source::SourceMap;
use codespan_reporting::diagnostic as codespan;
use codespan_reporting::files::Error;
use codespan_reporting::term::{self, Config};

type Shown = codespan::Diagnostic<crate::span::FileId>;

/// Renders diagnostics as the user sees them, in order, each followed by a blank line;
/// with ANSI colours if `color`.
///
/// Labels in files that `map` does not contain are omitted.
pub fn render(map: &SourceMap, diagnostics: &[Diagnostic], color: bool) -> String {
    let mut out = Vec::new();
    for diagnostic in diagnostics {
        let files = Excerpts::new(map, diagnostic);
        let shown = to_codespan(&files, diagnostic);
        let config = Config { tab_width: 2, ..Config::default() };
        // Writing to memory cannot fail, and all labels are in `files`.
        if write(&mut out, &config, &files, &shown, color).is_err() {
            out.extend_from_slice(format!("error: {}\n", diagnostic.message).as_bytes());
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn write(
    out: &mut Vec<u8>,
    config: &Config,
    files: &Excerpts,
    shown: &Shown,
    color: bool,
) -> Result<(), Error> {
    match color {
        true => {
            term::emit_to_write_style(&mut term::termcolor::Ansi::new(out), config, files, shown)
        }
        false => term::emit_to_io_write(out, config, files, shown),
    }
}

/// Builds without the `cli` feature have no colours.
fn to_codespan(files: &Excerpts, diagnostic: &Diagnostic) -> Shown {
    let severity = match diagnostic.severity {
        Severity::Error => codespan::Severity::Error,
        Severity::Warning => codespan::Severity::Warning,
        Severity::Note => codespan::Severity::Note,
    };
    let labels = diagnostic.labels.iter().filter_map(|label| {
        let style = if label.primary {
            codespan::LabelStyle::Primary
        } else {
            codespan::LabelStyle::Secondary
        };
        let range = files.range(label.span)?;
        Some(codespan::Label::new(style, label.span.file, range).with_message(&label.text))
    });
    let hints = diagnostic.hints.iter().map(|hint| format!("hint: {hint}"));
    codespan::Diagnostic::new(severity)
        .with_message(&diagnostic.message)
        .with_labels(labels.collect())
        .with_notes(hints.chain(diagnostic.notes.iter().cloned()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::span::Span;

    fn one(text: &str, start: usize, end: usize) -> String {
        let mut map = SourceMap::new();
        let id = map.add("a.pcad", text);
        render(
            &map,
            &[Diagnostic::error("wrong", Span::new(id, start, end), "here").hint("do that")],
            false,
        )
    }

    #[test]
    fn shows_place_caret_and_hint() {
        let expected = "error: wrong\n  ┌─ a.pcad:2:5\n  │\n2 │ let é = 1;\n  │     ^ here\n  │\n  = hint: do that\n\n";
        assert_eq!(one("// x\nlet é = 1;\n", 9, 11), expected);
    }

    #[test]
    fn long_lines_are_cut_around_the_label_and_keep_their_columns() {
        let text = format!("{}BAD{}", "a".repeat(5000), "b".repeat(5000));
        let shown = one(&text, 5000, 5003);
        assert!(shown.len() < 1000, "{shown}");
        assert!(shown.contains("a.pcad:1:5001"), "{shown}");
        let line = shown.lines().find(|l| l.contains("BAD")).unwrap();
        let caret = shown.lines().find(|l| l.contains("^^^ here")).unwrap();
        let column = |line: &str, text| {
            line.chars().count() - line[line.find(text).unwrap()..].chars().count()
        };
        assert_eq!(column(line, "BAD"), column(caret, "^^^"));
    }

    #[test]
    fn control_characters_do_not_reach_the_terminal() {
        let shown = one("let \u{1b}[31m \u{9b} \u{202e} = 1;", 4, 5);
        assert!(!shown.contains(['\u{1b}', '\u{9b}', '\u{202e}']), "{shown:?}");
        assert!(shown.contains("let ?[31m ?? ??? = 1;"), "{shown:?}");
    }

    #[test]
    fn odd_spans_are_clamped() {
        for text in ["", "\n", "a", "a\r\n", "é\u{0}", "\u{feff}x"] {
            for start in 0..6 {
                for end in 0..6 {
                    assert!(
                        one(text, start, end).contains("error: wrong"),
                        "{text:?} {start}..{end}"
                    );
                }
            }
        }
    }

    #[test]
    fn colours_only_when_asked() {
        let mut map = SourceMap::new();
        let id = map.add("a.pcad", "x");
        let diagnostics = [Diagnostic::error("wrong", Span::new(id, 0, 1), "")];
        assert!(render(&map, &diagnostics, true).contains('\u{1b}'));
        assert!(!render(&map, &diagnostics, false).contains('\u{1b}'));
    }
}
