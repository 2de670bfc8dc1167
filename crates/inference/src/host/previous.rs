//! An earlier evaluation of an incremental function.

use pcadlang_engine::lang::builtins::{Args, PreviousEvaluation};
use pcadlang_engine::lang::value::Value;

/// An earlier evaluation of a host function: its arguments, its result, and the state
/// that it kept ([`Entry::incremental`](super::Entry::incremental)).
#[derive(Clone, Copy, Debug)]
pub struct Previous<'a, S> {
    before: &'a PreviousEvaluation,
    state: &'a S,
}

impl<'a, S: 'static> Previous<'a, S> {
    /// Returns `None` if the state has a different type.
    pub(super) fn new(before: &'a PreviousEvaluation) -> Option<Self> {
        before.state.downcast_ref().map(|state| Previous { before, state })
    }
}

impl<'a, S> Previous<'a, S> {
    /// Returns the earlier value of argument `i`.
    pub fn argument(&self, i: usize) -> &'a Value {
        self.before.args.get(i).unwrap_or(&Value::Unit)
    }

    /// Returns the earlier result.
    pub fn value(&self) -> &'a Value {
        &self.before.value
    }

    /// Returns the state that the function kept.
    pub fn state(&self) -> &'a S {
        self.state
    }

    /// Returns whether argument `i` differs from its earlier value. Numbers are compared
    /// by their bits; distributions, likelihoods and objects only by pointer. Values that
    /// share a pointer are equal without a comparison of their contents.
    ///
    /// ```
    /// use pcadlang::host::{Entry, Host, Previous, Type};
    /// use pcadlang::trace::Draws;
    /// use pcadlang::{Program, Value};
    /// // `slow(mesh, x)` prepares `mesh`, and does so again only when `mesh` changes.
    /// let slow = Entry::incremental("slow", |a, previous: Option<Previous<f64>>| {
    ///     let prepared = match previous {
    ///         Some(p) if !p.changed(a, 0) => {
    ///             assert!(p.argument(0).same(a.get(0)) && p.value().same(&Value::Num(*p.state())));
    ///             *p.state()
    ///         }
    ///         _ => a.num(0)? + 1.0,
    ///     };
    ///     Ok((Value::Num(prepared), prepared))
    /// })
    /// .argument("mesh", Type::Num, "What is prepared.")
    /// .argument("x", Type::Num, "The rest.");
    /// let text = "assume m ~ normal(0, 1); assume x ~ normal(0, 1); observe normal(slow(m, x), 1) = 0;";
    /// let mut trace = Program::parse(text)?.host(&Host::new().with(slow))?.compile()?.simulate(1, 0)?;
    /// trace.set("@x", 2.0, Draws::default()).unwrap();
    /// # Ok::<(), pcadlang::Error>(())
    /// ```
    pub fn changed(&self, a: &Args, i: usize) -> bool {
        !self.argument(i).same(a.get(i))
    }

    /// Returns the indices of the elements of argument `i` that have changed; `None` if
    /// it is not an array or its length has changed.
    pub fn changed_elements(&self, a: &Args, i: usize) -> Option<Vec<usize>> {
        let (old, new) = (self.argument(i), a.get(i));
        match (old, new) {
            (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
                Some((0..x.len()).filter(|i| x[*i].to_bits() != y[*i].to_bits()).collect())
            }
            (Value::List(x), Value::List(y)) if x.len() == y.len() => {
                Some((0..x.len()).filter(|i| !x[*i].same(&y[*i])).collect())
            }
            _ => None,
        }
    }
}
