//! Creating, joining and searching arrays and records; truth tests over arrays; strings.

use super::elementwise::{array, array_len, common_len, part};
use super::{Arg, ArgAdjoints, Args, Row, Type, arg, function, num};
use crate::lang::adjoint::Adjoint;
use crate::lang::error::{Fault, FaultKind};
use crate::lang::key::Key;
use crate::lang::missing::is_missing;
use crate::lang::value::{MOST_ELEMENTS, Value};
use smallvec::smallvec;
use std::cmp::Ordering;
use std::sync::Arc;

const SECTION: &str = "Arrays and records";

const XS: &[Arg] = &[arg("xs", Type::Array, "An array.")];
const N: &[Arg] = &[arg("n", Type::Int, "The number of elements.")];
const BOOLS: &[Arg] = &[arg("xs", Type::Array, "Bools.")];
const FIELDS: &[Arg] =
    &[arg("r", Type::Any, "A record, or an array whose keys are its positions.")];

pub(super) const TABLE: &[Row] = &[
    function(
        "len",
        SECTION,
        &[arg("x", Type::Any, "An array, record or string.")],
        Type::Int,
        "The number of elements, fields or characters.",
        len,
    )
    .flat(),
    function(
        "linspace",
        SECTION,
        &[
            arg("lo", Type::Num, "The first number."),
            arg("hi", Type::Num, "The last number."),
            arg("n", Type::Int, "The number of points; a single point is `lo`."),
        ],
        Type::Array,
        "`n` evenly spaced numbers from `lo` to `hi`, both included.",
        linspace,
    )
    .vjp(|a, _, by| {
        let n = a.count(2).ok()?;
        let (mut lo, mut hi) = (0.0, 0.0);
        for (i, g) in by.numbers(n).into_iter().enumerate() {
            let t = if n > 1 { i as f64 / (n - 1) as f64 } else { 0.0 };
            lo += g * (1.0 - t);
            hi += g * t;
        }
        Some(smallvec![Adjoint::Num(lo), Adjoint::Num(hi)])
    }),
    function(
        "range",
        SECTION,
        &[
            arg("start", Type::Num, "The first number."),
            arg("end", Type::Num, "The end, excluded."),
            num("step", 1.0, "The step, not 0; may be negative."),
        ],
        Type::Array,
        "`start`, `start + step`, … up to but excluding `end`; for whole numbers write `a .. b`.",
        range,
    )
    .vjp(|_, y, by| {
        let g = by.numbers(y.len()?);
        let step = g.iter().enumerate().map(|(i, g)| i as f64 * g).sum();
        Some(smallvec![Adjoint::Num(g.iter().sum()), Adjoint::Zero, Adjoint::Num(step)])
    }),
    function("zeros", SECTION, N, Type::Array, "An array of `n` zeros.", |a| Ok(array(a.count(0)?, |_| 0.0))).flat(),
    function("ones", SECTION, N, Type::Array, "An array of `n` ones.", |a| Ok(array(a.count(0)?, |_| 1.0))).flat(),
    function(
        "fill",
        SECTION,
        &[arg("x", Type::Any, "The element."), arg("n", Type::Int, "The number of elements.")],
        Type::Array,
        "An array of `n` copies of `x`.",
        |a| match a.get(0) {
            Value::Num(x) => Ok(array(a.count(1)?, |_| *x)),
            x => Ok(Value::from_elements(vec![x.clone(); a.count(1)?])),
        },
    )
    .vjp(|_, y, by| {
        let mut sum = Adjoint::Zero;
        (0..y.len()?).for_each(|i| sum.add(by.element(i)));
        Some(smallvec![sum])
    }),
    function(
        "concat",
        SECTION,
        &[arg("xs", Type::Array, "Arrays, or strings.")],
        Type::Any,
        "The arguments joined end to end.",
        concat,
    )
    .variadic()
    .vjp(vjp_concat),
    function(
        "append",
        SECTION,
        &[arg("xs", Type::Array, "An array."), arg("x", Type::Any, "The new element.")],
        Type::Array,
        "The array with one more element.",
        |a| {
            let mut xs = a.elements(0)?.into_owned();
            xs.push(a.get(1).clone());
            Ok(Value::from_elements(xs))
        },
    )
    .vjp(|a, y, by| {
        let n = y.len()?.saturating_sub(1);
        Some(smallvec![moved(a.get(0), by, |i| i), by.element(n)])
    }),
    function("reverse", SECTION, XS, Type::Array, "The elements from the last to the first.", |a| {
        let mut xs = a.elements(0)?.into_owned();
        xs.reverse();
        Ok(Value::from_elements(xs))
    })
    .vjp(|a, y, by| {
        let n = y.len()?;
        Some(smallvec![moved(a.get(0), by, |i| n - 1 - i)])
    }),
    function("sort", SECTION, XS, Type::Array, "Numbers or strings in ascending order, NaN last.", |a| {
        let xs = a.elements(0)?;
        let order = sorted(a, &xs)?;
        Ok(Value::from_elements(order.into_iter().filter_map(|i| xs.get(i).cloned()).collect()))
    })
    .vjp(|a, _, by| {
        let order = sorted(a, &a.elements(0).ok()?).ok()?;
        let mut sum = Adjoint::Zero;
        order.iter().enumerate().for_each(|(to, from)| sum.add_element(order.len(), *from, by.element(to)));
        Some(smallvec![sum])
    }),
    function("argsort", SECTION, XS, Type::Array, "The positions of the elements in ascending order.", |a| {
        let xs = a.elements(0)?;
        Ok(Value::array(sorted(a, &xs)?.into_iter().map(|i| i as f64).collect::<Vec<_>>()))
    })
    .flat(),
    function("argmax", SECTION, XS, Type::Int, "The position of the largest number, the first of equals.", |a| {
        best(a, |x, best| x > best)
    })
    .flat(),
    function("argmin", SECTION, XS, Type::Int, "The position of the smallest number, the first of equals.", |a| {
        best(a, |x, best| x < best)
    })
    .flat(),
    function(
        "zip",
        SECTION,
        &[arg("xs", Type::Array, "An array."), arg("ys", Type::Array, "Another array of the same length.")],
        Type::Array,
        "The array of the pairs `[x, y]`.",
        |a| {
            let (xs, ys) = (a.elements(0)?, a.elements(1)?);
            if xs.len() != ys.len() {
                return Err(a.wrong_length(1, &format!("as many elements as `xs`, {}", xs.len())));
            }
            let pair = |(x, y): (&Value, &Value)| Value::from_elements(vec![x.clone(), y.clone()]);
            Ok(Value::List(xs.iter().zip(ys.iter()).map(pair).collect()))
        },
    )
    .vjp(|_, z, by| {
        let n = z.len()?;
        let side = |k: usize| {
            let mut all = Adjoint::Zero;
            (0..n).for_each(|i| all.add_element(n, i, by.element(i).element(k)));
            all
        };
        Some(smallvec![side(0), side(1)])
    }),
    function("keys", SECTION, FIELDS, Type::Array, "The names of the fields in order.", |a| match a.get(0) {
        Value::Record(r) => Ok(Value::List(r.keys().map(|k| Value::Str(Arc::clone(k))).collect())),
        v => Ok(array(array_len(v).ok_or_else(|| a.wrong(0, "a record or array"))?, |i| i as f64)),
    })
    .flat(),
    function("values", SECTION, FIELDS, Type::Array, "The values of the fields in order.", |a| match a.get(0) {
        Value::Record(r) => Ok(Value::from_elements(r.values().cloned().collect())),
        v if array_len(v).is_some() => Ok(v.clone()),
        _ => Err(a.wrong(0, "a record or array")),
    })
    .vjp(|a, _, by| {
        let mut all = Adjoint::Zero;
        (0..a.get(0).len()?).for_each(|i| all.add_position(a.get(0), i, by.element(i)));
        Some(smallvec![all])
    }),
    function(
        "has",
        SECTION,
        &[arg("r", Type::Any, "A record, or an array."), arg("key", Type::Any, "The name of a field, or a position.")],
        Type::Bool,
        "Whether the record has this field, or the array this position.",
        |a| match (a.get(0), a.get(1)) {
            (Value::Record(r), Value::Str(k)) => Ok(Value::Bool(r.contains_key(k))),
            (Value::Record(_), _) => Err(a.wrong(1, "a string")),
            (v, k) => match (array_len(v), k) {
                (Some(n), Value::Num(_)) => {
                    Ok(Value::Bool(Key::from_value(k).and_then(|k| k.as_index()).is_some_and(|i| i < n)))
                }
                (Some(_), _) => Err(a.wrong(1, "a number")),
                _ => Err(a.wrong(0, "a record or array")),
            },
        },
    )
    .flat(),
    function("any", SECTION, BOOLS, Type::Bool, "Whether at least one element is true.", |a| {
        Ok(Value::Bool(bools(a)?.contains(&true)))
    })
    .flat(),
    function("all", SECTION, BOOLS, Type::Bool, "Whether every element is true.", |a| {
        Ok(Value::Bool(!bools(a)?.contains(&false)))
    })
    .flat(),
    function(
        "require",
        SECTION,
        &[
            arg("x", Type::Any, "A value that the program uses."),
            arg("condition", Type::Bool, "What must hold for it."),
            arg("otherwise", Type::Str, "The error message where it does not."),
        ],
        Type::Any,
        "`x`, or an error that ends the run where a condition does not hold, such as of the data.",
        |a| match a.bool(1)? {
            true => Ok(a.get(0).clone()),
            false => Err(Fault::new(FaultKind::Other, a.str(2)?)),
        },
    )
    .vjp(|_, _, by| Some(smallvec![by.clone(), Adjoint::Zero, Adjoint::Zero])),
    function(
        "is_missing",
        SECTION,
        &[arg("x", Type::Any, "A value, or an array of them.")],
        Type::Any,
        "Whether a value is missing: an empty or NA field of a CSV file, null of a JSON file, or NaN. Of an array, a bool for each element.",
        |a| is_missing(a.get(0)),
    )
    .flat(),
    function(
        "select",
        SECTION,
        &[
            arg("cond", Type::Any, "A bool, or an array of bools."),
            arg("a", Type::Any, "The result where it is true."),
            arg("b", Type::Any, "The result where it is false."),
        ],
        Type::Any,
        "`a` where the condition is true, `b` elsewhere, element by element; both are always computed.",
        |a| select(a, a.get(0), a.get(1), a.get(2)),
    )
    .vjp(|a, z, by| {
        let [x, y] = vjp_select(a.get(0), a.get(1), a.get(2), z, by)?;
        Some(smallvec![Adjoint::Zero, x, y])
    }),
    function(
        "str",
        SECTION,
        &[arg("x", Type::Any, "A value.")],
        Type::Str,
        "The value as text; long arrays are shortened.",
        |a| match a.get(0) {
            s @ Value::Str(_) => Ok(s.clone()),
            v => Ok(Value::Str(v.to_string().into())),
        },
    )
    .flat(),
];

