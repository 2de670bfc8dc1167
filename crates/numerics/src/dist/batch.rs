//! Log densities and their derivatives for many numbers under distributions of one
//! family, whose parameters lie in a buffer. The results equal those of evaluating one
//! number at a time, but there are no allocations, and work that depends only on
//! unchanged parameters is not repeated.

use super::*;
use crate::num::{Column, ExactSum};
use std::fmt;

/// Numbers in a column, and the columns of their distributions' parameters.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The numbers.
    pub x: Column,
    /// The parameters, in the order of the constructor.
    pub params: &'a [Column],
    /// The number of numbers.
    pub n: usize,
}

/// Numbers under distributions of one family. Columns of parameters are in the order of
/// the constructor; without columns, the parameters stay as they were when the batch was
/// made.
pub trait Batch: fmt::Debug + Send + Sync {
    /// Adds the log densities of `n` numbers to a sum. Returns false, with part of them
    /// added, if a number is NaN or a parameter is outside its domain.
    fn score(&mut self, buffer: &[f64], rows: Rows, sum: &mut ExactSum) -> bool;

    /// Appends the log densities of the numbers of the last `score`, one by one.
    fn each(&self, buffer: &[f64], rows: Rows, out: &mut Vec<f64>);

    /// Adds `weight` times the derivatives of the log densities of the last `score` to
    /// the adjoints, which are laid out like the buffer.
    fn vjp(&self, buffer: &[f64], by: &mut [f64], rows: Rows, weight: f64);

    /// Writes the log densities of `n` numbers to the buffer, from `out` on. Returns false
    /// if a number is NaN or a parameter is outside its domain.
    fn score_each(&mut self, buffer: &mut [f64], rows: Rows, out: usize) -> bool;

    /// Adds the derivatives of the log densities of the last `score_each` to the
    /// adjoints, each times the adjoint of its log density.
    fn vjp_each(&self, buffer: &[f64], by: &mut [f64], rows: Rows, out: usize);
}

/// A batch of one family that also gives the density and derivatives of its first
/// distribution, which may be a component of a mixture.
pub(super) trait Component: Batch {
    /// Rebuilds the distributions whose parameters have changed. Returns false if a
    /// parameter is outside its domain.
    fn refresh(&mut self, buffer: &[f64], params: &[Column]) -> bool;

    /// Returns the log density of a number under the first distribution.
    fn log_density_num(&self, x: f64) -> f64;

    /// Returns its derivative with respect to the number, and writes those with respect
    /// to the parameters.
    fn slopes_num(&self, x: f64, params: &mut [f64; 3]) -> f64;
}

/// A distribution with `N` numbers as parameters, of a value that a number stands for.
pub(super) trait Member<const N: usize>:
    Clone + fmt::Debug + Send + Sync + TryFrom<[f64; N], Error = ParamError>
{
    /// Returns the distribution with these parameters, which may reuse results from
    /// `self`; `None` if they are outside its domain.
    #[inline]
    fn moved(&self, params: [f64; N]) -> Option<Self> {
        Self::try_from(params).ok()
    }

    fn log_density(&self, x: f64) -> f64;

    /// Returns the derivatives with respect to the number (0 if it is discrete) and to
    /// the parameters; that of the first parameter only if it is asked for.
    fn slopes(&self, x: f64, first: bool) -> (f64, [f64; N]);
}

impl<T, const N: usize> Member<N> for T
where
    T: Scalar + Clone + TryFrom<[f64; N], Error = ParamError>,
{
    #[inline]
    fn moved(&self, params: [f64; N]) -> Option<Self> {
        self.reused(&params).or_else(|| Self::try_from(params).ok())
    }

    #[inline]
    fn log_density(&self, x: f64) -> f64 {
        self.log_density_num(x)
    }

    #[inline]
    fn slopes(&self, x: f64, first: bool) -> (f64, [f64; N]) {
        let slope = if first { self.slope(x) } else { self.slope_without_shape(x) };
        let mut params = [0.0; N];
        params.iter_mut().zip(&slope.params).for_each(|(p, s)| *p = *s);
        (slope.x.unwrap_or(0.0), params)
    }
}

/// Distributions, one for all numbers or one for each, with the parameters they were made
/// from.
#[derive(Debug)]
pub(super) struct Members<T, const N: usize>(Vec<(Option<[f64; N]>, T)>);

