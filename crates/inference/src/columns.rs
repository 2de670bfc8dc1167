//! The columns of recorded draws: names, shapes, and how draws with fewer columns are
//! fitted to those with more.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// The column of the log densities of the observed values, under the name that Stan
/// programs and ArviZ use.
pub const POINTWISE: &str = "log_lik";
/// The most observed values for which log densities are recorded.
pub const MOST_POINTS: usize = 1000;

/// How many numbers a column holds in each draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shape {
    /// One.
    Scalar,
    /// A fixed number of them, which may be 0.
    Vector(usize),
}

impl Shape {
    /// How many numbers it holds.
    pub fn len(self) -> usize {
        match self {
            Shape::Scalar => 1,
            Shape::Vector(n) => n,
        }
    }

    /// Whether it holds no numbers.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
}

/// A recorded quantity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name; parts of an address are separated by `/`.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
}

impl Column {
    /// A column of one number.
    pub fn scalar(name: impl Into<String>) -> Self {
        Column { name: name.into(), shape: Shape::Scalar }
    }

    /// A column of `n` numbers.
    #[doc(hidden)]
    pub fn vector(name: impl Into<String>, n: usize) -> Self {
        Column { name: name.into(), shape: Shape::Vector(n) }
    }
}

/// How many numbers a row holds.
pub fn width(columns: &[Column]) -> usize {
    columns.iter().map(|c| c.shape.len()).sum()
}

/// Merges two lists of columns: those of the first in their order, then the others. If
/// both have a column, its shape is the longer one.
pub fn merged(a: &[Column], b: &[Column]) -> Vec<Column> {
    let mut all: IndexMap<&str, Shape> = IndexMap::new();
    for c in a.iter().chain(b) {
        let shape = all.entry(&c.name).or_insert(c.shape);
        if c.shape.len() > shape.len() || c.shape == Shape::Vector(shape.len()) {
            *shape = c.shape;
        }
    }
    all.into_iter().map(|(name, shape)| Column { name: name.into(), shape }).collect()
}

/// Maps the numbers of a row to their positions in a row with other columns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout(Vec<Option<usize>>);

impl Layout {
    /// Maps rows of the columns `from` to rows of the columns `to`, by name.
    pub fn new(from: &[Column], to: &[Column]) -> Layout {
        let mut begin = 0;
        let mut places: HashMap<&str, std::ops::Range<usize>> = HashMap::new();
        for c in from {
            places.entry(&c.name).or_insert(begin..begin + c.shape.len());
            begin += c.shape.len();
        }
        let place = |c: &Column| {
            let there = places.get(c.name.as_str()).cloned().unwrap_or_default();
            (0..c.shape.len()).map(move |i| (i < there.len()).then_some(there.start + i))
        };
        Layout(to.iter().flat_map(place).collect())
    }

    /// Whether rows of `width` numbers remain unchanged.
    pub fn is_same(&self, width: usize) -> bool {
        self.0.len() == width && self.0.iter().enumerate().all(|(i, from)| *from == Some(i))
    }

    /// The row in the new columns, with NaN for numbers that it lacks.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let value =
            |from: &Option<usize>| from.and_then(|i| values.get(i)).copied().unwrap_or(f64::NAN);
        self.0.iter().map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_find_their_numbers_in_more_columns() {
        let few = [Column::scalar("a"), Column::vector("w", 2), Column::vector("e", 0)];
        let more = [Column::vector("w", 3), Column::scalar("z"), Column::vector("e", 1)];
        let all = merged(&few, &more);
        let wanted = [
            Column::scalar("a"),
            Column::vector("w", 3),
            Column::vector("e", 1),
            Column::scalar("z"),
        ];
        assert_eq!(all, wanted);
        let row = Layout::new(&few, &all).apply(&[1.0, 2.0, 3.0]);
        assert_eq!((&row[..3], row.len()), (&[1.0, 2.0, 3.0][..], 6));
        assert!(row[3..].iter().all(|x| x.is_nan()));
        let row = Layout::new(&more, &all).apply(&[5.0, 6.0, 7.0, 8.0, 9.0]);
        assert!(row[0].is_nan() && row[1..] == [5.0, 6.0, 7.0, 9.0, 8.0]);
        assert!(Layout::new(&all, &all).is_same(6) && !Layout::new(&all, &few).is_same(6));
        // A scalar that is a list in other draws becomes the list's first element.
        assert_eq!(
            merged(&[Column::scalar("x")], &[Column::vector("x", 1)]),
            [Column::vector("x", 1)]
        );
    }
}
