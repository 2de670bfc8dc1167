//! The spaces that values live in. How they map to unconstrained space is in `transform.rs`.

use super::Datum;
use std::sync::Arc;

/// Up to this many values are enumerated; a larger set counts as infinite.
pub const MAX_ENUMERATED: i64 = 10_000;

/// How far from 1 the sum of the shares of a simplex may be.
const SIMPLEX_TOLERANCE: f64 = 1e-8;

/// The space of a distribution's values.
#[derive(Clone, Debug, PartialEq)]
pub enum Support {
    /// All finite numbers.
    Real,
    /// Above 0.
    Positive,
    /// At or above a bound.
    AtLeast {
        /// The bound.
        lo: f64,
    },
    /// Between two bounds, both included.
    Interval {
        /// The lower bound.
        lo: f64,
        /// The upper bound.
        hi: f64,
    },
    /// Truth values.
    Boolean,
    /// Integers from `lo`, up to `hi` if there is one.
    Integers {
        /// The least.
        lo: i64,
        /// The greatest.
        hi: Option<i64>,
    },
    /// Shares that sum to 1.
    Simplex(usize),
    /// Vectors of so many finite numbers.
    Vector(usize),
    /// So many values of one space.
    Product(Box<Support>, usize),
    /// One value of each of these spaces.
    Each(Arc<[Support]>),
}

impl Support {
    /// Whether its values are single numbers.
    pub fn is_number(&self) -> bool {
        use Support::*;
        matches!(self, Real | Positive | AtLeast { .. } | Interval { .. } | Integers { .. })
    }

    /// Whether its values can be counted. A product is discrete if all of its parts are.
    pub fn is_discrete(&self) -> bool {
        match self {
            Support::Boolean | Support::Integers { .. } => true,
            Support::Product(one, _) => one.is_discrete(),
            Support::Each(all) => all.iter().all(Support::is_discrete),
            _ => false,
        }
    }

    /// Whether [`Support::finite_values`] has an answer.
    pub fn is_finite(&self) -> bool {
        match self {
            Support::Boolean => true,
            Support::Integers { lo, hi: Some(hi) } => hi.saturating_sub(*lo) < MAX_ENUMERATED,
            _ => false,
        }
    }

    /// All values in ascending order, if they are truth values or at most [`MAX_ENUMERATED`] integers.
    pub fn finite_values(&self) -> Option<Vec<Datum>> {
        match self {
            Support::Boolean => Some(vec![Datum::Bool(false), Datum::Bool(true)]),
            Support::Integers { lo, hi: Some(hi) } if self.is_finite() => {
                Some((*lo..=*hi).map(|i| Datum::Num(i as f64)).collect())
            }
            _ => None,
        }
    }

    /// Whether a value is of the right kind and size, be it inside or not.
    pub fn fits(&self, x: &Datum) -> bool {
        match self {
            Support::Boolean => matches!(x, Datum::Bool(_)),
            Support::Simplex(n) | Support::Vector(n) => x.with_numbers(*n, |_| ()).is_some(),
            Support::Product(one, n) => match x {
                Datum::Vec(xs) => xs.len() == *n && one.is_number(),
                Datum::List(xs) => xs.len() == *n && xs.iter().all(|x| one.fits(x)),
                _ => *n == 0 && x.len() == Some(0),
            },
            Support::Each(all) => match x {
                Datum::Vec(xs) => xs.len() == all.len() && all.iter().all(Support::is_number),
                Datum::List(xs) => xs.len() == all.len() && all.iter().zip(xs.iter()).all(|(s, x)| s.fits(x)),
                _ => false,
            },
            _ => matches!(x, Datum::Num(_)),
        }
    }

    /// Whether a number is inside.
    #[inline]
    pub fn contains_num(&self, x: f64) -> bool {
        match self {
            Support::Real => x.is_finite(),
            Support::Positive => x > 0.0 && x.is_finite(),
            Support::AtLeast { lo } => x >= *lo && x.is_finite(),
            Support::Interval { lo, hi } => (*lo..=*hi).contains(&x),
            Support::Integers { lo, hi } => {
                x.is_finite() && x == libm::trunc(x) && x >= *lo as f64 && hi.is_none_or(|hi| x <= hi as f64)
            }
            _ => false,
        }
    }

    /// Whether a value is inside.
    pub fn contains(&self, x: &Datum) -> bool {
        match (self, x) {
            (_, Datum::Num(x)) => self.contains_num(*x),
            (Support::Boolean, Datum::Bool(_)) => true,
            (Support::Simplex(n), _) => x.with_numbers(*n, is_simplex).unwrap_or(false),
            (Support::Vector(n), _) => x.with_numbers(*n, |xs| xs.iter().all(|x| x.is_finite())).unwrap_or(false),
            (Support::Product(one, n), Datum::Vec(xs)) => xs.len() == *n && xs.iter().all(|x| one.contains_num(*x)),
            (Support::Product(one, n), Datum::List(xs)) => xs.len() == *n && xs.iter().all(|x| one.contains(x)),
            (Support::Each(all), Datum::Vec(xs)) => {
                xs.len() == all.len() && all.iter().zip(xs.iter()).all(|(s, x)| s.contains_num(*x))
            }
            (Support::Each(all), Datum::List(xs)) => {
                xs.len() == all.len() && all.iter().zip(xs.iter()).all(|(s, x)| s.contains(x))
            }
            _ => false,
        }
    }
}

/// Whether these are shares of 1, but for rounding.
pub(super) fn is_simplex(xs: &[f64]) -> bool {
    xs.iter().all(|x| (0.0..=1.0).contains(x)) && (xs.iter().sum::<f64>() - 1.0).abs() <= SIMPLEX_TOLERANCE
}
