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

    /// True if it holds no numbers.
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

    /// True if rows of `width` numbers remain unchanged.
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
