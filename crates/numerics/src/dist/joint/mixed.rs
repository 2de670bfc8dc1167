//! Batches for one mixture whose weights and component parameters lie in a buffer, as in
//! [`crate::dist::batch`].

use crate::dist::batch::{Component, To, Weights, component};
use crate::dist::{Batch, Categorical, Dist, Mixture};
use crate::num::Column;
use smallvec::SmallVec;

/// A component's family and the columns of its parameters.
type Part = (Box<dyn Component>, SmallVec<[Column; 3]>);

/// A batch of numbers under one mixture.
#[derive(Debug)]
struct Mixed {
    /// The column of the weights; `None` if they are fixed.
    place: Option<Column>,
    weights: Vec<f64>,
    log_shares: Vec<f64>,
    total: f64,
    parts: Vec<Part>,
}

/// Creates the batch of a mixture whose weights and component parameters lie in these
/// columns, or are fixed. `None` if a component is not a scalar distribution that `batch`
/// supports, or has a separate parameter for each number.
pub fn batch_of_mixture(
    dist: &Mixture,
    weights: Option<Column>,
    columns: Vec<SmallVec<[Column; 3]>>,
) -> Option<Box<dyn Batch>> {
    let part = |(d, columns): (&Dist, SmallVec<[Column; 3]>)| {
        (d.elements().is_none() && columns.iter().all(|c| c.step == 0)).then_some(())?;
        Some((component(d, &columns)?, columns))
    };
    let parts = dist.components().iter().zip(columns).map(part).collect::<Option<Vec<_>>>()?;
    let (weights_now, log_shares, total) = dist.shares();
    (parts.len() == log_shares.len()).then_some(())?;
    let (log_shares, weights_now) = (log_shares.to_vec(), weights_now.to_vec());
    Some(Box::new(Mixed { place: weights, weights: weights_now, log_shares, total, parts }))
}

impl Mixed {
    fn refresh(&mut self, buffer: &[f64]) -> bool {
        if let Some(c) = self.place {
            let moved = (0..self.weights.len())
                .any(|i| c.get(buffer, i).to_bits() != self.weights[i].to_bits());
            if moved {
                self.weights.iter_mut().enumerate().for_each(|(i, w)| *w = c.get(buffer, i));
                if Categorical::new(&self.weights[..]).is_err() {
                    // They count as moved the next time.
                    self.weights.fill(f64::NAN);
                    return false;
                }
                (self.total, self.log_shares) =
                    Mixture::log_shares(&self.weights, std::mem::take(&mut self.log_shares));
            }
        }
        self.parts.iter_mut().all(|(p, columns)| p.refresh(buffer, columns))
    }

    /// Returns the components' log densities of a number, and that of the mixture.
    #[inline]
    fn scores(&self, x: f64) -> (SmallVec<[f64; 8]>, f64) {
        let scores: SmallVec<[f64; 8]> =
            self.parts.iter().map(|(p, _)| p.log_density_num(x)).collect();
        let all = Mixture::total(&self.log_shares, &scores);
        (scores, all)
    }

    #[inline]
    fn log_density(&self, x: f64) -> f64 {
        let (_, all) = self.scores(x);
        if all.is_nan() { f64::NEG_INFINITY } else { all }
    }

    /// Adds the derivatives of the log density of number `i`, times a weight.
    fn vjp_one(&self, buffer: &[f64], by: &mut [f64], x: Column, i: usize, weight: f64) {
        let at = x.get(buffer, i);
        let (scores, all) = self.scores(at);
        for (k, (part, columns)) in self.parts.iter().enumerate() {
            let s = scores[k];
            if let Some(c) = self.place.filter(|c| c.live) {
                by[c.at + k] += weight * Mixture::by_weight(s, all, self.total);
            }
            let share = Mixture::share(self.log_shares[k], s, all);
            if share <= 0.0 || !s.is_finite() {
                continue;
            }
            let mut of_params = [0.0; 3];
            let of_x = part.slopes_num(at, &mut of_params);
            if x.live {
                by[x.at + i * x.step] += weight * share * of_x;
            }
            columns
                .iter()
                .zip(of_params)
                .filter(|(c, _)| c.live)
                .for_each(|(c, p)| by[c.at] += weight * share * p);
        }
    }
}

impl Batch for Mixed {
    fn score(
        &mut self,
        buffer: &mut [f64],
        x: Column,
        _params: &[Column],
        n: usize,
        mut to: To<'_>,
    ) -> bool {
        self.refresh(buffer)
            && (0..n).all(|i| {
                let at = x.get(buffer, i);
                let score = self.log_density(at);
                match &mut to {
                    To::Sum(sum) => sum.add(score),
                    To::Places(out) => buffer[*out + i] = score,
                }
                !at.is_nan()
            })
    }

    fn each(&self, buffer: &[f64], x: Column, n: usize, out: &mut Vec<f64>) {
        out.extend((0..n).map(|i| self.log_density(x.get(buffer, i))));
    }

    fn vjp(
        &self,
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        _params: &[Column],
        n: usize,
        weights: Weights,
    ) {
        for i in 0..n {
            match weights {
                Weights::All(weight) => self.vjp_one(buffer, by, x, i, weight),
                // An infinite slope does not matter there.
                Weights::Places(from) if by[from + i] == 0.0 => {}
                Weights::Places(from) => self.vjp_one(buffer, by, x, i, by[from + i]),
            }
        }
    }
}
