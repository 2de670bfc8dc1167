//! The output of inference: draws, one row at a time, with their columns, and statistics of
//! the kernels.
//!
//! Draws flow into a [`Sink`], which decides where they go (a file, memory, a progress
//! line). Invariant: the number of values of every row is the [`width`] of the columns
//! announced last.

use super::plan::checkpoint::Checkpoint;
pub use super::stats::{KernelStats, SiteStats};
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io;
use std::ops::Range;

/// One recorded draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawRow {
    /// The chain, from 0.
    pub chain: u32,
    /// The draw within the chain, from 0.
    pub draw: u64,
    /// Kernel applications before it, including warm-up.
    pub step: u64,
    /// The natural logarithm of the joint density, up to a constant if the likelihood is
    /// unnormalised.
    pub log_joint: f64,
    /// The part of it from the random choices.
    pub log_prior: f64,
    /// The part of it from the observations.
    pub log_likelihood: f64,
    /// The acceptance rate since the previous draw; NaN if there were no proposals.
    pub acceptance: f64,
    /// Divergent trajectories since the previous draw.
    pub divergent: u64,
    /// The values of the columns, flattened.
    pub values: Vec<f64>,
}

/// Where the draws of one chain go.
pub trait Sink: Send {
    /// Announces the columns, before the first draw and again when a draw has more of
    /// them. Each earlier column is then among the new ones, possibly longer; earlier
    /// draws have NaN for what they lack ([`Layout`]).
    ///
    /// # Errors
    /// If they cannot be written.
    fn columns(&mut self, columns: &[Column]) -> io::Result<()>;

    /// Receives a draw.
    ///
    /// # Errors
    /// If it cannot be written.
    fn draw(&mut self, row: &DrawRow) -> io::Result<()>;

    /// Called when the chain has ended after `steps` kernel applications, with `warmup`
    /// before them, in `seconds` of wall time.
    ///
    /// # Errors
    /// If the sink cannot write this.
    fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()>;

    /// The checkpoint to resume from; called once, before all other methods. The sink
    /// already has the draws before it.
    ///
    /// # Errors
    /// If there is one that cannot be read.
    fn resume(&mut self) -> io::Result<Option<Checkpoint>> {
        Ok(None)
    }

    /// True if the sink stores checkpoints.
    fn takes_checkpoints(&self) -> bool {
        false
    }

    /// Stores a checkpoint. All draws before it must be stored as durably.
    ///
    /// # Errors
    /// If it cannot be written; the previous one must then be kept.
    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        let _ = checkpoint;
        Ok(())
    }
}

/// Discards draws, for chains that are observed by a callback.
#[derive(Clone, Copy, Debug, Default)]
pub struct Discard;

impl Sink for Discard {
    fn columns(&mut self, _: &[Column]) -> io::Result<()> {
        Ok(())
    }

    fn draw(&mut self, _: &DrawRow) -> io::Result<()> {
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }
}

/// The column of the log densities of the observed values, under the name that Stan
/// programs and ArviZ use.
pub const POINTWISE: &str = "log_lik";
/// The most observed values for which log densities are recorded.
pub const MOST_POINTS: usize = 1000;

/// The most different texts of a column; what comes after them is NaN.
pub const MOST_LEVELS: usize = 100;
/// The most numbers that differing sizes of an array may lead to; beyond them it is a vector.
const MOST_PADDED: usize = 100_000;

/// How many numbers a column holds in each draw.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shape {
    /// One.
    Scalar,
    /// The length of each dimension, at least one of them; 0 is possible. Numbers are in the
    /// order of nested lists: the last index changes first.
    Array(Vec<usize>),
}

impl Shape {
    /// How many numbers it holds.
    pub fn len(&self) -> usize {
        self.dims().iter().fold(1, |all, n| all.saturating_mul(*n))
    }

    /// True if it holds no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The lengths of its dimensions; none for a scalar.
    pub fn dims(&self) -> &[usize] {
        match self {
            Shape::Scalar => &[],
            Shape::Array(dims) => dims,
        }
    }

    /// The indices of each number, counted from 0, in their order.
    pub fn indices(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        (0..self.len()).map(|i| {
            let mut left = i;
            let mut at: Vec<usize> = self.dims().to_vec();
            for n in at.iter_mut().rev() {
                (left, *n) = (left / *n, left % *n);
            }
            at
        })
    }

