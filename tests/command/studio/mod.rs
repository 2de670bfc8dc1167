//! `pcadlang studio`, used over its protocol as the page uses it.

mod client;
mod first;
mod guesses;
mod limbs;
mod refused;
mod runs;
mod sessions;