fn len(a: &Args) -> Result<Value, Fault> {
    let n = match a.get(0) {
        Value::Str(s) => s.chars().count(),
        v => v.len().ok_or_else(|| a.wrong(0, "an array, record or string"))?,
    };
    Ok(Value::Num(n as f64))
}

fn linspace(a: &Args) -> Result<Value, Fault> {
    let (lo, hi, n) = (a.num(0)?, a.num(1)?, a.count(2)?);
    let last = n.saturating_sub(1);
    // The end points are exact, and rounding cannot swap neighbours.
    let at = |i| {
        if i == 0 {
            lo
        } else if i == last {
            hi
        } else {
            lo + (hi - lo) * (i as f64 / last as f64)
        }
    };
    Ok(array(n, at))
}

fn range(a: &Args) -> Result<Value, Fault> {
    let (start, end, step) = (a.num(0)?, a.num(1)?, a.num(2)?);
    let n = libm::ceil((end - start) / step);
    if n.is_nan() || step == 0.0 {
        return Err(Fault::domain(format!(
            "range: steps of {step} do not lead from {start} to {end}"
        )));
    }
    if n > MOST_ELEMENTS as f64 {
        return Err(a.too_many(n));
    }
    Ok(array(n.max(0.0) as usize, |i| start + i as f64 * step))
}

