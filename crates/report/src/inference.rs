//! The results of a run in the groups of ArviZ's format: `posterior`, `sample_stats`,
//! `log_likelihood` and `observed_data`.
//!
//! An array has dimensions `NAME_dim_0`, `NAME_dim_1`, …. A record whose fields have one shape
//! is an array with a dimension `NAME_field`, whose coordinate is the names of the fields; the
//! fields of others are arrays of their own. Texts are numbers of categories, counted from 0, of
//! which the coordinate `NAME_level` is the list. Observed values have one dimension
//! `observation`, with their names as its coordinate. `/` in names becomes `.`, as in programs.

use super::ChainDraws;
use pcadlang_inference::draws::{Column, DrawRow, POINTWISE};
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
    let (arrays, names) = posterior(columns, &rows, &dims);
    let mut all = vec![names.iter().fold(Group::counted("posterior", arrays), Group::with)];
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

/// The arrays of the recorded quantities, and the coordinates that do not count.
fn posterior(
    columns: &[Column],
    rows: &[&DrawRow],
    dims: &[(String, usize)],
) -> (Vec<Array>, Vec<Array>) {
    let (mut taken, mut arrays, mut names) = (reserved(columns), Vec::new(), Vec::new());
    let (mut begin, mut rest) = (0, columns);
    while let Some(c) = rest.first() {
        let fields = record_at(columns, rest);
        let own = &rest[..fields.max(1)];
        rest = &rest[own.len()..];
        let (first, n) = (begin, c.shape.len());
        begin += n * own.len();
        if c.name == POINTWISE || n == 0 {
            continue;
        }
        let whole = if fields > 0 { c.name.rsplit_once('/').map_or("", |p| p.0) } else { &c.name };
        let name = name_of(whole, &mut taken);
        let sizes = c.shape.dims().iter().enumerate();
        let mut dims: Vec<(String, usize)> = dims
            .iter()
            .cloned()
            .chain(sizes.map(|(i, n)| (format!("{name}_dim_{i}"), *n)))
            .collect();
        if fields > 0 {
            let field = |c: &Column| c.name.rsplit('/').next().unwrap_or_default().to_owned();
            let texts = own.iter().map(field).collect();
            let coordinate = coordinate(&format!("{name}_field"), texts);
            dims.extend(coordinate.dims.clone());
            names.push(coordinate);
        }
        let value = |r: &DrawRow, i: usize| r.values[first + i % own.len() * n + i / own.len()];
        let all = rows.iter().flat_map(|r| (0..n * own.len()).map(|i| value(r, i)));
        let numbers = match c.levels.is_empty() {
            true => Numbers::Floats(all.collect()),
            false => {
                names.push(coordinate(&format!("{name}_level"), c.levels.clone()));
                let all: Vec<f64> = all.collect();
                match all.iter().any(|x| x.is_nan()) {
                    true => Numbers::Floats(all),
                    false => Numbers::Integers(all.iter().map(|x| *x as i64).collect()),
                }
            }
        };
        arrays.push(Array { name, dims, numbers });
    }
    (arrays, names)
}

/// A coordinate of texts.
fn coordinate(name: &str, texts: Vec<String>) -> Array {
    let dims = vec![(name.to_owned(), texts.len())];
    Array { name: name.into(), dims, numbers: Numbers::Texts(texts) }
}

/// The number of columns at the head of `rest` that are a whole record, whose fields are numbers
/// or arrays of one shape; 0 if there is none.
fn record_at(all: &[Column], rest: &[Column]) -> usize {
    fn record(c: &Column) -> Option<&str> {
        c.is_field.then(|| c.name.rsplit_once('/')).flatten().map(|(record, _)| record)
    }
    let Some(name) = rest.first().and_then(record) else { return 0 };
    let own = rest.iter().take_while(|c| record(c) == Some(name)).count();
    let inside = |c: &&Column| c.name.strip_prefix(name).is_some_and(|r| r.starts_with('/'));
    let same = |c: &Column| c.shape == rest[0].shape && c.levels.is_empty();
    let whole = all.iter().filter(inside).count() == own && rest[..own].iter().all(same);
    if whole { own } else { 0 }
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

/// The names of coordinates, in lower case, which a quantity of the same name would replace.
fn reserved(columns: &[Column]) -> HashSet<String> {
    let of = |c: &Column| {
        let whole = plain(&c.name).to_lowercase();
        let record = whole.rsplit_once('.').filter(|_| c.is_field).map(|(record, _)| record);
        let owners: Vec<String> =
            std::iter::once(&*whole).chain(record).map(str::to_owned).collect();
        let dims = c.shape.dims().len();
        let ends = (0..dims).map(|i| format!("_dim_{i}")).chain(["_field".into(), "_level".into()]);
        ends.flat_map(|end| owners.iter().map(|o| o.clone() + &end).collect::<Vec<_>>())
            .collect::<Vec<String>>()
    };
    let dims = ["chain", "draw"].map(str::to_owned);
    columns.iter().flat_map(of).chain(dims).collect()
}

/// Converts a name to one that is valid for a folder and differs from all names taken.
fn name_of(name: &str, taken: &mut HashSet<String>) -> String {
    let plain = plain(name);
    let mut all = std::iter::once(plain.clone()).chain((2..).map(|i| format!("{plain}_{i}")));
    all.find(|name| taken.insert(name.to_lowercase())).unwrap_or(plain)
}

/// Converts a name to one that is valid for a folder.
fn plain(name: &str) -> String {
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
    if plain.is_empty() || plain.starts_with('.') { format!("_{plain}") } else { plain }
}
