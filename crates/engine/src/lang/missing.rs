//! Entries of tables without a usable value: missing ones, and those that cannot be read. A
//! table with some is read all the same, since their columns may never be used; using one is
//! an error that says where it is.

use super::fault::{Fault, FaultKind};
use super::value::{Object, Value};
use std::any::Any;
use std::sync::Arc;

/// An entry of a column whose other entries have values.
#[derive(Clone, Debug)]
pub struct Missing {
    /// The file.
    pub file: Arc<str>,
    /// The name of the column.
    pub name: Arc<str>,
    /// The line and the column in the file, from 1.
    pub at: (usize, usize),
    /// The text of the entry.
    pub text: Box<str>,
    /// Why it is missing.
    pub why: Why,
}

/// Why an entry is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// It is left out.
    Absent,
    /// It is a number with a decimal comma.
    Comma,
    /// It is a number that is too large.
    Huge,
    /// It is something else than the rest of the column.
    Other,
}

impl Object for Missing {
    fn type_name(&self) -> &'static str {
        match self.why {
            Why::Absent => "a missing entry",
            _ => "an unreadable entry",
        }
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn numbers(&self) -> Option<Vec<f64>> {
        Some(vec![f64::NAN])
    }
}

impl Missing {
    /// Returns the first such entry in a value, its elements and its fields.
    pub fn first_in(v: &Value) -> Option<&Missing> {
        match v {
            Value::Object(_) => v.downcast(),
            Value::List(xs) => xs.iter().find_map(Missing::first_in),
            Value::Record(r) => r.values().find_map(Missing::first_in),
            _ => None,
        }
    }

    /// The error of using it.
    pub fn fault(&self) -> Fault {
        let Missing { file, name, at: (line, column), text, .. } = self;
        let (what, hint) = match self.why {
            Why::Absent => (
                if text.is_empty() { "is empty".into() } else { format!("is missing (`{text}`)") },
                "leave the row out, or model the entry: if is_missing(d.y[i]) { … } else \
                 { observe normal(m, s) = d.y[i] as y; }"
                    .to_owned(),
            ),
            Why::Comma => {
                (format!("has a comma (`{text}`)"), format!("write {}", text.replace(',', ".")))
            }
            Why::Huge => (
                format!("is out of range (`{text}`)"),
                "numbers go up to 1.8e308; write the logarithm, or another unit".into(),
            ),
            Why::Other => (
                format!("is not a number (`{text}`), though most of the column are"),
                "correct it, or write NA for a missing entry".into(),
            ),
        };
        let message = format!("{file}, line {line}, column {column}: the entry of `{name}` {what}");
        Fault::new(FaultKind::Missing, message).with_hint(hint)
    }
}

/// True if a value is missing: an entry that was left out, `nothing` or NaN.
///
/// # Errors
/// If it is an entry that cannot be read, which is a mistake in the file.
pub(crate) fn is_missing(v: &Value) -> Result<Value, Fault> {
    let missing = match v {
        Value::Array(xs) => {
            return Ok(Value::List(xs.iter().map(|x| Value::Bool(x.is_nan())).collect()));
        }
        Value::List(xs) => {
            return xs.iter().map(is_missing).collect::<Result<_, _>>().map(Value::List);
        }
        Value::Num(x) => x.is_nan(),
        Value::Unit => true,
        v => match v.downcast::<Missing>() {
            Some(m) if m.why == Why::Absent => true,
            Some(m) => return Err(m.fault()),
            None => false,
        },
    };
    Ok(Value::Bool(missing))
}