fn concat(a: &Args) -> Result<Value, Fault> {
    if let Value::Str(_) = a.get(0) {
        let parts = (0..a.values.len()).map(|i| a.str(i)).collect::<Result<Vec<_>, _>>()?;
        a.fits(parts.iter().map(|p| p.len()).sum())?;
        return Ok(Value::Str(parts.concat().into()));
    }
    a.fits(a.values.iter().filter_map(|v| v.len()).sum())?;
    // Same as below, without a `Value` for each number.
    if a.values.iter().all(|v| matches!(v, Value::Array(_))) {
        let mut all = Vec::new();
        for v in a.values {
            if let Value::Array(xs) = v {
                all.extend_from_slice(xs);
            }
        }
        return Ok(Value::array(all));
    }
    let mut all = Vec::new();
    for i in 0..a.values.len() {
        all.extend(a.elements(i)?.iter().cloned());
    }
    Ok(Value::from_elements(all))
}

/// The adjoint of an array whose element `i` became element `to(i)`.
fn moved(xs: &Value, by: &Adjoint, to: impl Fn(usize) -> usize) -> Adjoint {
    let n = xs.len().unwrap_or(0);
    let mut all = Adjoint::Zero;
    (0..n).for_each(|i| all.add_element(n, i, by.element(to(i))));
    all
}

