//! Syntax errors and their messages. The advice on text that does not fit the grammar is
//! in [`advice`](super::advice).

use super::deep::MAX_DEPTH;
use super::span::Span;
use super::token::Foreign;
use crate::diag::{Diagnostic, IntoDiagnostic, too_large};

/// The maximum number of errors reported for a text; a last one then says that there are
/// more.
pub const MAX_ERRORS: usize = 20;
/// The maximum number of brackets that may be open at a time.
pub const MAX_NESTING: usize = 200;
/// The maximum number of tokens in a file.
pub const MAX_TOKENS: usize = 1 << 20;

/// A syntax error and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntaxError {
    /// The kind of error.
    pub kind: SyntaxErrorKind,
    /// Its place in the source.
    pub span: Span,
}

/// The kinds of syntax errors.
#[derive(Clone, Debug, PartialEq)]
#[allow(private_interfaces)] // `Foreign` and `Advice` are for the messages only.
#[non_exhaustive]
pub enum SyntaxErrorKind {
    /// A character that begins no token.
    UnknownCharacter(char),
    /// A spelling from another language.
    Foreign(Foreign, String),
    /// A string without its closing quote on the same line.
    UnterminatedString,
    /// A `/*` without `*/`.
    UnterminatedComment,
    /// An unknown escape in a string.
    UnknownEscape,
    /// A number beyond the range of 64-bit floating point.
    NumberTooLarge,
    /// A malformed address literal.
    Address(AddressError),
    /// A `$` without a name.
    TagSelection,
    /// A bracket that is not closed.
    Unclosed {
        /// The bracket.
        open: char,
        /// The token before which it should have been closed, in words; `None` for the
        /// end of the text.
        before: Option<(String, Span)>,
    },
    /// A closing bracket that nothing opened.
    StrayClose(char),
    /// More than [`MAX_NESTING`] brackets inside each other.
    TooNested,
    /// A tree deeper than [`MAX_DEPTH`].
    TooDeep,
    /// More than [`MAX_TOKENS`] tokens.
    TooManyTokens,
    /// A text larger than [`MAX_SOURCE_BYTES`](crate::diag::MAX_SOURCE_BYTES), with its
    /// size in bytes.
    TooLarge(usize),
    /// A statement without its semicolon.
    MissingSemicolon {
        /// True if the text ends there.
        at_end: bool,
    },
    /// A token that does not fit the grammar.
    Unexpected {
        /// The token that was found, in words.
        found: String,
        /// True if it is the end of the text.
        at_end: bool,
        /// The tokens that were expected, in words.
        expected: String,
        /// Advice on what was probably meant.
        advice: Option<Advice>,
    },
    /// An `if` without `else` whose branch has a value.
    ValueWithoutElse,
    /// A `~` after something that is not a name.
    DrawTarget,
    /// Further errors are not reported.
    TooManyErrors,
}

/// The wording of an error, if it can be better than "unexpected …, expected …".
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Advice {
    /// The error.
    pub message: Option<String>,
    /// The label at its place.
    pub label: Option<String>,
    /// The replacement.
    pub hint: Option<String>,
    /// The index of the token to point at, if it is not the one that did not fit.
    pub place: Option<usize>,
}

/// The kinds of errors in address literals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AddressError {
    /// No name after the `@`.
    NoName,
    /// `#0`, or a number beyond 32 bits.
    Occurrence,
    /// A key in none of the allowed forms.
    Key,
    /// A key without its `]`.
    KeyEnd,
    /// A computed key without its `}`.
    OpenKey,
}

impl SyntaxError {
    pub(crate) fn new(kind: SyntaxErrorKind, span: Span) -> Self {
        SyntaxError { kind, span }
    }

    /// Returns whether the text may merely be unfinished, so that an interactive prompt
    /// can ask for another line.
    pub fn is_incomplete(&self) -> bool {
        matches!(
            self.kind,
            SyntaxErrorKind::UnterminatedComment
                | SyntaxErrorKind::Unclosed { before: None, .. }
                | SyntaxErrorKind::MissingSemicolon { at_end: true }
                | SyntaxErrorKind::Unexpected { at_end: true, .. }
        )
    }
}

impl std::fmt::Display for SyntaxError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.clone().into_diagnostic().message)
    }
}

impl std::error::Error for SyntaxError {}

