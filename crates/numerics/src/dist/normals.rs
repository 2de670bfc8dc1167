//! Batches of normal distributions: the same arithmetic as [`Normal`]'s, in loops over
//! columns that the compiler can vectorise.

use super::batch::{To, Weights, component, parts};
use super::continuous::log_norm;
use super::draw::standard;
use super::{Batch, Dist, Normal};
use crate::num::Column;
use crate::num::simd::{sum_of_triples, vectorised_if_many};

/// Creates the batch of a scalar distribution, or of a distribution whose elements are
/// all of one family. Its parameters lie in these columns, or are fixed. `None` for other
/// distributions, and if the columns do not fit the family.
pub fn batch(dist: &Dist, params: &[Column]) -> Option<Box<dyn Batch>> {
    match Normals::new(parts(dist), params.len()) {
        Some(normals) => Some(Box::new(normals)),
        None => Some(component(dist, params)?),
    }
}

/// Numbers under one normal distribution, or under one each.
#[derive(Debug)]
pub(super) struct Normals {
    mean: Vec<f64>,
    sd: Vec<f64>,
    log_norm: Vec<f64>,
    /// The standardised numbers and log densities of the last score.
    z: Vec<f64>,
    terms: Vec<f64>,
}

impl Normals {
    /// Creates the batch of these distributions with `width` columns of parameters, or
    /// none; `None` if there are others among them.
    pub fn new(parts: &[Dist], width: usize) -> Option<Normals> {
        let own = |d: &Dist| if let Dist::Normal(d) = d { Some(*d) } else { None };
        let all: Vec<Normal> = parts.iter().map(own).collect::<Option<_>>()?;
        (width == 0 || width == 2).then_some(())?;
        let known = |x: f64| if width == 0 { x } else { f64::NAN };
        Some(Normals {
            mean: all.iter().map(|d| d.location()).collect(),
            // NaN is no standard deviation, so the first one differs.
            sd: all.iter().map(|d| known(d.scale())).collect(),
            log_norm: all.iter().map(|d| d.log_norm()).collect(),
            z: Vec::new(),
            terms: Vec::new(),
        })
    }

    /// Takes the parameters from the buffer. False if one is outside its domain.
    #[inline(always)]
    fn refresh(&mut self, buffer: &[f64], params: &[Column]) -> bool {
        let [mean, sd] = params else { return true };
        let n = self.mean.len();
        for i in 0..if sd.step == 0 { n.min(1) } else { n } {
            let now = sd.get(buffer, i);
            if now.to_bits() == self.sd[i].to_bits() {
                continue;
            }
            if !(now > 0.0 && now.is_finite()) {
                return false;
            }
            let log_norm = log_norm(now);
            if sd.step == 0 {
                self.sd.fill(now);
                self.log_norm.fill(log_norm);
            } else {
                (self.sd[i], self.log_norm[i]) = (now, log_norm);
            }
        }
        match mean.step {
            0 => self.mean.fill(buffer[mean.at]),
            _ => self.mean.copy_from_slice(&buffer[mean.at..mean.at + n]),
        }
        self.mean.iter().fold(true, |all, m| all & m.is_finite())
    }

    /// Standardises the numbers. False if one is NaN.
    #[inline(always)]
    fn standardise(&mut self, buffer: &[f64], x: Column, n: usize) -> bool {
        self.z.resize(n, 0.0);
        let (z, mean, sd) = (&mut self.z[..], &self.mean[..], &self.sd[..]);
        let mut finite = true;
        let mut one = |z: &mut f64, x: f64, mean: f64, sd: f64| {
            let d = x - mean;
            finite &= d.is_finite();
            *z = d / sd;
        };
        match (x.step, mean, sd) {
            (0, ..) => {
                let x = buffer[x.at];
                let each = mean.iter().zip(sd).cycle();
                z.iter_mut().zip(each).for_each(|(z, (m, s))| one(z, x, *m, *s));
            }
            (_, [mean], [sd]) => {
                let xs = &buffer[x.at..x.at + n];
                z.iter_mut().zip(xs).for_each(|(z, x)| one(z, *x, *mean, *sd));
            }
            _ => {
                let xs = &buffer[x.at..x.at + n];
                let each = mean.iter().zip(sd);
                z.iter_mut().zip(xs).zip(each).for_each(|((z, x), (m, s))| one(z, *x, *m, *s));
            }
        }
        finite || self.standardise_far(buffer, x)
    }

