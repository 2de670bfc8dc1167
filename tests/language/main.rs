//! The language: how programs are read, checked and printed, what their messages say, and
//! the pages about it that are generated.

#[path = "../common/mod.rs"]
mod common;

mod builtins;
mod docs;
mod editor;
mod errors;
mod examples;
mod limits;
mod parse;
mod reading;
