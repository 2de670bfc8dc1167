//! The draws of a chain in memory, and the scalar quantities in them.

use super::table::number;
use pcadlang_inference::diagnostics::{Summary, summary};
use pcadlang_inference::draws::{Column, DrawRow, Layout, POINTWISE, Shape, merged, width};
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;

/// The draws of one chain.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainDraws {
    /// Key-value pairs about the chain (settings, counts), as in the file of draws.
    pub comments: Vec<(String, String)>,
    /// The recorded quantities.
    pub columns: Vec<Column>,
    /// The draws, in order.
    pub rows: Vec<DrawRow>,
    /// One of every `every` draws is kept: 1, unless there was not enough room for all.
    pub every: u64,
}

impl Default for ChainDraws {
    fn default() -> Self {
        ChainDraws { comments: Vec::new(), columns: Vec::new(), rows: Vec::new(), every: 1 }
    }
}

impl Quantity {
    /// Makes a quantity of the draws of each chain, which are not numbers of categories.
    pub fn new(name: &str, column: Option<usize>, chains: Vec<Vec<f64>>) -> Quantity {
        let summary = summary(&chains);
        let sizes = [summary.mean, summary.q05, summary.q95].map(f64::abs);
        let size = sizes.into_iter().filter(|x| x.is_finite()).fold(0.0, f64::max);
        Quantity {
            name: name.into(),
            column,
            chains,
            summary,
            levels: Vec::new(),
            frequent: None,
            noise: ROUNDING * size,
        }
    }

    /// Formats a number about it, with 0 for what is only the error of rounding.
    pub fn number(&self, x: f64) -> String {
        number(if x.abs() < self.noise { 0.0 } else { x })
    }

    /// Returns whether all draws are the same number.
    pub(super) fn is_constant(&self) -> bool {
        let mut all = self.chains.iter().flatten();
        all.next().is_some_and(|first| all.all(|x| x == first))
    }

    /// Returns the reason why R-hat is undefined; `None` if it is defined.
    pub fn why_no_r_hat(&self) -> Option<&'static str> {
        if !self.summary.r_hat.is_nan() {
            return None;
        }
        let draws = || self.chains.iter().flatten();
        Some(match () {
            () if self.drawn().count() < 2 => "a single chain",
            () if self.drawn().any(|c| c.len() < 4) => "fewer than 4 draws per chain",
            () if draws().any(|x| x.is_nan()) => "it is missing from some draws",
            () if !draws().all(|x| x.is_finite()) => "it is infinite in some draws",
            () if self.is_stuck() => {
                "it never moved in any chain, and the chains have different values"
            }
            () => "it never moved",
        })
    }

    /// The chains that have draws.
    pub(super) fn drawn(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.chains.iter().filter(|c| !c.is_empty())
    }

    /// Returns whether each chain is constant, but not all of them at the same value.
    #[doc(hidden)]
    pub fn is_stuck(&self) -> bool {
        let same = |xs: &[f64]| xs.windows(2).all(|w| w[0].to_bits() == w[1].to_bits());
        let firsts: Vec<f64> = self.chains.iter().filter_map(|c| c.first().copied()).collect();
        self.chains.iter().all(|c| same(c)) && !same(&firsts)
    }
}

impl ChainDraws {
    /// Converts the draws to other columns, by name.
    #[doc(hidden)]
    pub fn widen(&mut self, columns: Vec<Column>) {
        let layout = Layout::new(&self.columns, &columns);
        if !layout.is_same(width(&self.columns)) {
            self.rows.iter_mut().for_each(|r| r.values = layout.apply(&r.values));
        }
        self.columns = columns;
    }

    /// Drops the log densities of single observed values.
    #[doc(hidden)]
    pub fn drop_pointwise(&mut self) {
        let others = self.columns.iter().filter(|c| c.name != POINTWISE);
        self.widen(others.cloned().collect());
    }
}

/// Converts all chains to the union of their columns, with NaN where a draw lacks one.
pub fn widen(chains: &mut [ChainDraws]) {
    let Some(all) = common(chains) else { return };
    chains.iter_mut().for_each(|c| c.widen(all.clone()));
}

/// Returns the union of the columns of all chains, if they are not all the same.
fn common(chains: &[ChainDraws]) -> Option<Vec<Column>> {
    let mut each = chains.iter().map(|c| &c.columns).filter(|c| !c.is_empty());
    let first = each.next()?;
    let others: Vec<_> = each.filter(|c| *c != first).collect();
    (!others.is_empty()).then(|| others.into_iter().fold(first.clone(), |all, c| merged(&all, c)))
}

