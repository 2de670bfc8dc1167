//! Where the values of a distribution lie.

use super::Datum;

/// The set of values of a distribution.
#[derive(Clone, Debug, PartialEq)]
pub enum Support {
    /// Any number.
    Real,
    /// (0, inf)
    Positive,
    /// [0, inf)
    NonNegative,
    /// Between two numbers; `hi` may be infinite.
    Interval {
        /// The lower end.
        lo: f64,
        /// The upper end.
        hi: f64,
    },
    /// `true` and `false`.
    Boolean,
    /// Whole numbers, both ends included; without `hi`, unbounded above.
    Integers {
        /// The least.
        lo: i64,
        /// The greatest.
        hi: Option<i64>,
    },
    /// Vectors of this length of positive numbers that sum to 1.
    Simplex(usize),
    /// Vectors of this length.
    Vector(usize),
    /// This many independent values of the same kind.
    Repeat(Box<Support>, usize),
    /// Independent values of various kinds.
    Product(std::sync::Arc<[Support]>),
}

/// More values than this are not enumerated.
const ENUMERATED: i64 = 10_000;

impl Support {
    /// Whether values are counted rather than measured.
    pub fn is_discrete(&self) -> bool {
        match self {
            Support::Boolean | Support::Integers { .. } => true,
            Support::Repeat(s, _) => s.is_discrete(),
            Support::Product(s) => s.iter().all(Support::is_discrete),
            _ => false,
        }
    }

    /// Whether there are finitely many values, few enough to go through.
    pub fn is_finite(&self) -> bool {
        match self {
            Support::Boolean => true,
            Support::Integers { lo, hi: Some(hi) } => hi.checked_sub(*lo).is_some_and(|n| n < ENUMERATED),
            _ => false,
        }
    }

    /// All values in order, if [`is_finite`](Support::is_finite).
    pub fn finite_values(&self) -> Option<Vec<Datum>> {
        match self {
            Support::Boolean => Some(vec![Datum::Bool(false), Datum::Bool(true)]),
            Support::Integers { lo, hi: Some(hi) } if self.is_finite() => {
                Some((*lo..=*hi).map(|k| Datum::Num(k as f64)).collect())
            }
            _ => None,
        }
    }

    /// Whether a value has the right kind and shape, wherever it lies.
    pub fn fits(&self, x: &Datum) -> bool {
        match (self, x) {
            (Support::Boolean, Datum::Bool(_)) => true,
            (Support::Boolean, _) => false,
            (Support::Simplex(n) | Support::Vector(n), Datum::Vec(v)) => v.len() == *n,
            (Support::Simplex(_) | Support::Vector(_), _) => false,
            (Support::Repeat(s, n), x) => each(x, *n, |_, e| s.fits(e)),
            (Support::Product(s), x) => each(x, s.len(), |i, e| s[i].fits(e)),
            (_, Datum::Num(_)) => true,
            _ => false,
        }
    }

    /// Whether a value lies in the support.
    pub fn contains(&self, x: &Datum) -> bool {
        match (self, x) {
            (Support::Real, Datum::Num(x)) => x.is_finite(),
            (Support::Positive, Datum::Num(x)) => *x > 0.0 && x.is_finite(),
            (Support::NonNegative, Datum::Num(x)) => *x >= 0.0 && x.is_finite(),
            (Support::Interval { lo, hi }, Datum::Num(x)) => x.is_finite() && *lo <= *x && *x <= *hi,
            (Support::Boolean, Datum::Bool(_)) => true,
            (Support::Integers { lo, hi }, Datum::Num(x)) => {
                *x == libm::trunc(*x) && *x >= *lo as f64 && hi.is_none_or(|h| *x <= h as f64) && x.is_finite()
            }
            (Support::Simplex(n), Datum::Vec(v)) => {
                v.len() == *n && v.iter().all(|x| *x >= 0.0) && (v.iter().sum::<f64>() - 1.0).abs() < 1e-9
            }
            (Support::Vector(n), Datum::Vec(v)) => v.len() == *n && v.iter().all(|x| x.is_finite()),
            (Support::Repeat(s, n), x) => each(x, *n, |_, e| s.contains(e)),
            (Support::Product(s), x) => each(x, s.len(), |i, e| s[i].contains(e)),
            _ => false,
        }
    }
}

/// Whether a datum has `n` elements that all pass.
fn each(x: &Datum, n: usize, pass: impl Fn(usize, &Datum) -> bool) -> bool {
    match x {
        Datum::Vec(v) => v.len() == n && v.iter().enumerate().all(|(i, x)| pass(i, &Datum::Num(*x))),
        Datum::List(v) => v.len() == n && v.iter().enumerate().all(|(i, x)| pass(i, x)),
        _ => false,
    }
}
