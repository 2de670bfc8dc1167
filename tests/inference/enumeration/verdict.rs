//! Tests whether independent draws have a known distribution, with a stated false alarm
//! rate.

use statrs::distribution::{Binomial, DiscreteCDF};

/// Counts of draws in cells of known probability. Cells may overlap, since each is tested
/// by itself.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    pub draws: u64,
    /// The name of each cell, its probability, and its number of draws.
    pub cells: Vec<(String, f64, u64)>,
}

impl Counts {
    /// Returns a bound on the probability that correct draws deviate as much as the worst
    /// cell: twice the exact binomial tail beyond its count, times the number of cells
    /// (Bonferroni).
    pub fn p_value(&self) -> (f64, String) {
        let mut worst = (1.0, String::new());
        let cells = self.cells.len() as f64;
        for (name, p, count) in &self.cells {
            let tail = match *p {
                p if p <= 0.0 => f64::from(u8::from(*count == 0)),
                p if p >= 1.0 => f64::from(u8::from(*count == self.draws)),
                p => {
                    let Ok(b) = Binomial::new(p, self.draws) else { continue };
                    let below = b.cdf(*count);
                    let above = if *count == 0 { 1.0 } else { b.sf(*count - 1) };
                    2.0 * below.min(above)
                }
            };
            if tail * cells < worst.0 {
                let share = *count as f64 / self.draws as f64;
                worst = (
                    tail * cells,
                    format!("{name}: {share:.4} of {} draws, expected {p:.4}", self.draws),
                );
            }
        }
        worst
    }
}

/// Pearson's statistic over many tables of disjoint cells, centred and scaled by its
/// exact mean and variance under the correct distribution, so that small deviations
/// shared by many programs add up.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pooled {
    pub tables: u64,
    excess: f64,
    variance: f64,
}

impl Pooled {
    /// Adds a table of disjoint cells that partition the states.
    pub fn add(&mut self, draws: u64, cells: &[(f64, u64)]) {
        let n = draws as f64;
        // Rare cells would skew the distribution of the statistic.
        if cells.len() < 2 || cells.iter().any(|(p, _)| p * n < 3.0) {
            return;
        }
        let k = cells.len() as f64;
        let statistic: f64 = cells.iter().map(|(p, c)| (*c as f64 - n * p).powi(2) / (n * p)).sum();
        let inverse: f64 = cells.iter().map(|(p, _)| 1.0 / p).sum();
        self.tables += 1;
        self.excess += statistic - (k - 1.0);
        self.variance += 2.0 * (k - 1.0) + (inverse - k * k - 2.0 * k + 2.0) / n;
    }

    pub fn merge(&mut self, o: &Pooled) {
        self.tables += o.tables;
        self.excess += o.excess;
        self.variance += o.variance;
    }

    /// Returns the number of standard deviations by which the sum exceeds its
    /// expectation.
    pub fn z(&self) -> f64 {
        if self.variance > 0.0 { self.excess / self.variance.sqrt() } else { 0.0 }
    }
}
