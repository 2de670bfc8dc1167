//! The common part of Gaussian vectors: a mean, a Cholesky factor, and how the choice is
//! stored. `mv_normal` and `gp` differ only in where these come from.
//!
//! A whitened vector stores white noise z ~ N(0, I) with value = mean + L z, so the value
//! follows when the mean and L change. A centred vector stores the value.

use crate::dist::joint::factor::Factor;
use crate::dist::{Datum, Gradient};
use crate::num::LN_SQRT_2PI;
use crate::rng::Stream;

/// N(mean, L L').
#[derive(Clone, Debug, PartialEq)]
pub(in crate::dist) struct Gaussian {
    pub mean: Box<[f64]>,
    pub factor: Factor,
    pub whitened: bool,
}

/// Returns the log density of standard normal noise.
fn standard_score(z: &[f64]) -> f64 {
    let square: f64 = z.iter().map(|z| z * z).sum();
    -0.5 * square - LN_SQRT_2PI * z.len() as f64
}

impl Gaussian {
    pub fn size(&self) -> usize {
        self.mean.len()
    }

    pub fn centred(&self) -> Gaussian {
        Gaussian { whitened: false, ..self.clone() }
    }

    fn noise(&self, rng: &mut Stream) -> Vec<f64> {
        self.mean.iter().map(|_| rng.standard_normal()).collect()
    }

    pub fn sample(&self, rng: &mut Stream) -> Datum {
        self.factor.colour(&self.mean, &self.noise(rng)).into()
    }

