//! The results of a run in the groups of ArviZ's format: `posterior`, `sample_stats`,
//! `log_likelihood` and `observed_data`.
//!
//! A vector has a dimension `NAME_dim_0`; observed values have one dimension `observation`,
//! with their names as its coordinate. `/` in names becomes `.`, as in programs.

use super::ChainDraws;
use pcadlang_inference::draws::{Column, DrawRow, POINTWISE, Shape};
use std::collections::HashSet;

/// The name of an observed value, and the value; NaN if it is not a number.
pub type Point = (String, f64);

/// The elements of an array.
#[derive(Clone, Debug)]
pub enum Numbers {
    /// Numbers.
    Floats(Vec<f64>),
    /// Whole numbers.
    Integers(Vec<i64>),
    /// Truth values.
    Truths(Vec<bool>),
    /// Texts.
    Texts(Vec<String>),
}

/// An array of a group.
#[derive(Clone, Debug)]
pub struct Array {
    /// Its name.
    pub name: String,
    /// The names and lengths of its dimensions.
    pub dims: Vec<(String, usize)>,
    /// Its elements, row by row.
    pub numbers: Numbers,
}

/// A group of arrays, with a coordinate for each dimension.
#[derive(Clone, Debug)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Its coordinates and arrays, each coordinate with its own name as its only dimension.
    pub arrays: Vec<Array>,
}

impl Group {
    /// A group of arrays and, for each dimension, a coordinate that counts from 0.
    fn counted(name: &str, arrays: Vec<Array>) -> Group {
        let dims: indexmap::IndexSet<(String, usize)> =
            arrays.iter().flat_map(|a| a.dims.clone()).collect();
        let coordinate = |(dim, n): (String, usize)| Array {
            name: dim.clone(),
            dims: vec![(dim, n)],
            numbers: Numbers::Integers((0..n as i64).collect()),
        };
        let coordinates = dims.into_iter().map(coordinate);
        Group { name: name.into(), arrays: coordinates.chain(arrays).collect() }
    }

    /// The same with another coordinate in the place of the one that counts.
    fn with(mut self, coordinate: &Array) -> Group {
        self.arrays.retain(|a| a.name != coordinate.name);
        self.arrays.insert(0, coordinate.clone());
        self
    }
}

/// Returns the draws of a run's chains, which must have the same columns, with the step size
/// of each chain's Hamiltonian kernel if it has one, and the observed values. Chains without
/// draws are left out, and the others are cut to the length of the shortest.
pub fn groups(chains: &[ChainDraws], step_sizes: &[Option<f64>], points: &[Point]) -> Vec<Group> {
    let known = step_sizes.iter().copied().chain(std::iter::repeat(None));
    let (chains, step_sizes): (Vec<&ChainDraws>, Vec<Option<f64>>) =
        chains.iter().zip(known).filter(|(c, _)| !c.rows.is_empty()).unzip();
    let draws = chains.iter().map(|c| c.rows.len()).min().unwrap_or(0);
    let rows: Vec<&DrawRow> = chains.iter().flat_map(|c| &c.rows[..draws]).collect();
    let dims = vec![("chain".to_owned(), chains.len()), ("draw".to_owned(), draws)];
    let columns = chains.first().map_or(&[][..], |c| &c.columns);
    let mut all = vec![Group::counted("posterior", posterior(columns, &rows, &dims))];
    let mut stats = sample_stats(&rows, &dims);
    if step_sizes.iter().any(Option::is_some) {
        let each =
            step_sizes.iter().flat_map(|s| std::iter::repeat_n(s.unwrap_or(f64::NAN), draws));
        let numbers = Numbers::Floats(each.collect());
        stats.push(Array { name: "step_size".into(), dims: dims.clone(), numbers });
    }
    all.push(Group::counted("sample_stats", stats));
    if let Some((at, n)) = place_of(columns, POINTWISE).filter(|(_, n)| *n == points.len()) {
        let observation = vec![("observation".to_owned(), n)];
        let both = dims.iter().chain(&observation).cloned().collect();
        let scores = rows.iter().flat_map(|r| r.values[at..at + n].to_vec()).collect();
        let values = points.iter().map(|p| p.1).collect();
        let array = |dims, numbers| Array {
            name: "observed".into(),
            dims,
            numbers: Numbers::Floats(numbers),
        };
        let names = Numbers::Texts(points.iter().map(|p| p.0.clone()).collect());
        let names = Array { name: "observation".into(), dims: observation.clone(), numbers: names };
        for (group, array) in
            [("log_likelihood", array(both, scores)), ("observed_data", array(observation, values))]
        {
            all.push(Group::counted(group, vec![array]).with(&names));
        }
    }
    all
}

/// Returns the position of a column's numbers in a row, and how many there are.
fn place_of(columns: &[Column], name: &str) -> Option<(usize, usize)> {
    let before = columns.iter().position(|c| c.name == name)?;
    Some((columns[..before].iter().map(|c| c.shape.len()).sum(), columns[before].shape.len()))
}

fn posterior(columns: &[Column], rows: &[&DrawRow], dims: &[(String, usize)]) -> Vec<Array> {
    let (mut at, mut taken, mut all) = (0, HashSet::new(), Vec::new());
    for c in columns {
        let (begin, n) = (at, c.shape.len());
        at += n;
        if c.name == POINTWISE || n == 0 {
            continue;
        }
        let name = name_of(&c.name, &mut taken);
        let mut dims = dims.to_vec();
        if let Shape::Vector(n) = c.shape {
            dims.push((format!("{name}_dim_0"), n));
        }
        let numbers = rows.iter().flat_map(|r| r.values[begin..begin + n].to_vec()).collect();
        all.push(Array { name, dims, numbers: Numbers::Floats(numbers) });
    }
    all
}

fn sample_stats(rows: &[&DrawRow], dims: &[(String, usize)]) -> Vec<Array> {
    let array = |name: &str, numbers| Array { name: name.into(), dims: dims.to_vec(), numbers };
    let floats = |f: fn(&DrawRow) -> f64| Numbers::Floats(rows.iter().map(|r| f(r)).collect());
    vec![
        array("lp", floats(|r| r.log_joint)),
        array("log_prior", floats(|r| r.log_prior)),
        array("log_likelihood_sum", floats(|r| r.log_likelihood)),
        array("acceptance_rate", floats(|r| r.acceptance)),
        array("diverging", Numbers::Truths(rows.iter().map(|r| r.divergent > 0).collect())),
        array("step", Numbers::Integers(rows.iter().map(|r| r.step as i64).collect())),
    ]
}

/// Converts a name to one that is valid for a folder and differs from all names taken.
fn name_of(name: &str, taken: &mut HashSet<String>) -> String {
    let fits = |c: char| c.is_alphanumeric() || "_.-+[]()".contains(c);
    let plain: String = name
        .chars()
        .map(|c| {
            if c == '/' {
                '.'
            } else if fits(c) {
                c
            } else {
                '_'
            }
        })
        .collect();
    let plain =
        if plain.is_empty() || plain.starts_with('.') { format!("_{plain}") } else { plain };
    let mut all = std::iter::once(plain.clone()).chain((2..).map(|i| format!("{plain}_{i}")));
    all.find(|name| taken.insert(name.to_lowercase())).unwrap_or(plain)
}
