//! An example for every built-in. Each one runs: `tests/examples.rs` sees to that.
//!
//! An example is an expression with its value behind `//`, or a program. What uses
//! `scene` is to be read with the line [`INCLUDE`] before it.

mod distributions;
mod inference;
mod scene;
mod values;

use super::Builtin;

/// The line that programs with `scene` begin with.
pub const INCLUDE: &str = "include \"std/scene.pcad\" as scene;";

/// By full name.
type Examples = &'static [(&'static str, &'static str)];

impl Builtin {
    /// An example of its use, if it is the language's own.
    pub fn example(&self) -> Option<&'static str> {
        if self.host.is_some() {
            return None;
        }
        let name = self.full_name();
        [values::EXAMPLES, distributions::EXAMPLES, inference::EXAMPLES, scene::EXAMPLES]
            .into_iter()
            .flatten()
            .find(|(of, _)| *of == name)
            .map(|(_, text)| *text)
    }
}
