//! The commands. Only these modules print; everything they do is the library's.

pub mod args;
mod check;
mod contours;
mod doc;
mod files;
mod given;
mod progress;
mod run;
mod sample;
mod scene;

use args::{Cli, Command};
use pcadlang::Error;
use pcadlang::diag::render;
use std::io::IsTerminal;
use std::process::ExitCode;

/// Why a command failed.
pub enum Failure {
    /// Messages with their places.
    Program(Box<Error>),
    /// Anything else, as text, and a hint.
    Plain(String, Option<String>),
    /// The user ended it; what there was is kept.
    Interrupted,
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Failure::Program(Box::new(e))
    }
}

/// A failure that is only text.
fn plain(message: impl Into<String>) -> Failure {
    Failure::Plain(message.into(), None)
}

/// Runs a command. Exit codes: 0 done, 1 program or data error, 2 usage (by clap), 3 interrupted.
pub fn main(cli: Cli) -> ExitCode {
    let done = match cli.command {
        Command::Run(a) => run::run(&a),
        Command::Sample(a) => sample::sample(&a),
        Command::Check(a) => check::check(&a),
        Command::Contours(a) => contours::contours(&a),
        Command::Doc(a) => doc::doc(&a),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Program(e)) => {
            eprint!("{}", render(&e.sources, &e.diagnostics, has_colors()));
            ExitCode::from(1)
        }
        Err(Failure::Plain(message, hint)) => {
            eprintln!("error: {message}");
            if let Some(h) = hint {
                eprintln!("  = hint: {h}");
            }
            ExitCode::from(1)
        }
        Err(Failure::Interrupted) => ExitCode::from(3),
    }
}

/// Whether messages may have colours: on a terminal, unless NO_COLOR is set (https://no-color.org).
fn has_colors() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}
