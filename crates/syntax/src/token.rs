//! The tokens of the language, as far as logos can recognise them.
//!
//! Lexing is context-free. Keywords, punctuation, names and numbers are regular and left
//! to logos. Of lexemes that need more (strings, block comments, addresses, tag
//! selections), logos recognises only the first characters, as a [`Token::Open`], and
//! [`lexer`](super::lexer) scans the rest by hand. Spellings from other languages are
//! tokens too ([`Token::Foreign`]), so that the message can say what to write instead.
//! Neither of these two reaches the parser.

use super::ast::Address;
use super::deep::Deep;
use logos::Logos;
use std::rc::Rc;
use std::sync::Arc;

/// A token; names and keywords borrow from the source.
#[derive(Logos, Clone, Debug, PartialEq)]
#[logos(skip r"[ \t\r\n\x0c]+")]
#[logos(skip(r"//[^\n]*", allow_greedy = true))]
pub(crate) enum Token<'s> {
    #[regex("[A-Za-z_][A-Za-z0-9_]*")]
    Name(&'s str),
    #[regex(r"[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?", number, priority = 10)]
    Number(f64),
    Str(Arc<str>),
    Address(Rc<Deep<Address>>),
    TagSel((Arc<str>, Option<Arc<str>>)),

    // Items
    #[token("include")]
    Include,
    #[token("param")]
    Param,
    #[token("data")]
    Data,
    #[token("fn")]
    Fn,
    #[token("kernel")]
    Kernel,
    #[token("infer")]
    Infer,
    #[token("report")]
    Report,
    #[token("export")]
    Export,
    #[token("as")]
    As,
    #[token("to")]
    To,

    // Model statements
    #[token("assume")]
    Assume,
    #[token("let")]
    Let,
    #[token("observe")]
    Observe,
    #[token("with")]
    With,
    #[token("coarse")]
    Coarse,
    #[token("predict")]
    Predict,
    #[token("factor")]
    Factor,
    #[token("force")]
    Force,
    #[token("freeze")]
    Freeze,
    #[token("forget")]
    Forget,
    #[token("sample")]
    Sample,
    #[token("for")]
    For,
    #[token("in")]
    In,
    #[token("if")]
    If,
    #[token("else")]
    Else,

    // Inference statements
    #[token("warmup")]
    Warmup,
    #[token("repeat")]
    Repeat,
    #[token("every")]
    Every,
    #[token("mix")]
    Mix,
    #[token("stop")]
    Stop,
    #[token("when")]
    When,
    #[token("collect")]
    Collect,
    #[token("propose")]
    Propose,

    // Words of expressions
    #[token("or")]
    Or,
    #[token("and")]
    And,
    #[token("not")]
    Not,
    #[token("true")]
    True,
    #[token("false")]
    False,

    // Punctuation
    #[token("(")]
    LParen,
    #[token(")")]
    RParen,
    #[token("[")]
    LBracket,
    #[token("]")]
    RBracket,
    #[token("{")]
    LBrace,
    #[token("}")]
    RBrace,
    #[token(",")]
    Comma,
    #[token(";")]
    Semi,
    #[token(":")]
    Colon,
    #[token(".")]
    Dot,
    #[token("#")]
    Hash,
    #[token("=")]
    Bind,
    #[token("~")]
    Tilde,
    #[token("=>")]
    Arrow,
    #[token("..")]
    Range,
    #[token("==")]
    EqEq,
    #[token("!=")]
    NotEq,
    #[token("<")]
    Lt,
    #[token("<=")]
    Le,
    #[token(">")]
    Gt,
    #[token(">=")]
    Ge,
    #[token("+")]
    Plus,
    #[token("-")]
    Minus,
    #[token("*")]
    Star,
    #[token("/")]
    Slash,
    #[token("%")]
    Percent,
    #[token("**")]
    StarStar,
    #[token("&")]
    Amp,

    /// The first characters of a lexeme that is scanned by hand.
    #[token("\"", |_| Open::Str)]
    #[token("/*", |_| Open::Comment)]
    #[token("@", |_| Open::Address)]
    #[token("$", |_| Open::TagSel)]
    Open(Open),

    /// A spelling from another language, or a slip; the lexer reports it and replaces it
    /// with its probable meaning.
    #[token("&&", |_| Foreign::And)]
    #[token("||", |_| Foreign::Or)]
    #[token("!", |_| Foreign::Not)]
    #[token("<-", |_| Foreign::LeftArrow)]
    #[token("->", |_| Foreign::RightArrow)]
    #[token(":=", |_| Foreign::ColonEq)]
    #[token("===", |_| Foreign::EqEqEq)]
    #[token("!==", |_| Foreign::NotEqEq)]
    #[token("^", |_| Foreign::Caret)]
    #[token("|", |_| Foreign::Bar)]
    #[token("|>", |_| Foreign::Bar)]
    #[token("+=", |_| Foreign::Update)]
    #[token("-=", |_| Foreign::Update)]
    #[token("*=", |_| Foreign::Update)]
    #[token("/=", |_| Foreign::Update)]
    #[token("++", |_| Foreign::Increment)]
    #[token("::", |_| Foreign::ColonColon)]
    #[token("'", |_| Foreign::Quote)]
    #[regex("[“”„«»‘’`]", |_| Foreign::Quote)]
    #[regex(r"[0-9][0-9A-Za-z_]*(\.[0-9][0-9A-Za-z_]*)*", |_| Foreign::Number, priority = 1)]
    #[regex(r"[0-9A-Za-z_]*[\p{L}--[A-Za-z]][\p{L}\p{M}\p{N}_]*", |_| Foreign::Name)]
    Foreign(Foreign),

    /// The placeholder of a statement that did not parse; only
    /// [`recover`](super::recover) makes it.
    Bad,
}

