//! Log densities and their derivatives for many numbers under distributions of one
//! family, whose parameters lie in a buffer. The results equal those of evaluating one
//! number at a time, but there are no allocations, and work that depends only on
//! unchanged parameters is not repeated.

use super::*;
use crate::num::{Column, ExactSum};
use std::fmt;

/// Numbers under distributions of one family. Columns of parameters are in the order of
/// the constructor; without columns, the parameters stay as they were when the batch was
/// made.
pub trait Batch: fmt::Debug + Send + Sync {
    /// Adds the log densities of `n` numbers to a sum. Returns false, with part of them
    /// added, if a number is NaN or a parameter is outside its domain.
    fn score(
        &mut self,
        buffer: &[f64],
        x: Column,
        params: &[Column],
        n: usize,
        sum: &mut ExactSum,
    ) -> bool;

    /// Adds `weight` times the derivatives of the log densities of the last `score` to
    /// the adjoints, which are laid out like the buffer.
    fn vjp(
        &self,
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        weight: f64,
    );
}

/// A batch of one family that also gives the density and derivatives of its first
/// distribution.
pub(super) trait Family: Batch {
    /// Rebuilds the distributions whose parameters have changed. Returns false if a
    /// parameter is outside its domain.
    fn refresh(&mut self, buffer: &[f64], params: &[Column]) -> bool;

    /// Returns the log density of a number under the first distribution.
    fn log_density_num(&self, x: f64) -> f64;

    /// Returns its derivative with respect to the number, and writes those with respect
    /// to the parameters.
    fn slopes_num(&self, x: f64, params: &mut [f64; 3]) -> f64;
}

/// A distribution of one number with `N` parameters.
trait Member<const N: usize>: Clone + fmt::Debug + Send + Sync {
    /// Creates the distribution with these parameters; `None` if they are outside its
    /// domain.
    fn with(params: [f64; N]) -> Option<Self>;

    /// Like `with`, but may reuse results from `self` that depend only on parameters that
    /// are the same.
    fn moved(&self, params: [f64; N]) -> Option<Self> {
        Self::with(params)
    }

    fn log_density(&self, x: f64) -> f64;

    /// Returns the derivatives with respect to the number (0 if it is discrete) and to
    /// the parameters.
    fn slopes(&self, x: f64) -> (f64, [f64; N]);
}

/// Implements `Member` for families through their `Scalar` implementation.
macro_rules! members {
    ($($family:ident: $n:literal, $with:expr;)*) => {$(
        impl Member<$n> for $family {
            fn with(params: [f64; $n]) -> Option<Self> {
                let with: fn([f64; $n]) -> Result<$family, ParamError> = $with;
                with(params).ok()
            }

            #[inline]
            fn log_density(&self, x: f64) -> f64 {
                self.log_density_num(x)
            }

            #[inline]
            fn slopes(&self, x: f64) -> (f64, [f64; $n]) {
                slopes(self.slope(x))
            }
        }
    )*};
}

#[inline]
fn slopes<const N: usize>(slope: Slope) -> (f64, [f64; N]) {
    let mut params = [0.0; N];
    params.iter_mut().zip(&slope.params).for_each(|(p, s)| *p = *s);
    (slope.x.unwrap_or(0.0), params)
}

members! {
    LogNormal: 2, |[a, b]| LogNormal::new(a, b);
    Uniform: 2, |[a, b]| Uniform::new(a, b);
    Beta: 2, |[a, b]| Beta::new(a, b);
    Gamma: 2, |[a, b]| Gamma::new(a, b);
    Exponential: 1, |[a]| Exponential::new(a);
    HalfNormal: 1, |[a]| HalfNormal::new(a);
    HalfCauchy: 2, |[a, b]| HalfCauchy::new(a, b);
    StudentT: 3, |[a, b, c]| StudentT::new(a, b, c);
    InvGamma: 2, |[a, b]| InvGamma::new(a, b);
    Cauchy: 2, |[a, b]| Cauchy::new(a, b);
    Laplace: 2, |[a, b]| Laplace::new(a, b);
    VonMises: 2, |[a, b]| VonMises::new(a, b);
    Weibull: 2, |[a, b]| Weibull::new(a, b);
    NegBinomial: 2, |[a, b]| NegBinomial::new(a, b);
    Geometric: 1, |[a]| Geometric::new(a);
    Flat: 2, |[lo, hi]| Flat::new(lo, hi);
    Binomial: 2, |[a, b]| Binomial::new(a, b);
    Poisson: 1, |[a]| Poisson::new(a);
}

impl Member<2> for Normal {
    fn with([mean, sd]: [f64; 2]) -> Option<Self> {
        Normal::new(mean, sd).ok()
    }

    #[inline]
    fn moved(&self, [mean, sd]: [f64; 2]) -> Option<Self> {
        self.near(mean, sd).ok()
    }

