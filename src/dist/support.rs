//! The spaces that values live in. How they map to unconstrained space is in
//! `transform.rs`.

use super::{Datum, triangle};
use core::f64::consts::{PI, TAU};
use std::fmt;
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
    /// At or below a bound.
    AtMost {
        /// The bound.
        hi: f64,
    },
    /// Angles in radians, in (-pi, pi]. The unconstrained coordinate is the angle, over
    /// which the density goes on periodically.
    Circle,
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
    /// So many numbers of one continuous space in ascending order; equal neighbours are
    /// its boundary.
    Ascending(Box<Support>, usize),
    /// Cholesky factors of correlation matrices with so many rows: n rows of n numbers,
    /// zeros above a diagonal that is not negative, every row of length 1.
    CorrelationFactor(usize),
    /// Cholesky factors of covariance matrices with so many rows: zeros above a positive
    /// diagonal.
    CovarianceFactor(usize),
    /// Counts for so many kinds that sum to a total.
    Counts {
        /// The total.
        total: i64,
        /// How many kinds.
        kinds: usize,
    },
    /// So many values of one space.
    Product(Box<Support>, usize),
    /// One value of each of these spaces.
    Each(Arc<[Support]>),
}

impl Support {
    /// Whether its values are single numbers.
    pub fn is_number(&self) -> bool {
        use Support::*;
        matches!(
            self,
            Real | Positive
                | AtLeast { .. }
                | AtMost { .. }
                | Interval { .. }
                | Circle
                | Integers { .. }
        )
    }

    /// Whether its values can be counted. A product is discrete if all of its parts are.
    pub fn is_discrete(&self) -> bool {
        match self {
            Support::Boolean | Support::Integers { .. } | Support::Counts { .. } => true,
            Support::Product(one, _) => one.is_discrete(),
            Support::Each(all) => all.iter().all(Support::is_discrete),
            _ => false,
        }
    }

