//! The surface language: tokens, grammar, syntax tree and spans. It is pure: text in,
//! tree and errors out.
//!
//! The stages are: `lexer` makes tokens (with `string` and `address`), `delimiters`
//! matches their brackets, and the parser generated from `grammar/pcad.lalrpop` builds
//! the tree through `build`. Where the text does not fit the grammar, `recover` repairs
//! the tokens and parses again, with `advice` on what was probably meant. `format`
//! converts a tree back to text.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod address;
mod advice;
pub mod ast;
mod build;
mod deep;
mod delimiters;
pub mod diag;
pub mod elsewhere;
mod entry;
mod error;
mod expected;
mod format;
mod lexer;
mod parse;
mod recover;
mod scan;
pub mod span;
mod statements;
mod string;
mod token;
mod tokens;

pub use deep::MAX_DEPTH;
pub use entry::{Class, classes, is_directive, is_incomplete};
pub use error::{AddressError, MAX_ERRORS, MAX_NESTING, MAX_TOKENS, SyntaxError, SyntaxErrorKind};
pub use format::{WIDTH, format, print, print_expr};
pub use parse::{parse, parse_expr};
pub use statements::{Place, STATEMENTS, Statement};
pub use string::record_key;
pub use token::{KEYWORDS, is_keyword, is_name, keywords};

lalrpop_util::lalrpop_mod!(
    #[allow(clippy::all, missing_docs, unused, unreachable_pub)]
    grammar,
    "/pcad.rs"
);
