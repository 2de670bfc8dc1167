//! Work on programs apart from runs: the session of a prompt or a studio, what editors
//! ask, proposals from banks, trade-offs of settings, scores.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod bank;
pub mod editor;
pub mod failure;
pub mod lsp;
pub mod score;
pub mod session;
pub mod tradeoff;
