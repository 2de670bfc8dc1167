//! The operation that sums a choice out: for each of its values the sum of the scores
//! that depend on it, and the log of the sum of their exponentials.

use pcadlang_numerics::num::Column;
use pcadlang_numerics::num::simd::{sum_of_triples, vectorised_if_many};
use pcadlang_numerics::num::wide::log_sum_exp_rows;
use smallvec::SmallVec;

/// Scores that are added, in columns.
pub(super) type Terms = SmallVec<[Term; 2]>;

/// A column of scores.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    pub column: Column,
    /// True if it is raised to the power of the likelihood.
    pub observed: bool,
}

impl Term {
    /// Adds these scores to a row.
    #[inline(always)]
    fn add(&self, v: &[f64], power: f64, row: &mut [f64]) {
        let Column { at, step, .. } = self.column;
        if self.observed && power != 1.0 {
            // An impossible value is impossible at every power.
            let tempered = |x: f64| if x == f64::NEG_INFINITY { x } else { x * power };
            row.iter_mut().enumerate().for_each(|(i, r)| *r += tempered(v[at + i * step]));
        } else if step == 0 {
            let x = v[at];
            row.iter_mut().for_each(|r| *r += x);
        } else {
            // Not by `for_each`, which is not compiled for wide instructions if not inlined.
            for (r, x) in row.iter_mut().zip(&v[at..]) {
                *r += x;
            }
        }
    }
}

/// Choices with the same number of values, summed out side by side.
#[derive(Clone, Debug)]
pub(super) struct LogSumExp {
    /// By value.
    pub values: Box<[Terms]>,
    /// The index of the results, and how many there are.
    pub out: usize,
    pub n: usize,
    /// By value and choice, the conditional probabilities at the last run.
    pub shares: Vec<f64>,
}

impl LogSumExp {
    /// Writes the log sums; false if one is not a number.
    pub fn forward(&mut self, v: &mut [f64], power: f64) -> bool {
        let n = self.n;
        self.shares.resize(self.values.len() * n, 0.0);
        let (before, out) = v.split_at_mut(self.out);
        vectorised_if_many(
            n,
            #[inline(always)]
            || {
                let rows = self.shares.chunks_exact_mut(n.max(1));
                for (terms, row) in self.values.iter().zip(rows) {
                    row.fill(0.0);
                    for t in terms {
                        t.add(before, power, row);
                    }
                }
            },
        );
        log_sum_exp_rows(&mut self.shares, &mut out[..n])
    }

    /// Adds the adjoints of the terms: those of the results, times the conditional
    /// probabilities of the values.
    pub fn reverse(&self, g: &mut [f64], power: f64) {
        vectorised_if_many(
            self.n,
            #[inline(always)]
            || self.reverse_here(g, power),
        );
    }

    #[inline(always)]
    fn reverse_here(&self, g: &mut [f64], power: f64) {
        let (before, by) = g.split_at_mut(self.out);
        for (terms, row) in self.values.iter().zip(self.shares.chunks_exact(self.n.max(1))) {
            for t in terms.iter().filter(|t| t.column.live) {
                let scale = if t.observed { power } else { 1.0 };
                let at = t.column.at;
                let by = &by[..self.n];
                if t.column.step == 0 {
                    before[at] += sum_of_triples(row, by, by, |s, b, _| scale * (s * b));
                } else {
                    for ((g, s), b) in before[at..].iter_mut().zip(row).zip(by) {
                        *g += scale * (s * b);
                    }
                }
            }
        }
    }

    /// Returns the conditional probabilities of the values of choice `i`.
    pub fn conditional(&self, i: usize) -> impl Iterator<Item = f64> {
        (0..self.values.len()).map(move |value| self.shares[value * self.n + i])
    }
}
