//! Sums over finite variables by variable elimination, and exact joint draws.
//!
//! A factor is a table of log weights of the joint values of a few variables. A variable is
//! eliminated by adding the factors that depend on it and replacing them with the log of the
//! sum of exponentials over its values. In the reverse order, each variable can be drawn
//! given those drawn before (Koller & Friedman 2009, chapters 9 and 12.3). Variables are
//! eliminated in the order of min-fill (section 9.4.3.2): first those whose neighbours are
//! nearly all neighbours of each other.

use crate::num::log_sum_exp;
use crate::rng::Stream;
use std::collections::BTreeSet;

/// Log weights that depend on the same variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    /// The variables, by number, in ascending order.
    pub scope: Vec<usize>,
    /// By joint value; that of the first variable varies fastest.
    pub table: Vec<f64>,
}

/// Variables with their numbers of values, eliminated one by one.
#[derive(Clone, Debug)]
pub struct Elimination {
    steps: Vec<Step>,
    log_sum: f64,
}

/// An eliminated variable.
#[derive(Clone, Debug)]
struct Step {
    variable: usize,
    /// The variables on which its conditional depends, with their numbers of values.
    given: Vec<(usize, usize)>,
    /// The sum of the factors: for each joint value of those, all values of the variable.
    table: Vec<f64>,
    values: usize,
}

/// Why variables are not eliminated: a table would have this many entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge(pub usize);

/// The order of min-fill: each variable with its neighbours when it is eliminated, in
/// ascending order. Among equals, those that appear first in `scopes` are first.
pub fn min_fill(variables: usize, scopes: &[&[usize]]) -> Vec<(usize, Vec<usize>)> {
    let mut near: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); variables];
    let mut rank = vec![usize::MAX; variables];
    for (i, scope) in scopes.iter().enumerate() {
        for x in *scope {
            near[*x].extend(scope.iter().filter(|y| *y != x));
            rank[*x] = rank[*x].min(i);
        }
    }
    let mut by_rank: Vec<usize> = (0..variables).collect();
    by_rank.sort_by_key(|x| rank[*x]);
    by_rank.iter().enumerate().for_each(|(i, x)| rank[*x] = i);
    let mut fill: Vec<usize> = (0..variables).map(|x| missing(&near, x)).collect();
    let mut open: BTreeSet<(usize, usize)> = (0..variables).map(|x| (fill[x], rank[x])).collect();
    let mut order = Vec::with_capacity(variables);
    while let Some((_, first)) = open.pop_first() {
        let x = by_rank[first];
        let others = std::mem::take(&mut near[x]);
        let mut changed = others.clone();
        for y in &others {
            near[*y].remove(&x);
            let new: Vec<usize> =
                others.iter().copied().filter(|z| z != y && !near[*y].contains(z)).collect();
            if !new.is_empty() {
                // A new edge is no longer missing between those that know both of its ends.
                changed.extend(near[*y].iter());
            }
            near[*y].extend(new);
        }
        for y in changed {
            let now = missing(&near, y);
            if now != fill[y] {
                open.remove(&(fill[y], rank[y]));
                open.insert((now, rank[y]));
                fill[y] = now;
            }
        }
        order.push((x, others.into_iter().collect()));
    }
    order
}

/// With more neighbours a table is too large in any case, and pairs are not counted.
const MOST_NEIGHBOURS: usize = 32;

/// The number of pairs of neighbours of `x` that are not neighbours of each other.
fn missing(near: &[BTreeSet<usize>], x: usize) -> usize {
    if near[x].len() > MOST_NEIGHBOURS {
        return near[x].len().pow(2);
    }
    let others: Vec<usize> = near[x].iter().copied().collect();
    let pairs = others
        .iter()
        .enumerate()
        .map(|(i, y)| others[i + 1..].iter().filter(|z| !near[*y].contains(z)).count());
    pairs.sum()
}