    /// Whether some part of a value is discrete.
    pub(crate) fn has_discrete_part(&self) -> bool {
        match self {
            Support::Product(one, _) => one.has_discrete_part(),
            Support::Each(all) => all.iter().any(Support::has_discrete_part),
            one => one.is_discrete(),
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

    /// All values in ascending order, if they are truth values or at most
    /// [`MAX_ENUMERATED`] integers.
    pub fn finite_values(&self) -> Option<Vec<Datum>> {
        let mut values = Vec::new();
        self.list_values(&mut values).then_some(values)
    }

    /// The same into a list that is used again; false, and the list empty, if the support
    /// is not finite.
    #[doc(hidden)]
    pub fn list_values(&self, values: &mut Vec<Datum>) -> bool {
        values.clear();
        match self {
            Support::Boolean => values.extend([Datum::Bool(false), Datum::Bool(true)]),
            Support::Integers { lo, hi: Some(hi) } if self.is_finite() => {
                values.extend((*lo..=*hi).map(|i| Datum::Num(i as f64)));
            }
            _ => return false,
        }
        true
    }

    /// Whether a value is of the right kind and size, be it inside or not.
    pub fn fits(&self, x: &Datum) -> bool {
        match self {
            Support::Boolean => matches!(x, Datum::Bool(_)),
            Support::Simplex(n)
            | Support::Vector(n)
            | Support::Ascending(_, n)
            | Support::Counts { kinds: n, .. } => x.with_numbers(*n, |_| ()).is_some(),
            Support::CorrelationFactor(n) | Support::CovarianceFactor(n) => {
                triangle::entries(x, *n).is_some()
            }
            Support::Product(one, n) => match x {
                Datum::Vec(xs) => xs.len() == *n && one.is_number(),
                Datum::List(xs) => xs.len() == *n && xs.iter().all(|x| one.fits(x)),
                _ => *n == 0 && x.len() == Some(0),
            },
            Support::Each(all) => match x {
                Datum::Vec(xs) => xs.len() == all.len() && all.iter().all(Support::is_number),
                Datum::List(xs) => {
                    xs.len() == all.len() && all.iter().zip(xs.iter()).all(|(s, x)| s.fits(x))
                }
                _ => false,
            },
            _ => matches!(x, Datum::Num(_)),
        }
    }

    /// Whether a number is inside.
    #[inline]
    #[doc(hidden)]
    pub fn contains_num(&self, x: f64) -> bool {
        match self {
            Support::Real => x.is_finite(),
            Support::Positive => x > 0.0 && x.is_finite(),
            Support::AtLeast { lo } => x >= *lo && x.is_finite(),
            Support::Interval { lo, hi } => (*lo..=*hi).contains(&x),
            Support::AtMost { hi } => x <= *hi && x.is_finite(),
            Support::Circle => x > -PI && x <= PI,
            Support::Integers { lo, hi } => {
                x.is_finite()
                    && x == libm::trunc(x)
                    && x >= *lo as f64
                    && hi.is_none_or(|hi| x <= hi as f64)
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
            (Support::Vector(n), _) => {
                x.with_numbers(*n, |xs| xs.iter().all(|x| x.is_finite())).unwrap_or(false)
            }
            (Support::Ascending(one, n), _) => {
                let inside =
                    |xs: &[f64]| is_ascending(xs) && xs.iter().all(|x| one.contains_num(*x));
                x.with_numbers(*n, inside).unwrap_or(false)
            }
            (Support::Counts { total, kinds }, _) => {
                x.with_numbers(*kinds, |xs| are_counts(xs, *total)).unwrap_or(false)
            }
            (Support::CorrelationFactor(n), _) => {
                triangle::entries(x, *n).is_some_and(|xs| triangle::is_correlation_factor(&xs, *n))
            }
            (Support::CovarianceFactor(n), _) => {
                triangle::entries(x, *n).is_some_and(|xs| triangle::is_covariance_factor(&xs, *n))
            }
            (Support::Product(one, n), Datum::Vec(xs)) => {
                xs.len() == *n && xs.iter().all(|x| one.contains_num(*x))
            }
            (Support::Product(one, n), Datum::List(xs)) => {
                xs.len() == *n && xs.iter().all(|x| one.contains(x))
            }
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

/// In words, after "the support is".
impl fmt::Display for Support {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Support::Real => write!(f, "all finite numbers"),
            Support::Positive => write!(f, "numbers above 0"),
            Support::AtLeast { lo } => write!(f, "numbers of at least {lo}"),
            Support::Interval { lo, hi } => write!(f, "numbers from {lo} to {hi}"),
            Support::AtMost { hi } => write!(f, "numbers of at most {hi}"),
            Support::Circle => write!(f, "angles in (-pi, pi]"),
            Support::Boolean => write!(f, "true and false"),
            Support::Integers { lo, hi: Some(hi) } => write!(f, "integers from {lo} to {hi}"),
            Support::Integers { lo, hi: None } => write!(f, "integers of at least {lo}"),
            Support::Simplex(n) => write!(f, "{n} proportions that sum to 1"),
            Support::Vector(n) => write!(f, "vectors of {n} finite numbers"),
            Support::Ascending(one, n) => write!(f, "{n} in ascending order of {one}"),
            Support::CorrelationFactor(n) => {
                write!(f, "Cholesky factors of {n} x {n} correlation matrices")
            }
            Support::CovarianceFactor(n) => {
                write!(f, "Cholesky factors of {n} x {n} covariance matrices")
            }
            Support::Counts { total, kinds } => write!(f, "{kinds} counts that sum to {total}"),
            Support::Product(one, n) => write!(f, "{n} of {one}"),
            Support::Each(all) => write!(f, "{} values, each with its own support", all.len()),
        }
    }
}

/// Whether these are shares of 1, but for rounding.
pub(super) fn is_simplex(xs: &[f64]) -> bool {
    xs.iter().all(|x| (0.0..=1.0).contains(x))
        && (xs.iter().sum::<f64>() - 1.0).abs() <= SIMPLEX_TOLERANCE
}

/// Whether every number is at least the one before it.
pub(super) fn is_ascending(xs: &[f64]) -> bool {
    xs.windows(2).all(|w| w[0] <= w[1])
}

/// Whether these are whole numbers from 0 with this sum.
pub(super) fn are_counts(xs: &[f64], total: i64) -> bool {
    let count = |x: &f64| *x >= 0.0 && *x <= total as f64 && *x == libm::trunc(*x);
    xs.iter().all(count)
        && xs.iter().map(|x| i128::from(*x as i64)).sum::<i128>() == i128::from(total)
}

/// The same direction in (-pi, pi]; 0 for what is not a finite number.
pub(super) fn wrap_angle(x: f64) -> f64 {
    let x = if x.abs() <= PI { x } else { libm::remainder(x, TAU) };
    if x.is_nan() {
        0.0
    } else if x <= -PI {
        PI
    } else {
        x.min(PI)
    }
}
