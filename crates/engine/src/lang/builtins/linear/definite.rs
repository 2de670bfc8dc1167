//! Symmetric positive definite matrices: Cholesky factors, linear systems, determinants,
//! and their derivatives.
//!
//! Values are computed from the lower triangle only. The adjoint of a matrix is
//! symmetric: an off-diagonal entry shares its derivative equally with its mirror image.

use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::elementwise::array;
use crate::lang::builtins::linear::matrix::Matrix;
use crate::lang::builtins::{Arg, Args, Row, Type, arg, function};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use pcadlang_numerics::dist::Factor;
use smallvec::smallvec;

const SECTION: &str = "Matrices";

/// The maximum difference between an entry and its mirror image, as a fraction of the
/// largest entry.
const ASYMMETRY: f64 = 1e-8;

const M: Arg = arg("m", Type::Array, "A symmetric positive definite matrix, such as a covariance.");

pub(in crate::lang::builtins) const TABLE: &[Row] = &[
    function(
        "cholesky",
        SECTION,
        &[M],
        Type::Array,
        "The Cholesky factor L of `m = L L'`: lower triangular with a positive diagonal, as `mv_normal` takes it (`chol = L`).",
        |a| {
            let l = read(a)?;
            let n = l.size();
            Ok(Value::List((0..n).map(|i| array(n, |j| l.row(i).get(j).copied().unwrap_or(0.0))).collect()))
        },
    )
    .vjp(|a, _, by| {
        let l = read(a).ok()?;
        let n = l.size();
        let by: Vec<f64> = (0..n).flat_map(|i| by.element(i).numbers(n).into_iter().take(i + 1)).collect();
        let by = l.vjp_cholesky(&by);
        // A packed off-diagonal entry stands for both of its positions in the matrix.
        let entry = |i: usize, j: usize| if i == j { by[packed(i, i)] } else { 0.5 * by[packed(i.max(j), i.min(j))] };
        Some(smallvec![symmetric(n, entry)])
    }),
    function(
        "solve",
        SECTION,
        &[M, arg("b", Type::Array, "A vector, or a matrix with as many rows as `m`.")],
        Type::Array,
        "The solution x of `matmul(m, x) = b`, for a symmetric positive definite `m`: `matmul(inverse of m, b)` without the inverse.",
        |a| {
            let l = read(a)?;
            let columns = right_side(a, l.size())?;
            let solved: Vec<Vec<f64>> = columns.iter().map(|b| l.solve(b)).collect();
            Ok(match a.get(1) {
                Value::Array(_) => Value::array(solved.into_iter().next().unwrap_or_default()),
                _ => Value::List((0..l.size()).map(|i| array(solved.len(), |j| solved[j][i])).collect()),
            })
        },
    )
    .vjp(|a, value, by| {
        let l = read(a).ok()?;
        let n = l.size();
        let vector = matches!(value, Value::Array(_));
        let width = if vector { 1 } else { value.element(0).and_then(|r| r.len()).unwrap_or(0) };
        let column = |j: usize, v: &Value| -> Vec<f64> {
            let numbers = |v: &Value| v.numbers();
            match v {
                Value::Array(xs) => xs.to_vec(),
                v => (0..n).filter_map(|i| numbers(&v.element(i)?).get(j).copied()).collect(),
            }
        };
        // The adjoint of b is m^-1 times that of x; the adjoint of m is minus that times
        // x'.
        let by_b: Vec<Vec<f64>> = (0..width)
            .map(|j| match vector {
                true => l.solve(&by.numbers(n)),
                false => l.solve(&(0..n).map(|i| by.element(i).element(j).number()).collect::<Vec<_>>()),
            })
            .collect();
        let x: Vec<Vec<f64>> = (0..width).map(|j| column(j, value)).collect();
        let by_m = symmetric(n, |i, j| -(0..width).map(|k| by_b[k][i] * x[k][j]).sum::<f64>());
        let by_b = match vector {
            true => Adjoint::Array(by_b.into_iter().next().unwrap_or_default()),
            false => Adjoint::List((0..n).map(|i| Adjoint::Array(by_b.iter().map(|c| c[i]).collect())).collect()),
        };
        Some(smallvec![by_m, by_b])
    }),
    function(
        "logdet",
        SECTION,
        &[M],
        Type::Num,
        "The logarithm of the determinant of a symmetric positive definite matrix.",
        |a| {
            let l = read(a)?;
            Ok(Value::Num(2.0 * l.log_det()))
        },
    )
    .vjp(|a, _, by| {
        let l = read(a).ok()?;
        let n = l.size();
        let unit = |j: usize| (0..n).map(|i| f64::from(u8::from(i == j))).collect::<Vec<_>>();
        let inverse: Vec<Vec<f64>> = (0..n).map(|j| l.solve(&unit(j))).collect();
        let by = by.number();
        Some(smallvec![symmetric(n, |i, j| by * inverse[j][i])])
    }),
];

