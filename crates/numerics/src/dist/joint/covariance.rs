//! Covariance functions of one variable: the usual stationary ones, their sums and
//! products. These are not distributions.

use crate::dist::ParamError;
use crate::dist::param::positive;
use crate::num::exp_each;
use nalgebra::DMatrix;
use std::fmt;
use std::ops::{Add, Mul};
use std::sync::Arc;

/// A positive semi-definite function of two points. The variance at a point is `sd^2`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Covariance {
    /// sd^2 exp(-d^2 / (2 length^2)).
    SqExp {
        /// The length scale, in units of the points.
        length: f64,
        /// The standard deviation.
        sd: f64,
    },
    /// sd^2 (1 + r) exp(-r), r = sqrt(3) d / length.
    Matern32 {
        /// The length scale, in units of the points.
        length: f64,
        /// The standard deviation.
        sd: f64,
    },
    /// sd^2 (1 + r + r^2 / 3) exp(-r), r = sqrt(5) d / length.
    Matern52 {
        /// The length scale, in units of the points.
        length: f64,
        /// The standard deviation.
        sd: f64,
    },
    /// sd^2 exp(-2 sin^2(pi d / period) / length^2).
    Periodic {
        /// The period, in units of the points.
        period: f64,
        /// The dimensionless length scale: values stay similar over about length period /
        /// (2 pi).
        length: f64,
        /// The standard deviation.
        sd: f64,
    },
    /// sd^2 for a point of a list and itself; 0 for two points, even if they coincide.
    White {
        /// The standard deviation.
        sd: f64,
    },
    /// The sum of two covariance functions.
    Sum(Arc<(Covariance, Covariance)>),
    /// The product of two covariance functions.
    Product(Arc<(Covariance, Covariance)>),
}

use Covariance::*;

impl Covariance {
    /// Creates the squared exponential; fails unless both parameters are positive and
    /// finite.
    pub fn sq_exp(length: f64, sd: f64) -> Result<Covariance, ParamError> {
        Ok(SqExp {
            length: positive("sq_exp", "length", length)?,
            sd: positive("sq_exp", "sd", sd)?,
        })
    }

    /// Creates Matérn's function with nu = 3/2; fails unless both parameters are positive
    /// and finite.
    pub fn matern32(length: f64, sd: f64) -> Result<Covariance, ParamError> {
        Ok(Matern32 {
            length: positive("matern32", "length", length)?,
            sd: positive("matern32", "sd", sd)?,
        })
    }

    /// Creates Matérn's function with nu = 5/2; fails unless both parameters are positive
    /// and finite.
    pub fn matern52(length: f64, sd: f64) -> Result<Covariance, ParamError> {
        Ok(Matern52 {
            length: positive("matern52", "length", length)?,
            sd: positive("matern52", "sd", sd)?,
        })
    }

    /// Creates the periodic function (MacKay 1998); fails unless all parameters are
    /// positive and finite.
    pub fn periodic(period: f64, length: f64, sd: f64) -> Result<Covariance, ParamError> {
        let period = positive("periodic", "period", period)?;
        Ok(Periodic {
            period,
            length: positive("periodic", "length", length)?,
            sd: positive("periodic", "sd", sd)?,
        })
    }

    /// Creates white noise; fails unless the standard deviation is positive and finite.
    pub fn white(sd: f64) -> Result<Covariance, ParamError> {
        Ok(White { sd: positive("white", "sd", sd)? })
    }

    /// Returns the variance at a point.
    pub fn variance(&self) -> f64 {
        match self {
            SqExp { sd, .. }
            | Matern32 { sd, .. }
            | Matern52 { sd, .. }
            | Periodic { sd, .. }
            | White { sd } => sd * sd,
            Sum(two) => two.0.variance() + two.1.variance(),
            Product(two) => two.0.variance() * two.1.variance(),
        }
    }

    /// Returns the covariance of two different points of a list, at distance `d`.
    pub fn at_distance(&self, d: f64) -> f64 {
        match self {
            SqExp { length, sd } => {
                let r = d / length;
                sd * sd * libm::exp(-0.5 * r * r)
            }
            Matern32 { length, sd } => {
                let r = (3f64.sqrt() * (d / length)).min(1e3);
                sd * sd * (1.0 + r) * libm::exp(-r)
            }
            Matern52 { length, sd } => {
                let r = (5f64.sqrt() * (d / length)).min(1e3);
                sd * sd * (1.0 + r * (1.0 + r / 3.0)) * libm::exp(-r)
            }
            Periodic { period, length, sd } => {
                // The remainder is exact, so distant points keep their phase. It is the
                // one nearest to 0, so points that are whole periods apart are as
                // accurate as near ones.
                let s = libm::sin(core::f64::consts::PI * (libm::remainder(d, *period) / period))
                    / length;
                sd * sd * libm::exp(-2.0 * s * s)
            }
            White { .. } => 0.0,
            Sum(two) => two.0.at_distance(d) + two.1.at_distance(d),
            Product(two) => two.0.at_distance(d) * two.1.at_distance(d),
        }
    }

