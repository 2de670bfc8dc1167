//! The spaces of values. Their maps to unconstrained space are in `transform.rs`.

use super::Datum;
use super::joint::triangle;
use core::f64::consts::{PI, TAU};
use std::fmt;
use std::sync::Arc;

/// The largest number of values that are enumerated; a larger set counts as infinite.
pub const MAX_ENUMERATED: i64 = 10_000;

/// The largest distance from 1 of the sum of a simplex's proportions.
const SIMPLEX_TOLERANCE: f64 = 1e-8;

/// The space of a distribution's values.
#[derive(Clone, Debug, PartialEq)]
pub enum Support {
    /// All finite numbers.
    Real,
    /// Numbers above 0.
    Positive,
    /// Numbers at or above a bound.
    AtLeast {
        /// The bound.
        lo: f64,
    },
    /// Numbers between two bounds, both included.
    Interval {
        /// The lower bound.
        lo: f64,
        /// The upper bound.
        hi: f64,
    },
    /// The same, of a density with a pole at the upper bound: the probability within a
    /// small distance of it is proportional to a power of the distance. Coordinates go on
    /// where doubles are too coarse to show the distance.
    Pole {
        /// The lower bound.
        lo: f64,
        /// The upper bound.
        hi: f64,
        /// The power, above 0 and below 1.
        power: f64,
    },
    /// Numbers at or below a bound.
    AtMost {
        /// The bound.
        hi: f64,
    },
    /// Angles in radians, in (-pi, pi]. The unconstrained coordinate is the angle, in
    /// which the density is periodic.
    Circle,
    /// Truth values.
    Boolean,
    /// Integers from `lo` to `hi`, or without an upper bound.
    Integers {
        /// The smallest integer.
        lo: i64,
        /// The largest integer.
        hi: Option<i64>,
    },
    /// This many proportions that sum to 1.
    Simplex(usize),
    /// Vectors of this many finite numbers.
    Vector(usize),
    /// This many numbers of one continuous space in ascending order. Sequences with equal
    /// neighbours are its boundary.
    Ascending(Box<Support>, usize),
    /// Cholesky factors of n x n correlation matrices: n rows of n numbers, with zeros
    /// above a non-negative diagonal and rows of length 1.
    CorrelationFactor(usize),
    /// Cholesky factors of n x n covariance matrices: zeros above a positive diagonal.
    CovarianceFactor(usize),
    /// Counts per category that sum to a total.
    Counts {
        /// The total.
        total: i64,
        /// The number of categories.
        kinds: usize,
    },
    /// This many values of one space.
    Product(Box<Support>, usize),
    /// One value from each of these spaces.
    Each(Arc<[Support]>),
}

impl Support {
    /// Returns whether values are single numbers.
    pub fn is_number(&self) -> bool {
        use Support::*;
        matches!(
            self,
            Real | Positive
                | AtLeast { .. }
                | AtMost { .. }
                | Interval { .. }
                | Pole { .. }
                | Circle
                | Integers { .. }
        )
    }

    /// Returns whether values are discrete. A product is discrete if all of its parts
    /// are.
    pub fn is_discrete(&self) -> bool {
        match self {
            Support::Boolean | Support::Integers { .. } | Support::Counts { .. } => true,
            Support::Product(one, _) => one.is_discrete(),
            Support::Each(all) => all.iter().all(Support::is_discrete),
            _ => false,
        }
    }

    /// Returns whether some part of a value is discrete.
    pub fn has_discrete_part(&self) -> bool {
        match self {
            Support::Product(one, _) => one.has_discrete_part(),
            Support::Each(all) => all.iter().any(Support::has_discrete_part),
            one => one.is_discrete(),
        }
    }

    /// Returns whether [`Support::finite_values`] returns a list.
    pub fn is_finite(&self) -> bool {
        match self {
            Support::Boolean => true,
            Support::Integers { lo, hi: Some(hi) } => hi.saturating_sub(*lo) < MAX_ENUMERATED,
            _ => false,
        }
    }

    /// Returns all values in ascending order, if they are truth values or at most
    /// [`MAX_ENUMERATED`] integers.
    pub fn finite_values(&self) -> Option<Vec<Datum>> {
        let mut values = Vec::new();
        self.list_values(&mut values).then_some(values)
    }

    /// Like [`Support::finite_values`], but reuses a list. Returns false, with an empty
    /// list, if the support is not finite.
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

    /// Returns whether a value is of the right kind and size, whether or not it is
    /// inside.
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

    /// Returns whether a number is inside.
    #[inline]
    #[doc(hidden)]
    pub fn contains_num(&self, x: f64) -> bool {
        match self {
            Support::Real => x.is_finite(),
            Support::Positive => x > 0.0 && x.is_finite(),
            Support::AtLeast { lo } => x >= *lo && x.is_finite(),
            Support::Interval { lo, hi } | Support::Pole { lo, hi, .. } => (*lo..=*hi).contains(&x),
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

    /// Returns whether a value is inside.
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

/// Describes the space, as in "the support is …".
impl fmt::Display for Support {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Support::Real => write!(f, "all finite numbers"),
            Support::Positive => write!(f, "numbers above 0"),
            Support::AtLeast { lo } => write!(f, "numbers of at least {lo}"),
            Support::Interval { lo, hi } | Support::Pole { lo, hi, .. } => {
                write!(f, "numbers from {lo} to {hi}")
            }
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

/// Returns whether these are proportions that sum to 1, up to rounding.
pub(super) fn is_simplex(xs: &[f64]) -> bool {
    xs.iter().all(|x| (0.0..=1.0).contains(x))
        && (xs.iter().sum::<f64>() - 1.0).abs() <= SIMPLEX_TOLERANCE
}

/// Returns whether every number is at least the previous one.
pub(super) fn is_ascending(xs: &[f64]) -> bool {
    xs.windows(2).all(|w| w[0] <= w[1])
}

/// Returns whether these are non-negative integers with this sum.
pub(super) fn are_counts(xs: &[f64], total: i64) -> bool {
    let count = |x: &f64| *x >= 0.0 && *x <= total as f64 && *x == libm::trunc(*x);
    xs.iter().all(count)
        && xs.iter().map(|x| i128::from(*x as i64)).sum::<i128>() == i128::from(total)
}

/// Returns the same angle in (-pi, pi]; 0 if it is infinite or NaN.
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
