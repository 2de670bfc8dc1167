//! Whether independent draws have a distribution that is known, with the chance of a
//! false alarm stated.

use statrs::distribution::{Binomial, DiscreteCDF};

/// Counts of draws in cells whose probabilities are known. Sets of cells may overlap:
/// each cell is judged by itself.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    pub draws: u64,
    /// What a cell is, its probability, how many draws were in it.
    pub cells: Vec<(String, f64, u64)>,
}

impl Counts {
    /// A bound on the chance that right draws are as far off as the worst cell: twice the
    /// exact binomial tail beyond its count, times the number of cells (Bonferroni).
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
/// exact mean and variance under the right distribution: small deviations that many
/// programs share add up.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pooled {
    pub tables: u64,
    excess: f64,
    variance: f64,
}

impl Pooled {
    /// A table of disjoint cells that make up all.
    pub fn add(&mut self, draws: u64, cells: &[(f64, u64)]) {
        let n = draws as f64;
        // Rare cells would make the distribution of the statistic lopsided.
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

    /// How many standard deviations the sum is above its expectation.
    pub fn z(&self) -> f64 {
        if self.variance > 0.0 { self.excess / self.variance.sqrt() } else { 0.0 }
    }
}