    /// Puts the covariances of two different points at each of these distances into `out`,
    /// with the bits of [`Covariance::at_distance`].
    fn at_distances(&self, distances: &[f64], out: &mut [f64]) {
        let each = |out: &mut [f64], f: &dyn Fn(f64) -> f64| {
            out.iter_mut().zip(distances).for_each(|(o, d)| *o = f(*d));
        };
        match self {
            SqExp { length, sd } => {
                out.iter_mut().zip(distances).for_each(|(o, d)| {
                    let r = d / length;
                    *o = -0.5 * r * r;
                });
                exp_each(out);
                out.iter_mut().for_each(|k| *k *= sd * sd);
            }
            Matern32 { length, sd } => {
                let scaled = |d: &f64| (3f64.sqrt() * (d / length)).min(1e3);
                out.iter_mut().zip(distances).for_each(|(o, d)| *o = -scaled(d));
                exp_each(out);
                let scale = |(o, d): (&mut f64, &f64)| *o *= sd * sd * (1.0 + scaled(d));
                out.iter_mut().zip(distances).for_each(scale);
            }
            Matern52 { length, sd } => {
                let scaled = |d: &f64| (5f64.sqrt() * (d / length)).min(1e3);
                out.iter_mut().zip(distances).for_each(|(o, d)| *o = -scaled(d));
                exp_each(out);
                out.iter_mut().zip(distances).for_each(|(o, d)| {
                    let r = scaled(d);
                    *o *= sd * sd * (1.0 + r * (1.0 + r / 3.0));
                });
            }
            Periodic { .. } => each(out, &|d| self.at_distance(d)),
            White { .. } => out.fill(0.0),
            Sum(two) | Product(two) => {
                let mut more = vec![0.0; out.len()];
                two.0.at_distances(distances, out);
                two.1.at_distances(distances, &mut more);
                let both = out.iter_mut().zip(&more);
                if matches!(self, Sum(_)) {
                    both.for_each(|(o, m)| *o += m);
                } else {
                    both.for_each(|(o, m)| *o *= m);
                }
            }
        }
    }

    /// Returns the number of parameters: for a sum or product, those of the left side,
    /// then those of the right.
    pub fn param_count(&self) -> usize {
        match self {
            SqExp { .. } | Matern32 { .. } | Matern52 { .. } => 2,
            Periodic { .. } => 3,
            White { .. } => 1,
            Sum(two) | Product(two) => two.0.param_count() + two.1.param_count(),
        }
    }

    /// Adds the derivatives of `by` times the covariance of two points at distance `d`,
    /// or of a point with itself (`None`), with respect to the parameters in the order of
    /// the constructors.
    pub fn vjp(&self, d: Option<f64>, by: f64, out: &mut [f64]) {
        let k = d.map_or_else(|| self.variance(), |d| self.at_distance(d));
        // Adds the derivative `g` of the covariance with respect to parameter `i`.
        let mut add = |i: usize, g: f64| {
            if let Some(o) = out.get_mut(i) {
                *o += by * g;
            }
        };
        let far = d.unwrap_or(0.0);
        match self {
            SqExp { length, sd } => {
                let r = far / length;
                add(0, k * r * r / length);
                add(1, 2.0 * k / sd);
            }
            Matern32 { length, sd } => {
                let r = (3f64.sqrt() * (far / length)).min(1e3);
                add(0, sd * sd * r * r * libm::exp(-r) / length);
                add(1, 2.0 * k / sd);
            }
            Matern52 { length, sd } => {
                let r = (5f64.sqrt() * (far / length)).min(1e3);
                add(0, sd * sd * r * r * (1.0 + r) * libm::exp(-r) / (3.0 * length));
                add(1, 2.0 * k / sd);
            }
            Periodic { period, length, sd } => {
                let angle = core::f64::consts::PI * (libm::remainder(far, *period) / period);
                let s = libm::sin(angle) / length;
                // The phase is proportional to the whole distance, so its derivative with
                // respect to the period depends on all of it.
                add(
                    0,
                    4.0 * k * s * libm::cos(angle) / length * core::f64::consts::PI * far
                        / (period * period),
                );
                add(1, 4.0 * k * s * s / length);
                add(2, 2.0 * k / sd);
            }
            White { sd } => {
                if d.is_none() {
                    add(0, 2.0 * sd);
                }
            }
            Sum(two) => {
                let (left, right) = out.split_at_mut(two.0.param_count().min(out.len()));
                two.0.vjp(d, by, left);
                two.1.vjp(d, by, right);
            }
            Product(two) => {
                let value = |c: &Covariance| d.map_or_else(|| c.variance(), |d| c.at_distance(d));
                let (left, right) = out.split_at_mut(two.0.param_count().min(out.len()));
                two.0.vjp(d, by * value(&two.1), left);
                two.1.vjp(d, by * value(&two.0), right);
            }
        }
    }

