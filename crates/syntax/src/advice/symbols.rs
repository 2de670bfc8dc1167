//! Rules about symbols, numbers and the heads of blocks.

use super::{Advice, Rules, hint, say};
use crate::delimiters::first_on_line;
use crate::token::Token;

impl Rules<'_, '_> {
    /// Returns advice on symbols that do not fit.
    pub(super) fn symbol(&self) -> Option<Advice> {
        match self.found()? {
            Token::Bind => self.bind(),
            Token::EqEq if self.expects("=") => {
                say("`==` compares", "write `=`", "a value is bound by `=`")
            }
            Token::Tilde => self.tilde(),
            Token::LBracket if self.first() == Some(&Token::Let) && self.distance() == 2 => {
                let name = self.text(self.context.at.saturating_sub(1));
                say("`let` binds a name, not an element", "expected `=`", recurrence(name))
            }
            Token::Colon => self.colon(),
            Token::Semi => self.semicolon(),
            Token::Hash => self.hash(),
            Token::Str(_) => self.string(),
            Token::Arrow => hint(
                "a function is written `fn(x) { … }`; `weight => kernel;` is used only in `mix { … }`",
            ),
            Token::Plus if self.expects_expression() => hint("there is no unary `+`"),
            Token::Range if !self.expects_expression() => {
                hint("`..` does not chain, and `a .. b` has no step")
            }
            Token::In if self.expects_operator() => {
                hint("`in` is used only in `for x in xs { … }`")
            }
            token if token.is_comparison() && !self.expects_expression() && !self.expects("=") => {
                say("comparisons do not chain", "", "write `a < b and b < c`")
            }
            Token::Name(_) if self.first() == Some(&Token::Data) && self.expects(":") => {
                hint("a type follows a colon: `data photo: image;`")
            }
            Token::Name(_) if self.expects("a string") && !self.expects_expression() => {
                hint("write it in quotes: \"…\"")
            }
            _ => None,
        }
    }

    fn bind(&self) -> Option<Advice> {
        if self.expects_expression() {
            return None;
        }
        let name = self.text(self.context.start);
        match self.first()? {
            Token::Name(_) if self.expects("~") && self.distance() == 1 => say(
                format!("`{name}` is not bound by `=` alone"),
                "",
                format!(
                    "write `let {name} = …;` for a value, `{name} ~ …;` for a random choice; values do not change"
                ),
            ),
            Token::Name(_) if self.expects("~") => {
                let others = "`x[k] ~ d;` makes a random choice; an array is made by `map(f, xs)`";
                say("values do not change", "", format!("{others}; {}", recurrence(name)))
            }
            Token::Fn if self.expects_block() => {
                hint("write the body of a function in braces: `fn f(x) { x + 1 }`")
            }
            _ if self.expects_name_only() => None,
            _ => say(
                "`=` does not compare",
                "write `==`",
                "`a == b` compares; `let x = e;` binds one name",
            ),
        }
    }

    fn tilde(&self) -> Option<Advice> {
        let name = self.text(self.context.at.saturating_sub(1));
        match self.first()? {
            Token::Let if self.distance() == 2 => say(
                "`let` binds a value, not a random choice",
                "expected `=`",
                format!(
                    "write `{name} ~ …;` without `let`; in the model also `assume {name} ~ …;`"
                ),
            ),
            Token::Observe => say(
                "`observe` names the distribution first",
                "expected `=`",
                format!(
                    "write `observe d = {name};`, for example `observe normal(0, 1) = {name};`"
                ),
            ),
            Token::Param | Token::Data => hint("a random choice is made by `assume x ~ d;`"),
            _ if !self.expects_expression() => {
                hint("only a name can be drawn: `x ~ d;` or, with a key, `x[k] ~ d;`")
            }
            _ => None,
        }
    }

    fn colon(&self) -> Option<Advice> {
        let same_line = !first_on_line(
            self.context.tokens.text,
            &self.context.tokens.lexemes,
            self.context.at + 1,
        );
        if self.first() == Some(&Token::Let) && self.distance() == 2 {
            return hint("`let` has no type annotation: write `let x = e;`");
        }
        if self.expects_block()
            && !(same_line && matches!(self.next(), Some(Token::Number(_) | Token::Name(_))))
        {
            return hint("blocks are written in braces: `{ … }`");
        }
        if !self.expects_expression() {
            return hint("a range is written `1 .. 10`");
        }
        None
    }

    fn semicolon(&self) -> Option<Advice> {
        if self.expects_statement() {
            return say("a `;` without a statement", "delete it", "no `;` follows a block");
        }
        if self.expects_block() {
            return self.head();
        }
        match self.first()? {
            Token::Observe if self.expects("=") => {
                let message = "`observe` without an observed value";
                if (self.context.start..self.context.at)
                    .any(|i| self.token(i) == Some(&Token::EqEq))
                {
                    say(
                        message,
                        "expected `=` before this",
                        "`==` compares; write `observe d = v;`",
                    )
                } else {
                    say(
                        message,
                        "expected `=`",
                        "write `observe d = v;`: the distribution, then the value",
                    )
                }
            }
            Token::Param if self.expects("=") => say(
                "a `param` without a default",
                "expected `=`",
                "write `param n = 10;`; it is set by `--set n=20`",
            ),
            Token::Export if self.expects("to") => hint("write `export e to \"file\";`"),
            _ if self.expects("else") && !self.expects("a name") => say(
                "an `if` with a value needs an `else`",
                "expected `else { … }`",
                "give the value for the other case: `if c { a } else { b }`",
            ),
            _ if self.expects("=>") => {
                say("a kernel without a weight", "expected `=>`", "write `0.5 => kernel;`")
            }
            _ => None,
        }
    }

