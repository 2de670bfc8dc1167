//! A drawn value, in the few forms distributions know. It is not a value of the language,
//! which has more.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What a distribution draws and scores.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Datum {
    /// A number; integers are numbers with an integral value.
    Num(f64),
    /// A truth value.
    Bool(bool),
    /// Numbers.
    Vec(Arc<[f64]>),
    /// Values of any form.
    List(Arc<[Datum]>),
}

impl Datum {
    /// The value with these elements: a vector if all are numbers.
    pub fn from_elements(elements: Vec<Datum>) -> Datum {
        let numbers: Option<Vec<f64>> = elements.iter().map(Datum::num).collect();
        match numbers {
            Some(xs) => Datum::Vec(xs.into()),
            None => Datum::List(elements.into()),
        }
    }

    /// The number, if it is one.
    pub fn num(&self) -> Option<f64> {
        match self {
            Datum::Num(x) => Some(*x),
            _ => None,
        }
    }

    /// How many elements it has, if it is a collection.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> Option<usize> {
        match self {
            Datum::Vec(xs) => Some(xs.len()),
            Datum::List(xs) => Some(xs.len()),
            _ => None,
        }
    }

    /// Element `i`, if there is one.
    pub fn element(&self, i: usize) -> Option<Datum> {
        match self {
            Datum::Vec(xs) => xs.get(i).map(|x| Datum::Num(*x)),
            Datum::List(xs) => xs.get(i).cloned(),
            _ => None,
        }
    }

    /// The numbers of a vector of length `n`; a list of numbers will do.
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
