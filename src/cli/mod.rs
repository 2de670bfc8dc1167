//! The commands. Only these modules print; the library does the work.

#[macro_use]
mod print;

pub mod args;
mod contours;
mod detect;
mod edges;
mod evaluate;
mod learn;
mod manual;
mod people;
mod programs;
mod reopening;
mod repl;
mod running;
mod sample;
mod scene;
mod term;
mod tradeoff;

use args::{Cli, Command};
use pcadlang::Error;
use programs::{calibrate, check, doc, fmt, predict, watch};
use reopening::{compare, date, report, seen, show};
use running::{files, inputs, job, places, progress, quality, resume, run};
use std::fmt::{Display, Formatter};
use std::process::ExitCode;
use term::has_colors;

/// Why a command failed.
pub enum Failure {
    /// Diagnostics with source locations.
    Program(Box<Error>),
    /// Any other error: a message and an optional hint.
    Plain(String, Option<String>),
    /// The user interrupted the command; results so far are kept.
    Interrupted,
}

/// The message, without colours or a final line break.
impl Display for Failure {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Failure::Program(e) => f.write_str(e.to_string().trim_end()),
            Failure::Plain(message, _) => f.write_str(message),
            Failure::Interrupted => f.write_str("interrupted"),
        }
    }
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Failure::Program(Box::new(e))
    }
}

/// Makes a failure from a message without a hint.
fn plain(message: impl Into<String>) -> Failure {
    Failure::Plain(message.into(), None)
}

/// The help text on exit codes.
pub const EXIT_CODES: &str = "\
Exit codes: 0 success, 1 an error in the program, its data or a file, 2 an error in the command line, \
3 interrupted (results so far are kept), 130 interrupted twice.";

/// Runs a command and returns its exit code.
pub fn main(cli: Cli) -> ExitCode {
    let done = match cli.command {
        Command::Run(a) => run::run(&a),
        Command::Evaluate(a) => evaluate::evaluate(&a),
        Command::Tradeoff(a) => tradeoff::tradeoff(&a),
        Command::Sample(a) => sample::sample(&a),
        Command::Learn(a) => learn::learn(&a),
        Command::Check(a) if a.sbc || a.geweke => calibrate::calibrate(&a),
        Command::Check(a) if a.watch => watch::watch(&a),
        Command::Check(a) => check::check(&a),
        Command::Predict(a) => predict::predict(&a),
        Command::Contours(a) => contours::contours(&a),
        Command::Detect(a) => detect::detect(&a),
        Command::Doc(a) => doc::doc(&a),
        Command::Repl(a) => repl::repl(&a),
        Command::Fmt(a) => fmt::fmt(&a),
        Command::Completions(a) => manual::completions(&a),
        Command::Man(a) => manual::man(&a),
        Command::Show(a) => show::show(&a),
        Command::Compare(a) => compare::compare(&a),
        Command::Report(a) => report::report(&a),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => ExitCode::from(term::fail(failure)),
    }
}