/// The index of an entry of the lower triangle, packed by rows.
fn packed(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// Computes the Cholesky factor of the first argument, after checking it.
fn read(a: &Args) -> Result<Factor, Fault> {
    let m = Matrix::read(a, 0)?;
    let (name, n) = (a.builtin.full_name(), m.rows.len());
    if m.width != n {
        let message = format!("{name}: `m` must be square, got {n} x {}", m.width);
        return Err(Fault::type_error(message)
            .with_hint("a covariance matrix has one row and one column per variable"));
    }
    let entries = m.rows.iter().flat_map(|r| r.iter());
    let largest = entries.clone().fold(0.0, |most: f64, x| most.max(x.abs()));
    if !entries.clone().all(|x| x.is_finite()) {
        return Err(Fault::domain(format!("{name}: `m` must have finite entries")));
    }
    for i in 0..n {
        for j in 0..i {
            let (one, other) = (m.rows[i][j], m.rows[j][i]);
            if (one - other).abs() > ASYMMETRY * largest {
                let message = format!(
                    "{name}: `m` must be symmetric, got {one} at [{i}][{j}] and {other} at [{j}][{i}]"
                );
                return Err(
                    Fault::type_error(message).with_hint("(m + transpose(m)) / 2 is symmetric")
                );
            }
        }
    }
    let lower = m.rows.iter().enumerate().flat_map(|(i, r)| r[..=i].iter().copied()).collect();
    Factor::new(n, lower).map_err(|rows| {
        let message = format!(
            "{name}: `m` must be positive definite, but its leading block of {rows} rows is not"
        );
        Fault::domain(message).with_hint(
            "a covariance matrix has positive variances and correlations between -1 and 1; adding \
             a small number to the diagonal helps against rounding errors",
        )
    })
}

/// The mean of a matrix and its transpose, as an adjoint.
fn symmetric(n: usize, entry: impl Fn(usize, usize) -> f64) -> Adjoint {
    let row =
        |i: usize| Adjoint::Array((0..n).map(|j| 0.5 * (entry(i, j) + entry(j, i))).collect());
    Adjoint::List((0..n).map(row).collect())
}

/// Returns the columns of the second argument, each of length `n`.
fn right_side(a: &Args, n: usize) -> Result<Vec<Vec<f64>>, Fault> {
    let wrong = |rows: usize| {
        Fault::type_error(format!("solve: `b` must have as many rows as `m`, {n}, got {rows}"))
            .with_hint("the matrix comes first: solve(m, b)")
    };
    if let Value::Array(b) = a.get(1) {
        return if b.len() == n { Ok(vec![b.to_vec()]) } else { Err(wrong(b.len())) };
    }
    let b = Matrix::read(a, 1)?;
    if b.rows.len() != n {
        return Err(wrong(b.rows.len()));
    }
    Ok((0..b.width).map(|j| b.rows.iter().map(|r| r[j]).collect()).collect())
}
