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
