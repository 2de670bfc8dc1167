//! Batches of normal distributions: the same arithmetic as [`Normal`]'s, in loops over
//! columns that the compiler can vectorise.

use super::batch::{component, parts};
use super::continuous::log_norm;
use super::draw::standard;
use super::{Batch, Dist, Normal, Scalar};
use crate::num::{Column, ExactSum};

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

    /// The distribution of number `i`; `None` if a parameter is outside its domain.
    fn own(&self, buffer: &[f64], params: &[Column], i: usize) -> Option<Normal> {
        let [mean, sd] = match params {
            [mean, sd] => [mean, sd].map(|c| c.get(buffer, i)),
            _ => [&self.mean, &self.sd].map(|list| list[if list.len() == 1 { 0 } else { i }]),
        };
        Normal::new(mean, sd).ok()
    }

    /// Standardises the numbers. False if one is NaN.
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

    /// Adds the derivatives with respect to a column, as a function of the standardised
    /// number and the standard deviation.
    #[inline(always)]
    fn add(
        &self,
        by: &mut [f64],
        c: &Column,
        n: usize,
        weight: f64,
        slope: impl Fn(f64, f64) -> f64,
    ) {
        let z = &self.z[..];
        if c.step == 0 {
            by[c.at] += weight
                * match &self.sd[..] {
                    [sd] => z.iter().fold(0.0, |sum, z| sum + slope(*z, *sd)),
                    all => z.iter().zip(all).fold(0.0, |sum, (z, sd)| sum + slope(*z, *sd)),
                };
            return;
        }
        let each = by[c.at..c.at + n].iter_mut().zip(z);
        match &self.sd[..] {
            [sd] => each.for_each(|(g, z)| *g += slope(*z, *sd) * weight),
            all => each.zip(all).for_each(|((g, z), sd)| *g += slope(*z, *sd) * weight),
        }
    }
}

impl Batch for Normals {
    fn score(
        &mut self,
        buffer: &[f64],
        x: Column,
        params: &[Column],
        n: usize,
        sum: &mut ExactSum,
    ) -> bool {
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
        sum.add_each(self.terms.iter().copied());
        true
    }

    fn each(&self, _: &[f64], _: Column, _: usize, out: &mut Vec<f64>) {
        out.extend_from_slice(&self.terms);
    }

    fn vjp(&self, _: &[f64], by: &mut [f64], x: Column, params: &[Column], n: usize, weight: f64) {
        if x.live {
            self.add(by, &x, n, weight, |z, sd| -z / sd);
        }
        if let [mean, sd] = params {
            if mean.live {
                self.add(by, mean, n, weight, |z, sd| z / sd);
            }
            if sd.live {
                self.add(by, sd, n, weight, |z, sd| (z * z - 1.0) / sd);
            }
        }
    }
    fn score_each(
        &mut self,
        buffer: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> bool {
        if let Some(there) = Normal::score_columns(buffer, x, params, n, out) {
            return there;
        }
        (0..n).fold(true, |there, i| {
            let at = x.get(buffer, i);
            let own = self.own(buffer, params, i);
            buffer[out + i] = own.map_or(f64::NEG_INFINITY, |d| d.log_density_num(at));
            there && !at.is_nan()
        })
    }

    fn vjp_each(
        &self,
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) {
        if Normal::vjp_columns(buffer, by, x, params, n, out) {
            return;
        }
        for i in 0..n {
            let (weight, own) = (by[out + i], self.own(buffer, params, i));
            let Some(own) = own.filter(|_| weight != 0.0) else { continue };
            let z = standard(x.get(buffer, i), own.location(), own.scale());
            let by_mean = z / own.scale() * weight;
            let mut give = |c: &Column, g: f64| {
                if c.live {
                    by[c.at + i * c.step] += g;
                }
            };
            give(&x, -by_mean);
            if let [mean, sd] = params {
                give(mean, by_mean);
                give(sd, (z * z - 1.0) / own.scale() * weight);
            }
        }
    }
}
