//! What was probably meant by a text that does not fit the grammar: habits from other languages, and common slips.
//!
//! This only chooses words; a rule that misses costs a hint, not a message.

use super::error::SyntaxErrorKind;
use super::expected;
use super::recover::Tokens;
use super::token::Token;
use std::collections::BTreeSet;

/// Words for an error, where there are better ones than "unexpected …, expected …".
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Advice {
    /// What is wrong.
    pub message: Option<String>,
    /// What to say at the place.
    pub label: Option<String>,
    /// What to do.
    pub hint: Option<String>,
}

/// Where the text does not fit.
pub(crate) struct Context<'a, 's> {
    pub tokens: &'a Tokens<'s>,
    /// The index of the token that did not fit; the number of tokens at the end.
    pub at: usize,
    /// The index of the first token of the statement.
    pub start: usize,
    /// The tokens that would have fitted, as the parser names them.
    pub expected: &'a [String],
}

/// The error for a token that does not fit.
pub(crate) fn explain(context: &Context<'_, '_>) -> SyntaxErrorKind {
    let rules = Rules { expected: expected::names(context.expected), context };
    let found = context.tokens.lexemes.get(context.at).map(|l| match &l.token {
        Token::Number(_) => format!("number `{}`", rules.text(context.at)),
        Token::Str(_) => "string".to_owned(),
        Token::Address(_) => format!("address `{}`", rules.text(context.at)),
        token if token.is_keyword() => format!("keyword `{}`", rules.text(context.at)),
        _ => format!("`{}`", rules.text(context.at)),
    });
    SyntaxErrorKind::Unexpected { found, expected: expected::describe(context.expected), advice: rules.apply() }
}

struct Rules<'a, 's> {
    context: &'a Context<'a, 's>,
    expected: BTreeSet<&'a str>,
}

/// Keeps the message, adds a hint.
fn hint(hint: impl Into<String>) -> Option<Advice> {
    Some(Advice { hint: Some(hint.into()), ..Advice::default() })
}

/// Another message, and a hint.
fn say(message: impl Into<String>, label: impl Into<String>, hint: impl Into<String>) -> Option<Advice> {
    Some(Advice { message: Some(message.into()), label: Some(label.into()), hint: Some(hint.into()) })
}