/// One number per draw, over all chains.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Its name: that of the column, with `[i]` (counted from 0, as in the language) for
    /// an element of a vector.
    pub name: String,
    /// The column it belongs to; `None` for the log joint density.
    pub column: Option<usize>,
    /// The draws, `[chain][draw]`.
    pub chains: Vec<Vec<f64>>,
    /// The summary of the draws.
    pub summary: Summary,
    /// Of text, its different values; a draw is the place of one, counted from 0.
    pub levels: Vec<String>,
    /// The most frequent value, if values are numbers of categories, which have no mean.
    pub frequent: Option<Frequent>,
    /// Smaller numbers are errors of rounding, beside the other elements of its array.
    noise: f64,
}

/// The error of rounding, relative to the largest number of a quantity.
const ROUNDING: f64 = 1e-12;

/// The most frequent of several values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Frequent {
    /// The value; the smallest, if several are as frequent.
    pub value: f64,
    /// What it stands for, if it is a text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// The fraction of draws with that value.
    pub share: f64,
}

impl Frequent {
    /// Returns the most frequent number, with its text; `None` if there are none, or one is NaN.
    pub(super) fn of<'a>(
        numbers: impl Iterator<Item = &'a f64>,
        levels: &[String],
    ) -> Option<Frequent> {
        let mut all: Vec<f64> = numbers.copied().collect();
        all.sort_by(f64::total_cmp);
        if all.last()?.is_nan() {
            return None;
        }
        let mut most = (0, 0.0);
        for run in all.chunk_by(|a, b| a == b) {
            if run.len() > most.0 {
                most = (run.len(), run[0]);
            }
        }
        let text = levels.get(most.1 as usize).cloned();
        Some(Frequent { value: most.1, text, share: most.0 as f64 / all.len() as f64 })
    }
}

impl fmt::Display for Frequent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.text.clone().unwrap_or_else(|| number(self.value));
        write!(f, "{value} ({:.0}%)", 100.0 * self.share)
    }
}

/// Marks the quantities whose values are numbers of categories, by their names.
pub fn mark_categories(quantities: &mut [Quantity], is: impl Fn(&str) -> bool) {
    for q in quantities.iter_mut().filter(|q| is(&q.name)) {
        q.frequent = Frequent::of(q.chains.iter().flatten(), &q.levels);
    }
}

/// Returns every scalar quantity of the chains with its summary, starting with the log
/// joint density (`log_joint`). The columns are the union of those of all chains, with
/// NaN where a draw lacks one. A column that repeats the log joint density, in the draws that
/// have it, is left out, and so are the log densities of single observed values.
pub fn quantities(chains: &[ChainDraws]) -> Vec<Quantity> {
    let mut chains = Cow::Borrowed(chains);
    if common(&chains).is_some() {
        widen(chains.to_mut());
    }
    let chains = &chains[..];
    let quantity = |name: String, column, value: &dyn Fn(&DrawRow) -> Option<f64>| {
        let series: Vec<Vec<f64>> =
            chains.iter().map(|c| c.rows.iter().filter_map(value).collect()).collect();
        Quantity::new(&name, column, series)
    };
    let mut out = vec![quantity("log_joint".into(), None, &|r| Some(r.log_joint))];
    let columns = chains.iter().map(|c| &c.columns[..]).find(|c| !c.is_empty()).unwrap_or_default();
    let mut at = 0;
    for (index, column) in columns.iter().enumerate() {
        if column.name == POINTWISE {
            // One column per observed value, for model comparison (`az.loo`); these are
            // not posterior quantities.
            at += column.shape.len();
            continue;
        }
        if column.name == out[0].name && column.shape == Shape::Scalar && repeats(chains, at) {
            at += 1;
            continue;
        }
        let first = out.len();
        for name in column.elements() {
            let mut q = quantity(name, Some(index), &|r| r.values.get(at).copied());
            if !column.levels.is_empty() {
                q.frequent = Frequent::of(q.chains.iter().flatten(), &column.levels);
                q.levels.clone_from(&column.levels);
            }
            out.push(q);
            at += 1;
        }
        let noise = out[first..].iter().map(|q| q.noise).fold(0.0, f64::max);
        out[first..].iter_mut().for_each(|q| q.noise = noise);
    }
    out
}

