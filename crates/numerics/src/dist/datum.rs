//! A drawn value, in the few forms that distributions use. The language has its own,
//! richer type of values.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A value that a distribution draws and scores.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Datum {
    /// A number; integers are numbers with an integral value.
    Num(f64),
    /// A truth value.
    Bool(bool),
    /// A vector of numbers.
    Vec(Arc<[f64]>),
    /// A list of values of any form.
    List(Arc<[Datum]>),
}

impl Datum {
    /// Collects elements into a value: a vector if all are numbers, otherwise a list.
    pub fn from_elements(elements: Vec<Datum>) -> Datum {
        let numbers: Option<Vec<f64>> = elements.iter().map(Datum::num).collect();
        match numbers {
            Some(xs) => Datum::Vec(xs.into()),
            None => Datum::List(elements.into()),
        }
    }

    /// Returns the number, if the value is one.
    pub fn num(&self) -> Option<f64> {
        match self {
            Datum::Num(x) => Some(*x),
            _ => None,
        }
    }

    /// Returns the number of elements, if the value is a collection.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> Option<usize> {
        match self {
            Datum::Vec(xs) => Some(xs.len()),
            Datum::List(xs) => Some(xs.len()),
            _ => None,
        }
    }

    /// Returns element `i`, if it exists.
    pub fn element(&self, i: usize) -> Option<Datum> {
        match self {
            Datum::Vec(xs) => xs.get(i).map(|x| Datum::Num(*x)),
            Datum::List(xs) => xs.get(i).cloned(),
            _ => None,
        }
    }

    /// Calls `f` with the numbers of a vector, or list of numbers, of length `n`.
    pub(super) fn with_numbers<T>(&self, n: usize, f: impl FnOnce(&[f64]) -> T) -> Option<T> {
        match self {
            Datum::Vec(xs) if xs.len() == n => Some(f(xs)),
            Datum::List(xs) if xs.len() == n => {
                let xs: Vec<f64> = xs.iter().map(Datum::num).collect::<Option<_>>()?;
                Some(f(&xs))
            }
            _ => None,
        }
    }
}

impl From<f64> for Datum {
    fn from(x: f64) -> Datum {
        Datum::Num(x)
    }
}

impl From<bool> for Datum {
    fn from(b: bool) -> Datum {
        Datum::Bool(b)
    }
}

impl From<Vec<f64>> for Datum {
    fn from(xs: Vec<f64>) -> Datum {
        Datum::Vec(xs.into())
    }
}