impl Elimination {
    /// Eliminates variables with these numbers of values, each at least 1.
    ///
    /// # Errors
    /// If a table would have more than `largest` entries.
    pub fn new(counts: &[usize], factors: Vec<Factor>, largest: usize) -> Result<Self, TooLarge> {
        let scopes: Vec<&[usize]> = factors.iter().map(|f| &f.scope[..]).collect();
        let order = min_fill(counts.len(), &scopes);
        for (x, others) in &order {
            let sizes = others.iter().chain([x]).map(|y| counts[*y]);
            let size = sizes.fold(1usize, usize::saturating_mul);
            if size > largest {
                return Err(TooLarge(size));
            }
        }
        let mut of_variable: Vec<Vec<usize>> = vec![Vec::new(); counts.len()];
        let mut alive: Vec<Option<Factor>> = Vec::with_capacity(factors.len());
        let mut log_sum = 0.0;
        let add = |f: Factor, alive: &mut Vec<Option<Factor>>, of: &mut Vec<Vec<usize>>| {
            f.scope.iter().for_each(|x| of[*x].push(alive.len()));
            alive.push(Some(f));
        };
        for f in factors {
            match &f.table[..] {
                [weight] if f.scope.is_empty() => log_sum += weight,
                _ => add(f, &mut alive, &mut of_variable),
            }
        }
        let mut steps = Vec::with_capacity(order.len());
        for (variable, others) in order {
            let places = std::mem::take(&mut of_variable[variable]);
            let mine: Vec<Factor> = places.into_iter().filter_map(|i| alive[i].take()).collect();
            let step = Step::new(variable, &others, counts, &mine);
            let table: Vec<f64> = step.table.chunks(step.values).map(log_sum_exp).collect();
            match &table[..] {
                [sum] if others.is_empty() => log_sum += sum,
                _ => add(Factor { scope: others, table }, &mut alive, &mut of_variable),
            }
            steps.push(step);
        }
        Ok(Elimination { steps, log_sum })
    }

    /// The log of the sum of the weights of all joint values; -∞ if there is none of
    /// positive weight.
    pub fn log_sum(&self) -> f64 {
        self.log_sum
    }

    /// The number of entries of all tables.
    pub fn entries(&self) -> usize {
        self.steps.iter().map(|s| s.table.len()).sum()
    }

    /// Draws a joint value with probability proportional to its weight, which must be
    /// positive for some: by variable, the index of its value.
    pub fn draw(&self, rng: &mut Stream) -> Vec<usize> {
        let (mut drawn, mut weights) = (vec![0; self.steps.len()], Vec::new());
        for s in self.steps.iter().rev() {
            let joint = s.given.iter().rev().fold(0, |p, (y, n)| p * n + drawn[*y]);
            let log = &s.table[joint * s.values..(joint + 1) * s.values];
            let most = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            weights.clear();
            weights.extend(log.iter().map(|l| if *l == most { 1.0 } else { libm::exp(l - most) }));
            drawn[s.variable] = rng.weighted(&weights, weights.iter().sum());
        }
        drawn
    }
}

