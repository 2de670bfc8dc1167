//! How built-ins pass derivatives back: vector-Jacobian products of functions of numbers, element by element and otherwise.

use super::Args;
use super::elementwise::{array_len, part};
use crate::lang::adjoint::Adjoint;
use crate::lang::value::Value;
use smallvec::{SmallVec, smallvec};

/// The adjoints of a call's arguments, in order; those left out at the end are zero.
pub type Pulled = SmallVec<[Adjoint; 4]>;

/// From the arguments, the result and its adjoint to the adjoints of the arguments; `None` where nobody knows them.
pub type Pull = fn(&Args, &Value, &Adjoint) -> Option<Pulled>;

/// The derivative of a function.
#[derive(Clone, Copy, Debug)]
pub enum Derivative {
    /// Not known.
    Unknown,
    /// Zero wherever there is one: comparing, counting, rounding, and what has no numbers in it.
    Zero,
    /// Its vector-Jacobian product.
    Product(Pull),
}

/// A product in which nothing stays nothing: an infinite slope of something that does not matter is 0.
pub(super) fn times(by: f64, slope: f64) -> f64 {
    if by == 0.0 { 0.0 } else { by * slope }
}

/// Element `i` of an array of numbers; a number stands for every element.
fn number(v: &Value, i: usize) -> Option<f64> {
    match v {
        Value::Num(x) => Some(*x),
        Value::Array(xs) => xs.get(i).copied(),
        _ => None,
    }
}

/// A function of one number, element by element: `slope(x, y)` is dy/dx.
pub(super) fn unary(a: &Args, y: &Value, by: &Adjoint, slope: fn(f64, f64) -> f64) -> Option<Pulled> {
    fn go(x: &Value, y: &Value, by: &Adjoint, slope: fn(f64, f64) -> f64) -> Option<Adjoint> {
        Some(match (x, y, by) {
            (_, _, Adjoint::Zero) => Adjoint::Zero,
            (Value::Num(x), Value::Num(y), by) => Adjoint::Num(times(by.number(), slope(*x, *y))),
            (Value::Array(xs), Value::Array(ys), by) => {
                let by = by.numbers(xs.len());
                let all = xs.iter().zip(ys.iter()).zip(by);
                Adjoint::Array(all.map(|((x, y), g)| times(g, slope(*x, *y))).collect())
            }
            (Value::List(xs), y, by) => {
                let one = |(i, x): (usize, &Value)| go(x, &y.element(i)?, &by.element(i), slope);
                Adjoint::List(xs.iter().enumerate().map(one).collect::<Option<_>>()?)
            }
            _ => return None,
        })
    }
    Some(smallvec![go(a.get(0), y, by, slope)?])
}

/// A function of two numbers, element by element as [`super::elementwise::broadcast`] pairs them: `slopes(x, y, z)` are dz/dx
/// and dz/dy.
pub(super) fn binary(
    x: &Value,
    y: &Value,
    z: &Value,
    by: &Adjoint,
    slopes: fn(f64, f64, f64) -> [f64; 2],
) -> Option<[Adjoint; 2]> {
    let zero = || [Adjoint::Zero, Adjoint::Zero];
    match (x, y, z, by) {
        (_, _, _, Adjoint::Zero) => Some(zero()),
        (Value::Num(x), Value::Num(y), Value::Num(z), by) => {
            Some(slopes(*x, *y, *z).map(|s| Adjoint::Num(times(by.number(), s))))
        }
        (Value::Num(_) | Value::Array(_), Value::Num(_) | Value::Array(_), Value::Array(zs), by) => {
            let at = |v: &Value, i: usize| number(v, i).unwrap_or(f64::NAN);
            let by = by.numbers(zs.len());
            let (mut gx, mut gy) = (Vec::with_capacity(zs.len()), Vec::with_capacity(zs.len()));
            for (i, (z, g)) in zs.iter().zip(by).enumerate() {
                let [sx, sy] = slopes(at(x, i), at(y, i), *z);
                gx.push(times(g, sx));
                gy.push(times(g, sy));
            }
            let put = |v: &Value, g: Vec<f64>| match v {
                Value::Num(_) => Adjoint::Num(g.iter().sum()),
                _ => Adjoint::Array(g),
            };
            Some([put(x, gx), put(y, gy)])
        }
        _ => {
            let n = array_len(z)?;
            let mut both = zero();
            for i in 0..n {
                let parts = binary(&part(x, i), &part(y, i), &z.element(i)?, &by.element(i), slopes)?;
                for ((sum, v), one) in both.iter_mut().zip([x, y]).zip(parts) {
                    if array_len(v).is_some() { sum.add_element(n, i, one) } else { sum.add(one) }
                }
            }
            Some(both)
        }
    }
}

/// The same for a call with two arguments.
pub(super) fn of_two(a: &Args, z: &Value, by: &Adjoint, slopes: fn(f64, f64, f64) -> [f64; 2]) -> Option<Pulled> {
    binary(a.get(0), a.get(1), z, by, slopes).map(|both| both.into_iter().collect())
}

/// A function of an array that gives one number: `slopes(xs, y)` are its partial derivatives.
pub(super) fn reduction(a: &Args, y: &Value, by: &Adjoint, slopes: fn(&[f64], f64) -> Vec<f64>) -> Option<Pulled> {
    let xs = a.numbers(0).ok()?;
    let Value::Num(y) = y else { return None };
    let g = by.number();
    let all = slopes(&xs, *y);
    Some(smallvec![Adjoint::Array(all.into_iter().map(|s| times(g, s)).collect())])
}

/// A function of several numbers that gives one of them, element by element (`min`, `max`, `clamp`, `select`): the derivative
/// goes to the first of `order` that is equal to it.
pub(super) fn one_of(values: &[&Value], order: &[usize], z: &Value, by: &Adjoint) -> Option<Pulled> {
    let mut all: Pulled = smallvec![Adjoint::Zero; values.len()];
    match (z, by) {
        (_, Adjoint::Zero) => {}
        (Value::Num(z), by) => {
            let i = *order.iter().find(|i| matches!(values[**i], Value::Num(x) if x == z))?;
            all[i] = by.clone();
        }
        (Value::Array(zs), by) if values.iter().all(|v| matches!(v, Value::Num(_) | Value::Array(_))) => {
            let by = by.numbers(zs.len());
            for (i, (z, g)) in zs.iter().zip(by).enumerate().filter(|(_, (_, g))| *g != 0.0) {
                let k = *order.iter().find(|k| number(values[**k], i) == Some(*z))?;
                match values[k] {
                    Value::Array(_) => all[k].add_element(zs.len(), i, Adjoint::Num(g)),
                    _ => all[k].add(Adjoint::Num(g)),
                }
            }
        }
        _ => {
            let n = array_len(z)?;
            for i in 0..n {
                let parts: SmallVec<[Value; 4]> = values.iter().map(|v| part(v, i)).collect();
                let parts: SmallVec<[&Value; 4]> = parts.iter().collect();
                let pulled = one_of(&parts, order, &z.element(i)?, &by.element(i))?;
                for ((sum, v), one) in all.iter_mut().zip(values).zip(pulled) {
                    if array_len(v).is_some() { sum.add_element(n, i, one) } else { sum.add(one) }
                }
            }
        }
    }
    Some(all)
}