    /// Standardises numbers that are far away, infinite or NaN.
    #[cold]
    fn standardise_far(&mut self, buffer: &[f64], x: Column) -> bool {
        let each = self.mean.iter().zip(&self.sd).cycle();
        for (i, (z, (mean, sd))) in self.z.iter_mut().zip(each).enumerate() {
            *z = standard(x.get(buffer, i), *mean, *sd);
        }
        (0..self.z.len()).all(|i| !x.get(buffer, i).is_nan())
    }

    /// Computes the log densities. False if a number is NaN or a parameter is outside its
    /// domain.
    fn compute(&mut self, buffer: &[f64], x: Column, params: &[Column], n: usize) -> bool {
        vectorised_if_many(
            n,
            #[inline(always)]
            || self.compute_here(buffer, x, params, n),
        )
    }

    #[inline(always)]
    fn compute_here(&mut self, buffer: &[f64], x: Column, params: &[Column], n: usize) -> bool {
        if !self.refresh(buffer, params) || !self.standardise(buffer, x, n) {
            return false;
        }
        self.terms.resize(n, 0.0);
        let term = |z: f64, log_norm: f64| {
            let score = log_norm - 0.5 * z * z;
            if z.is_nan() { f64::NEG_INFINITY } else { score }
        };
        let pairs = self.terms.iter_mut().zip(&self.z);
        match &self.log_norm[..] {
            [one] => pairs.for_each(|(t, z)| *t = term(*z, *one)),
            all => pairs.zip(all).for_each(|((t, z), one)| *t = term(*z, *one)),
        }
        true
    }

    /// Adds the derivatives with respect to a column: `slope` is their product with the
    /// standard deviation, as a function of the standardised number. Each is multiplied by
    /// its weight, a function of the number in `weights` at its place, and all by `all`.
    #[inline(always)]
    fn add(
        &self,
        by: &mut [f64],
        c: &Column,
        (weights, weight): (&[f64], impl Fn(f64) -> f64),
        all: f64,
        slope: impl Fn(f64) -> f64,
    ) {
        // An infinite slope does not matter where the weight is 0.
        let times = |slope: f64, weight: f64| if weight == 0.0 { 0.0 } else { slope * weight };
        let z = &self.z[..];
        if c.step == 0 {
            by[c.at] += match &self.sd[..] {
                [sd] => {
                    let part = |z, w, _| times(slope(z), weight(w));
                    all * (sum_of_triples(z, weights, weights, part) / sd)
                }
                sds => {
                    let part = |z, w, sd| times(slope(z) / sd, weight(w));
                    all * sum_of_triples(z, weights, sds, part)
                }
            };
            return;
        }
        let each = by[c.at..].iter_mut().zip(z).zip(weights);
        match &self.sd[..] {
            // The factor is infinite for subnormal deviations only.
            [sd] if (all / sd).is_finite() => {
                let factor = all / sd;
                each.for_each(|((g, z), w)| *g += times(slope(*z), weight(*w)) * factor);
            }
            [sd] => each.for_each(|((g, z), w)| *g += times(slope(*z) / sd, weight(*w)) * all),
            sds => {
                let each = each.zip(sds);
                each.for_each(|(((g, z), w), sd)| {
                    *g += times(slope(*z) / sd, weight(*w)) * all;
                });
            }
        }
    }

    /// Adds the derivatives with respect to all columns, as [`Normals::add`] does.
    #[inline(always)]
    fn add_slopes(
        &self,
        by: &mut [f64],
        (x, params): (Column, &[Column]),
        weights: (&[f64], impl Fn(f64) -> f64 + Copy),
        all: f64,
    ) {
        vectorised_if_many(
            self.z.len(),
            #[inline(always)]
            || {
                if x.live {
                    self.add(by, &x, weights, all, |z| -z);
                }
                if let [mean, sd] = params {
                    if mean.live {
                        self.add(by, mean, weights, all, |z| z);
                    }
                    if sd.live {
                        self.add(by, sd, weights, all, |z| z * z - 1.0);
                    }
                }
            },
        );
    }
}

