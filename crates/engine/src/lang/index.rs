//! Indexing of plain values: arrays by position, records by name, objects by field; and
//! the way back, for adjoints.

use super::adjoint::Adjoint;
use super::fault::{Fault, FaultKind};
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
    // The conversion saturates, and gives 0 for NaN; a comparison then fails.
    let i = x as i64;
    ((i as usize) < len && i as f64 == x).then_some(i as usize)
}

/// Returns the components `[x, y, z]` as a record with these names.
pub fn xyz(v: [f64; 3]) -> Value {
    Value::Record(Arc::new(
        ["x", "y", "z"].into_iter().map(Arc::from).zip(v.map(Value::Num)).collect(),
    ))
}

impl Adjoint {
    /// Adds to the part that indexing a value with these keys selects, one key after the
    /// other.
    pub fn add_at(&mut self, base: &Value, keys: &[Value], by: Adjoint) {
        let Some((key, rest)) = keys.split_first() else { return self.add(by) };
        if by.is_zero() {
            return;
        }
        match (base, key) {
            (Value::Array(_) | Value::List(_), Value::Num(i)) => {
                let (n, i) = (base.len().unwrap_or(0), *i as usize);
                let mut inner = Adjoint::Zero;
                inner.add_at(&base.element(i).unwrap_or_default(), rest, by);
                self.add_element(n, i, inner);
            }
            (Value::Array(_) | Value::List(_), Value::Array(at)) => {
                let n = base.len().unwrap_or(0);
                for (k, i) in at.iter().enumerate() {
                    // The remaining keys index into the array of selected elements.
                    let part = if rest.is_empty() { by.element(k) } else { Adjoint::Unknown };
                    self.add_element(n, *i as usize, part);
                }
            }
            (Value::Record(r), Value::Str(name)) => {
                let mut inner = Adjoint::Zero;
                inner.add_at(r.get(name).unwrap_or(&Value::Unit), rest, by);
                self.add_field(name, inner);
            }
            _ => *self = Adjoint::Unknown,
        }
    }

    /// Adds to the adjoint of element `i` of an array, or of field `i` of a record.
    pub fn add_position(&mut self, base: &Value, i: usize, by: Adjoint) {
        match base {
            Value::Record(r) => {
                if let Some((name, _)) = r.get_index(i) {
                    self.add_field(name, by);
                }
            }
            _ => self.add_element(base.len().unwrap_or(0), i, by),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indexing_goes_back_to_where_it_came_from() {
        let base = Value::record([("x", Value::array(vec![1.0, 2.0])), ("y", Value::Num(3.0))]);
        let mut a = Adjoint::Zero;
        a.add_at(&base, &[Value::str("x"), Value::Num(1.0)], Adjoint::Num(4.0));
        a.add_at(&base, &[Value::str("y")], Adjoint::Num(5.0));
        assert_eq!(a.field("x").numbers(2), [0.0, 4.0]);
        assert_eq!(a.field("y"), Adjoint::Num(5.0));
        let mut picked = Adjoint::Zero;
        let xs = Value::array(vec![1.0, 2.0, 3.0]);
        picked.add_at(
            &xs,
            &[Value::array(vec![2.0, 2.0, 0.0])],
            Adjoint::Array(vec![1.0, 10.0, 100.0]),
        );
        assert_eq!(picked.numbers(3), [100.0, 0.0, 11.0]);
        picked.add(Adjoint::Unknown);
        assert!(picked.is_unknown());
    }
}