/// Returns whether the numbers at index `at` of all rows are the log joint density, or NaN in
/// rows that lack the column.
fn repeats(chains: &[ChainDraws], at: usize) -> bool {
    let mut rows = chains.iter().flat_map(|c| &c.rows);
    let same = |x: f64, r: &DrawRow| x.is_nan() || x.to_bits() == r.log_joint.to_bits();
    rows.all(|r| r.values.get(at).is_some_and(|x| same(*x, r)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_joint_density_is_there_once() {
        let row = |x: f64, said: f64| DrawRow {
            log_joint: x,
            values: vec![said, 7.0],
            ..DrawRow::default()
        };
        let chain = |rows| ChainDraws {
            columns: vec![Column::scalar("log_joint"), Column::scalar("b")],
            rows,
            ..Default::default()
        };
        let names = |c: ChainDraws| {
            quantities(&[c]).into_iter().map(|q| (q.name, q.chains)).collect::<Vec<_>>()
        };
        let one = names(chain(vec![row(1.0, 1.0), row(2.0, 2.0)]));
        assert_eq!(
            one,
            [("log_joint".into(), vec![vec![1.0, 2.0]]), ("b".into(), vec![vec![7.0, 7.0]])]
        );
        assert_eq!(
            names(chain(vec![row(1.0, 1.0), row(2.0, 3.0)])).len(),
            3,
            "another thing of that name stays"
        );
        // A chain that collects something else lacks the column.
        let other = ChainDraws {
            columns: vec![Column::scalar("b")],
            rows: vec![DrawRow { log_joint: 3.0, values: vec![8.0], ..DrawRow::default() }],
            ..Default::default()
        };
        let both = quantities(&[chain(vec![row(1.0, 1.0)]), other]);
        assert_eq!(both.iter().map(|q| &*q.name).collect::<Vec<_>>(), ["log_joint", "b"]);
        assert_eq!(both[0].chains, [[1.0], [3.0]]);
    }

    #[test]
    fn arrays_texts_and_constants_are_shown_as_they_are() {
        let columns = vec![
            Column::new("R", Shape::Array(vec![2, 2])),
            Column { levels: vec!["cup".into(), "vase".into()], ..Column::scalar("kind") },
            Column::scalar("tiny"),
        ];
        let row = |i: u64| {
            let kind = if i == 0 { f64::NAN } else { 1.0 };
            DrawRow { values: vec![1.0, 2e-17, -0.0, 0.1, kind, 2e-17], ..DrawRow::default() }
        };
        let draws = |from: u64| ChainDraws {
            columns: columns.clone(),
            rows: (from..from + 1000).map(row).collect(),
            ..Default::default()
        };
        let q = quantities(&[draws(1), draws(1)]);
        let names: Vec<&str> = q[1..].iter().map(|q| &*q.name).collect();
        assert_eq!(names, ["R[0,0]", "R[0,1]", "R[1,0]", "R[1,1]", "kind", "tiny"]);
        let means = q[1..5].iter().map(|q| q.number(q.summary.mean));
        assert_eq!(means.collect::<Vec<_>>(), ["1", "0", "0", "0.1"]);
        assert!(q[1..5].iter().all(|q| q.summary.sd == 0.0 && q.number(q.summary.sd) == "0"));
        assert_eq!(q[6].number(q[6].summary.mean), "2.00e-17", "it is small by itself");
        assert_eq!(q[5].frequent.as_ref().map(ToString::to_string), Some("vase (100%)".into()));
        assert_eq!(quantities(&[draws(0)])[5].frequent, None, "missing from a draw");
    }

    #[test]
    fn vectors_become_elements() {
        let row = |draw, x: f64| DrawRow {
            draw,
            step: draw,
            log_joint: -x,
            values: vec![x, 2.0 * x, 3.0 * x],
            ..DrawRow::default()
        };
        let chain = |shift: f64| ChainDraws {
            columns: vec![Column::scalar("a"), Column::vector("v", 2)],
            rows: (0..4).map(|d| row(d, d as f64 + shift)).collect(),
            ..Default::default()
        };
        let q = quantities(&[chain(0.0), chain(1.0)]);
        assert_eq!(
            q.iter().map(|q| &*q.name).collect::<Vec<_>>(),
            ["log_joint", "a", "v[0]", "v[1]"]
        );
        assert_eq!(q[3].chains, [[0.0, 3.0, 6.0, 9.0], [3.0, 6.0, 9.0, 12.0]]);
        assert_eq!(q[1].summary.mean, 2.0);
        assert_eq!((q[0].column, q[3].column), (None, Some(1)));
        assert_eq!(quantities(&[])[0].chains.len(), 0);
    }
}
