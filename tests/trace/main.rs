//! Traces: updates and what they run again, operations by address, tapes and gradients.

#[path = "../common/mod.rs"]
mod common;

mod gradient;
mod incremental;
mod last_bit;
mod operations;
mod tape;
mod tape_scenes;
mod updates;
