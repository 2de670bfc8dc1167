//! Indexing of plain values: arrays by position, records by name, objects by field.

use super::error::{Fault, FaultKind};
use super::value::Value;
use std::sync::Arc;

/// Returns `base[key]` or `base.key`. An array of positions selects that many elements.
///
/// # Errors
/// If a position or name does not exist, or the value cannot be indexed.
pub fn index_value(base: &Value, key: &Value) -> Result<Value, Fault> {
    match (base, key) {
        (Value::Array(_) | Value::List(_), Value::Num(x)) => position(base, *x),
        // The same as the arm below, without a value for each number.
        (Value::Array(xs), Value::Array(at))
            if at.iter().all(|x| place(xs.len(), *x).is_some()) =>
        {
            Ok(Value::Array(at.iter().map(|x| xs[*x as usize]).collect()))
        }
        (Value::Array(_) | Value::List(_), Value::Array(at)) => {
            let picked: Result<Vec<Value>, Fault> = at.iter().map(|x| position(base, *x)).collect();
            picked.map(Value::from_elements)
        }
        (Value::Record(r), Value::Str(name)) => r.get(name).cloned().ok_or_else(|| {
            let fault = Fault::new(FaultKind::Index, format!("the record has no field `{name}`"));
            fault.with_nearest(name, "its fields are", r.keys().map(|k| &**k))
        }),
        (Value::Object(o), Value::Str(name)) => o.field(name).ok_or_else(|| {
            Fault::new(FaultKind::Index, format!("{} has no field `{name}`", o.type_name()))
        }),
        (Value::Array(_) | Value::List(_), k) => Err(Fault::type_error(format!(
            "an array index must be a number, not {}",
            k.type_name()
        ))),
        (Value::Record(_), k) => {
            Err(Fault::type_error(format!("a record index must be a name, not {}", k.type_name())))
        }
        (b, _) => Err(Fault::type_error(format!("{} has no elements or fields", b.type_name()))),
    }
}

fn position(base: &Value, x: f64) -> Result<Value, Fault> {
    let len = base.len().unwrap_or(0);
    let fail = |why: String| Err(Fault::new(FaultKind::Index, why));
    if let Some(i) = place(len, x) {
        return base.element(i).map_or_else(|| fail("no such element".into()), Ok);
    }
    if x != libm::trunc(x) {
        let message = format!("an array index must be a whole number, got {x}");
        return Err(
            Fault::new(FaultKind::Index, message).with_hint("floor(x) and round(x) give one")
        );
    }
    let range = match len {
        0 => "it is empty".to_owned(),
        _ => format!("its indices run from 0 to {}", len - 1),
    };
    Err(Fault::new(FaultKind::Index, format!("no element {x} in an array of length {len}"))
        .with_hint(range))
}

/// Returns `x` as an index into `len` elements, if it is one.
pub(crate) fn place(len: usize, x: f64) -> Option<usize> {
    // The conversion saturates, and gives 0 for NaN; the comparison then fails.
    let i = x as usize;
    (i < len && i as f64 == x).then_some(i)
}

/// Returns the components `[x, y, z]` as a record with these names.
pub fn xyz(v: [f64; 3]) -> Value {
    Value::Record(Arc::new(
        ["x", "y", "z"].into_iter().map(Arc::from).zip(v.map(Value::Num)).collect(),
    ))
}
