//! The surface language: tokens, grammar, syntax tree, spans. Pure: text in, tree and errors out.
pub mod ast;
pub mod span;