    #[inline]
    fn log_density(&self, x: f64) -> f64 {
        self.log_density_num(x)
    }

    #[inline]
    fn slopes(&self, x: f64) -> (f64, [f64; 2]) {
        slopes(self.slope(x))
    }
}

/// Truth values count as 1 and 0.
impl Member<1> for Flip {
    fn with([p]: [f64; 1]) -> Option<Self> {
        Flip::new(p).ok()
    }

    #[inline]
    fn log_density(&self, x: f64) -> f64 {
        self.log_probability(x != 0.0)
    }

    #[inline]
    fn slopes(&self, x: f64) -> (f64, [f64; 1]) {
        (0.0, [self.slope(x != 0.0)])
    }
}

/// Distributions, one for all numbers or one for each, with the parameters they were made
/// from.
#[derive(Debug)]
struct Members<T, const N: usize>(Vec<(Option<[f64; N]>, T)>);

impl<T: Member<N>, const N: usize> Family for Members<T, N> {
    fn refresh(&mut self, buffer: &[f64], params: &[Column]) -> bool {
        let Ok(columns) = <&[Column; N]>::try_from(params) else { return true };
        // If all but the first parameter are shared, most of the work is shared too.
        let alike = columns.iter().skip(1).all(|c| c.step == 0);
        for i in 0..self.0.len() {
            let p = columns.map(|c| c.get(buffer, i));
            if self.0[i].0.is_some_and(|old| old.map(f64::to_bits) == p.map(f64::to_bits)) {
                continue;
            }
            let near = if alike && i > 0 { &self.0[i - 1].1 } else { &self.0[i].1 };
            let Some(made) = near.moved(p) else { return false };
            self.0[i] = (Some(p), made);
        }
        true
    }

    fn log_density_num(&self, x: f64) -> f64 {
        self.0.first().map_or(f64::NEG_INFINITY, |(_, d)| d.log_density(x))
    }

    fn slopes_num(&self, x: f64, params: &mut [f64; 3]) -> f64 {
        let Some((_, d)) = self.0.first() else { return 0.0 };
        let (by, own) = d.slopes(x);
        params.iter_mut().zip(own).for_each(|(p, s)| *p = s);
        by
    }
}

impl<T: Member<N>, const N: usize> Batch for Members<T, N> {
    fn score(
        &mut self,
        buffer: &[f64],
        x: Column,
        params: &[Column],
        n: usize,
        sum: &mut ExactSum,
    ) -> bool {
        if !self.refresh(buffer, params) {
            return false;
        }
        let mut one = |x: f64, d: &T| {
            sum.add(d.log_density(x));
            !x.is_nan()
        };
        match &self.0[..] {
            [(_, d)] => (0..n).all(|i| one(x.get(buffer, i), d)),
            all => all.iter().enumerate().all(|(i, (_, d))| one(x.get(buffer, i), d)),
        }
    }

    fn vjp(
        &self,
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        weight: f64,
    ) {
        let each = self.0.len() != 1;
        let columns = <&[Column; N]>::try_from(params).ok();
        let (mut of_x, mut of_params) = (0.0, [0.0; N]);
        for i in 0..n {
            let (gx, gp) = self.0[if each { i } else { 0 }].1.slopes(x.get(buffer, i));
            if x.live {
                if x.step == 0 { of_x += gx } else { by[x.at + i] += gx * weight }
            }
            for (k, c) in columns.into_iter().flatten().enumerate().filter(|(_, c)| c.live) {
                if c.step == 0 { of_params[k] += gp[k] } else { by[c.at + i] += gp[k] * weight }
            }
        }
        if x.live && x.step == 0 {
            by[x.at] += of_x * weight;
        }
        for (k, c) in
            columns.into_iter().flatten().enumerate().filter(|(_, c)| c.live && c.step == 0)
        {
            by[c.at] += of_params[k] * weight;
        }
    }
}

/// Creates the batch of a scalar distribution, or of a distribution whose elements are
/// all of one family. Its parameters lie in these columns, or are fixed. `None` for other
/// distributions, and if the columns do not fit the family.
pub fn batch(dist: &Dist, params: &[Column]) -> Option<Box<dyn Batch>> {
    Some(family(dist, params)?)
}