    pub fn log_density(&self, x: &Datum) -> f64 {
        let score = x.with_numbers(self.size(), |x| {
            if x.iter().any(|x| !x.is_finite()) {
                return f64::NEG_INFINITY;
            }
            standard_score(&self.factor.whiten(&self.mean, x)) - self.factor.log_det()
        });
        score.filter(|s| !s.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    /// Returns the derivatives of the log density with respect to the value and the mean.
    pub fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        let solve = |x: &[f64]| self.factor.solve_transposed(self.factor.whiten(&self.mean, x));
        let by_mean = x.with_numbers(self.size(), solve)?;
        Some(Gradient { x: by_mean.iter().map(|g| -g).collect(), params: by_mean })
    }

    /// Returns derivatives with respect to the packed entries of L. For a centred vector,
    /// they are those of the log density; for a whitened one, those of a function of the
    /// value whose derivatives with respect to the value are `by_value`.
    pub fn factor_gradient(&self, stored: &Datum, by_value: &[f64]) -> Option<Vec<f64>> {
        let outer = |a: &[f64], z: &[f64]| -> Vec<f64> {
            a.iter().enumerate().flat_map(|(i, a)| z[..=i].iter().map(move |z| a * z)).collect()
        };
        if self.whitened {
            return stored.with_numbers(self.size(), |z| outer(by_value, z));
        }
        let z = self.whiten(stored)?;
        let mut by = outer(&self.factor.solve_transposed(z.clone()), &z);
        for i in 0..self.size() {
            by[i * (i + 1) / 2 + i] -= 1.0 / self.factor.diagonal(i);
        }
        Some(by)
    }

    /// Returns the white noise that gives a value; `None` if it is not finite.
    pub fn whiten(&self, x: &Datum) -> Option<Vec<f64>> {
        x.with_numbers(self.size(), |x| self.factor.whiten(&self.mean, x))
            .filter(|z| z.iter().all(|z| z.is_finite()))
    }

    pub fn colour(&self, z: &[f64]) -> Option<Datum> {
        (z.len() == self.size()).then(|| self.factor.colour(&self.mean, z).into())
    }

    pub fn sample_stored(&self, rng: &mut Stream) -> Datum {
        if self.whitened { self.noise(rng).into() } else { self.sample(rng) }
    }

    pub fn log_density_stored(&self, s: &Datum) -> f64 {
        if !self.whitened {
            return self.log_density(s);
        }
        let score = s.with_numbers(self.size(), standard_score);
        score.filter(|s| !s.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }

    pub fn gradient_stored(&self, s: &Datum) -> Option<Gradient> {
        if !self.whitened {
            return self.gradient(s);
        }
        if !self.log_density_stored(s).is_finite() {
            return None;
        }
        let x = s.with_numbers(self.size(), |z| z.iter().map(|z| -z).collect())?;
        Some(Gradient { x, params: vec![0.0; self.size()] })
    }

    /// Returns the value of a stored form. Noise of the wrong length is cut, or padded
    /// with zeros.
    #[allow(clippy::wrong_self_convention)] // The distribution is the map, not the result.
    pub fn from_noncentred(&self, s: &Datum) -> Datum {
        if !self.whitened {
            return s.clone();
        }
        match s.with_numbers(self.size(), |z| self.factor.colour(&self.mean, z)) {
            Some(x) => x.into(),
            None => {
                let number = |i| s.element(i).and_then(|x| x.num()).unwrap_or(0.0);
                let z: Vec<f64> = (0..self.size()).map(number).collect();
                self.factor.colour(&self.mean, &z).into()
            }
        }
    }

    pub fn to_noncentred(&self, value: &Datum) -> Option<Datum> {
        if self.whitened { self.whiten(value).map(Datum::from) } else { Some(value.clone()) }
    }
}

/// Implements [`crate::dist::Distribution`] for a family that wraps a [`Gaussian`].
macro_rules! gaussian_family {
    ($family:ident) => {
        impl $family {
            /// Returns derivatives with respect to the Cholesky factor, its lower triangle
            /// by rows. For a centred distribution, they are those of the log density; for
            /// a whitened one, those of a function of the value whose derivatives with
            /// respect to the value are `by_value`.
            pub fn factor_gradient(
                &self,
                stored: &$crate::dist::Datum,
                by_value: &[f64],
            ) -> Option<Vec<f64>> {
                self.0.factor_gradient(stored, by_value)
            }
        }

        impl $crate::dist::Distribution for $family {
            fn name(&self) -> &'static str {
                <$family as $crate::dist::Named>::NAME
            }

            fn support(&self) -> $crate::dist::Support {
                $crate::dist::Support::Vector(self.0.size())
            }

            fn is_gaussian(&self) -> bool {
                true
            }

            fn is_stored_whitened(&self) -> bool {
                self.0.whitened
            }

            fn from_noncentred_vjp(&self, by: &[f64]) -> Option<Vec<f64>> {
                Some(self.0.factor.transposed_times(by))
            }

            fn centred(&self) -> Option<$crate::dist::Dist> {
                self.0.whitened.then(|| self.to_centred().into())
            }

            $crate::dist::joint::gaussian::forward! {
                sample(rng: &mut $crate::rng::Stream) -> $crate::dist::Datum;
                log_density(x: &$crate::dist::Datum) -> f64;
                gradient(x: &$crate::dist::Datum) -> Option<$crate::dist::Gradient>;
                whiten(x: &$crate::dist::Datum) -> Option<Vec<f64>>;
                colour(z: &[f64]) -> Option<$crate::dist::Datum>;
                sample_stored(rng: &mut $crate::rng::Stream) -> $crate::dist::Datum;
                log_density_stored(s: &$crate::dist::Datum) -> f64;
                gradient_stored(s: &$crate::dist::Datum) -> Option<$crate::dist::Gradient>;
                from_noncentred(s: &$crate::dist::Datum) -> $crate::dist::Datum;
                to_noncentred(value: &$crate::dist::Datum) -> Option<$crate::dist::Datum>;
            }
        }
    };
}

macro_rules! forward {
    ($($name:ident($arg:ident: $ty:ty) -> $out:ty;)*) => {
        $(fn $name(&self, $arg: $ty) -> $out { self.0.$name($arg) })*
    };
}

pub(in crate::dist) use {forward, gaussian_family};