fn vjp_concat(a: &Args, _: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let mut from = 0;
    let part = |v: &&Value| {
        let (n, start) = (array_len(v).unwrap_or(0), from);
        from += n;
        match by {
            Adjoint::Array(gs) => {
                gs.get(start..start + n).map_or(Adjoint::Zero, |g| Adjoint::Array(g.to_vec()))
            }
            by => moved(v, by, |i| start + i),
        }
    };
    Some(a.values.iter().map(part).collect())
}

fn vjp_select(cond: &Value, x: &Value, y: &Value, z: &Value, by: &Adjoint) -> Option<[Adjoint; 2]> {
    if let Value::Bool(b) = cond {
        return Some(if *b { [by.clone(), Adjoint::Zero] } else { [Adjoint::Zero, by.clone()] });
    }
    let n = array_len(cond)?;
    let mut both = [Adjoint::Zero, Adjoint::Zero];
    for i in 0..n {
        let parts =
            vjp_select(&part(cond, i), &part(x, i), &part(y, i), &z.element(i)?, &by.element(i))?;
        for ((sum, v), one) in both.iter_mut().zip([x, y]).zip(parts) {
            if array_len(v).is_some() { sum.add_element(n, i, one) } else { sum.add(one) }
        }
    }
    Some(both)
}

/// Returns the positions of the elements in ascending order; the sort is stable.
fn sorted(a: &Args, xs: &[Value]) -> Result<Vec<usize>, Fault> {
    let mut order: Vec<usize> = (0..xs.len()).collect();
    if xs.iter().all(|x| matches!(x, Value::Num(_)))
        || xs.iter().all(|x| matches!(x, Value::Str(_)))
    {
        order.sort_by(|i, j| ascending(&xs[*i], &xs[*j]));
        return Ok(order);
    }
    Err(a.wrong(0, "an array of numbers, or one of strings"))
}

fn ascending(x: &Value, y: &Value) -> Ordering {
    match (x, y) {
        // A total order: NaN of either sign comes last; -0 and 0 are equal.
        (Value::Num(x), Value::Num(y)) => {
            x.is_nan().cmp(&y.is_nan()).then_with(|| (x + 0.0).total_cmp(&(y + 0.0)))
        }
        (Value::Str(x), Value::Str(y)) => x.cmp(y),
        _ => Ordering::Equal,
    }
}

/// Returns the position of the best number, ignoring NaN.
fn best(a: &Args, better: fn(f64, f64) -> bool) -> Result<Value, Fault> {
    let xs = a.numbers_from(0, 1)?;
    let mut found: Option<(usize, f64)> = None;
    for (i, x) in xs.iter().enumerate() {
        if !x.is_nan() && found.is_none_or(|(_, best)| better(*x, best)) {
            found = Some((i, *x));
        }
    }
    let nan = || Fault::new(FaultKind::Domain, format!("{}: every element is NaN", a.builtin.name));
    found.map(|(i, _)| Value::Num(i as f64)).ok_or_else(nan)
}

fn bools(a: &Args) -> Result<Vec<bool>, Fault> {
    let bool = |x: &Value| match x {
        Value::Bool(b) => Ok(*b),
        x => Err(a.element_wrong(0, "an array of bools", x)),
    };
    a.elements(0)?.iter().map(bool).collect()
}

fn select(a: &Args, cond: &Value, x: &Value, y: &Value) -> Result<Value, Fault> {
    if let Value::Bool(b) = cond {
        return Ok(if *b { x.clone() } else { y.clone() });
    }
    let Some(n) = array_len(cond) else { return Err(a.wrong(0, "a bool or an array of bools")) };
    common_len(a, cond, x)?;
    common_len(a, cond, y)?;
    let chosen = (0..n).map(|i| select(a, &part(cond, i), &part(x, i), &part(y, i)));
    chosen.collect::<Result<Vec<_>, _>>().map(Value::from_elements)
}