/// Like `batch`, but returns the batch as a [`Family`].
pub(super) fn family(dist: &Dist, params: &[Column]) -> Option<Box<dyn Family>> {
    let parts = match dist {
        Dist::Iid(d) => std::slice::from_ref(d.one()),
        Dist::Product(d) => d.parts(),
        one => std::slice::from_ref(one),
    };
    macro_rules! of {
        ($($family:ident: $n:literal),*) => {
            match parts.first()? {
                $(Dist::$family(_) if params.is_empty() || params.len() == $n => {
                    let one = |p: &Dist| if let Dist::$family(d) = p { Some((None, d.clone())) } else { None };
                    let all: Vec<(Option<[f64; $n]>, $family)> = parts.iter().map(one).collect::<Option<_>>()?;
                    Some(Box::new(Members::<$family, $n>(all)))
                })*
                _ => None,
            }
        };
    }
    of!(
        Normal: 2, LogNormal: 2, Uniform: 2, Beta: 2, Gamma: 2, Exponential: 1, HalfNormal: 1, HalfCauchy: 2, StudentT: 3,
        InvGamma: 2, Cauchy: 2, Laplace: 2, VonMises: 2, Weibull: 2, NegBinomial: 2, Geometric: 1, Flat: 2, Flip: 1,
        Binomial: 2, Poisson: 1
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// Creates a distribution from parameters near the middle of the family's domain.
    fn made(family: &str, p: &[f64]) -> Option<Dist> {
        Some(match (family, p) {
            ("normal", [a, b]) => Dist::Normal(Normal::new(*a, *b).ok()?),
            ("student_t", [a, b, c]) => Dist::StudentT(StudentT::new(*a, *b, *c).ok()?),
            ("gamma", [a, b]) => Dist::Gamma(Gamma::new(*a, *b).ok()?),
            ("poisson", [a]) => Dist::Poisson(Poisson::new(*a).ok()?),
            ("flip", [a]) => Dist::Flip(Flip::new(*a).ok()?),
            _ => return None,
        })
    }

    #[test]
    fn many_at_once_are_as_one_at_a_time() {
        for (family, width, seen) in [
            ("normal", 2, [0.3, 1.2, 2.0]),
            ("student_t", 3, [0.3, 1.2, 2.0]),
            ("gamma", 2, [0.3, 1.2, 2.0]),
            ("poisson", 1, [0.0, 2.0, 3.0]),
            ("flip", 1, [0.0, 1.0, 1.0]),
        ] {
            // Bit k of `shape` says whether parameter k has a value for each element.
            for shape in 0..1 << width {
                // The buffer holds one column per parameter, then the observed values.
                let at = |shift: f64, k: usize, i: usize| {
                    0.4 + 0.1 * k as f64
                        + shift
                        + if shape >> k & 1 == 1 { 0.07 * i as f64 } else { 0.0 }
                };
                let n = 3;
                let fill = |shift: f64| {
                    let mut v: Vec<f64> =
                        (0..width).flat_map(|k| (0..n).map(move |i| at(shift, k, i))).collect();
                    v.extend(seen);
                    v
                };
                let columns: Vec<Column> = (0..width)
                    .map(|k| Column { at: k * n, step: shape >> k & 1, live: true })
                    .collect();
                let x = Column { at: width * n, step: 1, live: true };
                let one = |v: &[f64], i: usize| {
                    let p: Vec<f64> = columns.iter().map(|c| c.get(v, i)).collect();
                    made(family, &p).unwrap()
                };
                let first = fill(0.0);
                let dist = match shape {
                    0 => one(&first, 0),
                    _ => Dist::Product(Arc::new(
                        Product::new((0..n).map(|i| one(&first, i)).collect()).unwrap(),
                    )),
                };
                let mut b = batch(&dist, &columns).unwrap();
                for shift in [0.0, 0.05, 0.05, 0.1] {
                    let v = fill(shift);
                    let (mut sum, mut expected) = (ExactSum::default(), ExactSum::default());
                    assert!(b.score(&v, x, &columns, n, &mut sum));
                    let mut by = vec![0.0; v.len()];
                    b.vjp(&v, &mut by, x, &columns, n, 2.0);
                    let mut slopes = vec![0.0; v.len()];
                    for (i, s) in seen.iter().enumerate() {
                        let datum =
                            if family == "flip" { Datum::Bool(*s != 0.0) } else { Datum::Num(*s) };
                        let d = one(&v, i);
                        expected.add(d.log_density(&datum));
                        let g = d.gradient(&datum).unwrap();
                        slopes[x.at + i] += 2.0 * g.x.first().copied().unwrap_or(0.0);
                        columns
                            .iter()
                            .zip(&g.params)
                            .for_each(|(c, p)| slopes[c.at + i * c.step] += 2.0 * p);
                    }
                    assert_eq!(sum, expected, "{family} {shape}");
                    let off =
                        by.iter().zip(&slopes).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(off < 1e-12, "{family} {shape}: {by:?}, one at a time {slopes:?}");
                }
                // Parameters outside the domain.
                let v = fill(-9.0);
                assert!(!b.score(&v, x, &columns, n, &mut ExactSum::default()), "{family}");
            }
        }
    }

    #[test]
    fn families_do_not_mix() {
        let parts = vec![made("normal", &[0.0, 1.0]).unwrap(), made("gamma", &[1.0, 1.0]).unwrap()];
        assert!(batch(&Dist::Product(Arc::new(Product::new(parts).unwrap())), &[]).is_none());
    }
}