impl<'s> Rules<'_, 's> {
    fn text(&self, i: usize) -> &'s str {
        let lexeme = self.context.tokens.lexemes.get(i);
        lexeme.and_then(|l| self.context.tokens.text.get(l.start..l.end)).unwrap_or("")
    }

    fn token(&self, i: usize) -> Option<&Token<'s>> {
        self.context.tokens.lexemes.get(i).map(|l| &l.token)
    }

    /// The token that did not fit, and its neighbours.
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

    fn expects(&self, name: &str) -> bool {
        self.expected.contains(name)
    }

    fn expects_expression(&self) -> bool {
        self.expects("a number") && self.expects("(")
    }

    fn expects_operator(&self) -> bool {
        self.expects("**") || self.expects("*") || self.expects("and")
    }

    /// How many tokens of the statement come before.
    fn distance(&self) -> usize {
        self.context.at.saturating_sub(self.context.start)
    }

    fn apply(&self) -> Option<Advice> {
        self.foreign_statement()
            .or_else(|| self.misplaced())
            .or_else(|| self.keyword_as_name())
            .or_else(|| self.by_token())
            .or_else(|| self.number())
            .or_else(|| self.block())
            .or_else(|| self.separator())
    }

    /// Statements of other languages, by their first word.
    fn foreign_statement(&self) -> Option<Advice> {
        if !matches!(self.first(), Some(Token::Name(_))) || !(1..=2).contains(&self.distance()) {
            return None;
        }
        let word = self.text(self.context.start);
        let next = self.token(self.context.start + 1);
        let named = matches!(next, Some(Token::Name(_)));
        let block = matches!(next, Some(Token::LBrace)) || (named && self.found() == Some(&Token::LBrace));
        let general = |what: &str, instead: &str| say(format!("there is no `{word}` {what}"), "", instead);
        match word {
            "def" | "function" | "func" | "fun" | "defun" | "define" if named => general(
                "here",
                "a function is declared by `fn f(x) { … }`; its value is the last expression, without `;`",
            ),
            "return" => say("there is no `return`", "", "the value of a body is its last expression, without `;`"),
            "var" | "const" | "val" | "auto" | "mut" | "set" if named => {
                general("here", "a value is bound by `let x = e;`, a random choice made by `x ~ d;`")
            }
            "int" | "real" | "float" | "double" | "bool" | "string" | "vector" | "matrix" | "array" if named => {
                general(
                    "declaration",
                    "names are not declared: `let x = e;` binds a value, `x ~ d;` makes a random choice",
                )
            }
            "import" | "from" | "using" | "use" | "require" | "load" => {
                general("here", "another file is read by `include \"file.pcad\" as name;`")
            }
            "model" | "parameters" | "transformed" | "generated" | "program" | "module" | "begin" if block => {
                general("block", "the statements of a model stand at the top level, one after the other")
            }
            "while" | "loop" | "do" | "until" => {
                general("loop", "write `for i in a .. b { … }`, or a function that calls itself")
            }
            "elif" | "elseif" | "elsif" => say(format!("there is no `{word}`"), "", "write `else if`"),
            "class" | "struct" | "type" | "enum" if named => general("here", "a record is written `{ x: 1, y: 2 }`"),
            "print" | "echo" | "show" => general("statement", "write `report e;`"),
            "query" | "condition" | "constrain" => {
                general("statement", "data are observed by `observe d = v;`, soft constraints added by `factor(logw);`")
            }
            "del" | "delete" => general("statement", "an observation is removed by `forget name;`"),
            "global" | "local" | "static" | "public" | "private" => {
                general("here", "a name is known where it is bound, and in what follows there")
            }
            _ => None,
        }
    }

    /// Keywords where they do not belong.
    fn misplaced(&self) -> Option<Advice> {
        let found = self.found()?;
        let word = self.text(self.context.at);
        if *found == Token::Else {
            let semicolon = self.back(1) == Some(&Token::Semi) && self.back(2) == Some(&Token::RBrace);
            let hint = if semicolon {
                "no `;` stands between `}` and `else`"
            } else {
                "write `if c { … } else { … }`; the branches are in braces"
            };
            return say("`else` without `if`", "", hint);
        }
        if self.expects("let") && self.expects("for") {
            if found.starts_inference_statement() {
                let place = format!("`{word}` belongs into an inference plan");
                return say(place, "not a statement of the model", format!("write `infer {{ {word} … }}`"));
            }
            if found.starts_model_statement() {
                let place = format!("`{word}` belongs into the model");
                return say(place, "not a statement of an inference plan", "put it outside of `infer` or `kernel`");
            }
            if *found == Token::Fn && matches!(self.next(), Some(Token::Name(_))) {
                let hint = "declare it at the top level, or bind it: `let f = fn(x) { … };`";
                return say("a named function cannot be declared in a block", "", hint);
            }
            if found.starts_item() && *found != Token::Fn {
                return say(format!("`{word}` stands at the top level only"), "this is inside a block", "move it out");
            }
        }
        if matches!(found, Token::If | Token::Fn | Token::Not) && self.expects_expression() && !self.expects(word) {
            let message = format!("`{word}` as an operand needs parentheses");
            return say(message, "", format!("write `( {word} … )`"));
        }
        if *found == Token::If && self.expects_operator() {
            return hint("a choice between two values is written `if c { a } else { b }`");
        }
        None
    }

    fn keyword_as_name(&self) -> Option<Advice> {
        let found = self.found()?;
        let word = self.text(self.context.at);
        let value = self.expects_expression()
            && self
                .next()
                .is_some_and(|t| t.is_infix() || matches!(t, Token::Comma | Token::RParen | Token::Semi | Token::Dot));
        if !found.is_keyword() || !(value || (self.expects("a name") && !self.expects_expression())) {
            return None;
        }
        let message = format!("`{word}` is a keyword and cannot be a name");
        say(message, "expected a name", format!("choose another, such as `{word}_` or `my_{word}`"))
    }

    /// Symbols that do not fit.
    fn by_token(&self) -> Option<Advice> {
        match self.found()? {
            Token::Bind => self.bind(),
            Token::EqEq if self.expects("=") => say("`==` compares", "write `=`", "a value is bound by `=`"),
            Token::Tilde => self.tilde(),
            Token::Colon => self.colon(),
            Token::Semi => self.semicolon(),
            Token::Hash => self.hash(),
            Token::Arrow => hint("a function is written `fn(x) { … }`; `weight => kernel;` stands in `mix { … }`"),
            Token::Plus if self.expects_expression() => hint("there is no `+` before a single value"),
            Token::Range if self.expects_operator() => hint("`..` does not chain, and `a .. b` has no step"),
            Token::In if self.expects_operator() => hint("`in` stands in `for x in xs { … }` only"),
            token if token.is_comparison() && self.expects_operator() => {
                say("comparisons do not chain", "", "write `a < b and b < c`")
            }
            Token::Str(_) if self.expects("a name") && !self.expects_expression() => {
                hint("names are written without quotes")
            }
            Token::Name(_) if self.expects("a string") && !self.expects_expression() => {
                hint("this text is written in quotes: \"…\"")
            }
            _ => None,
        }
    }

    fn bind(&self) -> Option<Advice> {
        let name = self.text(self.context.start);
        match self.first()? {
            Token::Name(_) if self.expects("~") && self.distance() == 1 => say(
                format!("`{name}` is not bound by `=` alone"),
                "",
                format!("write `let {name} = …;` for a value, `{name} ~ …;` for a random choice; values do not change"),
            ),
            Token::Name(_) if self.expects("~") => {
                say("values do not change", "", "`x[k] ~ d;` makes a random choice; an array is made by `map(f, xs)`")
            }
            _ if self.expects("==") => {
                say("`=` does not compare", "write `==`", "`a == b` compares, `let x = e;` binds")
            }
            _ => None,
        }
    }

    fn tilde(&self) -> Option<Advice> {
        let name = self.text(self.context.at.saturating_sub(1));
        match self.first()? {
            Token::Let => say(
                "`let` binds a value, not a random choice",
                "expected `=`",
                format!("write `{name} ~ …;` without `let`; in the model also `assume {name} ~ …;`"),
            ),
            Token::Observe => say(
                "`observe` gives the distribution first",
                "expected `=`",
                format!("write `observe d = {name};`, for example `observe normal(0, 1) = {name};`"),
            ),
            Token::Param | Token::Data => hint("a random choice is made by `assume x ~ d;`"),
            _ if self.expects_operator() => hint("only a name can be drawn, `x ~ d;`, or one with a key, `x[k] ~ d;`"),
            _ => None,
        }
    }

    fn colon(&self) -> Option<Advice> {
        if self.expects("{") {
            return hint("blocks are written in braces: `{ … }`");
        }
        if self.first() == Some(&Token::Let) && self.distance() == 2 {
            return hint("`let` declares no type: `let x = e;`");
        }
        let record = matches!(self.back(2), Some(Token::LBrace | Token::Comma));
        match self.back(1)? {
            Token::Str(_) if record => hint("the keys of a record are names, without quotes: `{ x: 1 }`"),
            _ if self.expects_operator() => hint("a range is written `1 .. 10`"),
            _ => None,
        }
    }

    fn semicolon(&self) -> Option<Advice> {
        if self.distance() == 0 {
            return say("a `;` without a statement", "delete it", "no `;` follows a block");
        }
        if self.expects("else") {
            return say("an `if` with a value needs an `else`", "expected `else { … }`", "what is it otherwise?");
        }
        match self.first()? {
            Token::Observe if self.expects("=") => {
                let mut statement = (self.context.start..self.context.at).map(|i| self.token(i));
                let message = "`observe` without an observed value";
                if statement.any(|t| t == Some(&Token::EqEq)) {
                    say(message, "expected `=` before this", "`==` compares; write `observe d = v;`")
                } else {
                    say(message, "expected `=`", "write `observe d = v;`: the distribution, then the value")
                }
            }
            Token::Param if self.expects("=") => {
                say("a `param` without a default", "expected `=`", "write `param n = 10;`; it is set by `--set n=20`")
            }
            Token::Export if self.expects("to") => hint("write `export e to \"file\";`"),
            _ if self.expects("=>") => say("a kernel without a weight", "expected `=>`", "write `0.5 => kernel;`"),
            _ => None,
        }
    }

    fn hash(&self) -> Option<Advice> {
        if self.distance() == 0 || !self.expects_operator() {
            return hint("a comment begins with `//`; `#` marks a random choice with a tag: `x ~ d #tag;`");
        }
        hint("a tag stands at the end of a random choice, `x ~ d #tag;`; a comment begins with `//`")
    }

    /// Numbers and what is written around them.
    fn number(&self) -> Option<Advice> {
        match (self.back(2), self.back(1), self.found()?, self.next()) {
            (_, _, Token::Dot, Some(Token::Number(_))) if self.expects_expression() => {
                hint(format!("write `0.{}`", self.text(self.context.at + 1)))
            }
            (Some(Token::Number(_)), Some(Token::Dot), _, _) => {
                let number = self.text(self.context.at.saturating_sub(2));
                hint(format!("a number does not end with a point: write `{number}.0`"))
            }
            (_, Some(Token::Dot), Token::Number(_), _) => hint("an element is written `x[0]`, a field `x.name`"),
            (_, Some(Token::Number(_)), Token::Name(_), _) if self.expects_operator() => {
                let (number, name) = (self.text(self.context.at - 1), self.text(self.context.at));
                hint(format!("to multiply, write `{number} * {name}`"))
            }
            (Some(Token::Hash), Some(Token::Name(_)), Token::Name(_), _) => {
                let tag = self.text(self.context.at - 1);
                hint(format!("a comment begins with `//`; `#{tag}` was read as a tag"))
            }
            _ => None,
        }
    }

    /// Heads of blocks.
    fn block(&self) -> Option<Advice> {
        let found = self.found()?;
        if self.first() == Some(&Token::For) && self.distance() <= 4 && !self.expects_expression() {
            let parenthesised = *found == Token::LParen && self.distance() == 1;
            let hint_text = if parenthesised {
                "the head of a loop has no parentheses: `for i in 1 .. 10 { … }`"
            } else {
                "a loop is written `for i in 1 .. 10 { … }` or `for x in xs { … }`"
            };
            if self.distance() <= 2 {
                return hint(hint_text);
            }
        }
        if let Some(word @ (Token::Repeat | Token::Warmup | Token::Every)) = self.back(3)
            && self.back(2) == Some(&Token::LBrace)
            && self.expects(":")
        {
            let word = if *word == Token::Repeat {
                "repeat"
            } else if *word == Token::Warmup {
                "warmup"
            } else {
                "every"
            };
            let message = format!("`{word}` without a number");
            return say(message, "", format!("write `{word} 100 {{ … }}`"));
        }
        if self.expects("{") {
            return hint("blocks and branches are written in braces: `if c { a } else { b }`, `fn f(x) { x + 1 }`");
        }
        if *found == Token::LBrace
            && self.back(1) == Some(&Token::RParen)
            && matches!(self.first(), Some(Token::Name(_)))
        {
            return hint("a function is declared by `fn f(x) { … }`");
        }
        None
    }

    /// Commas.
    fn separator(&self) -> Option<Advice> {
        let found = self.found()?;
        if *found == Token::Comma {
            return match self.first()? {
                Token::Let | Token::Assume | Token::Predict => hint("each name is bound by a statement of its own"),
                Token::Name(_) if self.expects("~") => hint("each random choice is made by a statement of its own"),
                _ => None,
            };
        }
        if self.expects(",") && (found.starts_expression() || *found == Token::Minus) {
            return say(
                "expected `,` between these",
                "expected `,` before this",
                "arguments and elements are separated by commas",
            );
        }
        None
    }
}
