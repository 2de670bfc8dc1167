//! Failures of built-in functions, and the kinds of all failures at run time.

use pcadlang_numerics::dist::ParamError;

/// The kind of a failure, which determines how it is handled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// A number outside a parameter's domain, or a matrix that cannot be factorised:
    /// impossible under the model, so a proposal that leads here is rejected and counted.
    /// At the start of a chain it is reported.
    Domain,
    /// A value of the wrong type.
    Type,
    /// An index or key that does not exist.
    Index,
    /// A limit on recursion or size.
    Limit,
    /// A requested stop, or the end of the available time.
    Stopped,
    /// A value that depends on itself.
    Cycle,
    /// Two draws at one address.
    Duplicate,
    /// The use of a missing entry of a table.
    Missing,
    /// A file that cannot be read, and anything else.
    Other,
}

/// A failure inside a built-in function, which knows its arguments but not where it was
/// called.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Its kind.
    pub kind: FaultKind,
    /// The error message.
    pub message: String,
    /// A suggestion.
    pub hint: Option<String>,
}

impl Fault {
    /// Creates a failure of some kind.
    pub fn new(kind: FaultKind, message: impl Into<String>) -> Self {
        Fault { kind, message: message.into(), hint: None }
    }

    /// Creates a failure for a number outside its domain.
    pub fn domain(message: impl Into<String>) -> Self {
        Fault::new(FaultKind::Domain, message)
    }

    /// Creates a failure for a value of the wrong type.
    pub fn type_error(message: impl Into<String>) -> Self {
        Fault::new(FaultKind::Type, message)
    }

    /// Names the function in which it arose.
    #[doc(hidden)]
    pub fn of(self, function: &str) -> Self {
        Fault { message: format!("{function}: {}", self.message), ..self }
    }

    /// Adds a hint.
    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Adds a hint for an unknown name: the most similar known one, or all of them after
    /// `introduced`.
    #[doc(hidden)]
    pub fn with_nearest<'a>(
        self,
        name: &str,
        introduced: &str,
        known: impl Iterator<Item = &'a str> + Clone,
    ) -> Self {
        match pcadlang_syntax::diag::nearest(name, known.clone()) {
            Some(near) => self.with_hint(format!("did you mean `{near}`?")),
            None => {
                self.with_hint(format!("{introduced} {}", known.collect::<Vec<_>>().join(", ")))
            }
        }
    }
}

/// Invalid parameters are a domain fault: a proposal that leads to them is rejected.
impl From<ParamError> for Fault {
    fn from(e: ParamError) -> Fault {
        Fault::new(FaultKind::Domain, e.to_string())
    }
}
