//! Properties of the terminal, and error messages.

use super::failure::Failure;
use pcadlang_syntax::diag::render;
use std::io::IsTerminal;

/// Returns whether errors may have colours: on a terminal that supports them, unless
/// NO_COLOR is set (<https://no-color.org>).
pub fn has_colors() -> bool {
    let set = |name| std::env::var_os(name).is_some_and(|v: std::ffi::OsString| !v.is_empty());
    let dumb = std::env::var_os("TERM").is_some_and(|v| v == "dumb");
    is_live() && !dumb && !set("NO_COLOR")
}

/// Returns whether errors and progress go to a terminal.
pub fn is_live() -> bool {
    std::io::stderr().is_terminal()
}

/// Prints why a command failed, and returns its exit code.
pub fn fail(failure: Failure) -> u8 {
    match failure {
        Failure::Program(e) => {
            error_text!("{}", render(&e.sources, &e.diagnostics, has_colors()));
            1
        }
        Failure::Plain(message, hint) => {
            error_line!("error: {message}");
            if let Some(h) = hint {
                error_line!("  = hint: {h}");
            }
            1
        }
        Failure::Interrupted => 3,
    }
}
