//! Converts the tree back to text, in two ways that share one printer.
//!
//! [`print`] gives the canonical form of a tree: a line for each statement, however long,
//! and no more parentheses than needed. [`format`] reformats a text and keeps its
//! comments: tokens keep their spelling, including numbers and parentheses, and only
//! spaces, line ends and commas before closing brackets change. The printer walks the
//! tree; when it formats, it takes each token from the text, with its spelling and the
//! comments beside it.
//!
//! Parsing the output of either yields the same tree up to spans, for every tree that the
//! parser makes without errors.

mod columns;
mod expressions;
mod layout;
mod printer;
mod statements;
mod token_cursor;

use super::ast::{Expr, Program};
use super::error::SyntaxError;
use super::parse::parse;
use super::span::FileId;
use printer::Printer;

/// The maximum width of a line of formatted code, in columns. Comments and code that
/// cannot be broken may be longer.
pub const WIDTH: usize = 100;

/// Prints a program in canonical form.
pub fn print(program: &Program) -> String {
    let mut printer = Printer::default();
    printer.program(program);
    ended(printer.set(usize::MAX))
}

/// Prints an expression in canonical form.
pub fn print_expr(expr: &Expr) -> String {
    let mut printer = Printer::default();
    printer.expr(expr);
    printer.set(usize::MAX)
}

/// Formats the text of a program. Comments, single empty lines and alignment in columns
/// are kept.
///
/// A block or bracket that fits on a line is put on one line, unless the text has a line
/// end right behind its opening bracket.
///
/// # Errors
/// Returns the syntax errors of the text.
pub fn format(text: &str) -> Result<String, Vec<SyntaxError>> {
    let plain = text.replace("\r\n", "\n");
    let (program, errors) = parse(&plain, FileId(0));
    if !errors.is_empty() {
        // Their spans must be those in the original text.
        return Err(parse(text, FileId(0)).1);
    }
    let mut printer = Printer::formatting(&plain);
    printer.program(&program);
    let formatted = ended(printer.set(WIDTH));
    Ok(if text.contains("\r\n") { formatted.replace('\n', "\r\n") } else { formatted })
}

/// Adds a final line end, unless the text is empty.
fn ended(text: String) -> String {
    if text.is_empty() { text } else { text + "\n" }
}