impl<T: Member<N> + 'static, const N: usize> Members<T, N> {
    /// Creates the batch of distributions of this family with `width` columns of
    /// parameters, or none; `None` if there are others among them.
    pub(super) fn component(
        parts: &[Dist],
        width: usize,
        own: fn(&Dist) -> Option<&T>,
    ) -> Option<Box<dyn Component>> {
        const { assert!(N <= 3, "a mixture keeps the derivatives by at most 3 parameters") };
        let one = |p: &Dist| Some((None, own(p)?.clone()));
        let all: Vec<_> = parts.iter().map(one).collect::<Option<_>>()?;
        (width == 0 || width == N).then(|| Box::new(Members::<T, N>(all)) as Box<dyn Component>)
    }
}

impl<T: Member<N>, const N: usize> Component for Members<T, N> {
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
        let (by, own) = d.slopes(x, true);
        params.iter_mut().zip(own).for_each(|(p, s)| *p = s);
        by
    }
}

impl<T: Member<N>, const N: usize> Members<T, N> {
    /// Returns each number with its distribution.
    fn numbers(&self, buffer: &[f64], rows: Rows) -> impl Iterator<Item = (f64, &T)> {
        let each = usize::from(self.0.len() != 1);
        (0..rows.n).map(move |i| (rows.x.get(buffer, i), &self.0[i * each].1))
    }

    /// Adds the derivatives of the log densities, times `all`, and times the adjoint of
    /// each, of which the first is at `weights`, if there are any.
    fn add_slopes(
        &self,
        buffer: &[f64],
        by: &mut [f64],
        rows: Rows,
        weights: Option<usize>,
        all: f64,
    ) {
        let (x, columns) = (rows.x, <&[Column; N]>::try_from(rows.params).ok());
        let first = columns.and_then(|c| c.first()).is_some_and(|c| c.live);
        let (mut of_x, mut of_params) = (0.0, [0.0; N]);
        for (i, (at, d)) in self.numbers(buffer, rows).enumerate() {
            let weight = weights.map_or(1.0, |from| by[from + i]);
            // An infinite slope does not matter there.
            if weight == 0.0 {
                continue;
            }
            let (gx, gp) = d.slopes(at, first);
            if x.live {
                let g = gx * weight;
                if x.step == 0 { of_x += g } else { by[x.at + i] += g * all }
            }
            for (k, c) in columns.into_iter().flatten().enumerate().filter(|(_, c)| c.live) {
                let g = gp[k] * weight;
                if c.step == 0 { of_params[k] += g } else { by[c.at + i] += g * all }
            }
        }
        if x.live && x.step == 0 {
            by[x.at] += of_x * all;
        }
        for (k, c) in
            columns.into_iter().flatten().enumerate().filter(|(_, c)| c.live && c.step == 0)
        {
            by[c.at] += of_params[k] * all;
        }
    }
}

impl<T: Member<N>, const N: usize> Batch for Members<T, N> {
    fn score(&mut self, buffer: &[f64], rows: Rows, sum: &mut ExactSum) -> bool {
        if !self.refresh(buffer, rows.params) {
            return false;
        }
        let mut there = true;
        sum.add_each(self.numbers(buffer, rows).map(|(x, d)| {
            there &= !x.is_nan();
            d.log_density(x)
        }));
        there
    }

    fn each(&self, buffer: &[f64], rows: Rows, out: &mut Vec<f64>) {
        out.extend(self.numbers(buffer, rows).map(|(x, d)| d.log_density(x)));
    }

    fn vjp(&self, buffer: &[f64], by: &mut [f64], rows: Rows, weight: f64) {
        self.add_slopes(buffer, by, rows, None, weight);
    }

    fn score_each(&mut self, buffer: &mut [f64], rows: Rows, out: usize) -> bool {
        if !self.refresh(buffer, rows.params) {
            return false;
        }
        // What is read is before what is written.
        let (before, out) = buffer.split_at_mut(out);
        let mut there = true;
        for (out, (x, d)) in out.iter_mut().zip(self.numbers(before, rows)) {
            there &= !x.is_nan();
            *out = d.log_density(x);
        }
        there
    }

    fn vjp_each(&self, buffer: &[f64], by: &mut [f64], rows: Rows, out: usize) {
        self.add_slopes(buffer, by, rows, Some(out), 1.0);
    }
}

/// Returns the distributions of the elements, or the one of all of them.
pub(super) fn parts(dist: &Dist) -> &[Dist] {
    match dist {
        Dist::Iid(d) => std::slice::from_ref(d.one()),
        Dist::Product(d) => d.parts(),
        one => std::slice::from_ref(one),
    }
}

/// Like [`batch`], but returns the batch as a [`Component`].
pub(super) fn component(dist: &Dist, params: &[Column]) -> Option<Box<dyn Component>> {
    families::component(parts(dist), params.len())
}
