//! Printing that never ends the program: who reads may go away (`pcadlang run … | head`), and the run goes on and keeps its files. The
//! macros of the standard library panic there.

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
