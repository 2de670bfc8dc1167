//! An example for every built-in. Each one runs: `tests/examples.rs` sees to that.
//!
//! An example is an expression with its value behind `//`, or a program. What uses
//! `scene` is to be read with the line [`INCLUDE`] before it.

mod distributions;
mod inference;
mod values;

use super::Text;

/// The line that programs with `scene` begin with.
pub const INCLUDE: &str = "include \"std/scene.pcad\" as scene;";

/// By full name.
pub(crate) type Examples = &'static [(&'static str, &'static str)];

/// The example of one of the language's built-ins.
pub(super) fn of(name: &str) -> Option<Text> {
    [values::EXAMPLES, distributions::EXAMPLES, inference::EXAMPLES]
        .into_iter()
        .flatten()
        .find(|(of, _)| *of == name)
        .map(|(_, text)| (*text).into())
}
