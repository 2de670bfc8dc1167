//! Functions, distributions, likelihoods and kernels that a host program adds to the
//! language.
//!
//! A [`Host`] is a list of [`Entry`]s. They join the table of built-ins, so that static
//! checks, error messages, completion and `doc` treat them like those of the language.

mod checked;
mod entry;
mod previous;

#[doc(inline)]
pub use crate::KernelCall;
pub use entry::Entry;
#[doc(inline)]
pub use pcadlang_engine::lang::adjoint::Adjoint;
#[doc(inline)]
pub use pcadlang_engine::lang::builtins::data::{
    DataFormat, Literal, Options as DataOptions, ReadRelative,
};
#[doc(inline)]
pub use pcadlang_engine::lang::builtins::{Args, Defaults, Domain, InputHook, Type};
#[doc(inline)]
pub use pcadlang_engine::lang::error::{Fault, FaultKind};
#[doc(inline)]
pub use pcadlang_engine::lang::value::{Likelihood, Located, Object};
#[doc(inline)]
pub use pcadlang_numerics::dist::{Datum, Distribution, Gradient, ParamError, Support};
pub use previous::Previous;

use pcadlang_engine::lang::builtins::{Builtin, Table, doc};
use pcadlang_syntax::diag::{Diagnostic, Error, Severity, SourceMap};
use pcadlang_syntax::{is_keyword, is_name};
use std::sync::Arc;

/// The items that a host registers; see the [module](self).
#[derive(Clone, Default)]
pub struct Host {
    entries: Vec<Entry>,
    hooks: Vec<Arc<dyn InputHook>>,
}

impl Host {
    /// Creates an empty host.
    pub fn new() -> Host {
        Host::default()
    }

    /// Adds an entry.
    #[must_use]
    pub fn with(mut self, entry: Entry) -> Host {
        self.entries.push(entry);
        self
    }

    /// Adds a hook that prepares the inputs of programs before they are compiled.
    #[must_use]
    pub fn hook(mut self, hook: Arc<dyn InputHook>) -> Host {
        self.hooks.push(hook);
        self
    }

    /// These built-ins and the host's, unchecked.
    #[doc(hidden)]
    pub fn added_to(&self, own: &Table) -> Table {
        let mut table = own.clone().with(self.entries.iter().map(|e| Builtin::clone(&e.builtin)));
        table.hooks.extend(self.hooks.iter().cloned());
        table
    }

    /// These built-ins and the host's.
    ///
    /// # Errors
    /// A name that is none or taken, arguments that cannot be told apart, a gradient of
    /// what is not a function: all of them.
    #[doc(hidden)]
    pub fn table(&self, own: &Table) -> Result<Arc<Table>, Error> {
        let mut diagnostics = Vec::new();
        let mut wrong = |message: String, hint: &str| {
            let d = Diagnostic::new(Severity::Error, message);
            diagnostics.push(if hint.is_empty() { d } else { d.hint(hint) });
        };
        for (i, e) in self.entries.iter().enumerate() {
            let (b, name) = (&e.builtin, &*e.builtin.name);
            let taken = own.find(&b.module, name).is_some() || own.constant(name).is_some();
            if !is_name(name) || is_keyword(name) {
                wrong(
                    format!("`{name}` is not a valid name for a host function"),
                    "a name is a letter or `_`, then letters, digits and `_`, and not a keyword",
                );
            } else if own.constant(name).is_some() || taken && !e.replaces {
                wrong(
                    format!("`{name}` is a built-in of the language"),
                    "choose another name; functions can be `replacing()`",
                );
            } else if self.entries[..i]
                .iter()
                .any(|o| o.builtin.name == b.name && o.builtin.module == b.module)
            {
                wrong(format!("the host registers `{name}` twice"), "");
            }
            if let Some(what) = &e.wrong {
                wrong(format!("`{name}`: {what}"), "");
            }
            e.check_arguments().into_iter().for_each(|message| wrong(message, ""));
        }
        match diagnostics.is_empty() {
            true => Ok(Arc::new(self.added_to(own))),
            false => Err(Error { diagnostics, sources: SourceMap::new() }),
        }
    }

    /// The text of `pcadlang doc` for a name: the host's own, or the language's. `None` also
    /// where an entry is not valid.
    pub fn doc(&self, name: &str) -> Option<String> {
        doc::doc(&*self.table(&crate::table()).ok()?, name)
    }
}
