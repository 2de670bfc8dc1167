//! Matches brackets, and repairs those that do not match.
//!
//! After [`balance`] every bracket has its mate. [`recover`](super::recover) can then
//! find statements by skipping over bracketed tokens, and a forgotten bracket is one
//! error instead of a parse error at the end of the file. Brackets that match are left
//! unchanged; if they do not, indentation and keywords show where one is missing.

use super::error::{MAX_ERRORS, MAX_NESTING, SyntaxError, SyntaxErrorKind};
use super::lexer::Lexeme;
use super::span::{FileId, Span};
use super::token::Token;

/// An open bracket.
#[derive(Clone, Copy)]
struct Open {
    /// Its index in the output.
    index: usize,
    close: char,
    /// The indentation of its line. `inner` is the indentation of the next token's line,
    /// if that token begins a line.
    indent: usize,
    inner: Option<usize>,
}

struct Balancer<'a, 's> {
    text: &'s str,
    file: FileId,
    input: &'a [Lexeme<'s>],
    output: Vec<Lexeme<'s>>,
    mates: Vec<usize>,
    open: Vec<Open>,
    errors: Vec<SyntaxError>,
}

/// Tokens whose brackets match.
pub(crate) struct Balanced<'s> {
    pub lexemes: Vec<Lexeme<'s>>,
    /// For each bracket, the index of its mate; for any other token, its own index.
    pub mates: Vec<usize>,
    pub errors: Vec<SyntaxError>,
}

/// Adds, replaces or removes brackets so that they match. Returns no tokens if brackets
/// are nested more than [`MAX_NESTING`] deep.
pub(crate) fn balance<'s>(text: &'s str, file: FileId, lexemes: Vec<Lexeme<'s>>) -> Balanced<'s> {
    match mates(&lexemes) {
        Ok(Some(mates)) => Balanced { lexemes, mates, errors: Vec::new() },
        Ok(None) => {
            let (output, mates) =
                (Vec::with_capacity(lexemes.len()), Vec::with_capacity(lexemes.len()));
            let mut b = Balancer {
                text,
                file,
                input: &lexemes,
                output,
                mates,
                open: Vec::new(),
                errors: Vec::new(),
            };
            b.run();
            Balanced { lexemes: b.output, mates: b.mates, errors: b.errors }
        }
        Err(index) => {
            let span = lexemes
                .get(index)
                .map_or(Span::new(file, 0, 0), |l| Span::new(file, l.start, l.end));
            let errors = vec![SyntaxError::new(SyntaxErrorKind::TooNested, span)];
            Balanced { lexemes: Vec::new(), mates: Vec::new(), errors }
        }
    }
}

