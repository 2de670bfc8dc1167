//! The draws of a chain in memory, and the scalar quantities they give.

use crate::infer::diagnostics::{Summary, summary};
use crate::infer::draws::{Column, DrawRow, Shape};

/// The draws of one chain.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainDraws {
    /// Pairs said about the chain (settings, counts), as the file of draws has them.
    pub comments: Vec<(String, String)>,
    /// The recorded quantities.
    pub columns: Vec<Column>,
    /// The draws, in order.
    pub rows: Vec<DrawRow>,
    /// Of how many draws each one is kept: 1, unless there was no room for all.
    pub every: u64,
}

impl Default for ChainDraws {
    fn default() -> Self {
        ChainDraws { comments: Vec::new(), columns: Vec::new(), rows: Vec::new(), every: 1 }
    }
}

/// One number per draw, over all chains.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Its name: the column's, with `[i]` (from 0, as the language counts) for the element of a vector.
    pub name: String,
    /// The column it belongs to; `None` for the log joint density.
    pub column: Option<usize>,
    /// The draws, `[chain][draw]`.
    pub chains: Vec<Vec<f64>>,
    /// What they say.
    pub summary: Summary,
}

/// Every scalar quantity of some chains, the log joint density (`log_joint`) first, with its summary. Columns are those
/// of the first chain that has any; a chain whose draws lack one has none of it. A column that says the log joint density
/// again is left out.
pub fn quantities(chains: &[ChainDraws]) -> Vec<Quantity> {
    let quantity = |name: String, column, value: &dyn Fn(&DrawRow) -> Option<f64>| {
        let series: Vec<Vec<f64>> = chains.iter().map(|c| c.rows.iter().filter_map(value).collect()).collect();
        Quantity { name, column, summary: summary(&series), chains: series }
    };
    let mut out = vec![quantity("log_joint".into(), None, &|r| Some(r.log_joint))];
    let columns = chains.iter().map(|c| &c.columns[..]).find(|c| !c.is_empty()).unwrap_or_default();
    let mut at = 0;
    for (index, column) in columns.iter().enumerate() {
        if column.name == out[0].name && column.shape == Shape::Scalar && repeats(chains, at) {
            at += 1;
            continue;
        }
        for i in 0..column.shape.len() {
            let name = match column.shape {
                Shape::Scalar => column.name.clone(),
                Shape::Vector(_) => format!("{}[{i}]", column.name),
            };
            out.push(quantity(name, Some(index), &|r| r.values.get(at).copied()));
            at += 1;
        }
    }
    out
}

/// Whether the numbers at a place of every row are the log joint density.
fn repeats(chains: &[ChainDraws], at: usize) -> bool {
    let mut rows = chains.iter().flat_map(|c| &c.rows);
    rows.all(|r| r.values.get(at).is_some_and(|x| x.to_bits() == r.log_joint.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_joint_density_is_there_once() {
        let row = |x: f64, said: f64| DrawRow {
            chain: 0,
            draw: 0,
            step: 0,
            log_joint: x,
            log_prior: 0.0,
            log_likelihood: 0.0,
            values: vec![said, 7.0],
        };
        let chain = |rows| ChainDraws {
            columns: vec![Column::scalar("log_joint"), Column::scalar("b")],
            rows,
            ..Default::default()
        };
        let names = |c: ChainDraws| quantities(&[c]).into_iter().map(|q| (q.name, q.chains)).collect::<Vec<_>>();
        let one = names(chain(vec![row(1.0, 1.0), row(2.0, 2.0)]));
        assert_eq!(one, [("log_joint".into(), vec![vec![1.0, 2.0]]), ("b".into(), vec![vec![7.0, 7.0]])]);
        assert_eq!(names(chain(vec![row(1.0, 1.0), row(2.0, 3.0)])).len(), 3, "another thing of that name stays");
    }

    #[test]
    fn vectors_become_elements() {
        let row = |draw, x: f64| DrawRow {
            chain: 0,
            draw,
            step: draw,
            log_joint: -x,
            log_prior: 0.0,
            log_likelihood: 0.0,
            values: vec![x, 2.0 * x, 3.0 * x],
        };
        let chain = |shift: f64| ChainDraws {
            columns: vec![Column::scalar("a"), Column::vector("v", 2)],
            rows: (0..4).map(|d| row(d, d as f64 + shift)).collect(),
            ..Default::default()
        };
        let q = quantities(&[chain(0.0), chain(1.0)]);
        assert_eq!(q.iter().map(|q| &*q.name).collect::<Vec<_>>(), ["log_joint", "a", "v[0]", "v[1]"]);
        assert_eq!(q[3].chains, [[0.0, 3.0, 6.0, 9.0], [3.0, 6.0, 9.0, 12.0]]);
        assert_eq!(q[1].summary.mean, 2.0);
        assert_eq!((q[0].column, q[3].column), (None, Some(1)));
        assert_eq!(quantities(&[])[0].chains.len(), 0);
    }
}
