//! Documentation of built-ins, and search in it.

pub mod doc;
pub mod search;
