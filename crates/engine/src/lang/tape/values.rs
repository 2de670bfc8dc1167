//! The values on a tape at its last run, and their adjoints.

use crate::lang::adjoint::Adjoint;
use crate::lang::value::Value;

/// The results of a tape: numbers in one buffer, and values of other kinds (objects,
/// likelihoods) in a list.
#[derive(Debug, Default)]
pub(super) struct Values {
    pub numbers: Vec<f64>,
    pub objects: Vec<Value>,
}

impl Values {
    /// Allocates numbers; returns the index of the first.
    pub fn reserve(&mut self, n: usize) -> usize {
        let at = self.numbers.len();
        self.numbers.resize(at + n, f64::NAN);
        at
    }
}

/// The adjoints of these values, at the same places.
#[derive(Debug, Default)]
pub(super) struct Adjoints {
    pub numbers: Vec<f64>,
    pub objects: Vec<Adjoint>,
}