    /// The smallest shape that holds both. An array and a scalar, and arrays with different
    /// numbers of dimensions, make a vector.
    fn with(&self, other: &Shape) -> Shape {
        match (self.dims(), other.dims()) {
            (a, b) if a == b => self.clone(),
            (a, b) if a.len() == b.len() && !a.is_empty() => {
                let dims: Vec<usize> = a.iter().zip(b).map(|(a, b)| *a.max(b)).collect();
                let all = dims.iter().try_fold(1usize, |n, d| n.checked_mul(*d));
                match all.is_some_and(|n| n <= MOST_PADDED.max(self.len() + other.len())) {
                    true => Shape::Array(dims),
                    false => Shape::Array(vec![self.len().max(other.len())]),
                }
            }
            (_, b) if !b.is_empty() && self.is_empty() => other.clone(),
            (a, _) if !a.is_empty() && other.is_empty() => self.clone(),
            _ => Shape::Array(vec![self.len().max(other.len())]),
        }
    }

    /// The place of a number of another shape in this one.
    fn place(&self, at: &[usize], number: usize) -> Option<usize> {
        if at.len() != self.dims().len() {
            return (number < self.len()).then_some(number);
        }
        let within = at.iter().zip(self.dims()).all(|(i, n)| i < n);
        within.then(|| at.iter().zip(self.dims()).fold(0, |all, (i, n)| all * n + i))
    }
}

/// A recorded quantity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name; parts of an address, and fields of records, are separated by `/`.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Of text, its different values so far: a number is the place of one of them, from 0.
    /// Empty for anything else.
    #[serde(default)]
    pub levels: Vec<String>,
    /// Whether the last part of its name is a field of a record.
    #[serde(default)]
    pub is_field: bool,
}

impl Column {
    /// A column of one number.
    pub fn scalar(name: impl Into<String>) -> Self {
        Column::new(name, Shape::Scalar)
    }

    /// A column of `n` numbers.
    #[doc(hidden)]
    pub fn vector(name: impl Into<String>, n: usize) -> Self {
        Column::new(name, Shape::Array(vec![n]))
    }

    /// A column of numbers.
    pub fn new(name: impl Into<String>, shape: Shape) -> Self {
        Column { name: name.into(), shape, levels: Vec::new(), is_field: false }
    }

    /// The name of each of its numbers, with indices counted from 0 as in the language:
    /// `R[1,0]`.
    pub fn elements(&self) -> impl Iterator<Item = String> + '_ {
        self.shape.indices().map(|at| match &at[..] {
            [] => self.name.clone(),
            at => {
                let at: Vec<String> = at.iter().map(usize::to_string).collect();
                format!("{}[{}]", self.name, at.join(","))
            }
        })
    }

    /// Whether one holds texts and the other numbers.
    fn differs_in_kind(&self, other: &Column) -> bool {
        !self.shape.is_empty()
            && !other.shape.is_empty()
            && self.levels.is_empty() != other.levels.is_empty()
    }

    /// Takes up what another column of this name holds.
    fn join(&mut self, other: &Column) {
        if self.differs_in_kind(other) {
            return;
        }
        for level in &other.levels {
            if !self.levels.contains(level) {
                self.levels.push(level.clone());
            }
        }
        self.shape = self.shape.with(&other.shape);
    }
}

/// How many numbers a row holds.
pub fn width(columns: &[Column]) -> usize {
    columns.iter().map(|c| c.shape.len()).sum()
}

/// Merges two lists of columns: those of the first in their order, then the others. If
/// both have a column, it has room for both, and the texts of both.
pub fn merged(a: &[Column], b: &[Column]) -> Vec<Column> {
    let mut all: IndexMap<&str, Column> = IndexMap::new();
    for c in a.iter().chain(b) {
        all.entry(&c.name).and_modify(|known| known.join(c)).or_insert_with(|| c.clone());
    }
    all.into_values().collect()
}

/// Maps the numbers of a row to their positions in a row with other columns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    places: Vec<Option<usize>>,
    /// Where texts have other numbers: positions in the new row, and the new number of each.
    codes: Vec<(Range<usize>, Vec<Option<usize>>)>,
}

