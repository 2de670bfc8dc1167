//! Tables of ln Gamma at integers added to a constant, which reduce an evaluation to
//! counting and look-ups.
//!
//! Invariant: a look-up equals the formula to the last bit, whether the count is in the
//! table or beyond it.

use pcadlang_numerics::num::ln_gamma;

/// Maximum length of a table; values for larger counts are computed on demand.
const LONGEST: usize = 1 << 16;

/// `ln Gamma(a + n) - ln Gamma(a)` for n = 0, 1, ...: the log of the rising factorial of
/// `a`.
#[derive(Debug, Clone)]
pub(super) struct LnRising {
    a: f64,
    ln_gamma_a: f64,
    table: Vec<f64>,
}

impl LnRising {
    /// Builds a table for a constant above 0 and counts mostly up to `most`.
    pub fn new(a: f64, most: usize) -> Self {
        let mut this = LnRising { a, ln_gamma_a: ln_gamma(a), table: Vec::new() };
        this.table =
            (0..most.saturating_add(1).min(LONGEST) as u32).map(|n| this.formula(n)).collect();
        this
    }

    /// Returns the value for a count.
    pub fn at(&self, n: u32) -> f64 {
        self.table.get(n as usize).copied().unwrap_or_else(|| self.formula(n))
    }

    fn formula(&self, n: u32) -> f64 {
        if n == 0 { 0.0 } else { ln_gamma(self.a + f64::from(n)) - self.ln_gamma_a }
    }
}

/// Scores counts of colours as one exchangeable sequence whose probabilities have a
/// symmetric Dirichlet prior:
/// `ln Gamma(A) - ln Gamma(A + N) + sum over k of (ln Gamma(a + n_k) - ln Gamma(a))`, A =
/// K a (the Dirichlet-multinomial without its multinomial coefficient).
#[derive(Debug, Clone)]
pub(super) struct DirichletMultinomial {
    each: LnRising,
    all: LnRising,
}

impl DirichletMultinomial {
    /// Builds the tables for `colours` colours with `a` prior counts each, and up to
    /// about `most` pixels.
    pub fn new(colours: usize, a: f64, most: usize) -> Self {
        DirichletMultinomial {
            each: LnRising::new(a, most),
            all: LnRising::new(a * colours as f64, most),
        }
    }

    /// Returns the increase of the log-probability per pixel of a colour, given the
    /// counts of that colour and of all: the mean of removing one and adding one.
    pub fn slope(&self, n: u32, all: u32) -> f64 {
        let mean = |table: &LnRising, n: u32| match n {
            0 => table.at(1),
            n => 0.5 * (table.at(n + 1) - table.at(n - 1)),
        };
        mean(&self.each, n) - mean(&self.all, all)
    }

    /// Returns the log-probability of a sequence with these counts; 0 for an empty one.
    pub fn score(&self, counts: impl Iterator<Item = u32>) -> f64 {
        let (mut n, mut sum) = (0, 0.0);
        for c in counts.filter(|c| *c > 0) {
            n += c;
            sum += self.each.at(c);
        }
        sum - self.all.at(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_ups_are_logs_of_rising_factorials() {
        for a in [0.01, 0.5, 16.0] {
            let t = LnRising::new(a, 40);
            let mut sum = 0.0;
            for n in 0..200 {
                assert!((t.at(n) - sum).abs() < 1e-11 * sum.abs().max(1.0), "{a} {n}");
                sum += libm::log(a + f64::from(n));
            }
        }
        assert_eq!(LnRising::new(0.5, 10).at(11), LnRising::new(0.5, 20).at(11));
        assert_eq!(LnRising::new(0.5, usize::MAX).table.len(), LONGEST);
    }

    #[test]
    fn an_urn_is_its_draws_one_after_another() {
        let urn = DirichletMultinomial::new(3, 0.7, 10);
        let sequence = [0usize, 2, 2, 0, 2, 1, 2];
        let (mut counts, mut sum) = ([0u32; 3], 0.0);
        for (n, k) in sequence.iter().enumerate() {
            sum += libm::log((0.7 + f64::from(counts[*k])) / (2.1 + n as f64));
            counts[*k] += 1;
        }
        assert!((urn.score(counts.into_iter()) - sum).abs() < 1e-12);
        assert_eq!(urn.score([0; 3].into_iter()), 0.0);
    }
}
