//! Runs of the command: their inputs, chains, progress and folders; and runs that have
//! ended, read again. What is printed here is progress and notes.
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

#[macro_use]
pub mod print;

pub mod args;
pub mod best;
pub mod drawing_budget;
pub mod embedded;
pub mod files;
pub mod hint;
pub mod inputs;
pub mod job;
pub mod keypoints;
pub mod live;
pub mod people;
pub mod places;
pub mod pose;
pub mod progress;
pub mod quality;
pub mod record;
pub mod reopening;
pub mod resume;
pub mod scene;
pub mod stream;
pub mod term;
pub mod verdict;
pub mod watched;

pub use pcadlang_workbench::failure;
