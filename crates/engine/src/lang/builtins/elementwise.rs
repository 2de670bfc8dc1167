//! Functions of scalars, applied element by element to arrays and nested arrays.
//!
//! Two arrays must have equal lengths; any other value is paired with every element.
//! Plain numbers are handled first because nearly every call in a model has them.

use super::{Args, Scalar};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use std::sync::Arc;

/// Applies the table's scalar function to numbers and arrays of numbers.
pub(super) fn mapped(a: &Args) -> Result<Value, Fault> {
    match a.builtin.scalar {
        Some(Scalar::Unary(f)) => unary(a, f),
        _ => binary(a, of_two(a)),
    }
}

/// Returns the table's function of two numbers.
pub(super) fn of_two(a: &Args) -> fn(f64, f64) -> f64 {
    match a.builtin.scalar {
        Some(Scalar::Binary(f)) => f,
        _ => |_, _| f64::NAN,
    }
}

/// Applies a function of one number.
pub(super) fn unary(a: &Args, f: fn(f64) -> f64) -> Result<Value, Fault> {
    fn go(a: &Args, v: &Value, f: fn(f64) -> f64) -> Result<Value, Fault> {
        match v {
            Value::Num(x) => Ok(Value::Num(f(*x))),
            Value::Array(xs) => Ok(Value::Array(xs.iter().map(|x| f(*x)).collect())),
            Value::List(xs) => xs
                .iter()
                .map(|x| go(a, x, f))
                .collect::<Result<Vec<_>, _>>()
                .map(Value::from_elements),
            _ => Err(not_a_number(a, 0, v)),
        }
    }
    go(a, a.get(0), f)
}

/// Applies a function of two numbers.
pub(super) fn binary(a: &Args, f: fn(f64, f64) -> f64) -> Result<Value, Fault> {
    numeric(a, a.get(0), a.get(1), f, &|x, y| match x {
        Value::Num(_) => Err(not_a_number(a, 1, y)),
        _ => Err(not_a_number(a, 0, x)),
    })
}

/// Applies a function of two numbers to numbers or arrays; `other` handles pairs in which
/// one value is neither. A function that is known here is applied to several numbers at a time.
pub(super) fn numeric(
    a: &Args,
    x: &Value,
    y: &Value,
    f: impl Fn(f64, f64) -> f64 + Copy,
    other: Pairing<'_>,
) -> Result<Value, Fault> {
    match (x, y) {
        (Value::Num(x), Value::Num(y)) => Ok(Value::Num(f(*x, *y))),
        (Value::Array(xs), Value::Num(y)) => {
            Ok(Value::Array(xs.iter().map(|x| f(*x, *y)).collect()))
        }
        (Value::Num(x), Value::Array(ys)) => {
            Ok(Value::Array(ys.iter().map(|y| f(*x, *y)).collect()))
        }
        (Value::Array(xs), Value::Array(ys)) if xs.len() == ys.len() => {
            Ok(Value::Array(xs.iter().zip(ys.iter()).map(|(x, y)| f(*x, *y)).collect()))
        }
        _ => match common_len(a, x, y)? {
            None => other(x, y),
            // Rows of a matrix are arrays of numbers again.
            Some(n) => {
                let rows = (0..n).map(|i| numeric(a, &part(x, i), &part(y, i), f, other));
                rows.collect::<Result<Vec<_>, _>>().map(Value::from_elements)
            }
        },
    }
}

/// The operation of [`broadcast`] on two values that are not arrays.
pub(super) type Pairing<'a> = &'a dyn Fn(&Value, &Value) -> Result<Value, Fault>;

/// Pairs the elements of two values recursively, down to values that are not arrays.
pub(super) fn broadcast(a: &Args, x: &Value, y: &Value, f: Pairing<'_>) -> Result<Value, Fault> {
    match common_len(a, x, y)? {
        None => f(x, y),
        Some(n) => {
            let parts = (0..n).map(|i| broadcast(a, &part(x, i), &part(y, i), f));
            parts.collect::<Result<Vec<_>, _>>().map(Value::from_elements)
        }
    }
}

/// Returns the common length of two values; `None` if neither is an array.
pub(super) fn common_len(a: &Args, x: &Value, y: &Value) -> Result<Option<usize>, Fault> {
    match (array_len(x), array_len(y)) {
        (Some(m), Some(n)) if m != n => {
            let name = a.builtin.full_name();
            Err(Fault::type_error(format!("{name}: arrays of lengths {m} and {n} do not match")))
        }
        (m, n) => Ok(m.or(n)),
    }
}

/// Returns element `i` of an array; any other value is broadcast.
pub(super) fn part(v: &Value, i: usize) -> Value {
    v.element(i).unwrap_or_else(|| v.clone())
}

/// Returns the length of an array; `None` for other values.
pub(super) fn array_len(v: &Value) -> Option<usize> {
    match v {
        Value::Array(xs) => Some(xs.len()),
        Value::List(xs) => Some(xs.len()),
        _ => None,
    }
}

/// The error that an argument, or an element of it, is not a number.
pub(super) fn not_a_number(a: &Args, i: usize, found: &Value) -> Fault {
    match array_len(a.get(i)) {
        Some(_) => a.element_wrong(i, "a number or an array of numbers", found),
        None => a.wrong(i, "a number or an array of numbers"),
    }
}

/// Creates an array of numbers from a function of the index.
pub(super) fn array(n: usize, f: impl FnMut(usize) -> f64) -> Value {
    let xs: Arc<[f64]> = (0..n).map(f).collect();
    Value::Array(xs)
}