impl Batch for Normals {
    fn score(
        &mut self,
        buffer: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        to: To<'_>,
    ) -> bool {
        let there = self.compute(buffer, x, params, n);
        match to {
            _ if !there => {}
            To::Sum(sum) => sum.add_all(&self.terms),
            To::Places(out) => buffer[out..out + n].copy_from_slice(&self.terms),
        }
        there
    }

    fn each(&self, _: &[f64], _: Column, _: usize, out: &mut Vec<f64>) {
        out.extend_from_slice(&self.terms);
    }

    fn vjp(
        &self,
        _: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        weights: Weights,
    ) {
        match weights {
            Weights::All(weight) => self.add_slopes(by, (x, params), (&self.z, |_| 1.0), weight),
            Weights::Places(from) => {
                // What is read is before what is written.
                let (by, weights) = by.split_at_mut(from);
                self.add_slopes(by, (x, params), (&weights[..n], |w| w), 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_those_of_single_distributions() {
        compare(5);
        // Enough to be vectorised, with a rest.
        compare(75);
    }

    /// Compares a batch with the distributions themselves, one by one.
    fn compare(n: usize) {
        let repeated = |xs: [f64; 5]| xs.into_iter().cycle().take(n);
        // Numbers, means and standard deviations, then a place for each log density.
        let mut buffer: Vec<f64> = repeated([0.3, -1.0, 2.5, 1e100, 0.0]).collect();
        buffer.extend(repeated([0.1, 0.2, -0.3, 0.4, 0.5]));
        buffer.extend(repeated([1.0, 0.5, 2.0, 1e-3, 0.7]));
        buffer.resize(4 * n, f64::NAN);
        let weights: Vec<f64> = repeated([0.5, -2.0, 0.0, 1e-3, 1.5]).collect();
        let column = |at: usize, step: usize| Column { at, step, live: true };
        let one = Dist::Normal(Normal::new(0.0, 1.0).unwrap());
        for steps in 0..8 {
            let step = |bit: usize| (steps >> bit) & 1;
            let (x, params) = (column(0, step(0)), [column(n, step(1)), column(2 * n, step(2))]);
            let parts = vec![one.clone(); if step(1) + step(2) == 0 { 1 } else { n }];
            let mut normals = Normals::new(&parts, 2).unwrap();
            let mut plain = super::super::families::component(&parts, 2).unwrap();
            let score = |batch: &mut dyn Batch| {
                let mut own = buffer.clone();
                assert!(batch.score(&mut own, x, &params, n, To::Places(3 * n)));
                let mut by = vec![0.0; 3 * n];
                by.extend(&weights);
                batch.vjp(&own, &mut by, x, &params, n, Weights::Places(3 * n));
                by.truncate(3 * n);
                (own, by)
            };
            let ((found, by), (expected, by_expected)) = (score(&mut normals), score(&mut *plain));
            let bits = |xs: &[f64]| xs.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&found), bits(&expected), "{steps}");
            for (found, expected) in by.iter().zip(&by_expected) {
                let error = (found - expected).abs();
                assert!(error <= 1e-12 * expected.abs(), "{steps}: {found}, {expected}");
            }
            // Outside of the domain there is no density, wherever that is.
            for (at, bad) in
                [(2 * n, 0.0), (2 * n + 3, -1.0), (n + 1, f64::INFINITY), (2, f64::NAN)]
            {
                let read = at % n == 0
                    || step(match at / n {
                        0 => 0,
                        1 => 1,
                        _ => 2,
                    }) == 1;
                let mut own = buffer.clone();
                own[at] = bad;
                for batch in [&mut normals as &mut dyn Batch, &mut *plain] {
                    let there = batch.score(&mut own, x, &params, n, To::Places(3 * n));
                    assert_eq!(there, !read, "{at}");
                }
            }
        }
    }
}