    /// Adds [`Covariance::vjp`] of two points at each of these distances.
    pub(in crate::dist) fn vjp_each(&self, distances: &[f64], by: &[f64], out: &mut [f64]) {
        match (self, &mut *out) {
            (SqExp { length, sd }, [by_length, by_sd]) => {
                let mut k = vec![0.0; distances.len()];
                self.at_distances(distances, &mut k);
                k.iter_mut().zip(by).for_each(|(k, by)| *k *= by);
                *by_sd += 2.0 * k.iter().sum::<f64>() / sd;
                let square = |(k, d): (&f64, &f64)| k * (d / length) * (d / length);
                *by_length += k.iter().zip(distances).map(square).sum::<f64>() / length;
            }
            (White { .. }, _) => {}
            (Sum(two), out) => {
                let (left, right) = out.split_at_mut(two.0.param_count().min(out.len()));
                two.0.vjp_each(distances, by, left);
                two.1.vjp_each(distances, by, right);
            }
            (Product(two), out) => {
                let times = |c: &Covariance| {
                    let mut values = vec![0.0; distances.len()];
                    c.at_distances(distances, &mut values);
                    values.iter_mut().zip(by).for_each(|(v, by)| *v *= by);
                    values
                };
                let (left, right) = out.split_at_mut(two.0.param_count().min(out.len()));
                two.0.vjp_each(distances, &times(&two.1), left);
                two.1.vjp_each(distances, &times(&two.0), right);
            }
            (_, out) => {
                distances.iter().zip(by).for_each(|(d, by)| self.vjp(Some(*d), *by, out));
            }
        }
    }

    /// Returns the covariance matrix of values at these points.
    pub fn matrix(&self, at: &[f64]) -> DMatrix<f64> {
        let packed = self.packed(at, 0.0);
        DMatrix::from_fn(at.len(), at.len(), |i, j| {
            let (i, j) = (i.max(j), i.min(j));
            packed[i * (i + 1) / 2 + j]
        })
    }

    /// Returns the lower triangle of the covariance matrix, packed by rows, with `jitter`
    /// added to the diagonal. If most distances are also distances from the first point,
    /// as on a regular grid, these are evaluated once and reused.
    pub(in crate::dist) fn packed(&self, at: &[f64], jitter: f64) -> Vec<f64> {
        let n = at.len();
        let row = |i: usize| at[..i].iter().map(move |x| (at[i] - x).abs());
        let from_first: Vec<f64> = at.iter().map(|x| (x - at[0]).abs()).collect();
        let is_known = |i: usize| row(i).zip(from_first[..=i].iter().rev()).map(|(d, f)| d == *f);
        let pairs = n * n.saturating_sub(1) / 2;
        let mut distances: Vec<f64> = Vec::with_capacity(pairs);
        let known: usize = (0..n).map(|i| is_known(i).filter(|known| *known).count()).sum();
        let reuse = 2 * known > pairs;
        for i in 0..n {
            match reuse {
                true => distances.extend(row(i).zip(is_known(i)).filter(|d| !d.1).map(|d| d.0)),
                false => distances.extend(row(i)),
            }
        }
        let mut others = vec![0.0; distances.len()];
        self.at_distances(&distances, &mut others);
        let mut first = vec![0.0; if reuse { n } else { 0 }];
        self.at_distances(&from_first[..first.len()], &mut first);
        let mut packed = Vec::with_capacity(n * (n + 1) / 2);
        let (diagonal, mut others) = (self.variance() + jitter, &others[..]);
        for i in 0..n {
            if reuse {
                for (known, k) in is_known(i).zip(first[..=i].iter().rev()) {
                    match (known, others) {
                        (false, [other, rest @ ..]) => {
                            packed.push(*other);
                            others = rest;
                        }
                        _ => packed.push(*k),
                    }
                }
            } else {
                let (own, rest) = others.split_at(i);
                packed.extend_from_slice(own);
                others = rest;
            }
            packed.push(diagonal);
        }
        packed
    }
}

