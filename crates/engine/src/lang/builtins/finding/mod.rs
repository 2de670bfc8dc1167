//! Documentation of built-ins, and search in it.

pub(in crate::lang::builtins) mod aliases;
pub mod doc;
pub mod search;
