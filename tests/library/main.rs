//! What hosts of the library rely on: examples, the promised items, sessions, and the
//! layers of its modules.

#[path = "../common/mod.rs"]
mod common;

mod api;
mod embedding;
mod session;
