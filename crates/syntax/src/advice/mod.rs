//! Guesses what was meant by a text that does not fit the grammar: habits from other
//! languages, and common slips.
//!
//! The rules only choose words: if one is missing, the message lacks a hint. The rules
//! about names and keywords are in [`words`], the others in [`symbols`].

mod symbols;
mod words;

use super::error::{Advice, SyntaxError, SyntaxErrorKind};
use super::expected;
use super::token::Token;
use super::tokens::Tokens;
use std::collections::BTreeSet;

/// The position at which the text does not fit.
pub(crate) struct Context<'a, 's> {
    pub tokens: &'a Tokens<'s>,
    /// The index of the token that did not fit; the number of tokens for the end of the
    /// text.
    pub at: usize,
    /// The index of the first token of the statement.
    pub start: usize,
    /// The tokens that would have fitted, as the parser names them.
    pub expected: &'a [String],
    /// True if the statement may merely lack its semicolon.
    pub semicolon: bool,
}

/// Returns the error for a token that does not fit.
pub(crate) fn explain(context: &Context<'_, '_>) -> SyntaxError {
    let Context { tokens, at, .. } = *context;
    let rules = Rules { expected: expected::names(context.expected), context };
    let at_end = at >= tokens.lexemes.len();
    let advice = if context.semicolon { rules.foreign_statement() } else { rules.apply() };
    if context.semicolon && advice.is_none() {
        return SyntaxError::new(
            SyntaxErrorKind::MissingSemicolon { at_end },
            tokens.span_after(at),
        );
    }
    let text = rules.text(at);
    let found = match tokens.lexemes.get(at).map(|l| &l.token) {
        None => tokens.end_name.to_owned(),
        Some(Token::Number(_)) => format!("number `{text}`"),
        Some(Token::Str(_)) => "string".to_owned(),
        Some(Token::Address(_)) => format!("address `{text}`"),
        Some(token) if token.is_keyword() => format!("keyword `{text}`"),
        Some(_) => format!("`{text}`"),
    };
    let span = tokens.span_at(advice.as_ref().and_then(|a| a.place).unwrap_or(at));
    let expected = expected::describe(context.expected);
    SyntaxError::new(SyntaxErrorKind::Unexpected { found, at_end, expected, advice }, span)
}

/// Returns advice that keeps the message and adds a hint.
fn hint(hint: impl Into<String>) -> Option<Advice> {
    Some(Advice { hint: Some(hint.into()), ..Advice::default() })
}

/// Returns advice with another message and label, and a hint.
fn say(
    message: impl Into<String>,
    label: impl Into<String>,
    hint: impl Into<String>,
) -> Option<Advice> {
    Some(Advice {
        message: Some(message.into()),
        label: Some(label.into()),
        hint: Some(hint.into()),
        place: None,
    })
}

/// The input of the rules.
struct Rules<'a, 's> {
    context: &'a Context<'a, 's>,
    expected: BTreeSet<&'a str>,
}

impl<'s> Rules<'_, 's> {
    fn apply(&self) -> Option<Advice> {
        self.foreign_statement()
            .or_else(|| self.keyword_as_name())
            .or_else(|| self.misplaced())
            .or_else(|| self.number())
            .or_else(|| self.symbol())
            .or_else(|| self.head())
            .or_else(|| self.comma())
    }

    fn text(&self, i: usize) -> &'s str {
        let lexeme = self.context.tokens.lexemes.get(i);
        lexeme.and_then(|l| self.context.tokens.text.get(l.start..l.end)).unwrap_or("")
    }

    fn token(&self, i: usize) -> Option<&Token<'s>> {
        self.context.tokens.lexemes.get(i).map(|l| &l.token)
    }

    /// Returns the token that did not fit; `next` and `back` return its neighbours.
    fn found(&self) -> Option<&Token<'s>> {
        self.token(self.context.at)
    }

    fn next(&self) -> Option<&Token<'s>> {
        self.token(self.context.at + 1)
    }

    fn back(&self, n: usize) -> Option<&Token<'s>> {
        self.context.at.checked_sub(n).and_then(|i| self.token(i))
    }

    fn first(&self) -> Option<&Token<'s>> {
        self.token(self.context.start)
    }

    /// Returns the number of tokens of the statement before the one that did not fit.
    fn distance(&self) -> usize {
        self.context.at.saturating_sub(self.context.start)
    }

    fn expects(&self, name: &str) -> bool {
        self.expected.contains(name)
    }

    fn expects_statement(&self) -> bool {
        expected::is_statement(&self.expected)
    }

    fn expects_expression(&self) -> bool {
        expected::is_expression(&self.expected)
    }

    fn expects_operator(&self) -> bool {
        expected::is_operator(&self.expected)
    }

    /// Returns whether only the braces of a block, or a continuation of its head, could
    /// follow.
    fn expects_block(&self) -> bool {
        self.expects("{") && !self.expects_expression()
    }

    fn expects_name_only(&self) -> bool {
        self.expects("a name") && !self.expects_expression()
    }
}
