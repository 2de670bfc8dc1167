//! The maps between supports and unconstrained space: the identity, log, logit and
//! stick-breaking, as in the Stan reference manual ("Constraint transforms"). Those of
//! matrices are in `triangle.rs`, those of sorted numbers in `ascending.rs`.
//!
//! Points on the boundary, and points outside a support whose bounds have moved, map like
//! the nearest points inside, so coordinates are always finite. Mapping back always gives
//! a point strictly inside.

use super::clamp::{FAR, near};
use super::joint::{ascending, triangle};
use super::pole;
use super::support::wrap_angle;
use super::{Datum, Support};
use crate::num::log1p_exp;

impl Support {
    /// Returns the dimension of the unconstrained space; 0 for discrete values.
    pub fn free_dim(&self) -> usize {
        match self {
            Support::Boolean | Support::Integers { .. } | Support::Counts { .. } => 0,
            Support::Simplex(n) => n.saturating_sub(1),
            Support::Vector(n) | Support::Ascending(_, n) => *n,
            Support::CorrelationFactor(n) => n * n.saturating_sub(1) / 2,
            Support::CovarianceFactor(n) => n * (n + 1) / 2,
            Support::Product(one, n) => one.free_dim() * n,
            Support::Each(all) => all.iter().map(Support::free_dim).sum(),
            _ => 1,
        }
    }

    /// Returns how many numbers a gradient with respect to the value has: those of the
    /// continuous parts, and all entries of a matrix, row by row.
    pub fn gradient_dim(&self) -> usize {
        match self {
            Support::CorrelationFactor(n) | Support::CovarianceFactor(n) => n * n,
            Support::Simplex(n) => *n,
            Support::Product(one, n) => one.gradient_dim() * n,
            Support::Each(all) => all.iter().map(Support::gradient_dim).sum(),
            other => other.free_dim(),
        }
    }

    /// Returns the coordinate of a number; 0 for supports other than continuous numbers.
    #[inline]
    pub fn to_free_scalar(&self, x: f64) -> f64 {
        let y = match self {
            Support::Real => return if x.is_nan() { 0.0 } else { x.clamp(f64::MIN, f64::MAX) },
            Support::Positive => libm::log(x),
            Support::AtLeast { lo } => libm::log(x - lo),
            Support::AtMost { hi } => libm::log(hi - x),
            Support::Circle => return wrap_angle(x),
            Support::Pole { lo, hi, power } => return pole::to_free(*lo, *hi, *power, x, 0.5),
            Support::Interval { lo, hi } => libm::log(x - lo) - libm::log(hi - x),
            _ => return 0.0,
        };
        match self {
            _ if y.is_finite() => y.clamp(-FAR, FAR),
            Support::Interval { lo, hi } if x - lo >= hi - x => FAR,
            Support::Interval { .. } => -FAR,
            _ if y == f64::INFINITY => FAR,
            _ => -FAR,
        }
    }

    /// Returns the number at a coordinate, and log |dx/dy| there; (0, 0) for supports
    /// other than continuous numbers.
    #[inline]
    pub fn from_free_scalar(&self, y: f64) -> (f64, f64) {
        match self {
            Support::Real => (if y.is_nan() { 0.0 } else { y.clamp(f64::MIN, f64::MAX) }, 0.0),
            Support::Positive => {
                let y = near(y);
                (libm::exp(y), y)
            }
            Support::AtLeast { lo } => {
                let y = near(y);
                ((lo + libm::exp(y)).clamp(lo.next_up(), f64::MAX), y)
            }
            Support::AtMost { hi } => {
                let y = near(y);
                ((hi - libm::exp(y)).clamp(f64::MIN, hi.next_down()), y)
            }
            Support::Circle => (wrap_angle(y), 0.0),
            Support::Pole { lo, hi, power } => pole::from_free(*lo, *hi, *power, y),
            Support::Interval { lo, hi } => {
                let (width, y) = (hi - lo, near(y));
                let share = libm::exp(-log1p_exp(y.abs()));
                let x = if y < 0.0 { lo + width * share } else { hi - width * share };
                let inside =
                    if lo.next_up() < *hi { x.clamp(lo.next_up(), hi.next_down()) } else { *lo };
                (inside, libm::log(width) - y.abs() - 2.0 * log1p_exp(-y.abs()))
            }
            _ => (0.0, 0.0),
        }
    }

