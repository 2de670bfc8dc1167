//! Cholesky factors as values, n rows of n numbers with zeros above the diagonal, and
//! their maps to unconstrained space.
//!
//! A factor of a correlation matrix has rows of length 1; its coordinates are those of
//! the canonical partial correlations (Lewandowski, Kurowicka & Joe 2009; "Cholesky
//! factors of correlation matrices" in the Stan reference manual). For a factor of a
//! covariance matrix, the diagonal is mapped to its logarithms. Coordinates are in row
//! order.

use crate::dist::Datum;
use crate::dist::clamp::{FAR, near};
use crate::num::log1p_exp;

/// The largest distance from 1 of the squared length of a row.
const ROW_TOLERANCE: f64 = 1e-8;

/// Returns the numbers of n rows of n, one row after the other; `None` for other values.
pub(in crate::dist) fn entries(x: &Datum, n: usize) -> Option<Vec<f64>> {
    let Datum::List(rows) = x else { return None };
    if rows.len() != n {
        return None;
    }
    let mut all = Vec::with_capacity(n * n);
    for row in rows.iter() {
        row.with_numbers(n, |xs| all.extend_from_slice(xs))?;
    }
    Some(all)
}

/// Returns the value with these entries.
pub(in crate::dist) fn value(n: usize, entries: &[f64]) -> Datum {
    Datum::List(entries.chunks(n.max(1)).map(|row| Datum::Vec(row.into())).collect())
}

/// Returns row `i`, up to its diagonal.
pub(in crate::dist) fn row(xs: &[f64], n: usize, i: usize) -> &[f64] {
    xs.get(i * n..i * n + i + 1).unwrap_or(&[])
}

fn is_triangle(xs: &[f64], n: usize) -> bool {
    xs.iter().all(|x| x.is_finite()) && (0..n).all(|i| (i + 1..n).all(|j| xs[i * n + j] == 0.0))
}

pub(in crate::dist) fn is_correlation_factor(xs: &[f64], n: usize) -> bool {
    let unit = |i: usize| {
        let row = row(xs, n, i);
        row.last().is_some_and(|d| *d >= 0.0)
            && (row.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() <= ROW_TOLERANCE
    };
    is_triangle(xs, n) && (0..n).all(unit)
}

pub(in crate::dist) fn is_covariance_factor(xs: &[f64], n: usize) -> bool {
    is_triangle(xs, n) && (0..n).all(|i| xs[i * n + i] > 0.0)
}

pub(in crate::dist) fn correlation_to_free(xs: &[f64], n: usize, out: &mut Vec<f64>) {
    for i in 1..n {
        let start = out.len();
        let row = row(xs, n, i);
        // The remaining length of the row, from the end, where the small numbers are.
        let mut rest = row[i].abs();
        for x in row[..i].iter().rev() {
            let y = if *x == 0.0 { 0.0 } else { libm::asinh(x / rest) };
            out.push(if y.is_nan() { 0.0 } else { y.clamp(-FAR, FAR) });
            rest = libm::hypot(rest, *x);
        }
        out[start..].reverse();
    }
}

/// Returns tanh y and ln(1 - tanh^2 y).
fn partial(y: f64) -> (f64, f64) {
    let y = near(y);
    (libm::tanh(y), 2.0 * (core::f64::consts::LN_2 - y.abs() - log1p_exp(-2.0 * y.abs())))
}

/// Returns the rows, and the log Jacobian with respect to the numbers below the diagonal.
pub(in crate::dist) fn correlation_from_free(n: usize, at: impl Fn(usize) -> f64) -> (Datum, f64) {
    let mut xs = vec![0.0; n * n];
    let (mut k, mut jacobian) = (0, 0.0);
    for i in 0..n {
        let mut log_rest = 0.0;
        for j in 0..i {
            let (z, log_left) = partial(at(k));
            k += 1;
            xs[i * n + j] = z * libm::exp(log_rest);
            jacobian += log_rest + log_left;
            log_rest += 0.5 * log_left;
        }
        xs[i * n + i] = libm::exp(log_rest).max(f64::MIN_POSITIVE);
    }
    (value(n, &xs), jacobian)
}

/// With z = tanh y and R the length that remains before an entry, x = z R. All entries
/// after it are proportional to sqrt(1 - z^2), whose logarithm has the derivative -z.
pub(in crate::dist) fn correlation_gradient(
    n: usize,
    at: impl Fn(usize) -> f64,
    by: impl Fn(usize) -> f64,
    out: &mut Vec<f64>,
) {
    let mut first = 0;
    for i in 1..n {
        let start = out.len();
        let mut log_rest = 0.0;
        let mut parts = Vec::with_capacity(i);
        for j in 0..i {
            let (z, log_left) = partial(at(first + j));
            parts.push((z, log_rest, log_left));
            log_rest += 0.5 * log_left;
        }
        let mut after = libm::exp(log_rest) * by(i * n + i);
        for (j, (z, log_rest, log_left)) in parts.into_iter().enumerate().rev() {
            let slope = by(i * n + j);
            let later = (i - 1 - j) as f64;
            out.push(libm::exp(log_rest + log_left) * slope - z * (after + 2.0 + later));
            after += z * libm::exp(log_rest) * slope;
        }
        out[start..].reverse();
        first += i;
    }
}

pub(in crate::dist) fn covariance_to_free(xs: &[f64], n: usize, out: &mut Vec<f64>) {
    for i in 0..n {
        let row = row(xs, n, i);
        out.extend(
            row[..i].iter().map(|x| if x.is_nan() { 0.0 } else { x.clamp(f64::MIN, f64::MAX) }),
        );
        let y = libm::log(row[i]);
        out.push(if y.is_nan() { -FAR } else { y.clamp(-FAR, FAR) });
    }
}

pub(in crate::dist) fn covariance_from_free(n: usize, at: impl Fn(usize) -> f64) -> (Datum, f64) {
    let mut xs = vec![0.0; n * n];
    let (mut k, mut jacobian) = (0, 0.0);
    for i in 0..n {
        for j in 0..=i {
            let y = at(k);
            k += 1;
            xs[i * n + j] = if j < i {
                if y.is_nan() { 0.0 } else { y.clamp(f64::MIN, f64::MAX) }
            } else {
                jacobian += near(y);
                libm::exp(near(y))
            };
        }
    }
    (value(n, &xs), jacobian)
}

pub(in crate::dist) fn covariance_gradient(
    n: usize,
    at: impl Fn(usize) -> f64,
    by: impl Fn(usize) -> f64,
    out: &mut Vec<f64>,
) {
    let mut k = 0;
    for i in 0..n {
        for j in 0..=i {
            let slope = by(i * n + j);
            out.push(if j < i { slope } else { slope * libm::exp(near(at(k))) + 1.0 });
            k += 1;
        }
    }
}
