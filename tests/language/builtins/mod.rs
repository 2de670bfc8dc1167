//! Tests of the built-ins through the table, as programs call them.

mod gradients;
mod lists;
mod maths;
mod objects;
mod operators;
mod search;
mod table;

use pcadlang::Value;
use pcadlang_engine::lang::builtins::{Args, Builtin, Kind, Table};
use pcadlang_engine::lang::error::Fault;
use std::sync::{Arc, LazyLock};

static TABLE: LazyLock<Arc<Table>> = LazyLock::new(pcadlang_library::standard::table);

/// A built-in by `module.name` or `name`.
fn find(name: &str) -> &'static Builtin {
    let (module, short) = match name.split_once('.') {
        Some((m, n)) if !m.is_empty() && !n.is_empty() => (m, n),
        _ => ("", name),
    };
    TABLE.get(TABLE.find(module, short).unwrap_or_else(|| panic!("no built-in {name}")))
}

/// Calls a function with arguments by position.
fn try_call(name: &str, values: &[Value]) -> Result<Value, Fault> {
    let builtin = find(name);
    let order = builtin.match_names(values.iter().map(|_| None)).map_err(Fault::type_error)?;
    let values: Vec<&Value> =
        order.iter().map(|i| i.map_or(&Value::Unit, |i| &values[i])).collect();
    let args = Args { builtin, values: &values };
    match builtin.kind {
        Kind::Function(f) => f(&args),
        Kind::Distribution(f) => f(&args).map(|d| Value::Dist(d.into())),
        Kind::Form(_) | Kind::Plan(_) => panic!("{name} is no function"),
    }
}

/// The same, of a call that must succeed.
fn call(name: &str, values: &[Value]) -> Value {
    try_call(name, values).unwrap_or_else(|f| panic!("{name}: {}", f.message))
}

/// The message, and hint if any, of a call that must fail.
fn fails(name: &str, values: &[Value]) -> String {
    match try_call(name, values) {
        Ok(v) => panic!("{name} gave {v}"),
        Err(Fault { message, hint: Some(hint), .. }) => format!("{message} ({hint})"),
        Err(f) => f.message,
    }
}

fn num(x: f64) -> Value {
    Value::Num(x)
}

fn arr(xs: &[f64]) -> Value {
    Value::array(xs.to_vec())
}

fn list(xs: &[Value]) -> Value {
    Value::List(xs.to_vec().into())
}

fn bools(xs: &[bool]) -> Value {
    Value::List(xs.iter().map(|b| Value::Bool(*b)).collect())
}

/// Asserts that two values are bit-identical.
#[track_caller]
fn same(got: Value, wanted: Value) {
    assert!(got.same(&wanted), "got {got}, wanted {wanted}");
}

/// Asserts that a number is within a relative error of 1e-15 (absolute below 1).
#[track_caller]
fn near(got: Value, wanted: f64) {
    let Value::Num(x) = got else { panic!("got {got}") };
    assert!((x - wanted).abs() <= 1e-15 * wanted.abs().max(1.0), "got {x}, wanted {wanted}");
}