    /// Appends the coordinates of a value. For any value there are [`Support::free_dim`]
    /// of them.
    pub fn to_free(&self, x: &Datum, out: &mut Vec<f64>) {
        let end = out.len() + self.free_dim();
        match (self, x) {
            (Support::Vector(n), _) => {
                x.with_numbers(*n, |xs| {
                    out.extend(xs.iter().map(|x| Support::Real.to_free_scalar(*x)))
                });
            }
            (Support::Simplex(n), _) => {
                x.with_numbers(*n, |xs| stick_lengths(xs, out));
            }
            (Support::Ascending(one, n), _) => {
                x.with_numbers(*n, |xs| ascending::to_free(one, xs, out));
            }
            (Support::CorrelationFactor(n), _) => {
                triangle::entries(x, *n)
                    .iter()
                    .for_each(|xs| triangle::correlation_to_free(xs, *n, out));
            }
            (Support::CovarianceFactor(n), _) => {
                triangle::entries(x, *n)
                    .iter()
                    .for_each(|xs| triangle::covariance_to_free(xs, *n, out));
            }
            (Support::Product(one, n), Datum::Vec(xs))
                if one.is_number() && one.free_dim() == 1 =>
            {
                out.extend(xs.iter().take(*n).map(|x| one.to_free_scalar(*x)));
            }
            (Support::Product(one, n), _) => {
                (0..*n).filter_map(|i| x.element(i)).for_each(|x| one.to_free(&x, out));
            }
            (Support::Each(all), _) => {
                all.iter()
                    .enumerate()
                    .filter_map(|(i, s)| Some((s, x.element(i)?)))
                    .for_each(|(s, x)| s.to_free(&x, out));
            }
            (_, Datum::Num(x)) if self.free_dim() == 1 => out.push(self.to_free_scalar(*x)),
            _ => {}
        }
        out.resize(end, 0.0);
    }

    /// Returns the value at a point of unconstrained space, and log |dx/dy| there. For a
    /// simplex, x is all proportions but the last; for a Cholesky factor, its lower
    /// triangle, for a correlation matrix without the diagonal. Missing coordinates count
    /// as 0. Discrete parts take their smallest value.
    pub fn from_free(&self, y: &[f64]) -> (Datum, f64) {
        let at = |i: usize| y.get(i).copied().unwrap_or(0.0);
        match self {
            Support::Boolean => (Datum::Bool(false), 0.0),
            Support::Integers { lo, .. } => (Datum::Num(*lo as f64), 0.0),
            Support::Counts { total, kinds } => {
                let mut counts = vec![0.0; *kinds];
                counts.iter_mut().take(1).for_each(|c| *c = *total as f64);
                (counts.into(), 0.0)
            }
            Support::Ascending(one, n) => {
                let (x, jacobian) = ascending::from_free(one, *n, at);
                (x.into(), jacobian)
            }
            Support::CorrelationFactor(n) => triangle::correlation_from_free(*n, at),
            Support::CovarianceFactor(n) => triangle::covariance_from_free(*n, at),
            Support::Vector(n) => (
                (0..*n).map(|i| Support::Real.from_free_scalar(at(i)).0).collect::<Vec<_>>().into(),
                0.0,
            ),
            Support::Simplex(n) => {
                let (x, jacobian) = break_stick(*n, at);
                (x.into(), jacobian)
            }
            Support::Product(one, n) if one.is_number() && one.free_dim() == 1 => {
                let mut jacobian = 0.0;
                let mut put = |i| {
                    let (x, j) = one.from_free_scalar(at(i));
                    jacobian += j;
                    x
                };
                let xs: Vec<f64> = (0..*n).map(&mut put).collect();
                (xs.into(), jacobian)
            }
            Support::Product(one, n) => join((0..*n).map(|_| &**one), y),
            Support::Each(all) => join(all.iter(), y),
            number => {
                let (x, jacobian) = number.from_free_scalar(at(0));
                (Datum::Num(x), jacobian)
            }
        }
    }

