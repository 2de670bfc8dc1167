//! Values of random choices.

use std::sync::Arc;

/// A value that a distribution draws. Whole numbers are [`Datum::Num`].
#[derive(Clone, Debug, PartialEq)]
pub enum Datum {
    /// A number.
    Num(f64),
    /// A truth value.
    Bool(bool),
    /// A vector.
    Vec(Arc<[f64]>),
    /// Several values that are not all numbers.
    List(Arc<[Datum]>),
}

impl Datum {
    /// The smallest form of a list: numbers become a vector.
    pub fn from_elements(xs: Vec<Datum>) -> Datum {
        let numbers: Option<Arc<[f64]>> =
            xs.iter().map(|x| if let Datum::Num(x) = x { Some(*x) } else { None }).collect();
        match numbers {
            Some(v) => Datum::Vec(v),
            None => Datum::List(xs.into()),
        }
    }

    /// The number of elements, for vectors and lists.
    pub fn len(&self) -> Option<usize> {
        match self {
            Datum::Vec(v) => Some(v.len()),
            Datum::List(v) => Some(v.len()),
            _ => None,
        }
    }

    /// Whether it is a vector or list without elements.
    pub fn is_empty(&self) -> bool {
        self.len() == Some(0)
    }

    /// An element of a vector or list.
    pub fn element(&self, i: usize) -> Option<Datum> {
        match self {
            Datum::Vec(v) => v.get(i).map(|x| Datum::Num(*x)),
            Datum::List(v) => v.get(i).cloned(),
            _ => None,
        }
    }
}
