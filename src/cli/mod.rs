//! The commands. Only these modules print; everything they do is the library's.

pub mod args;
mod check;
mod contours;
mod doc;
mod files;
mod given;
mod keypoints;
mod progress;
mod run;
mod sample;
mod scene;
mod term;

use args::{Cli, Command};
use pcadlang::Error;
use std::process::ExitCode;
use term::has_colors;

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
        Err(failure) => ExitCode::from(term::fail(failure)),
    }
}
