//! Access to the arguments of a built-in, with errors that name the argument.

use super::builtin::Args;
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::{MOST_ELEMENTS, Object, Record, Value};
use std::borrow::Cow;
use std::sync::Arc;

/// Numbers, borrowed if the value is already an array of numbers.
type Numbers<'a> = Cow<'a, [f64]>;

impl<'a> Args<'a> {
    /// Returns argument `i`, or the table's default if it is omitted.
    pub fn get(&self, i: usize) -> &'a Value {
        match self.values.get(i) {
            Some(v) if !matches!(v, Value::Unit) => v,
            _ => self.builtin.args.get(i).map_or(&Value::Unit, |a| &a.value),
        }
    }

    /// True if argument `i` has a value, from the call or from the table's default.
    pub fn given(&self, i: usize) -> bool {
        !matches!(self.get(i), Value::Unit)
    }

    fn name(&self, i: usize) -> &'a str {
        self.builtin.args.get(i).or(self.builtin.args.last()).map_or("argument", |a| &a.name)
    }

    /// The error that argument `i` does not have the required type.
    pub fn wrong(&self, i: usize, wanted: &str) -> Fault {
        let got = described(self.get(i));
        Fault::type_error(format!(
            "{}: `{}` must be {wanted}, got {got}",
            self.builtin.full_name(),
            self.name(i)
        ))
    }

    /// The error that argument `i` is an array with an unsuitable element.
    pub fn element_wrong(&self, i: usize, wanted: &str, found: &Value) -> Fault {
        let (name, got) = (self.builtin.full_name(), described(found));
        Fault::type_error(format!(
            "{name}: `{}` must be {wanted}, got an array with {got} in it",
            self.name(i)
        ))
    }

    /// The error that argument `i` has the wrong length.
    pub fn wrong_length(&self, i: usize, wanted: &str) -> Fault {
        let (name, got) = (self.builtin.full_name(), self.get(i).len().unwrap_or(0));
        Fault::type_error(format!("{name}: `{}` must have {wanted}, got {got}", self.name(i)))
    }

    /// The error that argument `i` is outside its domain.
    pub fn outside(&self, i: usize, rule: &str) -> Fault {
        let (name, got) = (self.builtin.full_name(), self.get(i));
        Fault::domain(format!("{name}: `{}` must be {rule}, got {got}", self.name(i)))
    }

    /// Reads a number.
    pub fn num(&self, i: usize) -> Result<f64, Fault> {
        match self.get(i) {
            Value::Num(x) => Ok(*x),
            _ => Err(self.wrong(i, "a number")),
        }
    }

    /// Reads a number, or returns a default.
    pub fn num_or(&self, i: usize, default: f64) -> Result<f64, Fault> {
        if self.given(i) { self.num(i) } else { Ok(default) }
    }

    /// Reads a positive, finite number, or returns a default.
    pub fn positive_or(&self, i: usize, default: f64) -> Result<f64, Fault> {
        let x = self.num_or(i, default)?;
        if x > 0.0 && x.is_finite() { Ok(x) } else { Err(self.outside(i, "positive and finite")) }
    }

    /// Reads a whole number within bounds.
    pub fn int_in(&self, i: usize, lo: i64, hi: i64) -> Result<i64, Fault> {
        let x = self.num(i)?;
        if x == libm::trunc(x) && x >= lo as f64 && x <= hi as f64 {
            return Ok(x as i64);
        }
        Err(match hi {
            i64::MAX => self.outside(i, &format!("a whole number, at least {lo}")),
            _ => self.outside(i, &format!("a whole number from {lo} to {hi}")),
        })
    }

    /// Reads a truth value, or returns a default.
    pub fn bool_or(&self, i: usize, default: bool) -> Result<bool, Fault> {
        match self.get(i) {
            Value::Unit => Ok(default),
            Value::Bool(b) => Ok(*b),
            _ => Err(self.wrong(i, "a bool")),
        }
    }

    /// Reads a string.
    pub fn str(&self, i: usize) -> Result<&'a str, Fault> {
        match self.get(i) {
            Value::Str(s) => Ok(s),
            _ => Err(self.wrong(i, "a string")),
        }
    }

    /// Reads a string that must be one of `options`; the first of them if it is omitted.
    pub fn choice<'b>(&self, i: usize, options: &'b [&'b str]) -> Result<&'b str, Fault> {
        if !self.given(i) {
            return Ok(options.first().copied().unwrap_or_default());
        }
        let s = self.str(i)?;
        options.iter().copied().find(|o| *o == s).ok_or_else(|| {
            let mut f = self.wrong(i, &format!("one of {}", quoted(options)));
            if let Some(n) = pcadlang_syntax::diag::nearest(s, options.iter().copied()) {
                f = f.with_hint(format!("did you mean \"{n}\"?"));
            }
            f
        })
    }

    /// Reads an array of numbers.
    pub fn array(&self, i: usize) -> Result<Arc<[f64]>, Fault> {
        match self.get(i) {
            Value::Array(xs) => Ok(Arc::clone(xs)),
            Value::List(xs) if xs.is_empty() => Ok(Arc::from([])),
            _ => Err(self.wrong(i, "an array of numbers")),
        }
    }

    /// Reads an array of numbers or bools, which count as 0 and 1.
    pub fn numbers(&self, i: usize) -> Result<Cow<'a, [f64]>, Fault> {
        match self.get(i) {
            Value::Array(xs) => Ok(Cow::Borrowed(xs)),
            Value::List(xs) => {
                let number = |x| {
                    truth(x).ok_or_else(|| self.element_wrong(i, "an array of numbers or bools", x))
                };
                xs.iter().map(number).collect::<Result<Vec<_>, _>>().map(Cow::Owned)
            }
            _ => Err(self.wrong(i, "an array of numbers")),
        }
    }

    /// Reads an array of at least `least` numbers.
    pub fn numbers_from(&self, i: usize, least: usize) -> Result<Cow<'a, [f64]>, Fault> {
        let xs = self.numbers(i)?;
        if xs.len() >= least {
            return Ok(xs);
        }
        let plural = if least == 1 { "" } else { "s" };
        Err(self.wrong_length(i, &format!("at least {least} element{plural}")))
    }

    /// Reads two arrays of numbers of equal length.
    pub fn number_pair(&self, i: usize, j: usize) -> Result<(Numbers<'a>, Numbers<'a>), Fault> {
        let (x, y) = (self.numbers(i)?, self.numbers(j)?);
        if x.len() == y.len() {
            return Ok((x, y));
        }
        Err(self.wrong_length(j, &format!("as many elements as `{}`, {}", self.name(i), x.len())))
    }

    /// Reads the number of elements of an array to create.
    pub fn count(&self, i: usize) -> Result<usize, Fault> {
        let n = self.int_in(i, 0, i64::MAX)? as usize;
        if n <= MOST_ELEMENTS { Ok(n) } else { Err(self.too_many(n as f64)) }
    }

    /// Checks the number of elements of a result.
    pub fn fits(&self, n: usize) -> Result<(), Fault> {
        if n <= MOST_ELEMENTS { Ok(()) } else { Err(self.too_many(n as f64)) }
    }

    /// The error that a distribution has too many parts or is nested too deeply.
    #[doc(hidden)]
    pub fn too_large(&self, what: &str, most: usize) -> Fault {
        Fault::new(
            FaultKind::Limit,
            format!("{}: more than {most} {what}", self.builtin.full_name()),
        )
    }

    /// The error that an array would be too long.
    #[doc(hidden)]
    pub fn too_many(&self, n: f64) -> Fault {
        let message = format!("{}: an array of {n} elements is too long", self.builtin.full_name());
        Fault::new(FaultKind::Limit, message)
            .with_hint(format!("at most {MOST_ELEMENTS} can be made in one call"))
    }

    /// Reads a vector of three numbers, or one number for all three, or returns a
    /// default.
    pub fn vec3_or(&self, i: usize, default: [f64; 3]) -> Result<[f64; 3], Fault> {
        match self.get(i) {
            Value::Unit => Ok(default),
            Value::Num(x) => Ok([*x; 3]),
            Value::Array(xs) if xs.len() == 3 => Ok([xs[0], xs[1], xs[2]]),
            _ => Err(self.wrong(i, "three numbers [x, y, z], or one for all of them")),
        }
    }

    /// Reads the elements of an array of any type.
    pub fn elements(&self, i: usize) -> Result<Cow<'a, [Value]>, Fault> {
        match self.get(i) {
            Value::List(xs) => Ok(Cow::Borrowed(xs)),
            Value::Array(xs) => Ok(Cow::Owned(xs.iter().map(|x| Value::Num(*x)).collect())),
            _ => Err(self.wrong(i, "an array")),
        }
    }

    /// Reads a record.
    pub fn record(&self, i: usize) -> Result<&'a Record, Fault> {
        match self.get(i) {
            Value::Record(r) => Ok(r),
            _ => Err(self.wrong(i, "a record")),
        }
    }

    /// Reads an object of type `T`; `wanted` describes it in messages.
    pub fn object<T: Object>(&self, i: usize, wanted: &str) -> Result<&'a T, Fault> {
        self.get(i).downcast::<T>().ok_or_else(|| self.wrong(i, wanted))
    }
}

/// Returns a number, or a bool as 0 or 1.
fn truth(v: &Value) -> Option<f64> {
    match v {
        Value::Num(x) => Some(*x),
        Value::Bool(b) => Some(f64::from(u8::from(*b))),
        _ => None,
    }
}

/// Describes a value by its type, and by the value itself if it is short.
fn described(v: &Value) -> String {
    match v {
        Value::Num(_) | Value::Bool(_) => format!("{} ({v})", v.type_name()),
        Value::Str(s) if s.chars().count() <= 40 => format!("{} ({v})", v.type_name()),
        v => v.type_name().to_owned(),
    }
}

fn quoted(options: &[&str]) -> String {
    options.iter().map(|o| format!("\"{o}\"")).collect::<Vec<_>>().join(", ")
}
