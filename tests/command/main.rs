//! The command `pcadlang`, run as users run it: what it prints and leaves, and the pages
//! that show it.

#[path = "../common/mod.rs"]
mod common;

mod bad_input;
mod bank;
mod cli;
mod evaluate;
mod guide;
mod hints;
mod lsp;
mod newcomers;
mod nothing_lost;
mod people;
mod readme;
mod repl;
mod report;
mod runs;
mod studio;
mod told;
mod tradeoff;
