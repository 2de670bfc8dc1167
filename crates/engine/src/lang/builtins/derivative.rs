//! Reverse-mode derivatives of built-ins: vector-Jacobian products of functions of
//! numbers, element by element or not.

use super::builtin::{ArgAdjoints, Args, Derivative};
use super::elementwise::{array_len, part};
use crate::lang::adjoint::Adjoint;
use crate::lang::value::Value;
use pcadlang_numerics::num::Column;
use pcadlang_numerics::num::simd::{sum_of_triples, vectorised_if_many};
use smallvec::{SmallVec, smallvec};

impl Derivative {
    /// Returns the adjoints of the arguments of a call, given its result and its adjoint.
    pub fn vjp(&self, a: &Args, value: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
        match (self, value) {
            (Derivative::Unknown, _) => None,
            (Derivative::Zero, _) => Some(ArgAdjoints::new()),
            (Derivative::Product(f), _) => f(a, value, by),
            (Derivative::Unary(f), _) => unary(a, value, by, *f),
            (Derivative::Binary(f), Value::Object(_)) => {
                f.objects.and_then(|vjp| vjp(a, value, by))
            }
            (Derivative::Binary(f), _) => of_two(a, value, by, f.slopes),
            (Derivative::Reduction(f), _) => reduction(a, value, by, f.slopes),
        }
    }
}

/// The row of a function of two numbers, given its slopes as a function of x, y and z.
/// Its loops are monomorphised, so that arithmetic runs over buffers without indirect
/// calls.
macro_rules! of_pairs {
    ($row:expr, $f:expr, $slopes:expr) => {
        of_pairs!($row, $f, $slopes, None)
    };
    ($row:expr, $f:expr, $slopes:expr, $objects:expr) => {{
        use $crate::lang::builtins::Binary;
        use $crate::lang::builtins::derivative::{each_pair, vjp_pairs};
        let form: &'static Binary = &const {
            Binary {
                slopes: $slopes,
                forward: |v, x, y, out, n| each_pair(v, x, y, out, n, $f),
                reverse: |v, g, x, y, out, n| vjp_pairs(v, g, x, y, out, n, $slopes),
                objects: $objects,
            }
        };
        $row.scalar(Scalar::Binary($f)).derivative(Derivative::Binary(form))
    }};
}
pub(super) use of_pairs;

/// Computes a function of two columns. The results start at `out`, behind both columns.
#[inline(always)]
pub(super) fn each_pair(
    v: &mut [f64],
    x: Column,
    y: Column,
    out: usize,
    n: usize,
    f: impl Fn(f64, f64) -> f64,
) {
    let (before, z) = v.split_at_mut(out);
    let z = &mut z[..n];
    vectorised_if_many(
        n,
        #[inline(always)]
        || match (x.step, y.step) {
            (0, 0) => z.fill(f(before[x.at], before[y.at])),
            (0, _) => {
                let x = before[x.at];
                z.iter_mut().zip(&before[y.at..y.at + n]).for_each(|(z, y)| *z = f(x, *y));
            }
            (_, 0) => {
                let y = before[y.at];
                z.iter_mut().zip(&before[x.at..x.at + n]).for_each(|(z, x)| *z = f(*x, y));
            }
            _ => {
                let both = before[x.at..x.at + n].iter().zip(&before[y.at..y.at + n]);
                z.iter_mut().zip(both).for_each(|(z, (x, y))| *z = f(*x, *y));
            }
        },
    );
}

/// Adds to the adjoints of both columns, if they are live.
#[inline(always)]
pub(super) fn vjp_pairs(
    v: &[f64],
    g: &mut [f64],
    x: Column,
    y: Column,
    out: usize,
    n: usize,
    slopes: impl Fn(f64, f64, f64) -> [f64; 2],
) {
    vectorised_if_many(
        n,
        #[inline(always)]
        || vjp_pairs_here(v, g, x, y, out, n, slopes),
    );
}

#[inline(always)]
fn vjp_pairs_here(
    v: &[f64],
    g: &mut [f64],
    x: Column,
    y: Column,
    out: usize,
    n: usize,
    slopes: impl Fn(f64, f64, f64) -> [f64; 2],
) {
    if n == 0 {
        return;
    }
    let (before, by) = g.split_at_mut(out);
    let (z, by) = (&v[out..out + n], &by[..n]);
    let end = |c: Column| c.at + 1 + (n - 1) * c.step;
    for (side, c) in [x, y].into_iter().enumerate().filter(|(_, c)| c.live) {
        // One loop for each way of stepping, so that bounds are checked once.
        let one = |by: f64, x: f64, y: f64, z: f64| times(by, slopes(x, y, z)[side]);
        let into = &mut before[c.at..end(c)];
        let (xs, ys) = (&v[x.at..end(x)], &v[y.at..end(y)]);
        match (into, xs, ys) {
            ([into], [x], [y]) => {
                *into += sum_of_triples(by, z, z, |b, z, _| one(b, *x, *y, z));
            }
            ([into], xs, [y]) if c.step == 0 => {
                *into += sum_of_triples(by, z, xs, |b, z, x| one(b, x, *y, z));
            }
            ([into], [x], ys) if c.step == 0 => {
                *into += sum_of_triples(by, z, ys, |b, z, y| one(b, *x, y, z));
            }
            (into, [x], ys) => {
                let all = into.iter_mut().zip(by.iter().zip(z).zip(ys));
                all.for_each(|(g, ((b, z), y))| *g += one(*b, *x, *y, *z));
            }
            (into, xs, [y]) => {
                let all = into.iter_mut().zip(by.iter().zip(z).zip(xs));
                all.for_each(|(g, ((b, z), x))| *g += one(*b, *x, *y, *z));
            }
            (into, xs, ys) => {
                let all = into.iter_mut().zip(by.iter().zip(z).zip(xs.iter().zip(ys)));
                all.for_each(|(g, ((b, z), (x, y)))| *g += one(*b, *x, *y, *z));
            }
        }
    }
}

