//! Printing that never ends the program: the reader may close the pipe
//! (`pcadlang run … | head`) while the run continues and keeps its files. The macros of
//! the standard library panic then.

use std::fmt::Arguments;
use std::io::Write;

/// Prints to standard output; errors are ignored.
pub fn out(text: Arguments) {
    let _ = std::io::stdout().write_fmt(text);
}

/// Prints to standard error; errors are ignored.
pub fn err(text: Arguments) {
    let _ = std::io::stderr().write_fmt(text);
}

/// The maximum width of a paragraph, in characters.
const WIDEST: usize = 100;

/// Prints a paragraph to standard output, wrapped between words if that is a terminal.
pub fn paragraph(text: &str) {
    let columns = console::Term::stdout().size_checked().map(|(_, columns)| usize::from(columns));
    match columns {
        Some(columns) => out(format_args!("{}\n", wrapped(text, columns.min(WIDEST)))),
        None => out(format_args!("{text}\n")),
    }
}

/// Wraps a text to a number of columns; lines after the first are indented, and a word
/// longer than a line stays whole.
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

/// Prints text to standard output.
#[macro_export]
macro_rules! print_text {
    ($($text:tt)*) => { $crate::print::out(format_args!($($text)*)) };
}

/// Prints a line to standard output.
#[macro_export]
macro_rules! print_line {
    ($($text:tt)*) => { $crate::print::out(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints text to standard error.
#[macro_export]
macro_rules! error_text {
    ($($text:tt)*) => { $crate::print::err(format_args!($($text)*)) };
}

/// Prints a line to standard error.
#[macro_export]
macro_rules! error_line {
    ($($text:tt)*) => { $crate::print::err(format_args!("{}\n", format_args!($($text)*))) };
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