impl fmt::Display for Covariance {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            SqExp { length, sd } => write!(f, "sq_exp(length = {length}, sd = {sd})"),
            Matern32 { length, sd } => write!(f, "matern32(length = {length}, sd = {sd})"),
            Matern52 { length, sd } => write!(f, "matern52(length = {length}, sd = {sd})"),
            Periodic { period, length, sd } => {
                write!(f, "periodic(period = {period}, length = {length}, sd = {sd})")
            }
            White { sd } => write!(f, "white(sd = {sd})"),
            Sum(two) => write!(f, "{} + {}", two.0, two.1),
            Product(two) => {
                for (i, part) in [&two.0, &two.1].into_iter().enumerate() {
                    f.write_str(if i > 0 { " * " } else { "" })?;
                    if matches!(part, Sum(_)) {
                        write!(f, "({part})")?
                    } else {
                        write!(f, "{part}")?
                    }
                }
                Ok(())
            }
        }
    }
}

impl Add for Covariance {
    type Output = Covariance;

    fn add(self, other: Covariance) -> Covariance {
        Sum(Arc::new((self, other)))
    }
}

impl Mul for Covariance {
    type Output = Covariance;

    fn mul(self, other: Covariance) -> Covariance {
        Product(Arc::new((self, other)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<Covariance> {
        let sq = Covariance::sq_exp(0.7, 1.3).unwrap();
        let (m3, m5) =
            (Covariance::matern32(2.0, 0.4).unwrap(), Covariance::matern52(0.3, 2.0).unwrap());
        let (p, w) =
            (Covariance::periodic(1.5, 0.8, 1.1).unwrap(), Covariance::white(0.3).unwrap());
        let sum = sq.clone() + w.clone();
        let both = (p.clone() + m3.clone()) * sq.clone();
        vec![sq, m3, m5, p, w, sum, both]
    }

    /// Irregular points, with some equal distances, and far ones.
    fn points() -> Vec<f64> {
        let mut at: Vec<f64> = (0..40).map(|i| libm::sin(f64::from(i)) * 3.0).collect();
        at.extend([10.0, 11.0, 12.0, 13.0, 400.0, -1e4]);
        at
    }

    #[test]
    fn a_matrix_has_the_bits_of_single_covariances() {
        // Irregular, regular, nearly regular, a single one, none.
        let grid: Vec<f64> = (0..40).map(|i| 0.125 * f64::from(i)).collect();
        let rounded: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i)).collect();
        for at in [points(), grid, rounded, vec![3.0], Vec::new()] {
            for cov in all() {
                let mut packed = cov.packed(&at, 0.25).into_iter();
                for i in 0..at.len() {
                    for j in 0..i {
                        let (found, expected) =
                            (packed.next(), cov.at_distance((at[i] - at[j]).abs()));
                        assert_eq!(found.map(f64::to_bits), Some(expected.to_bits()), "{cov}");
                    }
                    assert_eq!(packed.next(), Some(cov.variance() + 0.25));
                }
                assert_eq!(packed.next(), None);
            }
        }
    }

    #[test]
    fn derivatives_of_many_are_sums_of_single_ones() {
        let distances: Vec<f64> = points().windows(2).map(|p| (p[0] - p[1]).abs()).collect();
        let by: Vec<f64> = (0..distances.len()).map(|i| libm::cos(i as f64)).collect();
        for cov in all() {
            let (mut expected, mut found) =
                (vec![0.5; cov.param_count()], vec![0.5; cov.param_count()]);
            distances.iter().zip(&by).for_each(|(d, by)| cov.vjp(Some(*d), *by, &mut expected));
            cov.vjp_each(&distances, &by, &mut found);
            for (found, expected) in found.iter().zip(&expected) {
                let error = (found - expected).abs();
                assert!(error <= 1e-12 * (1.0 + expected.abs()), "{cov}: {found}, {expected}");
            }
        }
    }
}
