//! Rules about words: statements of other languages, and misplaced keywords.

use super::{Advice, Rules, say};
use crate::elsewhere::{Before, FOREIGN_STATEMENTS};
use crate::token::Token;

impl Rules<'_, '_> {
    /// Returns advice on statements of other languages, recognised by their first word.
    pub(super) fn foreign_statement(&self) -> Option<Advice> {
        let start = self.context.start;
        if !matches!(self.first(), Some(Token::Name(_))) || !(1..=2).contains(&self.distance()) {
            return None;
        }
        let word = self.text(start);
        let named = matches!(self.token(start + 1), Some(Token::Name(_)));
        let brace = |i| self.token(i) == Some(&Token::LBrace);
        let block = brace(start + 1) || (named && brace(start + 2));
        let (_, _, hint) = FOREIGN_STATEMENTS.iter().find(|(words, before, _)| {
            let fits = match before {
                Before::Anything => true,
                Before::Name => named,
                Before::Block => block,
            };
            fits && words.split(' ').any(|w| w == word)
        })?;
        let advice = say(format!("there is no `{word}`"), "", *hint);
        advice.map(|advice| Advice { place: Some(start), ..advice })
    }

    /// Returns advice on misplaced keywords.
    pub(super) fn misplaced(&self) -> Option<Advice> {
        let found = self.found()?;
        let word = self.text(self.context.at);
        if *found == Token::Else && !self.expects("in") {
            let semicolon = matches!(self.back(1), Some(Token::Semi | Token::Bad))
                && self.back(2) == Some(&Token::RBrace);
            let hint = if semicolon {
                "there is no `;` between `}` and `else`"
            } else {
                "write `if c { … } else { … }`, with both branches in braces"
            };
            return say("`else` without `if`", "", hint);
        }
        if self.expects_statement() {
            if found.starts_inference_statement() {
                let message = format!("`{word}` is allowed only in an inference plan");
                return say(
                    message,
                    "not a statement of the model",
                    format!("write `infer {{ {word} … }}`"),
                );
            }
            if found.starts_model_statement() {
                let message = format!("`{word}` is allowed only in the model");
                return say(
                    message,
                    "not a statement of an inference plan",
                    "move it outside `infer` or `kernel`",
                );
            }
            if found.starts_item() && *found != Token::Fn {
                return say(
                    format!("`{word}` is allowed only at the top level"),
                    "this is inside a block",
                    "move it out of the block",
                );
            }
        }
        if self.back(1) == Some(&Token::Fn) && matches!(found, Token::Name(_)) {
            let hint = "declare it at the top level, or bind it: `let f = fn(x) { … };`";
            return say("a named function cannot be declared here", "expected `(`", hint);
        }
        if (found.starts_statement() || found.starts_item())
            && self.expects_expression()
            && !self.expects(word)
        {
            let advice =
                say("this statement is incomplete", "expected an expression after this", "");
            return advice.map(|advice| Advice {
                hint: None,
                place: self.context.at.checked_sub(1),
                ..advice
            });
        }
        if matches!(found, Token::If | Token::Fn | Token::Not)
            && self.expects_expression()
            && !self.expects(word)
        {
            let message = format!("`{word}` as an operand needs parentheses");
            return say(message, "", format!("write `({word} …)`"));
        }
        if *found == Token::If && (self.expects_operator() || self.expects(";")) {
            return super::hint("a choice between two values is written `if c { a } else { b }`");
        }
        None
    }

    /// Returns advice on a keyword where a name is expected.
    pub(super) fn keyword_as_name(&self) -> Option<Advice> {
        let found = self.found()?;
        let word = self.text(self.context.at);
        let ends = |t: &Token<'_>| {
            t.is_infix() || matches!(t, Token::Comma | Token::RParen | Token::Semi | Token::Dot)
        };
        let value = self.expects_expression() && self.next().is_some_and(ends);
        if !found.is_keyword() || *found == Token::Else || !(value || self.expects_name_only()) {
            return None;
        }
        let message = format!("`{word}` is a keyword and cannot be a name");
        say(message, "expected a name", format!("choose another, such as `{word}_` or `my_{word}`"))
    }
}
