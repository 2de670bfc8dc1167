//! Printing that never ends the program: who reads may go away (`pcadlang run … | head`),
//! and the run goes on and keeps its files. The macros of the standard library panic
//! there.

use std::fmt::Arguments;
use std::io::Write;

/// Prints to standard output; what nobody reads is lost.
pub fn out(text: Arguments) {
    let _ = std::io::stdout().write_fmt(text);
}

/// Prints to standard error; what nobody reads is lost.
pub fn err(text: Arguments) {
    let _ = std::io::stderr().write_fmt(text);
}

/// Letters of a line that is read easily.
const WIDEST: usize = 100;

/// Prints a paragraph to standard output, wrapped between words where that is a terminal.
pub fn paragraph(text: &str) {
    let columns = console::Term::stdout().size_checked().map(|(_, columns)| usize::from(columns));
    match columns {
        Some(columns) => out(format_args!("{}\n", wrapped(text, columns.min(WIDEST)))),
        None => out(format_args!("{text}\n")),
    }
}

/// A text in lines of at most so many letters, those after the first a little further in;
/// a word that is longer than a line stays whole.
fn wrapped(text: &str, columns: usize) -> String {
    let (mut lines, mut length) = (String::new(), 0);
    for word in text.split(' ') {
        let n = word.chars().count();
        if length > 0 && length + 1 + n > columns {
            lines += "\n  ";
            length = 2;
        } else if length > 0 {
            lines.push(' ');
            length += 1;
        }
        lines += word;
        length += n;
    }
    lines
}

/// Text on standard output.
macro_rules! print_text {
    ($($text:tt)*) => { $crate::cli::print::out(format_args!($($text)*)) };
}

/// A line on standard output.
macro_rules! print_line {
    ($($text:tt)*) => { $crate::cli::print::out(format_args!("{}\n", format_args!($($text)*))) };
}

/// Text on standard error.
macro_rules! error_text {
    ($($text:tt)*) => { $crate::cli::print::err(format_args!($($text)*)) };
}

/// A line on standard error.
macro_rules! error_line {
    ($($text:tt)*) => { $crate::cli::print::err(format_args!("{}\n", format_args!($($text)*))) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paragraphs_break_between_words() {
        let text = "warning: the chains disagree: R-hat of é is 1.5";
        assert_eq!(wrapped(text, 30), "warning: the chains disagree:\n  R-hat of é is 1.5");
        assert_eq!(wrapped(text, 200), text);
        assert_eq!(wrapped("a unbreakable-path b", 6), "a\n  unbreakable-path\n  b");
        assert_eq!(wrapped("", 10), "");
        assert!(wrapped(&text.repeat(9), 40).lines().all(|l| l.chars().count() <= 40));
    }
}
