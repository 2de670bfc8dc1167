//! The `pcadlang` command.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(pcadlang::command(std::env::args_os()))
}
