//! How large and how deep a value is. Values are shared, so that a short program can make
//! one that has more elements than any memory (`[x, x]` of `[x, x]` of …); and what is
//! nested deeply is a danger to every function that walks it.

use super::value::Value;

/// The most elements of a value, those of its elements counted, and of an array that a
/// function makes in one go.
pub const MOST_ELEMENTS: usize = 10_000_000;
/// How deep arrays and records, distributions, and covariances may be nested.
pub const MOST_NESTED: u32 = 200;

/// Whether a value can be handled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// It can.
    Fits,
    /// It has more than [`MOST_ELEMENTS`].
    TooLarge,
    /// It is nested deeper than [`MOST_NESTED`].
    TooDeep,
}

impl Value {
    /// Whether it is small and flat enough to be handled. Takes time in proportion to its
    /// elements, but not to the numbers in arrays of numbers, and stops where it is too
    /// large.
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