/// The product, but 0 if `by` is 0: an infinite slope does not matter where the adjoint
/// is zero.
#[inline]
pub(crate) fn times(by: f64, slope: f64) -> f64 {
    if by == 0.0 { 0.0 } else { by * slope }
}

/// Returns element `i` of an array of numbers; a number is broadcast.
fn number(v: &Value, i: usize) -> Option<f64> {
    match v {
        Value::Num(x) => Some(*x),
        Value::Array(xs) => xs.get(i).copied(),
        _ => None,
    }
}

/// The vector-Jacobian product of a function of one number, element by element:
/// `slope(x, y)` is dy/dx.
fn unary(a: &Args, y: &Value, by: &Adjoint, slope: fn(f64, f64) -> f64) -> Option<ArgAdjoints> {
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

/// The vector-Jacobian product of a function of two numbers, paired as by
/// [`super::elementwise::broadcast`]: `slopes(x, y, z)` are dz/dx and dz/dy.
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
        (
            Value::Num(_) | Value::Array(_),
            Value::Num(_) | Value::Array(_),
            Value::Array(zs),
            by,
        ) => {
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
                let parts =
                    binary(&part(x, i), &part(y, i), &z.element(i)?, &by.element(i), slopes)?;
                for ((sum, v), one) in both.iter_mut().zip([x, y]).zip(parts) {
                    if array_len(v).is_some() { sum.add_element(n, i, one) } else { sum.add(one) }
                }
            }
            Some(both)
        }
    }
}

/// [`binary`] for a call with two arguments.
fn of_two(
    a: &Args,
    z: &Value,
    by: &Adjoint,
    slopes: fn(f64, f64, f64) -> [f64; 2],
) -> Option<ArgAdjoints> {
    binary(a.get(0), a.get(1), z, by, slopes).map(|both| both.into_iter().collect())
}

/// The vector-Jacobian product of a function of an array with a single number as its
/// result.
fn reduction(
    a: &Args,
    y: &Value,
    by: &Adjoint,
    slopes: fn(&[f64], f64, &mut [f64]),
) -> Option<ArgAdjoints> {
    let xs = a.numbers(0).ok()?;
    let Value::Num(y) = y else { return None };
    let g = by.number();
    let mut all = vec![0.0; xs.len()];
    slopes(&xs, *y, &mut all);
    all.iter_mut().for_each(|s| *s = times(g, *s));
    Some(smallvec![Adjoint::Array(all)])
}

/// The vector-Jacobian product of a function whose result is one of its arguments,
/// element by element (`min`, `max`, `clamp`): the adjoint goes to the first argument in
/// `order` that is equal to the result.
pub(super) fn one_of(
    values: &[&Value],
    order: &[usize],
    z: &Value,
    by: &Adjoint,
) -> Option<ArgAdjoints> {
    let mut all: ArgAdjoints = smallvec![Adjoint::Zero; values.len()];
    match (z, by) {
        (_, Adjoint::Zero) => {}
        (Value::Num(z), by) => {
            let i = *order.iter().find(|i| matches!(values[**i], Value::Num(x) if x == z))?;
            all[i] = by.clone();
        }
        (Value::Array(zs), by)
            if values.iter().all(|v| matches!(v, Value::Num(_) | Value::Array(_))) =>
        {
            let by = by.numbers(zs.len());
            let mut arrays: SmallVec<[Vec<f64>; 4]> = smallvec![Vec::new(); values.len()];
            for (i, (z, g)) in zs.iter().zip(by).enumerate().filter(|(_, (_, g))| *g != 0.0) {
                let k = *order.iter().find(|k| number(values[**k], i) == Some(*z))?;
                match values[k] {
                    Value::Array(_) => {
                        arrays[k].resize(zs.len(), 0.0);
                        arrays[k][i] = g;
                    }
                    _ => all[k].add(Adjoint::Num(g)),
                }
            }
            for (sum, own) in all.iter_mut().zip(arrays).filter(|(_, own)| !own.is_empty()) {
                sum.add(Adjoint::Array(own));
            }
        }
        _ => {
            let n = array_len(z)?;
            for i in 0..n {
                let parts: SmallVec<[Value; 4]> = values.iter().map(|v| part(v, i)).collect();
                let parts: SmallVec<[&Value; 4]> = parts.iter().collect();
                let argument_adjoints = one_of(&parts, order, &z.element(i)?, &by.element(i))?;
                for ((sum, v), one) in all.iter_mut().zip(values).zip(argument_adjoints) {
                    if array_len(v).is_some() { sum.add_element(n, i, one) } else { sum.add(one) }
                }
            }
        }
    }
    Some(all)
}