    fn hash(&self) -> Option<Advice> {
        if self.distance() == 0 || self.expects_statement() {
            return hint(
                "a comment begins with `//`; `#` marks a random choice with a tag: `x ~ d #tag;`",
            );
        }
        hint("a tag goes at the end of a random choice, `x ~ d #tag;`; a comment begins with `//`")
    }

    fn string(&self) -> Option<Advice> {
        if self.first() == Some(&Token::Param) && self.expects("=") {
            return say(
                "a `param` without a default",
                "expected `=`",
                "write `param n = 10 \"help\";`",
            );
        }
        if self.expects_name_only() {
            return hint("write the name without quotes");
        }
        None
    }

    /// Returns advice on numbers and the tokens around them.
    pub(super) fn number(&self) -> Option<Advice> {
        match (self.back(2), self.back(1), self.found()?, self.next()) {
            (_, _, Token::Dot, Some(Token::Number(_))) if self.expects_expression() => {
                hint(format!("write `0.{}`", self.text(self.context.at + 1)))
            }
            (Some(Token::Number(_)), Some(Token::Dot), _, _) => {
                let number = self.text(self.context.at.saturating_sub(2));
                hint(format!("a number cannot end with a decimal point: write `{number}.0`"))
            }
            (_, Some(Token::LBrace | Token::Comma), Token::Number(_), Some(Token::Colon)) => {
                let number = self.text(self.context.at);
                hint(format!("the keys of a record are names or strings: `{{ \"{number}\": … }}`"))
            }
            (_, Some(Token::Dot), Token::Number(_), _) => {
                hint("an element is written `x[0]`, a field `x.name`")
            }
            (_, Some(Token::Number(_)), Token::Name(_), _)
                if !self.expects_expression() && !self.expects(",") =>
            {
                let (number, name) = (self.text(self.context.at - 1), self.text(self.context.at));
                hint(format!("to multiply, write `{number} * {name}`"))
            }
            (Some(Token::Hash), Some(_), _, _) => {
                let tag = self.text(self.context.at - 1);
                hint(format!("a comment begins with `//`; `#{tag}` was read as a tag"))
            }
            _ => None,
        }
    }

    /// Returns advice on the heads of statements and blocks.
    pub(super) fn head(&self) -> Option<Advice> {
        let found = self.found();
        let counted = match self.back(3) {
            Some(Token::Repeat) => Some("repeat"),
            Some(Token::Warmup) => Some("warmup"),
            Some(Token::Every) => Some("every"),
            _ => None,
        };
        if let Some(word) = counted
            && self.back(2) == Some(&Token::LBrace)
            && self.expects(":")
        {
            let advice = say(
                format!("`{word}` without a count"),
                "how many times?",
                format!("write `{word} 100 {{ … }}`"),
            );
            return advice.map(|advice| Advice { place: Some(self.context.at - 3), ..advice });
        }
        match self.first()? {
            Token::For if found == Some(&Token::LParen) && self.distance() == 1 => {
                hint("the head of a loop has no parentheses: `for i in 1 .. 10 { … }`")
            }
            Token::For if self.distance() <= 2 => {
                hint("a loop is written `for i in 1 .. 10 { … }` or `for x in xs { … }`")
            }
            Token::Data if found == Some(&Token::LBrace) => hint(
                "data are declared one by one: `data photo: image;`, `data points = csv(\"points.csv\");`",
            ),
            _ if self.expects("when") && self.back(1) == Some(&Token::Stop) => {
                hint("write `stop when c;`")
            }
            _ if self.expects_block() => hint(
                "blocks and branches are written in braces: `if c { a } else { b }`, `fn f(x) { x + 1 }`",
            ),
            Token::Name(_)
                if found == Some(&Token::LBrace) && self.back(1) == Some(&Token::RParen) =>
            {
                hint("a function is declared by `fn f(x) { … }`")
            }
            _ => None,
        }
    }

    /// Returns advice on superfluous and missing commas.
    pub(super) fn comma(&self) -> Option<Advice> {
        let found = self.found()?;
        if *found == Token::Comma && !self.expects_expression() {
            return match self.first()? {
                Token::Let | Token::Assume | Token::Predict => {
                    hint("each name needs its own statement")
                }
                Token::Name(_) => hint("each random choice needs its own statement"),
                _ => None,
            };
        }
        let juxtaposed = found.starts_expression() && !self.expects_expression();
        (self.expects(",") && juxtaposed).then(|| Advice {
            message: Some("expected `,`".to_owned()),
            label: Some("a comma is missing before this".to_owned()),
            ..Advice::default()
        })
    }
}

/// Describes how to write an array whose elements depend on earlier ones.
fn recurrence(name: &str) -> String {
    let i = if name == "t" { "i" } else { "t" };
    let fold = format!("fold(fn(all, {i}) {{ append(all, f(all[{i} - 1])) }}, [first], 1 .. n)");
    format!("`{name}[{i}] = f({name}[{i} - 1])` in a loop is `let {name} = {fold};`")
}