impl Layout {
    /// Maps rows of the columns `from` to rows of the columns `to`, by name and index.
    pub fn new(from: &[Column], to: &[Column]) -> Layout {
        let mut begin = 0;
        let mut there: HashMap<&str, (usize, &Column)> = HashMap::new();
        for c in from {
            there.entry(&c.name).or_insert((begin, c));
            begin += c.shape.len();
        }
        let (mut places, mut codes) = (Vec::new(), Vec::new());
        for c in to {
            let known = there.get(c.name.as_str()).filter(|(_, old)| !c.differs_in_kind(old));
            let Some((begin, old)) = known else {
                places.resize(places.len() + c.shape.len(), None);
                continue;
            };
            let place = |(i, at): (usize, Vec<usize>)| old.shape.place(&at, i).map(|p| begin + p);
            let first = places.len();
            places.extend(c.shape.indices().enumerate().map(place));
            if !c.levels.starts_with(&old.levels) {
                let number = |level| c.levels.iter().position(|l| l == level);
                codes.push((first..places.len(), old.levels.iter().map(number).collect()));
            }
        }
        Layout { places, codes }
    }

    /// True if rows of `width` numbers remain unchanged.
    pub fn is_same(&self, width: usize) -> bool {
        let mut all = self.places.iter().enumerate();
        self.codes.is_empty() && self.places.len() == width && all.all(|(i, from)| *from == Some(i))
    }

    /// The row in the new columns, with NaN for numbers that it lacks.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let value =
            |from: &Option<usize>| from.and_then(|i| values.get(i)).copied().unwrap_or(f64::NAN);
        let mut row: Vec<f64> = self.places.iter().map(value).collect();
        for (places, codes) in &self.codes {
            for x in &mut row[places.clone()] {
                let code = (*x >= 0.0).then(|| codes.get(*x as usize).copied().flatten()).flatten();
                *x = code.map_or(f64::NAN, |n| n as f64);
            }
        }
        row
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

    #[test]
    fn arrays_grow_in_each_dimension() {
        let table = |rows, columns| Column::new("m", Shape::Array(vec![rows, columns]));
        let all = merged(&[table(1, 2)], &[table(2, 1)]);
        assert_eq!(all, [table(2, 2)]);
        let row = Layout::new(&[table(1, 2)], &all).apply(&[1.0, 2.0]);
        assert!(row[..2] == [1.0, 2.0] && row[2..].iter().all(|x| x.is_nan()));
        let row = Layout::new(&[table(2, 1)], &all).apply(&[1.0, 2.0]);
        assert!(row[0] == 1.0 && row[2] == 2.0 && row[1].is_nan() && row[3].is_nan());
        let names: Vec<String> = table(2, 2).elements().collect();
        assert_eq!(names, ["m[0,0]", "m[0,1]", "m[1,0]", "m[1,1]"]);
        // A list that was empty has no number of dimensions yet.
        assert_eq!(merged(&[Column::vector("m", 0)], &[table(2, 3)]), [table(2, 3)]);
        // Long in one direction each: no room for all combinations.
        let long = merged(&[table(1, 100_000)], &[table(100_000, 1)]);
        assert_eq!(long, [Column::vector("m", 100_000)]);
    }

    #[test]
    fn texts_keep_their_meaning() {
        let text = |levels: &[&str]| Column {
            levels: levels.iter().map(|s| (*s).to_owned()).collect(),
            ..Column::scalar("kind")
        };
        let (one, two) = ([text(&["cup", "vase"])], [text(&["lamp", "cup"])]);
        let all = merged(&one, &two);
        assert_eq!(all, [text(&["cup", "vase", "lamp"])]);
        assert!(Layout::new(&one, &all).is_same(1), "what was written stays as it is");
        let layout = Layout::new(&two, &all);
        assert_eq!([0.0, 1.0].map(|x| layout.apply(&[x])[0]), [2.0, 0.0]);
        assert!(layout.apply(&[f64::NAN])[0].is_nan() && layout.apply(&[7.0])[0].is_nan());
        // A number never becomes a text.
        let number = [Column::scalar("kind")];
        assert_eq!(merged(&number, &one), number);
        assert!(Layout::new(&number, &one).apply(&[1.0])[0].is_nan());
    }
}
