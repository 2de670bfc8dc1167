//! The values in a local density: numbers, booleans, values of the trace, and values that
//! the evaluation has made.

use crate::lang::builtins::{Args, Argument, Builtin, Kind, Scalar};
use crate::lang::index::place;
use crate::lang::local_density::PARAMETERS;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Datum, Dist};
use smallvec::SmallVec;

/// A value in a local density.
#[derive(Clone, Copy)]
pub enum Register<'a> {
    Num(f64),
    Bool(bool),
    Other(&'a Value),
    /// A value that the evaluation has made, by its index there.
    Made(u8),
}

impl<'a> Register<'a> {
    pub fn of_datum(x: &Datum) -> Option<Self> {
        match x {
            Datum::Num(x) => Some(Register::Num(*x)),
            Datum::Bool(b) => Some(Register::Bool(*b)),
            _ => None,
        }
    }

    /// Returns the number; the default if the argument is omitted.
    #[inline(always)]
    pub fn number_or_default(self, arg: &Argument) -> Option<f64> {
        match (self, &arg.value) {
            (Register::Num(x), _) => Some(x),
            (Register::Other(Value::Unit), Value::Num(x)) => Some(*x),
            _ => None,
        }
    }

    pub fn of(v: &'a Value) -> Self {
        match v {
            Value::Num(x) => Register::Num(*x),
            Value::Bool(b) => Register::Bool(*b),
            v => Register::Other(v),
        }
    }
}

/// Returns the distribution with these parameters.
pub fn family(builtin: &Builtin, parameters: &[Register]) -> Option<Dist> {
    if let Some(Scalar::Family(family)) = builtin.scalar {
        let numbers = parameters.iter().zip(&*builtin.args).map(|(p, a)| p.number_or_default(a));
        let numbers: SmallVec<[f64; PARAMETERS]> = numbers.collect::<Option<_>>()?;
        return (family.make)(&numbers).ok();
    }
    if let (Some(Scalar::Weights { make, .. }), [Register::Other(Value::Array(w))]) =
        (builtin.scalar, parameters)
    {
        return make(w);
    }
    let Kind::Distribution(make) = builtin.kind else { return None };
    let owned = parameters.iter().map(|r| match r {
        Register::Num(x) => Some(Value::Num(*x)),
        Register::Bool(b) => Some(Value::Bool(*b)),
        Register::Other(v) => Some(Value::clone(v)),
        Register::Made(_) => None,
    });
    let owned: SmallVec<[Value; PARAMETERS]> = owned.collect::<Option<_>>()?;
    let values: SmallVec<[&Value; PARAMETERS]> = owned.iter().collect();
    make(&Args { builtin, values: &values }).ok()
}

/// Returns an element of an array, if the index is in range.
pub fn element(base: &Value, key: f64) -> Option<Register<'_>> {
    match base {
        Value::Array(xs) => place(xs.len(), key).map(|i| Register::Num(xs[i])),
        Value::List(xs) => place(xs.len(), key).map(|i| Register::of(&xs[i])),
        _ => None,
    }
}