impl Step {
    fn new(variable: usize, others: &[usize], counts: &[usize], factors: &[Factor]) -> Step {
        let given: Vec<(usize, usize)> = others.iter().map(|y| (*y, counts[*y])).collect();
        let values = counts[variable];
        let joints = given.iter().map(|(_, n)| n).product::<usize>();
        let mut table = vec![0.0; joints * values];
        for f in factors {
            // How far the place in the factor's table moves with each variable.
            let mut strides = vec![0; counts.len().min(f.scope.last().map_or(0, |x| x + 1))];
            let mut stride = 1;
            for x in &f.scope {
                strides[*x] = stride;
                stride *= counts[*x];
            }
            let of = |x: usize| strides.get(x).copied().unwrap_or(0);
            let own = of(variable);
            let moves: Vec<(usize, usize)> = given.iter().map(|(y, n)| (of(*y), *n)).collect();
            let (mut digits, mut place) = (vec![0; moves.len()], 0);
            for row in table.chunks_mut(values) {
                row.iter_mut().enumerate().for_each(|(v, x)| *x += f.table[place + v * own]);
                for (digit, (stride, n)) in digits.iter_mut().zip(&moves) {
                    *digit += 1;
                    place += stride;
                    if *digit < *n {
                        break;
                    }
                    place -= stride * n;
                    *digit = 0;
                }
            }
        }
        Step { variable, given, table, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, StreamKey};

    /// Random factors over few variables.
    fn random(rng: &mut Stream) -> (Vec<usize>, Vec<Factor>) {
        let n = 2 + rng.index(5);
        let counts: Vec<usize> = (0..n).map(|_| 1 + rng.index(3)).collect();
        let factor = |rng: &mut Stream| {
            let scope: Vec<usize> = (0..n).filter(|_| rng.uniform() < 0.4).collect();
            let size = scope.iter().map(|x| counts[*x]).product();
            let entry = |rng: &mut Stream| {
                if rng.uniform() < 0.1 { f64::NEG_INFINITY } else { 2.0 * rng.standard_normal() }
            };
            Factor { scope, table: (0..size).map(|_| entry(rng)).collect() }
        };
        let factors = (0..1 + rng.index(6)).map(|_| factor(rng)).collect();
        (counts, factors)
    }

    fn weight(counts: &[usize], factors: &[Factor], values: &[usize]) -> f64 {
        let one =
            |f: &Factor| f.table[f.scope.iter().rev().fold(0, |p, x| p * counts[*x] + values[*x])];
        factors.iter().map(one).sum()
    }

    #[test]
    fn sums_and_draws_are_those_of_enumeration() {
        let mut rng = StreamKey::new(3, 0, Purpose::KERNEL).stream(0, 0, 0);
        for _ in 0..200 {
            let (counts, factors) = random(&mut rng);
            let all: usize = counts.iter().product();
            let values = |mut joint: usize| -> Vec<usize> {
                let mut digit = |n: &usize| {
                    let d = joint % n;
                    joint /= n;
                    d
                };
                counts.iter().map(&mut digit).collect()
            };
            let log: Vec<f64> = (0..all).map(|i| weight(&counts, &factors, &values(i))).collect();
            let exact = log_sum_exp(&log);
            let e = Elimination::new(&counts, factors, 1000).unwrap();
            assert!(
                exact == e.log_sum() || (exact - e.log_sum()).abs() < 1e-12 * (1.0 + exact.abs()),
                "{exact} {}",
                e.log_sum()
            );
            if exact == f64::NEG_INFINITY {
                continue;
            }
            let n = 4000.0;
            let mut seen = vec![0.0; all];
            for _ in 0..n as usize {
                let drawn = e.draw(&mut rng);
                seen[drawn.iter().zip(&counts).rev().fold(0, |p, (v, n)| p * n + v)] += 1.0;
            }
            for (s, l) in seen.iter().zip(&log) {
                let p = (l - exact).exp();
                let sd = (n * p * (1.0 - p)).sqrt();
                assert!((s - n * p).abs() <= 6.0 * sd + 1.0, "{s} of {n}, exactly {p}");
            }
        }
    }

    /// A grid of 10 x 10 has tables of at most 2^14 entries; a complete graph is refused.
    #[test]
    fn a_grid_is_eliminated_and_a_complete_graph_is_refused() {
        let pair =
            |a: usize, b: usize| Factor { scope: vec![a, b], table: vec![1.0, 0.0, 0.0, 1.0] };
        let at = |r: usize, c: usize| 10 * r + c;
        let mut grid = Vec::new();
        for r in 0..10 {
            for c in 0..10 {
                grid.extend((c < 9).then(|| pair(at(r, c), at(r, c + 1))));
                grid.extend((r < 9).then(|| pair(at(r, c), at(r + 1, c))));
            }
        }
        let e = Elimination::new(&[2; 100], grid, 1 << 14).unwrap();
        assert!(e.log_sum() > 180.0 && e.log_sum() < 180.0 + 100.0 * 2f64.ln());
        let all: Vec<Factor> = (0..30).flat_map(|a| (a + 1..30).map(move |b| pair(a, b))).collect();
        assert_eq!(Elimination::new(&[2; 30], all, 1 << 20).unwrap_err(), TooLarge(1 << 30));
    }
}
