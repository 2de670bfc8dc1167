//! Means and variances of named points in the plane or in space, updated with one draw at
//! a time and merged over chains.
//!
//! Invariant: the same draws in the same order give the same bits, and the result of
//! merging chains in order does not depend on when they ran.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The moments of one point over the draws so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The number of draws.
    pub count: u64,
    /// Their mean, by axis.
    pub mean: Vec<f64>,
    /// Sums of squared deviations from the mean, by axis.
    squares: Vec<f64>,
}

impl Point {
    /// Returns the square root of the mean of the variances along the axes; 0 for a
    /// single draw.
    pub fn sd(&self) -> f64 {
        let mean = self.squares.iter().sum::<f64>() / self.squares.len().max(1) as f64;
        (mean / self.freedom()).sqrt()
    }

    /// Returns the divisor of the sums of squares.
    fn freedom(&self) -> f64 {
        self.count.saturating_sub(1).max(1) as f64
    }

    fn merge(&mut self, o: &Point) {
        let (n, m) = (self.count as f64, o.count as f64);
        let all = n + m;
        if all == 0.0 {
            return;
        }
        if self.count == 0 {
            self.clone_from(o);
            return;
        }
        let axes = self.mean.iter_mut().zip(&mut self.squares);
        for ((mean, squares), (other, others)) in axes.zip(o.mean.iter().zip(&o.squares)) {
            let d = other - *mean;
            *mean += d * (m / all);
            *squares += others + d * d * (n * m / all);
        }
        self.count += o.count;
    }
}

/// Points by name, in order of first appearance. A point has the same number of axes in
/// all draws, but need not be in every draw.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Moments(IndexMap<Arc<str>, Point>);

impl Moments {
    /// Adds a point of a draw (Welford 1962), or the mean and variance of the point given
    /// the draw. Values that are not finite are left out.
    pub fn add(&mut self, name: &Arc<str>, at: &[f64], variance: f64) {
        if at.iter().all(|x| x.is_finite()) && variance.is_finite() {
            let one = Point { count: 1, mean: at.to_vec(), squares: vec![variance; at.len()] };
            self.0.entry(Arc::clone(name)).or_default().merge(&one);
        }
    }

    /// Adds the draws of another chain (Chan, Golub & LeVeque 1979).
    pub fn merge(&mut self, other: &Moments) {
        for (name, p) in &other.0 {
            self.0.entry(Arc::clone(name)).or_default().merge(p);
        }
    }

    /// Returns a mixture of moments with the given weights, which sum to 1. A point that
    /// some of them lack is a mixture of the others. Counts are summed.
    pub fn mixture(all: &[(f64, &Moments)]) -> Moments {
        let mut mixed = Moments::default();
        for (_, moments) in all {
            mixed.merge(moments);
        }
        for (name, p) in &mut mixed.0 {
            let own: Vec<(f64, &Point)> =
                all.iter().filter_map(|(share, m)| Some((*share, m.0.get(name)?))).collect();
            let sum: f64 = own.iter().map(|(share, _)| share).sum();
            if sum <= 0.0 || sum.is_nan() {
                continue;
            }
            let freedom = p.freedom();
            for axis in 0..p.mean.len() {
                let mean = own.iter().map(|(share, q)| share / sum * q.mean[axis]).sum::<f64>();
                let variance = |q: &Point| {
                    let off = q.mean[axis] - mean;
                    q.squares[axis] / q.freedom() + off * off
                };
                p.squares[axis] =
                    freedom * own.iter().map(|(share, q)| share / sum * variance(q)).sum::<f64>();
                p.mean[axis] = mean;
            }
        }
        mixed
    }

    /// Returns the points.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Point)> {
        self.0.iter().map(|(name, p)| (&**name, p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mixture_has_its_shares_means_and_spreads() {
        let name: Arc<str> = Arc::from("a");
        let of = |centre: f64, n: u32| {
            let mut m = Moments::default();
            (0..n).for_each(|i| m.add(&name, &[centre + f64::from(i % 2)], 0.0));
            m
        };
        let mixed = Moments::mixture(&[
            (0.75, &of(0.0, 10_000)),
            (0.25, &of(8.0, 100)),
            (0.0, &of(99.0, 70)),
        ]);
        let (_, p) = mixed.iter().next().unwrap();
        assert!((p.mean[0] - (0.5 + 0.25 * 8.0)).abs() < 1e-12, "{p:?}");
        // The variance within the parts is 1/4; the variance between them is 3/16 of 8
        // squared.
        assert!((p.sd() * p.sd() - (0.25 + 0.1875 * 64.0)).abs() < 0.001, "{}", p.sd());
        assert_eq!(p.count, 10_170);
    }

    #[test]
    fn merged_chains_are_as_one_and_as_two_passes() {
        let name: Arc<str> = Arc::from("a");
        let draws: Vec<[f64; 2]> =
            (0..50).map(|i| [1e6 + f64::from(i * i % 17), f64::from(i % 5) - 2.0]).collect();
        let of = |draws: &[[f64; 2]]| {
            let mut m = Moments::default();
            draws.iter().for_each(|d| m.add(&name, d, 0.0));
            m
        };
        let mut merged = of(&draws[..13]);
        merged.merge(&of(&draws[13..]));
        merged.add(&name, &[f64::NAN, 0.0], 0.0);
        merged.merge(&Moments::default());
        let n = draws.len() as f64;
        let mean = [0, 1].map(|i| draws.iter().map(|d| d[i]).sum::<f64>() / n);
        let variance = [0, 1].map(|i| {
            draws.iter().map(|d| (d[i] - mean[i]) * (d[i] - mean[i])).sum::<f64>() / (n - 1.0)
        });
        let sd = (0.5 * (variance[0] + variance[1])).sqrt();
        for m in [of(&draws), merged] {
            let (_, p) = m.iter().next().unwrap();
            assert_eq!(p.count, 50);
            assert!(
                (0..2).all(|i| (p.mean[i] - mean[i]).abs() < 1e-8) && (p.sd() - sd).abs() < 1e-8,
                "{p:?}"
            );
        }
        assert_eq!(of(&draws[..1]).iter().next().unwrap().1.sd(), 0.0);
    }
}
