//! An example for every built-in. `tests/examples.rs` runs them all.
//!
//! An example is an expression followed by `//` and its value, or a program. Programs
//! that use `scene` omit the line [`INCLUDE`], which precedes them.

mod distributions;
mod inference;
mod scene;
mod values;

use super::Builtin;

/// The first line of programs that use `scene`.
pub const INCLUDE: &str = "include \"std/scene.pcad\" as scene;";

/// Examples by full name.
type Examples = &'static [(&'static str, &'static str)];

impl Builtin {
    /// Returns an example of its use; `None` for a host's built-in.
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
