//! The commands. Only these modules print; the library does the work.
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

#[macro_use]
extern crate pcadlang_runs;

mod args;
mod camera;
mod contours;
mod detect;
mod evaluate;
pub mod guests;
mod learn;
mod manual;
mod programs;
mod repl;
mod run;
mod sample;
mod tradeoff;

use args::{Cli, Command};
use clap::{CommandFactory, Parser};
use pcadlang_runs::reopening::{compare, film, page, show};
use pcadlang_runs::term;
use programs::{calibrate, check, doc, fmt, predict, watch};
use std::ffi::OsString;

/// Runs the command with these arguments, the first of which is its name, and returns its exit
/// code. It prints, and handles Ctrl-C for the whole process.
pub fn command(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(e) => {
            // If it cannot be printed, the code still says so.
            let _ = e.print();
            return u8::try_from(e.exit_code()).unwrap_or(2);
        }
    };
    if let Err(e) = guests::register() {
        return term::fail(e.into());
    }
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
        Command::Camera(a) => camera::camera(&a),
        Command::Doc(a) => doc::doc(&a),
        Command::Repl(a) => repl::repl(&a),
        Command::Fmt(a) => fmt::fmt(&a),
        Command::Lsp => pcadlang_workbench::lsp::lsp(),
        Command::Studio(a) => pcadlang_studio::studio(&a),
        Command::Completions(a) => manual::completions(&a, Cli::command()),
        Command::Man(a) => manual::man(&a, Cli::command()),
        Command::Show(a) => show::show(&a),
        Command::Compare(a) => compare::compare(&a),
        Command::Film(a) => film::film(&a),
        Command::Report(a) => page::report(&a),
    };
    match done {
        Ok(()) => 0,
        Err(failure) => term::fail(failure),
    }
}
