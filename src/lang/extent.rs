//! Limits on the size and depth of values. Values are shared, so a short program can
//! build one with more elements than fit into any memory (`[x, x]` of `[x, x]` of …), and
//! deep nesting endangers every function that walks a value recursively.

use super::value::Value;

/// The maximum number of elements of a value, including those of its elements, and of an
/// array that a function builds at once.
pub const MOST_ELEMENTS: usize = 10_000_000;
/// The maximum nesting depth of arrays and records, distributions, and covariances.
pub const MOST_NESTED: u32 = 200;

/// Whether a value is within the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// It is.
    Fits,
    /// It has more than [`MOST_ELEMENTS`] elements.
    TooLarge,
    /// It is nested more deeply than [`MOST_NESTED`].
    TooDeep,
}

impl Value {
    /// Returns whether it is within the limits. The time is proportional to its elements,
    /// but does not depend on the numbers in arrays of numbers, and the search stops as
    /// soon as a limit is exceeded.
    pub fn extent(&self) -> Extent {
        let mut left = MOST_ELEMENTS;
        extent(self, MOST_NESTED, &mut left)
    }
}

fn extent(v: &Value, depth: u32, left: &mut usize) -> Extent {
    let elements = match v {
        Value::Array(xs) => xs.len(),
        Value::List(xs) => xs.len(),
        Value::Record(r) => r.len(),
        _ => return Extent::Fits,
    };
    let Some(depth) = depth.checked_sub(1) else { return Extent::TooDeep };
    match left.checked_sub(elements) {
        Some(rest) => *left = rest,
        None => return Extent::TooLarge,
    }
    let mut all = |parts: &mut dyn Iterator<Item = &Value>| {
        parts.map(|p| extent(p, depth, left)).find(|e| *e != Extent::Fits).unwrap_or(Extent::Fits)
    };
    match v {
        Value::List(xs) => all(&mut xs.iter()),
        Value::Record(r) => all(&mut r.values()),
        _ => Extent::Fits,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_and_size_are_bounded_where_they_are_said_to_be() {
        let wrap = |v: Value| Value::List(vec![v, Value::Unit].into());
        let nested = |n: u32| (0..n).fold(Value::Num(1.0), |v, _| wrap(v));
        assert_eq!(nested(MOST_NESTED).extent(), Extent::Fits);
        assert_eq!(nested(MOST_NESTED + 1).extent(), Extent::TooDeep);
        let shared = |n: u32| {
            (0..n).fold(Value::array(vec![1.0; 10]), |v, _| Value::List(vec![v.clone(), v].into()))
        };
        assert_eq!(shared(15).extent(), Extent::Fits);
        assert_eq!(shared(60).extent(), Extent::TooLarge);
        assert_eq!(Value::Num(1.0).extent(), Extent::Fits);
    }
}