/// Returns the mates, or `None` if brackets do not match or a `;` is inside parentheses
/// or square brackets. The error is the index of the first bracket that is too deep.
fn mates(lexemes: &[Lexeme<'_>]) -> Result<Option<Vec<usize>>, usize> {
    let mut mates: Vec<usize> = (0..lexemes.len()).collect();
    let mut open: Vec<(usize, char)> = Vec::new();
    let mut matched = true;
    for (i, lexeme) in lexemes.iter().enumerate() {
        if let Some(close) = closing(&lexeme.token) {
            if open.len() == MAX_NESTING {
                return Err(i);
            }
            open.push((i, close));
        } else if let Some(close) = closes(&lexeme.token) {
            match open.pop() {
                Some((start, expected)) if expected == close => {
                    mates[start] = i;
                    mates[i] = start;
                }
                _ => matched = false,
            }
        } else if lexeme.token == Token::Semi {
            matched &= open.last().is_none_or(|(_, close)| *close == '}');
        }
    }
    Ok((matched && open.is_empty()).then_some(mates))
}

/// Returns the bracket that closes this one.
fn closing(token: &Token<'_>) -> Option<char> {
    match token {
        Token::LParen => Some(')'),
        Token::LBracket => Some(']'),
        Token::LBrace => Some('}'),
        _ => None,
    }
}

/// Returns the bracket itself, if it is a closing one.
fn closes(token: &Token<'_>) -> Option<char> {
    match token {
        Token::RParen => Some(')'),
        Token::RBracket => Some(']'),
        Token::RBrace => Some('}'),
        _ => None,
    }
}

impl<'s> Balancer<'_, 's> {
    fn run(&mut self) {
        for (i, lexeme) in self.input.iter().enumerate() {
            let indent = self.indent_if_first(i);
            if let Some(open) =
                self.open.last_mut().filter(|open| open.index + 1 == self.output.len())
            {
                open.inner = indent;
            }
            self.close_before(i, indent);
            if let Some(close) = closing(&lexeme.token) {
                let indent = line_indent(self.text, lexeme.start);
                self.open.push(Open { index: self.output.len(), close, indent, inner: None });
                self.push(lexeme.clone());
            } else if let Some(close) = closes(&lexeme.token) {
                self.close(close, i, indent);
            } else {
                self.push(lexeme.clone());
            }
            if self.errors.len() > MAX_ERRORS {
                // After this many errors the remaining tokens do not matter.
                break;
            }
        }
        self.close_from(0, None);
    }

    fn push(&mut self, lexeme: Lexeme<'s>) {
        self.mates.push(self.output.len());
        self.output.push(lexeme);
    }

    /// Closes brackets that cannot be open before token `i`: parentheses and square
    /// brackets before `;` or a statement, and braces before a statement that is not
    /// indented further than the line that opened them.
    fn close_before(&mut self, i: usize, indent: Option<usize>) {
        let Some(lexeme) = self.input.get(i) else { return };
        let parentheses =
            self.open.iter().rposition(|open| open.close == '}').map_or(0, |brace| brace + 1);
        if lexeme.token == Token::Semi {
            return self.close_from(parentheses, Some(i));
        }
        let Some(indent) = indent.filter(|_| starts_statement(self.input, i)) else { return };
        self.close_from(parentheses, Some(i));
        let item = lexeme.token.starts_item();
        let done = |open: &Open| {
            indent <= open.indent && (item || open.inner.is_some_and(|inner| inner > open.indent))
        };
        if let Some(first) = self.open.iter().position(done) {
            self.close_from(first, Some(i));
        }
    }

    /// Handles a closing bracket.
    fn close(&mut self, close: char, i: usize, indent: Option<usize>) {
        let lexeme = &self.input[i];
        let brace = self.open.iter().rposition(|open| open.close == '}');
        let parentheses = brace.map_or(0, |brace| brace + 1);
        let mate = if close == '}' {
            // A `}` that begins a line indented less than that of the innermost open
            // brace closes the brace whose line has the same indentation.
            let aligned = |open: &Open| open.close == '}' && Some(open.indent) == indent;
            let inner =
                brace.is_some_and(|b| indent.is_some_and(|indent| indent < self.open[b].indent));
            brace.map(|b| self.open.iter().rposition(aligned).filter(|_| inner).unwrap_or(b))
        } else {
            // A brace opened on the same line may lack its `}`; a block that spans lines
            // is not closed by `)` or `]`.
            let line = self.text[..lexeme.start].rfind('\n').map_or(0, |i| i + 1);
            let passed = |open: &&Open| open.close != '}' || self.output[open.index].start >= line;
            let reach = self.open.len() - self.open.iter().rev().take_while(passed).count();
            let same =
                self.open[reach..].iter().rposition(|open| open.close == close).map(|p| reach + p);
            // Otherwise `)` and `]` were confused.
            same.or((self.open.len() > parentheses).then(|| self.open.len() - 1))
        };
        match mate {
            None => {
                let span = Span::new(self.file, lexeme.start, lexeme.end);
                self.errors.push(SyntaxError::new(SyntaxErrorKind::StrayClose(close), span));
            }
            Some(mate) => {
                self.close_from(mate + 1, Some(i));
                match self.open.pop() {
                    Some(open) if open.close == close => self.finish(open, lexeme.clone()),
                    Some(open) => {
                        self.open.push(open);
                        self.close_from(mate, Some(i));
                    }
                    None => {}
                }
            }
        }
    }

    /// Closes the open brackets from index `first` on, before token `i` or at the end of
    /// the text, and reports the innermost.
    fn close_from(&mut self, first: usize, i: Option<usize>) {
        let Some(innermost) = self.open[first..].last().copied() else { return };
        let opener = &self.output[innermost.index];
        let span = Span::new(self.file, opener.start, opener.end);
        let before = i.and_then(|i| self.input.get(i)).map(|l| {
            (format!("`{}`", &self.text[l.start..l.end]), Span::new(self.file, l.start, l.end))
        });
        let open = self.text[opener.start..].chars().next().unwrap_or_default();
        self.errors.push(SyntaxError::new(SyntaxErrorKind::Unclosed { open, before }, span));
        while self.open.len() > first
            && let Some(open) = self.open.pop()
        {
            let at = self.output.last().map_or(0, |l| l.end);
            let token = match open.close {
                ')' => Token::RParen,
                ']' => Token::RBracket,
                _ => Token::RBrace,
            };
            self.finish(open, Lexeme { token, start: at, end: at });
        }
    }

    /// Adds the bracket that closes `open` and makes the two mates.
    fn finish(&mut self, open: Open, lexeme: Lexeme<'s>) {
        let index = self.output.len();
        self.push(lexeme);
        self.mates[open.index] = index;
        self.mates[index] = open.index;
    }

    /// Returns the indentation of token `i`, if it is the first on its line.
    fn indent_if_first(&self, i: usize) -> Option<usize> {
        let lexeme = self.input.get(i)?;
        first_on_line(self.text, self.input, i).then(|| line_indent(self.text, lexeme.start))
    }
}

/// Returns whether token `i` is the first on its line.
pub(crate) fn first_on_line(text: &str, lexemes: &[Lexeme<'_>], i: usize) -> bool {
    let Some(lexeme) = lexemes.get(i) else { return false };
    let before = i.checked_sub(1).and_then(|i| lexemes.get(i)).map_or(0, |l| l.end);
    before == 0 || text.get(before..lexeme.start).is_some_and(|gap| gap.contains('\n'))
}

/// Returns whether token `i` is a keyword that starts a statement or item, and not the
/// name of a field or tag.
pub(crate) fn starts_statement(lexemes: &[Lexeme<'_>], i: usize) -> bool {
    let at = |i: usize| lexemes.get(i).map(|l| &l.token);
    let Some(token) = at(i) else { return false };
    let keyword = match token {
        Token::Fn => matches!(at(i + 1), Some(Token::Name(_))),
        token => token.starts_statement() || token.starts_item(),
    };
    let name = matches!(at(i + 1), Some(Token::Colon))
        || matches!(i.checked_sub(1).and_then(at), Some(Token::Dot | Token::Hash));
    keyword && !name
}

/// Returns the number of spaces and tabs at the start of the line that contains byte
/// `at`.
fn line_indent(text: &str, at: usize) -> usize {
    let start = text[..at].rfind('\n').map_or(0, |i| i + 1);
    text[start..].bytes().take_while(|b| matches!(b, b' ' | b'\t')).count()
}