/// A lexeme scanned by hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Open {
    Str,
    Comment,
    Address,
    TagSel,
}

/// A spelling from another language whose meaning can be guessed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Foreign {
    And,
    Or,
    Not,
    LeftArrow,
    RightArrow,
    ColonEq,
    EqEqEq,
    NotEqEq,
    Caret,
    Bar,
    Update,
    Increment,
    ColonColon,
    Quote,
    Number,
    Name,
}

impl Token<'_> {
    /// Returns whether the token is a keyword.
    pub(crate) fn is_keyword(&self) -> bool {
        use Token::*;
        self.starts_statement()
            || self.starts_item()
            || matches!(
                self,
                As | To | With | Coarse | In | If | Else | When | Or | And | Not | True | False
            )
    }

    /// Returns whether the token starts an item that is not allowed inside a body. `fn`
    /// counts only if a name follows it, which the caller has to check.
    pub(crate) fn starts_item(&self) -> bool {
        use Token::*;
        matches!(self, Include | Param | Data | Fn | Kernel | Infer | Report | Export)
    }

    /// Returns whether the token starts a statement and is not allowed anywhere else.
    pub(crate) fn starts_statement(&self) -> bool {
        self.starts_model_statement()
            || self.starts_inference_statement()
            || matches!(self, Token::Let | Token::For)
    }

    /// Returns whether the token starts a statement of models only.
    pub(crate) fn starts_model_statement(&self) -> bool {
        use Token::*;
        matches!(self, Assume | Observe | Predict | Factor | Force | Freeze | Forget | Sample)
    }

    /// Returns whether the token starts a statement of inference blocks only.
    pub(crate) fn starts_inference_statement(&self) -> bool {
        use Token::*;
        matches!(self, Warmup | Repeat | Every | Mix | Stop | Collect | Propose)
    }

    /// Returns whether the token starts an expression.
    pub(crate) fn starts_expression(&self) -> bool {
        use Token::*;
        matches!(
            self,
            Name(_)
                | Number(_)
                | Str(_)
                | Address(_)
                | TagSel(..)
                | True
                | False
                | LParen
                | LBracket
                | LBrace
                | If
                | Fn
                | Not
        )
    }

    /// Returns whether the token is an infix operator.
    pub(crate) fn is_infix(&self) -> bool {
        use Token::*;
        matches!(self, Or | And | Range | Plus | Minus | Star | Slash | Percent | StarStar | Amp)
            || self.is_comparison()
    }

    /// Returns whether the token is a comparison operator.
    pub(crate) fn is_comparison(&self) -> bool {
        use Token::*;
        matches!(self, EqEq | NotEq | Lt | Le | Gt | Ge)
    }
}

/// Returns the value of a well-formed number, which is infinite if it is too large.
fn number<'s>(lexer: &mut logos::Lexer<'s, Token<'s>>) -> Option<f64> {
    lexer.slice().parse().ok()
}

/// The keywords by their class in editors. The grammars for TextMate, Pygments and tree-sitter
/// are tested to have the same.
pub const KEYWORDS: [(&str, &str); 4] = [
    ("constant", "true false"),
    ("operator", "or and not"),
    ("control", "for in if else warmup repeat every mix stop when collect propose"),
    (
        "declaration",
        "include param data fn kernel infer report export as to assume let observe with \
         coarse predict factor force freeze forget sample",
    ),
];

/// Returns all keywords.
pub fn keywords() -> impl Iterator<Item = &'static str> {
    KEYWORDS.iter().flat_map(|(_, words)| words.split(' '))
}

/// Returns whether a text is a keyword.
pub fn is_keyword(text: &str) -> bool {
    is_name(text) && !matches!(Token::lexer(text).next(), Some(Ok(Token::Name(_))))
}

/// Returns whether a text is a name (or a keyword): an ASCII letter or `_`, then letters,
/// digits and `_`.
pub fn is_name(text: &str) -> bool {
    let mut bytes = text.bytes();
    bytes.next().is_some_and(|b| b.is_ascii_alphabetic() || b == b'_')
        && bytes.all(|b| b.is_ascii_alphanumeric() || b == b'_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_keyword_has_one_class() {
        let tokens = include_str!("token.rs").split("#[token(\"").skip(1);
        let mut known: Vec<&str> = tokens.filter_map(|t| t.split('"').next()).collect();
        known.retain(|t| is_name(t));
        let mut classed: Vec<&str> = keywords().collect();
        known.sort_unstable();
        classed.sort_unstable();
        assert_eq!(known, classed);
        assert!(classed.iter().all(|k| is_keyword(k)));
    }
}
