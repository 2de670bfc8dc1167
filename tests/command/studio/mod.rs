//! `pcadlang studio`, used over its protocol as the page uses it.

mod client;
mod guesses;
mod refused;
mod runs;
mod sessions;