impl IntoDiagnostic for SyntaxError {
    fn into_diagnostic(self) -> Diagnostic {
        use SyntaxErrorKind::*;
        let span = self.span;
        let error = |message: &str, label: &str| Diagnostic::error(message, span, label);
        match self.kind {
            UnknownCharacter(c) => unknown_character(c, span),
            Foreign(foreign, found) => foreign_spelling(foreign, &found, span),
            UnterminatedString => error("this string is not closed", "no closing `\"` on this line")
                .hint("a string cannot span lines; write a line break in it as `\\n`"),
            UnterminatedComment => error("this comment is not closed", "begins here").hint("`/*` needs a `*/`"),
            UnknownEscape => error("unknown escape in a string", "").hint(
                "the escapes are `\\n`, `\\t`, `\\r`, `\\\"`, `\\\\` and `\\u{1f600}`; a backslash is written `\\\\`",
            ),
            NumberTooLarge => error("this number is too large", "the largest is about 1.8e308"),
            Address(problem) => address(problem, span),
            TagSelection => error("a `$` without a tag", "expected a name right after it").hint(
                "`$rot` selects the choices tagged `#rot`, `$bone:arm_l` those tagged `#bone` with the value `arm_l`",
            ),
            Unclosed { open, before } => unclosed(open, before, span),
            StrayClose(close) => error(&format!("unexpected `{close}`"), "no open bracket to close"),
            TooNested => error("brackets are nested too deeply", "one too many")
                .note(format!("at most {MAX_NESTING} brackets may be open at a time")),
            TooDeep => error("this is nested too deeply", "in here")
                .hint("break it up with `let`; for a long sum or product, put the terms into an array")
                .note(format!("at most {MAX_DEPTH} operators, calls and blocks may be nested")),
            TooManyTokens => error("the program is too long", "")
                .hint("put data into a separate file: `data d = csv(\"points.csv\");`")
                .note(format!("at most {MAX_TOKENS} words, numbers and symbols are accepted in a file")),
            TooLarge(bytes) => too_large(bytes, span),
            MissingSemicolon { .. } => error("expected `;` at the end of this statement", "add `;` here"),
            Unexpected { found, expected, advice, .. } => unexpected(&found, &expected, advice, span),
            ValueWithoutElse => error("this value is lost when the condition is false", "the `if` has no `else`")
                .hint("add `else { … }`, or end the expression with `;`"),
            DrawTarget => error("expected a name before `~`", "this is not a name")
                .hint("write `x ~ d;` or, with a key, `x[k] ~ d;`; to observe a known value: `observe d = v;`"),
            TooManyErrors => error("too many errors", "further errors are not shown"),
        }
    }
}

fn unknown_character(c: char, span: Span) -> Diagnostic {
    let shown = match c {
        c if c.is_control() || c.is_whitespace() => format!("U+{:04X}", u32::from(c)),
        '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{feff}' => {
            format!("U+{:04X}", u32::from(c))
        }
        c => format!("`{c}`"),
    };
    let hint = match c {
        '\0' => Some("is this a text file?"),
        '\u{a0}' | '\u{202f}' | '\u{3000}' | '\u{2000}'..='\u{200a}' => {
            Some("this character looks like a space but is not; replace it with a space")
        }
        '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{feff}' => {
            Some("it is an invisible character; delete it")
        }
        '−' | '–' | '—' => Some("write minus as `-`"),
        '×' | '·' | '∗' => Some("write times as `*`"),
        '÷' => Some("write division as `/`"),
        '≤' => Some("write \"at most\" as `<=`"),
        '≥' => Some("write \"at least\" as `>=`"),
        '≠' => Some("write \"not equal\" as `!=`"),
        '…' => Some("a range is written `a .. b`"),
        '∼' | '～' => Some("a random choice is written with `~`"),
        '→' | '←' | '⇒' => {
            Some("an arm of `mix` is written with `=>`; a choice with `~`, a value with `=`")
        }
        '²' => Some("a power is written `x ** 2`"),
        '³' => Some("a power is written `x ** 3`"),
        '°' => Some("degrees are written `deg(30)`"),
        '∧' => Some("write `and`"),
        '∨' => Some("write `or`"),
        '¬' => Some("write `not`"),
        '；' => Some("a semicolon is written `;`"),
        '，' => Some("a comma is written `,`"),
        '（' | '）' => Some("parentheses are written `(` and `)`"),
        '?' => Some("a choice between two values is written `if c { a } else { b }`"),
        '\\' => {
            Some("a function is written `fn(x) { … }`; a statement may continue on the next line")
        }
        _ => None,
    };
    let diagnostic = Diagnostic::error(format!("unknown character {shown}"), span, "");
    hint.into_iter().fold(diagnostic, Diagnostic::hint)
}

