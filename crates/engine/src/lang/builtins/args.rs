//! Access to the arguments of a built-in, with errors that name the argument.

use super::builtin::{Args, Argument, Domain, Which};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::{MOST_ELEMENTS, Object, Record, Value};
use std::borrow::Cow;
use std::sync::Arc;

/// Numbers, borrowed if the value is already an array of numbers.
type Numbers<'a> = Cow<'a, [f64]>;

impl<'a> Args<'a> {
    /// Returns an argument, or its default if it is omitted.
    pub fn get(&self, i: impl Which) -> &'a Value {
        let i = i.position(&self.builtin.args);
        match self.values.get(i) {
            Some(v) if !matches!(v, Value::Unit) => v,
            _ => self.builtin.args.get(i).map_or(&Value::Unit, |a| &a.value),
        }
    }

    /// Returns whether the call itself gives an argument.
    pub fn is_written(&self, i: impl Which) -> bool {
        let value = self.values.get(i.position(&self.builtin.args));
        value.is_some_and(|v| !matches!(v, Value::Unit))
    }

    /// Returns whether an argument has a value, from the call or by default.
    pub fn given(&self, i: impl Which) -> bool {
        !matches!(self.get(i), Value::Unit)
    }

    fn declared(&self, i: impl Which) -> Option<&'a Argument> {
        let args = &self.builtin.args;
        args.get(i.position(args)).or(args.last())
    }

    fn name(&self, i: impl Which) -> &'a str {
        self.declared(i).map_or("argument", |a| &a.name)
    }

    fn domain(&self, i: impl Which) -> Domain {
        self.declared(i).map_or(Domain::Any, |a| a.domain)
    }

    /// The error that argument `i` does not have the required type.
    pub fn wrong(&self, i: impl Which, wanted: &str) -> Fault {
        let got = described(self.get(i));
        Fault::type_error(format!(
            "{}: `{}` must be {wanted}, got {got}",
            self.builtin.full_name(),
            self.name(i)
        ))
    }

    /// The error that argument `i` is an array with an unsuitable element.
    pub fn element_wrong(&self, i: impl Which, wanted: &str, found: &Value) -> Fault {
        let (name, got) = (self.builtin.full_name(), described(found));
        Fault::type_error(format!(
            "{name}: `{}` must be {wanted}, got an array with {got} in it",
            self.name(i)
        ))
    }

    /// The error that argument `i` has the wrong length.
    pub fn wrong_length(&self, i: impl Which, wanted: &str) -> Fault {
        let (name, got) = (self.builtin.full_name(), self.get(i).len().unwrap_or(0));
        Fault::type_error(format!("{name}: `{}` must have {wanted}, got {got}", self.name(i)))
    }

    /// The error that argument `i` is outside its domain.
    pub fn outside(&self, i: impl Which, rule: &str) -> Fault {
        let (name, got) = (self.builtin.full_name(), self.get(i));
        Fault::domain(format!("{name}: `{}` must be {rule}, got {got}", self.name(i)))
    }

    /// Reads a number.
    pub fn num(&self, i: impl Which) -> Result<f64, Fault> {
        let Value::Num(x) = self.get(i) else { return Err(self.wrong(i, "a number")) };
        let domain = self.domain(i);
        if domain.holds(*x) { Ok(*x) } else { Err(self.outside(i, &domain.to_string())) }
    }

    /// Reads a number, if there is one.
    pub fn num_if_given(&self, i: impl Which) -> Result<Option<f64>, Fault> {
        if self.given(i) { self.num(i).map(Some) } else { Ok(None) }
    }

    /// Reads a whole number within the declared bounds.
    pub fn int(&self, i: impl Which) -> Result<u32, Fault> {
        self.num(i).map(|x| x as u32)
    }

    /// Reads a whole number within bounds.
    pub fn int_in(&self, i: impl Which, lo: i64, hi: i64) -> Result<i64, Fault> {
        let Value::Num(x) = *self.get(i) else { return Err(self.wrong(i, "a number")) };
        if x == libm::trunc(x) && x >= lo as f64 && x <= hi as f64 {
            return Ok(x as i64);
        }
        Err(match hi {
            i64::MAX => self.outside(i, &format!("a whole number, at least {lo}")),
            _ => self.outside(i, &format!("a whole number from {lo} to {hi}")),
        })
    }

    /// Reads a truth value.
    pub fn bool(&self, i: impl Which) -> Result<bool, Fault> {
        match self.get(i) {
            Value::Bool(b) => Ok(*b),
            _ => Err(self.wrong(i, "a bool")),
        }
    }

    /// Reads a string.
    pub fn str(&self, i: impl Which) -> Result<&'a str, Fault> {
        match self.get(i) {
            Value::Str(s) => Ok(s),
            _ => Err(self.wrong(i, "a string")),
        }
    }

    /// Reads one of the declared words.
    pub fn word(&self, i: impl Which) -> Result<&'static str, Fault> {
        let s = self.str(i)?;
        let domain = self.domain(i);
        let words = if let Domain::Words(words) = domain { words } else { &[] };
        words.iter().copied().find(|word| *word == s).ok_or_else(|| {
            let f = self.wrong(i, &domain.to_string());
            match pcadlang_syntax::diag::nearest(s, words.iter().copied()) {
                Some(near) => f.with_hint(format!("did you mean \"{near}\"?")),
                None => f,
            }
        })
    }

    /// Reads an array of numbers.
    pub fn array(&self, i: impl Which) -> Result<Arc<[f64]>, Fault> {
        match self.get(i) {
            Value::Array(xs) => Ok(Arc::clone(xs)),
            Value::List(xs) if xs.is_empty() => Ok(Arc::from([])),
            _ => Err(self.wrong(i, "an array of numbers")),
        }
    }

    /// Reads an array of numbers or bools, which count as 0 and 1.
    pub fn numbers(&self, i: impl Which) -> Result<Cow<'a, [f64]>, Fault> {
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
    pub fn numbers_from(&self, i: impl Which, least: usize) -> Result<Cow<'a, [f64]>, Fault> {
        let xs = self.numbers(i)?;
        if xs.len() >= least {
            return Ok(xs);
        }
        let plural = if least == 1 { "" } else { "s" };
        Err(self.wrong_length(i, &format!("at least {least} element{plural}")))
    }

    /// Reads two arrays of numbers of equal length.
    pub fn number_pair(
        &self,
        i: impl Which,
        j: impl Which,
    ) -> Result<(Numbers<'a>, Numbers<'a>), Fault> {
        let (x, y) = (self.numbers(i)?, self.numbers(j)?);
        if x.len() == y.len() {
            return Ok((x, y));
        }
        Err(self.wrong_length(j, &format!("as many elements as `{}`, {}", self.name(i), x.len())))
    }

    /// Reads the number of elements of an array to create.
    pub fn count(&self, i: impl Which) -> Result<usize, Fault> {
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

    /// Reads a vector of three numbers, or one number for all three.
    pub fn vec3(&self, i: impl Which) -> Result<[f64; 3], Fault> {
        match self.get(i) {
            Value::Num(x) => Ok([*x; 3]),
            _ => match self.array(i)?[..] {
                [x, y, z] => Ok([x, y, z]),
                _ => Err(self.wrong_length(i, "3 numbers")),
            },
        }
    }

    /// Reads the elements of an array of any type.
    pub fn elements(&self, i: impl Which) -> Result<Cow<'a, [Value]>, Fault> {
        match self.get(i) {
            Value::List(xs) => Ok(Cow::Borrowed(xs)),
            Value::Array(xs) => Ok(Cow::Owned(xs.iter().map(|x| Value::Num(*x)).collect())),
            _ => Err(self.wrong(i, "an array")),
        }
    }

    /// Reads a record.
    pub fn record(&self, i: impl Which) -> Result<&'a Record, Fault> {
        match self.get(i) {
            Value::Record(r) => Ok(r),
            _ => Err(self.wrong(i, "a record")),
        }
    }

    /// Reads an object of type `T`; `wanted` describes it in messages.
    pub fn object<T: Object>(&self, i: impl Which, wanted: &str) -> Result<&'a T, Fault> {
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