    /// Appends the derivatives with respect to the coordinates of log p(x(y)) + log
    /// |dx/dy|, given those of log p with respect to the value (as in
    /// [`super::Gradient`], so without numbers for discrete parts). Gradient-based
    /// kernels use it.
    pub fn free_gradient(&self, y: &[f64], by_x: &[f64], out: &mut Vec<f64>) {
        let at = |i: usize| y.get(i).copied().unwrap_or(0.0);
        let by = |i: usize| by_x.get(i).copied().unwrap_or(0.0);
        match self {
            Support::Boolean | Support::Integers { .. } | Support::Counts { .. } => {}
            Support::Real | Support::Circle => out.push(by(0)),
            Support::Vector(n) => out.extend((0..*n).map(by)),
            Support::Positive | Support::AtLeast { .. } => {
                out.push(by(0) * libm::exp(near(at(0))) + 1.0)
            }
            Support::AtMost { .. } => out.push(1.0 - by(0) * libm::exp(near(at(0)))),
            Support::Ascending(one, n) => ascending::free_gradient(one, *n, at, by, out),
            Support::CorrelationFactor(n) => triangle::correlation_gradient(*n, at, by, out),
            Support::CovarianceFactor(n) => triangle::covariance_gradient(*n, at, by, out),
            Support::Interval { lo, hi } => {
                let p = crate::num::expit(near(at(0)));
                out.push(by(0) * (hi - lo) * p * (1.0 - p) + 1.0 - 2.0 * p);
            }
            Support::Pole { lo, hi, power } => {
                out.push(pole::gradient(*lo, *hi, *power, at(0), by(0)))
            }
            Support::Simplex(n) => stick_gradient(*n, at, by, out),
            Support::Product(one, n) => {
                let (dy, dx) = (one.free_dim(), one.gradient_dim());
                (0..*n).for_each(|i| {
                    one.free_gradient(part(y, i * dy, dy), part(by_x, i * dx, dx), out)
                });
            }
            Support::Each(all) => {
                let (mut from_y, mut from_x) = (0, 0);
                for s in all.iter() {
                    let (dy, dx) = (s.free_dim(), s.gradient_dim());
                    s.free_gradient(part(y, from_y, dy), part(by_x, from_x, dx), out);
                    (from_y, from_x) = (from_y + dy, from_x + dx);
                }
            }
        }
    }
}

fn part(xs: &[f64], from: usize, len: usize) -> &[f64] {
    xs.get(from..from + len).unwrap_or(&[])
}

fn join<'a>(parts: impl Iterator<Item = &'a Support>, y: &[f64]) -> (Datum, f64) {
    let (mut from, mut jacobian) = (0, 0.0);
    let mut one = |s: &Support| {
        let n = s.free_dim();
        let (x, j) = s.from_free(part(y, from, n));
        from += n;
        jacobian += j;
        x
    };
    let xs: Vec<Datum> = parts.map(&mut one).collect();
    (Datum::from_elements(xs), jacobian)
}

/// Returns the offset that maps equal proportions to 0: minus the log odds of one among
/// those left.
fn offset(n: usize, k: usize) -> f64 {
    libm::log((n - 1 - k) as f64)
}

/// Appends the coordinates of proportions. The remaining length is summed from the end,
/// where the small terms of a long stick are.
fn stick_lengths(xs: &[f64], out: &mut Vec<f64>) {
    let n = xs.len();
    let start = out.len();
    let mut rest = xs.last().copied().unwrap_or(1.0);
    for k in (0..n.saturating_sub(1)).rev() {
        let x = xs[k];
        let y = libm::log(x.max(f64::MIN_POSITIVE)) - libm::log(rest.max(f64::MIN_POSITIVE))
            + offset(n, k);
        out.push(y.clamp(-FAR, FAR));
        rest += x;
    }
    out[start..].reverse();
}

/// Returns the proportions at a point, and the log Jacobian. The remaining length is kept
/// as a logarithm.
fn break_stick(n: usize, at: impl Fn(usize) -> f64) -> (Vec<f64>, f64) {
    let mut xs = Vec::with_capacity(n);
    let (mut log_rest, mut jacobian) = (0.0, 0.0);
    for k in 0..n.saturating_sub(1) {
        let y = near(at(k)) - offset(n, k);
        let (log_taken, log_left) = (-log1p_exp(-y), -log1p_exp(y));
        xs.push(libm::exp(log_rest + log_taken).max(f64::MIN_POSITIVE));
        jacobian += log_rest + log_taken + log_left;
        log_rest += log_left;
    }
    if n > 0 {
        xs.push(libm::exp(log_rest).max(f64::MIN_POSITIVE));
    }
    (xs, jacobian)
}

/// Appends the derivatives with respect to y. With z_k the proportion that is taken of
/// the remaining length, x_k = rest_k z_k, so y_k moves x_k and all proportions after it.
fn stick_gradient(
    n: usize,
    at: impl Fn(usize) -> f64,
    by: impl Fn(usize) -> f64,
    out: &mut Vec<f64>,
) {
    if n < 2 {
        return;
    }
    let start = out.len();
    let (xs, _) = break_stick(n, &at);
    // The sum of x_j dlogp/dx_j over the proportions after k.
    let mut after = xs[n - 1] * by(n - 1);
    for k in (0..n - 1).rev() {
        let z = crate::num::expit(near(at(k)) - offset(n, k));
        let own = xs[k] * by(k);
        // d log x_k = 1 - z; d log x_j = -z for j > k; the Jacobian contains log z_k +
        // log (1 - z_k), and log rest_j for j > k.
        let later = (n - 2 - k) as f64;
        out.push(own * (1.0 - z) - after * z + 1.0 - 2.0 * z - later * z);
        after += own;
    }
    out[start..].reverse();
}