fn foreign_spelling(foreign: Foreign, found: &str, span: Span) -> Diagnostic {
    let error = |label: &str| {
        Diagnostic::error(format!("`{found}` is not an operator"), span, label.to_owned())
    };
    match foreign {
        Foreign::And => error("write `and`"),
        Foreign::Or => error("write `or`"),
        Foreign::Not => error("write `not`"),
        Foreign::LeftArrow => error("").hint(
            "`x ~ d;` makes a random choice, `let x = e;` binds a value; less than minus three is written `x < -3`",
        ),
        Foreign::RightArrow => {
            error("").hint("functions have no result type: `fn f(x) { … }`; an arm of `mix` is written with `=>`")
        }
        Foreign::ColonEq => error("").hint("a value is bound by `let x = e;`, a random choice by `x ~ d;`"),
        Foreign::EqEqEq => error("write `==`"),
        Foreign::NotEqEq => error("write `!=`"),
        Foreign::Caret => error("write `**`").hint("a power is written `x ** 2`"),
        Foreign::Bar => {
            error("").hint("write `or` between conditions, `fn(x) { … }` for a function, `f(x)` for its call")
        }
        Foreign::Update => error("").hint(
            "values cannot be changed; bind a new name, `let y = x + 1;`, or add to the log \
             density, `factor(logw);`",
        ),
        Foreign::Increment => error("").hint("values cannot be changed; bind a new name: `let y = x + 1;`"),
        Foreign::ColonColon => error("write `.`").hint("a name of an included file is written `scene.render`"),
        Foreign::Quote => Diagnostic::error(format!("strings are not written with {found}"), span, "")
            .hint("use straight double quotes: \"like this\""),
        Foreign::Number => malformed_number(found, span),
        Foreign::Name => Diagnostic::error(format!("`{found}` is not a name"), span, "")
            .hint("names are made of the letters a to z and A to Z, digits and `_`"),
    }
}

fn malformed_number(found: &str, span: Span) -> Diagnostic {
    let error = Diagnostic::error(format!("`{found}` is not a number"), span, "");
    let digits =
        found.len() - found.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.').len();
    let (number, tail) = found.split_at(digits);
    match tail.chars().next() {
        None => error.hint("a number has one decimal point; a range is written `1 .. 2`"),
        Some('_') => error.hint("digits are not grouped with `_`"),
        Some('e' | 'E') => error.hint("an exponent is written `1e-3`"),
        Some('x' | 'X' | 'b' | 'o') if number == "0" => {
            error.hint("numbers are written in decimal")
        }
        Some(_) => error.hint(format!(
            "to multiply, write `{number} * {tail}`; a name does not begin with a digit"
        )),
    }
}

fn address(problem: AddressError, span: Span) -> Diagnostic {
    match problem {
        AddressError::NoName => Diagnostic::error("an `@` without an address", span, "expected a name right after it")
            .hint("`@x` is the choice named x, `@pose[arm]/bone/rot` one inside a call, `@**` all of them"),
        AddressError::Occurrence => Diagnostic::error("the number after `#` counts from 1", span, "")
            .hint("`@geom#2` selects what the second call of `geom` makes"),
        AddressError::Key => {
            Diagnostic::error("this is not a key", span, "expected a word, a number, \"…\", `*` or `{`")
                .hint("a key that is computed is written in braces: `@x[{i + 1}]`")
        }
        AddressError::KeyEnd => Diagnostic::error("expected `]` after the key", span, "").hint(
            "a key that is computed is written in braces, `@x[{i + 1}]`; one with spaces in quotes, `@x[\"a b\"]`",
        ),
        AddressError::OpenKey => {
            Diagnostic::error("this computed key is not closed", span, "expected `}]` on this line")
                .hint("a computed key is written `@x[{i + 1}]`")
        }
    }
}

fn unclosed(open: char, before: Option<(String, Span)>, span: Span) -> Diagnostic {
    let error = Diagnostic::error(format!("this `{open}` is not closed"), span, "opened here");
    let close = match open {
        '(' => ')',
        '[' => ']',
        _ => '}',
    };
    match before {
        Some((found, place)) => error
            .secondary(place, format!("still open at {found}"))
            .hint(format!("add `{close}` somewhere before this {found}")),
        None => error.hint(format!("add `{close}` where it ends")),
    }
}

fn unexpected(found: &str, expected: &str, advice: Option<Advice>, span: Span) -> Diagnostic {
    let Advice { message, label, hint, .. } = advice.unwrap_or_default();
    let message = message.unwrap_or_else(|| format!("unexpected {found}"));
    let error =
        Diagnostic::error(message, span, label.unwrap_or_else(|| format!("expected {expected}")));
    hint.into_iter().fold(error, Diagnostic::hint)
}
