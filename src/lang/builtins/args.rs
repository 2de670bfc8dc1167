//! Reading the arguments of a built-in, with errors that name the argument.

use super::Builtin;
use crate::lang::error::Fault;
use crate::lang::value::{Object, Record, Value};
use std::borrow::Cow;
use std::sync::Arc;

/// The arguments of one call, in the table's order; `nothing` stands for those left out.
pub struct Args<'a> {
    /// The built-in called.
    pub builtin: &'a Builtin,
    /// The values.
    pub values: &'a [&'a Value],
}

impl<'a> Args<'a> {
    /// Argument `i`.
    pub fn get(&self, i: usize) -> &'a Value {
        const NOTHING: &Value = &Value::Unit;
        self.values.get(i).copied().unwrap_or(NOTHING)
    }

    /// Whether argument `i` was given.
    pub fn given(&self, i: usize) -> bool {
        !matches!(self.get(i), Value::Unit)
    }

    fn name(&self, i: usize) -> &'static str {
        self.builtin.args.get(i).or(self.builtin.args.last()).map_or("argument", |a| a.name)
    }

    /// The error that argument `i` is not what was wanted.
    pub fn wrong(&self, i: usize, wanted: &str) -> Fault {
        let got = match self.get(i) {
            Value::Unit => "nothing".to_owned(),
            v @ (Value::Num(_) | Value::Bool(_) | Value::Str(_)) => format!("{} ({v})", v.type_name()),
            v => v.type_name().to_owned(),
        };
        Fault::type_error(format!("{}: `{}` must be {wanted}, got {got}", self.builtin.name, self.name(i)))
    }

    /// The error that argument `i` is outside its domain.
    pub fn outside(&self, i: usize, rule: &str) -> Fault {
        Fault::domain(format!("{}: `{}` must be {rule}, got {}", self.builtin.name, self.name(i), self.get(i)))
    }

    /// A number.
    pub fn num(&self, i: usize) -> Result<f64, Fault> {
        match self.get(i) {
            Value::Num(x) => Ok(*x),
            _ => Err(self.wrong(i, "a number")),
        }
    }

    /// A number, or a default.
    pub fn num_or(&self, i: usize, default: f64) -> Result<f64, Fault> {
        if self.given(i) { self.num(i) } else { Ok(default) }
    }

    /// A positive, finite number, or a default.
    pub fn positive_or(&self, i: usize, default: f64) -> Result<f64, Fault> {
        let x = self.num_or(i, default)?;
        if x > 0.0 && x.is_finite() { Ok(x) } else { Err(self.outside(i, "positive and finite")) }
    }

    /// A whole number within bounds.
    pub fn int_in(&self, i: usize, lo: i64, hi: i64) -> Result<i64, Fault> {
        let x = self.num(i)?;
        if x == libm::trunc(x) && x >= lo as f64 && x <= hi as f64 {
            Ok(x as i64)
        } else {
            Err(self.outside(i, &format!("a whole number from {lo} to {hi}")))
        }
    }

    /// A truth value, or a default.
    pub fn bool_or(&self, i: usize, default: bool) -> Result<bool, Fault> {
        match self.get(i) {
            Value::Unit => Ok(default),
            Value::Bool(b) => Ok(*b),
            _ => Err(self.wrong(i, "a bool")),
        }
    }

    /// A string.
    pub fn str(&self, i: usize) -> Result<&'a str, Fault> {
        match self.get(i) {
            Value::Str(s) => Ok(s),
            _ => Err(self.wrong(i, "a string")),
        }
    }

    /// A string among some, or the first of them.
    pub fn choice<'b>(&self, i: usize, options: &'b [&'b str]) -> Result<&'b str, Fault> {
        if !self.given(i) {
            return Ok(options[0]);
        }
        let s = self.str(i)?;
        options.iter().copied().find(|o| *o == s).ok_or_else(|| {
            let mut f = self.wrong(i, &format!("one of {}", quoted(options)));
            if let Some(n) = crate::diag::nearest(s, options.iter().copied()) {
                f = f.with_hint(format!("did you mean \"{n}\"?"));
            }
            f
        })
    }

    /// An array of numbers.
    pub fn array(&self, i: usize) -> Result<Arc<[f64]>, Fault> {
        match self.get(i) {
            Value::Array(xs) => Ok(Arc::clone(xs)),
            Value::List(xs) if xs.is_empty() => Ok(Arc::from([])),
            _ => Err(self.wrong(i, "an array of numbers")),
        }
    }

    /// A vector of exactly three numbers, or one number for all three, or a default.
    pub fn vec3_or(&self, i: usize, default: [f64; 3]) -> Result<[f64; 3], Fault> {
        match self.get(i) {
            Value::Unit => Ok(default),
            Value::Num(x) => Ok([*x; 3]),
            Value::Array(xs) if xs.len() == 3 => Ok([xs[0], xs[1], xs[2]]),
            _ => Err(self.wrong(i, "three numbers [x, y, z], or one for all of them")),
        }
    }

    /// The elements of any array.
    pub fn elements(&self, i: usize) -> Result<Cow<'a, [Value]>, Fault> {
        match self.get(i) {
            Value::List(xs) => Ok(Cow::Borrowed(xs)),
            Value::Array(xs) => Ok(Cow::Owned(xs.iter().map(|x| Value::Num(*x)).collect())),
            _ => Err(self.wrong(i, "an array")),
        }
    }

    /// A record.
    pub fn record(&self, i: usize) -> Result<&'a Record, Fault> {
        match self.get(i) {
            Value::Record(r) => Ok(r),
            _ => Err(self.wrong(i, "a record")),
        }
    }

    /// An object of type `T`; `wanted` says what in words.
    pub fn object<T: Object>(&self, i: usize, wanted: &str) -> Result<&'a T, Fault> {
        self.get(i).downcast::<T>().ok_or_else(|| self.wrong(i, wanted))
    }
}

fn quoted(options: &[&str]) -> String {
    options.iter().map(|o| format!("\"{o}\"")).collect::<Vec<_>>().join(", ")
}
