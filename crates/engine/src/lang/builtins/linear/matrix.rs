//! Matrices: arrays of rows, which are arrays of numbers of equal length.
//!
//! Plain triple loops in a fixed order: the matrices of a model are small, and results
//! must not depend on the machine.

use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::elementwise::array;
use crate::lang::builtins::reduce::dot;
use crate::lang::builtins::{ArgAdjoints, Args, Row, Type, arg, function};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use smallvec::smallvec;
use std::borrow::Cow;

const SECTION: &str = "Matrices";

pub(in crate::lang::builtins) const TABLE: &[Row] = &[
    function(
        "matmul",
        SECTION,
        &[
            arg("a", Type::Array, "A matrix, or a vector taken as a row."),
            arg("b", Type::Array, "A matrix, or a vector taken as a column."),
        ],
        Type::Any,
        "The matrix product; a vector gives a vector, two vectors their dot product.",
        matmul,
    )
    .vjp(vjp_matmul),
    function(
        "transpose",
        SECTION,
        &[arg("a", Type::Array, "A matrix.")],
        Type::Array,
        "The transpose: the matrix with rows and columns exchanged.",
        |a| {
            let m = Matrix::read(a, 0)?;
            Ok(m.transposed().into_value())
        },
    )
    .vjp(|a, _, by| {
        let m = Matrix::read(a, 0).ok()?;
        let g = Matrix::of(by, m.width, m.rows.len());
        Some(smallvec![g.transposed().into_adjoint()])
    }),
    function(
        "diag",
        SECTION,
        &[arg("x", Type::Array, "A vector, or a matrix.")],
        Type::Array,
        "The diagonal matrix of a vector, or the diagonal of a matrix.",
        |a| match a.get(0) {
            Value::Array(xs) => {
                a.fits(xs.len().saturating_mul(xs.len()))?;
                Ok(rows(xs.len(), |i| array(xs.len(), |j| if i == j { xs[i] } else { 0.0 })))
            }
            _ => {
                let m = Matrix::read(a, 0)?;
                Ok(array(m.rows.len().min(m.width), |i| m.rows[i][i]))
            }
        },
    )
    .vjp(|a, _, by| match a.get(0) {
        Value::Array(xs) => {
            let g = Matrix::of(by, xs.len(), xs.len());
            Some(smallvec![Adjoint::Array((0..xs.len()).map(|i| g.rows[i][i]).collect())])
        }
        _ => {
            let m = Matrix::read(a, 0).ok()?;
            let g = by.numbers(m.rows.len().min(m.width));
            let entry = |i: usize, j: usize| if i == j { g[i] } else { 0.0 };
            Some(smallvec![Matrix::from_fn(m.rows.len(), m.width, entry).into_adjoint()])
        }
    }),
    function(
        "outer",
        SECTION,
        &[arg("xs", Type::Array, "A vector."), arg("ys", Type::Array, "A vector.")],
        Type::Array,
        "The outer product: the matrix of the products `xs[i] * ys[j]`.",
        |a| {
            let (xs, ys) = (a.numbers(0)?, a.numbers(1)?);
            a.fits(xs.len().saturating_mul(ys.len()))?;
            Ok(rows(xs.len(), |i| array(ys.len(), |j| xs[i] * ys[j])))
        },
    )
    .vjp(|a, _, by| {
        let (xs, ys) = (a.numbers(0).ok()?, a.numbers(1).ok()?);
        let g = Matrix::of(by, xs.len(), ys.len());
        let by_xs = g.rows.iter().map(|r| dot(r, &ys)).collect();
        let by_ys = g.transposed().rows.iter().map(|c| dot(c, &xs)).collect();
        Some(smallvec![Adjoint::Array(by_xs), Adjoint::Array(by_ys)])
    }),
    function(
        "identity",
        SECTION,
        &[arg("n", Type::Int, "The number of rows and columns, at most 3000.")],
        Type::Array,
        "The identity matrix.",
        |a| {
            let n = a.int_in(0, 0, 3000)? as usize;
            Ok(rows(n, |i| array(n, |j| f64::from(u8::from(i == j)))))
        },
    )
    .flat(),
];

/// Rows of equal length, borrowed from a value.
pub(in crate::lang::builtins) struct Matrix<'a> {
    /// The rows.
    pub rows: Vec<Cow<'a, [f64]>>,
    /// The length of each row.
    pub width: usize,
}

