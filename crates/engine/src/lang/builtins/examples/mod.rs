//! An example for every built-in. `tests/language/examples.rs` runs them all.
//!
//! An example is an expression followed by `//` and its value, or a program. Programs
//! that use `scene` omit the line [`INCLUDE`], which precedes them.

mod distributions;
mod plans;
mod values;

use super::Text;

/// The first line of programs that use `scene`.
pub const INCLUDE: &str = "include \"std/scene.pcad\" as scene;";

/// By full name.
pub(crate) type Examples = &'static [(&'static str, &'static str)];

/// The example of one of the language's built-ins.
pub(super) fn of(name: &str) -> Option<Text> {
    [values::EXAMPLES, distributions::EXAMPLES, plans::EXAMPLES]
        .into_iter()
        .flatten()
        .find(|(of, _)| *of == name)
        .map(|(_, text)| (*text).into())
}
