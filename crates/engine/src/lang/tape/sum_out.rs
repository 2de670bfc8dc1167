//! Sums over finite choices on a tape, by the elimination of variables.
//!
//! A factor is a table: a log weight for each joint value of a few choices. A choice is
//! summed out by adding the factors that depend on it and replacing them with the log of
//! the sum of exponentials over its values, a factor of the choices that they depend on
//! beside it. For choices that share no factor these are separate sums, for a chain the
//! forward algorithm, for a tree its upward pass (Koller & Friedman 2009, chapter 9). In
//! the reverse order, each choice can be drawn given those drawn before.

use super::build::Builder;
use super::log_sum_exp::{LogSumExp, Term, Terms};
use super::op::{Op, runs};
use super::summed::Summed;
use pcadlang_numerics::elimination::min_fill;
use pcadlang_numerics::num::Column;
use smallvec::SmallVec;

/// The maximum number of entries of a table.
const LARGEST: usize = 4096;
/// Up to how many scores an entry refers to, before they are added up.
const FEW: usize = 4;

/// An entry of a factor.
#[derive(Clone, Debug, Default)]
pub struct Entry {
    terms: Terms,
    /// The scores that are fixed: the log prior of choices, and the log likelihood.
    pub fixed: [f64; 2],
}

/// Scores that depend on the same choices.
#[derive(Clone, Debug, Default)]
pub struct Factor {
    /// The choices, by number, in ascending order.
    pub scope: Vec<usize>,
    /// By joint value; that of the first choice varies fastest.
    pub entries: Vec<Entry>,
}

impl Builder {
    /// Ends the terms of an entry ([`Builder::begin_terms`]).
    pub fn entry(&mut self, fixed: [f64; 2]) -> Entry {
        let mut terms = self.end_terms();
        for observed in [false, true] {
            if terms.iter().filter(|t| t.observed == observed).count() > FEW {
                let (some, rest): (Terms, Terms) =
                    terms.into_iter().partition(|t| t.observed == observed);
                let plain = some.into_iter().map(|t| Term { observed: false, ..t }).collect();
                terms = rest;
                let at = self.log_sum_exp(vec![plain]);
                terms.push(Term { column: Column { at, step: 0, live: true }, observed });
            }
        }
        Entry { terms, fixed }
    }

    fn log_sum_exp(&mut self, values: Vec<Terms>) -> usize {
        let out = self.reserve(1);
        self.ops.push(Op::LogSumExp(LogSumExp {
            values: values.into(),
            out,
            n: 1,
            shares: Vec::new(),
        }));
        out
    }

    /// Sums all choices, of which these are the numbers of values, out of these factors
    /// and adds the logs of the sums to the score. Returns the number of terms of all
    /// sums; `None` if a table would be too large.
    pub fn sum_out(&mut self, counts: &[usize], factors: Vec<Factor>) -> Option<usize> {
        let mut terms = 0;
        let mut alive: Vec<Option<(Vec<usize>, Vec<Terms>)>> = Vec::new();
        let mut of_choice: Vec<Vec<usize>> = vec![Vec::new(); counts.len()];
        let scopes: Vec<&[usize]> = factors.iter().map(|f| &f.scope[..]).collect();
        // Among equals in the order in which their factors were recorded, so that their sums
        // read consecutive numbers.
        let order = min_fill(counts.len(), &scopes);
        for f in factors {
            f.scope.iter().for_each(|x| of_choice[*x].push(alive.len()));
            let tables = f.entries.into_iter().map(|e| self.terms_of(e)).collect();
            alive.push(Some((f.scope, tables)));
        }
        let mut roots = Vec::new();
        for (x, others) in order {
            let given: Vec<(usize, usize)> = others.iter().map(|y| (*y, counts[*y])).collect();
            let size = given.iter().try_fold(counts[x], |n, g| n.checked_mul(g.1))?;
            if size > LARGEST {
                return None;
            }
            terms += size;
            let mine: Vec<(Vec<usize>, Vec<Terms>)> = std::mem::take(&mut of_choice[x])
                .into_iter()
                .filter_map(|f| alive[f].take())
                .collect();
            let mut sums = Vec::new();
            for joint in 0..size / counts[x].max(1) {
                let values = (0..counts[x])
                    .map(|value| {
                        let at = |y: usize| if y == x { value } else { digit(&given, joint, y) };
                        let entry = |(scope, table): &(Vec<usize>, Vec<Terms>)| {
                            let place = scope.iter().rev().fold(0, |p, y| p * counts[*y] + at(*y));
                            table[place].clone()
                        };
                        mine.iter().flat_map(entry).collect()
                    })
                    .collect();
                sums.push(self.log_sum_exp(values));
            }
            others.iter().for_each(|y| of_choice[*y].push(alive.len()));
            let live = |at: &usize| Term {
                column: Column { at: *at, step: 0, live: true },
                observed: false,
            };
            match &sums[..] {
                [sum] if others.is_empty() => roots.push(*sum),
                _ => {
                    let table = sums.iter().map(|s| SmallVec::from_iter([live(s)])).collect();
                    alive.push(Some((others, table)));
                }
            }
            let sums = sums.into_iter().map(|s| (s, 0)).collect();
            self.summed.push(Summed { choice: x, given, sums });
        }
        self.ops.push(Op::Total { from: runs(roots.into_iter()) });
        Some(terms)
    }

    /// The terms of an entry, with its fixed scores among the numbers of the tape.
    fn terms_of(&mut self, entry: Entry) -> Terms {
        let mut terms = entry.terms;
        for (x, observed) in entry.fixed.into_iter().zip([false, true]) {
            if x != 0.0 {
                let at = self.reserve(1);
                self.values.numbers[at] = x;
                terms.push(Term { column: Column { at, step: 0, live: false }, observed });
            }
        }
        terms
    }
}

/// The value of choice `y` in a joint value.
fn digit(given: &[(usize, usize)], mut joint: usize, y: usize) -> usize {
    for (z, n) in given {
        if *z == y {
            return joint % n;
        }
        joint /= n;
    }
    0
}