impl<'a> Matrix<'a> {
    /// Reads argument `i` as a matrix.
    pub fn read(a: &Args<'a>, i: usize) -> Result<Self, Fault> {
        let wrong = || a.wrong(i, "a matrix, an array of rows of numbers");
        let Value::List(list) = a.get(i) else { return Err(wrong()) };
        let row = |v: &'a Value| match v {
            Value::Array(xs) => Ok(Cow::Borrowed(&**xs)),
            _ => Err(wrong()),
        };
        let rows = list.iter().map(row).collect::<Result<Vec<_>, Fault>>()?;
        let width = rows.first().map_or(0, |r| r.len());
        match rows.iter().position(|r| r.len() != width) {
            Some(k) => {
                let what = format!(
                    "rows of one length; row 0 has {width} numbers, row {k} has {}",
                    rows[k].len()
                );
                Err(Fault::type_error(format!("{}: a matrix has {what}", a.builtin.full_name())))
            }
            None => Ok(Matrix { rows, width }),
        }
    }

    /// Returns it as a dense matrix.
    pub fn dense(&self) -> nalgebra::DMatrix<f64> {
        nalgebra::DMatrix::from_fn(self.rows.len(), self.width, |i, j| self.rows[i][j])
    }

    fn transposed(&self) -> Matrix<'static> {
        let column = |j: usize| Cow::Owned(self.rows.iter().map(|r| r[j]).collect());
        Matrix { rows: (0..self.width).map(column).collect(), width: self.rows.len() }
    }

    fn from_fn(rows: usize, width: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix<'static> {
        let row = |i: usize| Cow::Owned((0..width).map(|j| entry(i, j)).collect());
        Matrix { rows: (0..rows).map(row).collect(), width }
    }

    /// Converts the adjoint of a matrix of this size.
    fn of(by: &Adjoint, rows: usize, width: usize) -> Matrix<'static> {
        Matrix {
            rows: (0..rows).map(|i| Cow::Owned(by.element(i).numbers(width))).collect(),
            width,
        }
    }

    fn into_adjoint(self) -> Adjoint {
        Adjoint::List(self.rows.into_iter().map(|r| Adjoint::Array(r.into_owned())).collect())
    }

    fn into_value(self) -> Value {
        Value::List(self.rows.into_iter().map(|r| Value::array(r.into_owned())).collect())
    }
}

fn rows(n: usize, row: impl FnMut(usize) -> Value) -> Value {
    Value::List((0..n).map(row).collect())
}

fn matmul(a: &Args) -> Result<Value, Fault> {
    let is_vector = |i: usize| matches!(a.get(i), Value::Array(_));
    let left = if is_vector(0) { single_row(a, 0)? } else { Matrix::read(a, 0)? };
    let right = if is_vector(1) { single_row(a, 1)? } else { Matrix::read(a, 1)?.transposed() };
    if left.width != right.width {
        let (m, n) = (left.width, right.width);
        return Err(Fault::type_error(format!("matmul: `a` has {m} columns, `b` has {n} rows")));
    }
    a.fits(left.rows.len().saturating_mul(right.rows.len()))?;
    let cell = |i: usize, j: usize| dot(&left.rows[i], &right.rows[j]);
    Ok(match (is_vector(0), is_vector(1)) {
        (true, true) => Value::Num(cell(0, 0)),
        (true, false) => array(right.rows.len(), |j| cell(0, j)),
        (false, true) => array(left.rows.len(), |i| cell(i, 0)),
        (false, false) => rows(left.rows.len(), |i| array(right.rows.len(), |j| cell(i, j))),
    })
}

/// For C = A B with adjoint G, the adjoint of A is G B' and that of B is A' G.
fn vjp_matmul(a: &Args, _: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let is_vector = |i: usize| matches!(a.get(i), Value::Array(_));
    let left = if is_vector(0) { single_row(a, 0).ok()? } else { Matrix::read(a, 0).ok()? };
    // Stored by columns.
    let right =
        if is_vector(1) { single_row(a, 1).ok()? } else { Matrix::read(a, 1).ok()?.transposed() };
    let (n, m, inner) = (left.rows.len(), right.rows.len(), left.width);
    let g = match (is_vector(0), is_vector(1)) {
        (true, true) => Matrix::from_fn(1, 1, |_, _| by.number()),
        (true, false) => Matrix { rows: vec![Cow::Owned(by.numbers(m))], width: m },
        (false, true) => {
            let column = by.numbers(n);
            Matrix::from_fn(n, 1, |i, _| column[i])
        }
        (false, false) => Matrix::of(by, n, m),
    };
    let by_left =
        Matrix::from_fn(n, inner, |i, k| (0..m).map(|j| g.rows[i][j] * right.rows[j][k]).sum());
    // Stored by columns, too.
    let by_right =
        Matrix::from_fn(m, inner, |j, k| (0..n).map(|i| g.rows[i][j] * left.rows[i][k]).sum());
    let row = |m: Matrix| {
        Adjoint::Array(m.rows.into_iter().next().map(Cow::into_owned).unwrap_or_default())
    };
    Some(smallvec![
        if is_vector(0) { row(by_left) } else { by_left.into_adjoint() },
        if is_vector(1) { row(by_right) } else { by_right.transposed().into_adjoint() },
    ])
}

fn single_row<'a>(a: &Args<'a>, i: usize) -> Result<Matrix<'a>, Fault> {
    let xs = a.numbers(i)?;
    Ok(Matrix { width: xs.len(), rows: vec![xs] })
}
