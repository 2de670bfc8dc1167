//! The tree back to text, in two ways that share one printer.
//!
//! [`print`] gives one canonical form of a tree: a line for each statement, however long,
//! and no more parentheses than needed. [`format`] sets a text anew, with its comments:
//! tokens stay as they are written, numbers and parentheses too, and only spaces and line
//! ends change, and commas before closing brackets. The printer walks the tree; when it
//! formats, it takes each token from the text, which keeps its spelling and the comments
//! beside it.
//!
//! Parsing what either gives yields the same tree up to spans, for every tree that the
//! parser makes without errors.

mod columns;
mod expressions;
mod layout;
mod printer;
mod source;
mod statements;

use super::ast::{Expr, Program};
use super::error::SyntaxError;
use super::parse::parse;
use super::span::FileId;
use printer::Printer;

/// The columns of a line of formatted code; what cannot be broken, and comments, may be
/// longer.
pub const WIDTH: usize = 100;

/// A program as text.
pub fn print(program: &Program) -> String {
    let mut printer = Printer::default();
    printer.program(program);
    ended(printer.set(usize::MAX))
}

/// An expression as text.
pub fn print_expr(expr: &Expr) -> String {
    let mut printer = Printer::default();
    printer.expr(expr);
    printer.set(usize::MAX)
}

/// A program's text, formatted. Comments and single empty lines are kept, and so is what
/// was lined up.
///
/// A block or bracket that fits on a line is on one line, unless the text has a line end
/// right behind what opens it.
///
/// # Errors
/// The syntax errors of the text.
pub fn format(text: &str) -> Result<String, Vec<SyntaxError>> {
    let plain = text.replace("\r\n", "\n");
    let (program, errors) = parse(&plain, FileId(0));
    if !errors.is_empty() {
        // Their places are those of the text as it is.
        return Err(parse(text, FileId(0)).1);
    }
    let mut printer = Printer::formatting(&plain);
    printer.program(&program);
    let formatted = ended(printer.set(WIDTH));
    Ok(if text.contains("\r\n") { formatted.replace('\n', "\r\n") } else { formatted })
}

/// The text with a line end, if there is any text.
fn ended(text: String) -> String {
    if text.is_empty() { text } else { text + "\n" }
}
