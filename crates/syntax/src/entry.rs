//! Queries about text that is still being written in an editor or at a prompt: the
//! classes of its tokens, and whether it is incomplete.

use super::parse::lex;
use super::span::FileId;
use super::token::Token;
use std::ops::Range;

/// The class of a piece of text, for syntax highlighting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// A keyword.
    Keyword,
    /// Any other name.
    Name,
    /// A number.
    Number,
    /// A string.
    String,
    /// An address or a tag.
    Address,
    /// A comment.
    Comment,
}

/// Returns the pieces of a text that have a class, in order. The text need not be valid.
pub fn classes(text: &str) -> Vec<(Range<usize>, Class)> {
    let (lexemes, _) = lex(text, 0..text.len(), FileId(0), 0);
    let mut out = Vec::with_capacity(lexemes.len());
    let mut at = 0;
    for l in lexemes {
        comments(text, at..l.start, &mut out);
        let class = match &l.token {
            Token::Name(_) => Some(Class::Name),
            Token::Number(_) => Some(Class::Number),
            Token::Str(_) => Some(Class::String),
            Token::Address(_) | Token::TagSel(_) => Some(Class::Address),
            token if token.is_keyword() => Some(Class::Keyword),
            _ => None,
        };
        out.extend(class.map(|c| (l.start..l.end, c)));
        at = at.max(l.end);
    }
    comments(text, at..text.len(), &mut out);
    out
}

/// Adds the comments between two tokens to `out`.
fn comments(text: &str, gap: Range<usize>, out: &mut Vec<(Range<usize>, Class)>) {
    let mut at = gap.start;
    while let Some(rest) = text.get(at..gap.end) {
        let Some(start) = rest.find("//").into_iter().chain(rest.find("/*")).min().map(|i| at + i)
        else {
            return;
        };
        let (end, skip) = if text[start..].starts_with("//") { ("\n", 0) } else { ("*/", 2) };
        let stop =
            text[start + skip..gap.end].find(end).map_or(gap.end, |i| start + skip + i + skip);
        out.push((start..stop, Class::Comment));
        at = stop;
    }
}

/// Returns whether a text is incomplete: it ends inside brackets or a comment, or after a
/// token that needs a right-hand side.
pub fn is_incomplete(text: &str) -> bool {
    let (lexemes, errors) = lex(text, 0..text.len(), FileId(0), 0);
    if errors.iter().any(|e| e.kind == super::SyntaxErrorKind::UnterminatedComment) {
        return true;
    }
    let mut depth = 0_i64;
    for l in &lexemes {
        depth += match l.token {
            Token::LParen | Token::LBracket | Token::LBrace => 1,
            Token::RParen | Token::RBracket | Token::RBrace => -1,
            _ => 0,
        };
        if depth < 0 {
            // No continuation can match this closing bracket.
            return false;
        }
    }
    let open = |t: &Token| {
        t.is_infix() || matches!(t, Token::Tilde | Token::Bind | Token::Comma | Token::Arrow)
    };
    depth > 0 || lexemes.last().is_some_and(|l| open(&l.token))
}

/// Returns whether a text reads as an item or statement of a program rather than as an
/// expression.
pub fn is_directive(text: &str) -> bool {
    let (lexemes, _) = lex(text, 0..text.len(), FileId(0), 0);
    let mut depth = 0_i64;
    let drawn = lexemes.iter().any(|l| {
        depth += match l.token {
            Token::LParen | Token::LBracket | Token::LBrace => 1,
            Token::RParen | Token::RBracket | Token::RBrace => -1,
            _ => 0,
        };
        depth == 0 && matches!(l.token, Token::Tilde | Token::Semi | Token::Bind)
    });
    let starts = lexemes.first().is_some_and(|l| match &l.token {
        // A function without a name is an expression.
        Token::Fn => matches!(lexemes.get(1).map(|l| &l.token), Some(Token::Name(_))),
        t => t.starts_item() || t.starts_statement(),
    });
    drawn || starts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_has_its_class() {
        let text = "assume x /* a */ ~ normal(0.5, 1) #tag; // end\nf(@x[1], $tag, \"s\")";
        let found: Vec<(&str, Class)> =
            classes(text).into_iter().map(|(r, c)| (&text[r], c)).collect();
        use Class::*;
        let expected = [
            ("assume", Keyword),
            ("x", Name),
            ("/* a */", Comment),
            ("normal", Name),
            ("0.5", Number),
            ("1", Number),
            ("tag", Name),
            ("// end", Comment),
            ("f", Name),
            ("@x[1]", Address),
            ("$tag", Address),
            ("\"s\"", String),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn no_text_is_too_odd() {
        for text in [
            "",
            "/*",
            "/*/",
            "//",
            "\"",
            "é@$",
            "@",
            "((((",
            "}{",
            "/* é */ // ü",
            "a // b /* c */\n/* d",
        ] {
            for (r, _) in classes(text) {
                assert!(text.get(r.clone()).is_some_and(|t| !t.is_empty()), "{text:?} {r:?}");
            }
            is_incomplete(text);
            is_directive(text);
        }
    }

    #[test]
    fn what_goes_on_and_what_does_not() {
        for text in ["fn f(x) {", "let a = [1,", "assume x ~", "1 +", "/* so", "if a { 1 } else {"]
        {
            assert!(is_incomplete(text), "{text}");
        }
        for text in ["let a = 1", "f(x)", "}", ") + (", "\"open", "x // {", ""] {
            assert!(!is_incomplete(text), "{text}");
        }
    }

    #[test]
    fn directives_and_expressions() {
        for text in [
            "let a = 1",
            "x ~ normal(0, 1)",
            "t[1] ~ flip(0.5)",
            "f(1);",
            "a = 3",
            "fn f() { 1 }",
            "infer { }",
        ] {
            assert!(is_directive(text), "{text}");
        }
        for text in [
            "f(1)",
            "fn(x) { let y = x; y }",
            "a == 3",
            "f(x = 2)",
            "{ a: 1 }",
            "@x",
            "if a { let b = 1; b } else { 2 }",
        ] {
            assert!(!is_directive(text), "{text}");
        }
    }
}
