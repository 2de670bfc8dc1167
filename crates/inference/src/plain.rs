//! Values of plans that are plain data, and can be serialised.

use pcadlang_engine::lang::value::Value;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A number, truth value, string, array or record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Plain {
    Unit,
    Num(f64),
    Bool(bool),
    Str(Arc<str>),
    Array(Arc<[f64]>),
    List(Vec<Plain>),
    Record(Vec<(Arc<str>, Plain)>),
}

impl Plain {
    /// The value as plain data; `None` if it contains anything else, such as a function,
    /// a distribution or an object.
    pub fn of(value: &Value) -> Option<Plain> {
        Some(match value {
            Value::Unit => Plain::Unit,
            Value::Num(x) => Plain::Num(*x),
            Value::Bool(b) => Plain::Bool(*b),
            Value::Str(s) => Plain::Str(Arc::clone(s)),
            Value::Array(xs) => Plain::Array(Arc::clone(xs)),
            Value::List(xs) => Plain::List(xs.iter().map(Plain::of).collect::<Option<_>>()?),
            Value::Record(r) => {
                let field = |(k, v): (&Arc<str>, &Value)| Some((Arc::clone(k), Plain::of(v)?));
                Plain::Record(r.iter().map(field).collect::<Option<_>>()?)
            }
            _ => return None,
        })
    }

    /// Converts back to a value.
    pub fn value(&self) -> Value {
        match self {
            Plain::Unit => Value::Unit,
            Plain::Num(x) => Value::Num(*x),
            Plain::Bool(b) => Value::Bool(*b),
            Plain::Str(s) => Value::Str(Arc::clone(s)),
            Plain::Array(xs) => Value::Array(Arc::clone(xs)),
            Plain::List(xs) => Value::List(xs.iter().map(Plain::value).collect()),
            Plain::Record(r) => {
                Value::Record(Arc::new(r.iter().map(|(k, v)| (Arc::clone(k), v.value())).collect()))
            }
        }
    }
}
