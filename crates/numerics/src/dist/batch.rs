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

    /// Appends the log densities of the numbers of the last `score`, one by one.
    fn each(&self, buffer: &[f64], x: Column, n: usize, out: &mut Vec<f64>);

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

    /// Writes the log densities of `n` numbers to the buffer, from `out` on. Returns false
    /// if a number is NaN or a parameter is outside its domain.
    fn score_each(
        &mut self,
        buffer: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> bool;

    /// Adds the derivatives of the log densities of the last `score_each` to the
    /// adjoints, each times the adjoint of its log density.
    fn vjp_each(
        &self,
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    );
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

    /// See [`Scalar::score_columns`].
    fn score_columns(
        _buffer: &mut [f64],
        _x: Column,
        _params: &[Column],
        _n: usize,
        _out: usize,
    ) -> Option<bool> {
        None
    }

    /// See [`Scalar::vjp_columns`].
    fn vjp_columns(
        _buffer: &[f64],
        _by: &mut [f64],
        _x: Column,
        _params: &[Column],
        _n: usize,
        _out: usize,
    ) -> bool {
        false
    }

    /// Returns the derivatives with respect to the number (0 if it is discrete) and to
    /// the parameters.
    fn slopes(&self, x: f64) -> (f64, [f64; N]);
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

    fn score_columns(
        buffer: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> Option<bool> {
        <T as Scalar>::score_columns(buffer, x, params, n, out)
    }

    fn vjp_columns(
        buffer: &[f64],
        by: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> bool {
        <T as Scalar>::vjp_columns(buffer, by, x, params, n, out)
    }

    #[inline]
    fn slopes(&self, x: f64) -> (f64, [f64; N]) {
        let slope = self.slope(x);
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
        let mut numbers = true;
        let mut one = |x: f64, d: &T| {
            numbers &= !x.is_nan();
            d.log_density(x)
        };
        match &self.0[..] {
            [(_, d)] => sum.add_each((0..n).map(|i| one(x.get(buffer, i), d))),
            all => {
                let each = all.iter().enumerate();
                sum.add_each(each.map(|(i, (_, d))| one(x.get(buffer, i), d)));
            }
        }
        numbers
    }

    fn each(&self, buffer: &[f64], x: Column, n: usize, out: &mut Vec<f64>) {
        match &self.0[..] {
            [(_, d)] => out.extend((0..n).map(|i| d.log_density(x.get(buffer, i)))),
            all => {
                let one = |(i, (_, d)): (usize, &(_, T))| d.log_density(x.get(buffer, i));
                out.extend(all.iter().enumerate().map(one));
            }
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

    fn score_each(
        &mut self,
        buffer: &mut [f64],
        x: Column,
        params: &[Column],
        n: usize,
        out: usize,
    ) -> bool {
        let columns = <&[Column; N]>::try_from(params).ok();
        if let Some(there) = T::score_columns(buffer, x, params, n, out) {
            return there;
        }
        let alike = columns.is_some_and(|all| all.iter().skip(1).all(|c| c.step == 0));
        let mut there = true;
        for i in 0..self.0.len() {
            if let Some(columns) = columns {
                let p = columns.map(|c| c.get(buffer, i));
                if self.0[i].0.is_none_or(|old| old.map(f64::to_bits) != p.map(f64::to_bits)) {
                    let before = if alike && i > 0 { i - 1 } else { i };
                    let Some(made) = self.0[before].1.moved(p) else { return false };
                    self.0[i] = (Some(p), made);
                }
            }
            // One distribution may be that of all numbers.
            let own = if self.0.len() == 1 { 0..n } else { i..i + 1 };
            for j in own {
                let at = x.get(buffer, j);
                there &= !at.is_nan();
                buffer[out + j] = self.0[i].1.log_density(at);
            }
        }
        there
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
        if T::vjp_columns(buffer, by, x, params, n, out) {
            return;
        }
        let each = self.0.len() != 1;
        let columns = <&[Column; N]>::try_from(params).ok();
        let (mut of_x, mut of_params) = (0.0, [0.0; N]);
        for i in 0..n {
            let weight = by[out + i];
            if weight == 0.0 {
                continue;
            }
            let (gx, gp) = self.0[if each { i } else { 0 }].1.slopes(x.get(buffer, i));
            if x.live {
                if x.step == 0 { of_x += gx * weight } else { by[x.at + i] += gx * weight }
            }
            for (k, c) in columns.into_iter().flatten().enumerate().filter(|(_, c)| c.live) {
                let g = gp[k] * weight;
                if c.step == 0 { of_params[k] += g } else { by[c.at + i] += g }
            }
        }
        if x.live && x.step == 0 {
            by[x.at] += of_x;
        }
        for (k, c) in columns.into_iter().flatten().enumerate() {
            if c.live && c.step == 0 {
                by[c.at] += of_params[k];
            }
        }
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
