//! The built-ins available to a program, by index and by name, and the named constants.
//!
//! This is not a scope: lowering handles names in the program that shadow them.

use super::{Builtin, Text};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use indexmap::{Equivalent, IndexMap};
use rustc_hash::{FxBuildHasher, FxHashMap};
use std::fmt;
use std::sync::Arc;

/// A name with a fixed value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// One line about it.
    pub doc: &'static str,
}

const CONSTANTS: &[Constant] = &[
    Constant {
        name: "pi",
        value: std::f64::consts::PI,
        doc: "The ratio of a circle's circumference to its diameter.",
    },
    Constant {
        name: "inf",
        value: f64::INFINITY,
        doc: "Positive infinity; `-inf` is the log of zero.",
    },
];

/// The module and name of a built-in.
#[derive(Clone, Debug, Hash, PartialEq, Eq)]
struct FullName(Text, Text);

impl FullName {
    fn is_form(&self) -> bool {
        self.1.contains(' ')
    }
}

/// The name of a form, which no program can write.
fn form_name(name: &str, argument: &str) -> String {
    format!("{name} {argument}")
}

/// A borrowed [`FullName`], for look-ups.
#[derive(Hash)]
struct NameRef<'a>(&'a str, &'a str);

impl Equivalent<FullName> for NameRef<'_> {
    fn equivalent(&self, name: &FullName) -> bool {
        self.0 == name.0 && self.1 == name.1
    }
}

/// Values of arguments wherever a program leaves them out: of a built-in by full name, an
/// argument by name.
pub type Defaults = FxHashMap<(String, String), Value>;

/// Prepares a program's inputs for a host before the program is compiled.
pub trait InputHook: fmt::Debug + Send + Sync {
    /// Completes the `data` items that were given and the defaults of arguments.
    ///
    /// # Errors
    /// If they do not suit each other: a message for the user.
    fn prepare(
        &self,
        data: &mut IndexMap<String, Value>,
        defaults: &mut Defaults,
    ) -> Result<(), Fault>;

    /// Adapts the value of a `data` item, whether it was given or is read from a file.
    fn adapt(&self, value: Value, defaults: &Defaults) -> Value;
}

/// The built-ins a program sees, by index and by name.
#[derive(Clone, Debug)]
pub struct Table {
    entries: IndexMap<FullName, Builtin, FxBuildHasher>,
    /// Prepare the inputs of programs.
    pub hooks: Vec<Arc<dyn InputHook>>,
}

impl Table {
    /// A table without entries.
    pub(super) fn empty() -> Self {
        Table { entries: IndexMap::default(), hooks: Vec::new() }
    }

    /// The table with more built-ins; one of the same module and name replaces an earlier
    /// one.
    #[must_use]
    pub fn with(mut self, more: impl IntoIterator<Item = Builtin>) -> Self {
        let more = more.into_iter();
        // Forms stay behind what is listed.
        let forms: Vec<Builtin> =
            self.entries.iter().filter(|(n, _)| n.is_form()).map(|(_, b)| b.clone()).collect();
        self.entries.retain(|n, _| !n.is_form());
        self.entries.extend(more.map(|b| (FullName(b.module.clone(), b.name.clone()), b)));
        self.with_forms(forms)
    }

    /// The table with the forms of built-ins that calls may have, one by the name of an
    /// argument that only it has. They are found by [`form`](Table::form) alone.
    #[must_use]
    pub(super) fn with_forms(mut self, forms: impl IntoIterator<Item = Builtin>) -> Self {
        for b in forms {
            let last = b.args.last().map_or("", |a| &*a.name);
            let name = form_name(&b.name, last).into();
            self.entries.insert(FullName(b.module.clone(), name), b);
        }
        self
    }

    /// Returns the index of the form of a built-in that a call has if it gives this
    /// argument; `None` if there is one form only.
    pub(crate) fn form(&self, b: &Builtin, argument: &str) -> Option<u32> {
        self.find(&b.module, &form_name(&b.name, argument))
    }

    /// Returns the built-in at an index from [`find`](Table::find).
    pub fn get(&self, i: u32) -> &Builtin {
        &self.entries[i as usize]
    }

    /// Returns the index of a built-in; operators are named as they are written, the
    /// prefix ones `neg` and `not`.
    pub fn find(&self, module: &str, name: &str) -> Option<u32> {
        self.entries.get_index_of(&NameRef(module, name)).map(|i| i as u32)
    }

    /// All of them, in the order of the reference.
    pub fn iter(&self) -> impl Iterator<Item = &Builtin> + Clone {
        self.entries.iter().filter(|(name, _)| !name.is_form()).map(|(_, b)| b)
    }

    /// Returns the named constants: `pi`, `inf`.
    pub fn constants(&self) -> &'static [Constant] {
        CONSTANTS
    }

    /// Returns the value of a named constant.
    pub fn constant(&self, name: &str) -> Option<f64> {
        CONSTANTS.iter().find(|c| c.name == name).map(|c| c.value)
    }
}
