//! What is recorded: the values of choices that a state contains, and of those that nothing reads,
//! which are drawn anew with every record. Records of independent states are independent draws from
//! the distribution that the enumeration of everything gives.

use super::check::tabulate;
use super::execute::{Extent, Integration};
use super::posterior::Posterior;
use super::program::Program;
use super::verdict::{Counts, Pooled};
use pcadlang_inference::draws::Column;
use pcadlang_report::ChainDraws;
use std::collections::{BTreeMap, BTreeSet};

/// The number of intervals in which positions of continuous choices are counted.
const BINS: usize = 8;

/// The distribution of a program's records.
pub struct Records {
    all: Posterior,
    discrete: Vec<String>,
    continuous: Vec<String>,
}

impl Records {
    /// Enumerates the records of a program; `None` if there are too many.
    pub fn of(program: &Program, integration: Integration) -> Option<Records> {
        let all = Posterior::over(program, integration, Extent::Records)?;
        let (discrete, continuous) =
            program.recorded().into_iter().partition(|a| all.discrete.contains_key(a));
        Some(Records { all, discrete, continuous })
    }

    /// Returns what a plan must collect. Predictions, which are named q, are recorded anyway.
    pub fn collected(&self) -> String {
        let all = self.discrete.iter().chain(&self.continuous).filter(|a| !a.starts_with("@q"));
        let mut names: Vec<&str> =
            all.map(|a| a[1..].split_once('[').map_or(&a[1..], |(name, _)| name)).collect();
        names.sort_unstable();
        names.dedup();
        names.join(", ")
    }

    /// Counts records: combinations of the discrete values, and the positions of each continuous
    /// one, which are uniform. An error if a quantity is missing.
    pub fn count(&self, draws: &ChainDraws, skip: usize) -> Result<(Counts, Pooled), String> {
        let column = |a: &String| column(draws, a);
        let rows = || draws.rows.iter().skip(skip);
        let n = rows().count() as u64;
        let (mut counts, mut pooled) = (Counts { draws: n, cells: Vec::new() }, Pooled::default());
        let at = self.discrete.iter().map(column).collect::<Result<Vec<usize>, _>>()?;
        let joint = self.all.joint(&self.discrete);
        let mut seen = vec![0; joint.len()];
        for row in rows() {
            let values: Vec<String> = at.iter().map(|i| format!("{}", row.values[*i])).collect();
            let Some(i) = joint.keys().position(|k| *k == values) else {
                return Err(format!("{:?} recorded as {values:?}, which cannot be", self.discrete));
            };
            seen[i] += 1;
        }
        let kinds = joint.keys().map(|k| format!("recorded {:?} as {k:?}", self.discrete));
        tabulate(kinds.zip(joint.values().copied()).zip(seen), &mut counts, &mut pooled);
        for a in &self.continuous {
            let i = column(a)?;
            let mut bins = [0; BINS];
            for row in rows() {
                let u = self.all.below(a, row.values[i]);
                bins[((u * BINS as f64) as usize).min(BINS - 1)] += 1;
            }
            let bins = bins.into_iter().enumerate();
            counts.cells.extend(
                bins.map(|(b, c)| (format!("recorded {a}, bin {b}"), 1.0 / BINS as f64, c)),
            );
        }
        Ok((counts, pooled))
    }

    /// Returns the largest total variation distance of a discrete choice's records, over all of
    /// them.
    pub fn distance(&self, chains: &[ChainDraws]) -> Result<f64, String> {
        let mut worst = 0.0f64;
        for a in &self.discrete {
            let i = column(&chains[0], a)?;
            let (mut counts, rows) = (BTreeMap::new(), || chains.iter().flat_map(|c| &c.rows));
            rows().for_each(|r| {
                *counts.entry(vec![format!("{}", r.values[i])]).or_insert(0.0) += 1.0
            });
            let (n, expected) = (rows().count() as f64, self.all.joint(std::slice::from_ref(a)));
            let keys: BTreeSet<_> = counts.keys().chain(expected.keys()).collect();
            let off = |k| counts.get(k).unwrap_or(&0.0) / n - expected.get(k).unwrap_or(&0.0);
            worst = worst.max(0.5 * keys.into_iter().map(|k| off(k).abs()).sum::<f64>());
        }
        Ok(worst)
    }
}

/// Returns the index of a choice's records among the values of a row.
fn column(draws: &ChainDraws, address: &str) -> Result<usize, String> {
    let mut names = draws.columns.iter().flat_map(Column::elements);
    let at = names.position(|n| n == address[1..]);
    at.ok_or_else(|| format!("{address} is not recorded"))
}
