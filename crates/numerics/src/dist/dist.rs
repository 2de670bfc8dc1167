//! The methods of a distribution of any family.

use super::families::each;
use super::{CdfSlopes, Datum, Dist, Distribution, Gradient, Support, Tails};
use crate::rng::Stream;

/// Defines inherent methods that forward to [`Distribution`].
macro_rules! forward {
    ($($(#[$attribute:meta])* $name:ident($($arg:ident: $ty:ty),*) -> $out:ty;)*) => {$(
        #[doc = concat!("See [`Distribution::", stringify!($name), "`].")]
        $(#[$attribute])*
        pub fn $name(&self, $($arg: $ty),*) -> $out {
            each!(self, d => d.$name($($arg),*))
        }
    )*};
}

impl Dist {
    forward! {
        name() -> &str;
        support() -> Support;
        sample(rng: &mut Stream) -> Datum;
        #[inline]
        log_density(x: &Datum) -> f64;
        gradient(x: &Datum) -> Option<Gradient>;
        param_count() -> usize;
        has_moving_support() -> bool;
        is_gaussian() -> bool;
        whiten(x: &Datum) -> Option<Vec<f64>>;
        colour(z: &[f64]) -> Option<Datum>;
        is_scalar() -> bool;
        is_improper() -> bool;
        is_stored_whitened() -> bool;
        sample_stored(rng: &mut Stream) -> Datum;
        #[inline]
        log_density_stored(s: &Datum) -> f64;
        gradient_stored(s: &Datum) -> Option<Gradient>;
        from_noncentred(s: &Datum) -> Datum;
        from_noncentred_vjp(by: &[f64]) -> Option<Vec<f64>>;
        to_noncentred(value: &Datum) -> Option<Datum>;
        stored_support() -> Support;
        pole() -> Option<f64>;
        mean() -> Option<f64>;
        sd() -> Option<f64>;
        cdf_slopes(x: f64) -> Option<CdfSlopes>;
    }

    /// Returns the log density of a number.
    #[inline]
    pub fn log_density_num(&self, x: f64) -> f64 {
        self.log_density(&Datum::Num(x))
    }

    /// Returns the log probability of a truth value.
    #[inline]
    pub fn log_density_bool(&self, x: bool) -> f64 {
        match self {
            Dist::Flip(d) => d.log_probability(x),
            Dist::FlipLogit(d) => d.log_probability(x),
            _ => self.log_density(&Datum::Bool(x)),
        }
    }

    /// Returns the log probabilities on both sides of a number; `None` if they are not
    /// known.
    pub(super) fn tails(&self, x: f64) -> Option<Tails> {
        match x {
            f64::INFINITY => Some(Tails::ALL_BELOW),
            f64::NEG_INFINITY => Some(Tails::NONE_BELOW),
            x => each!(self, d => d.tails(x)),
        }
    }

    /// For a number x(y) that is stored as an unconstrained coordinate y: returns the
    /// derivatives with respect to the parameters, with y fixed, of f(x(y)) + log
    /// |dx/dy|, where `by` is df/dx. `None` if they are not known.
    pub fn by_bounds(&self, x: &Datum, by: f64) -> Option<Vec<f64>> {
        let x = x.num()?;
        // With respect to the lower and the upper bound.
        let (lo, hi) = match self.support() {
            // x = lo + (hi - lo) p, log |dx/dy| = log (hi - lo) + log p + log (1 - p).
            Support::Interval { lo, hi } => {
                let (width, p) = (hi - lo, (x - lo) / (hi - lo));
                (by * (1.0 - p) - 1.0 / width, by * p + 1.0 / width)
            }
            Support::AtLeast { .. } => (by, 0.0),
            Support::AtMost { .. } => (0.0, by),
            _ => (0.0, 0.0),
        };
        self.by_ends(lo, hi)
    }

    /// Returns the derivatives with respect to the parameters of a function of the bounds
    /// of the support, given those with respect to the bounds.
    pub(super) fn by_ends(&self, lo: f64, hi: f64) -> Option<Vec<f64>> {
        each!(self, d => d.by_bounds(lo, hi))
    }

    /// Returns the number of independent elements, each of which is a separate choice;
    /// `None` if the distribution is a single choice.
    pub fn elements(&self) -> Option<usize> {
        match self {
            Dist::Iid(d) => Some(d.len()),
            Dist::Product(d) => Some(d.len()),
            _ => None,
        }
    }

    /// Returns the distribution of element `i`, or `self` if that element does not exist.
    pub fn element(&self, i: usize) -> Dist {
        match self {
            Dist::Iid(d) => d.one().clone(),
            Dist::Product(d) => d.parts().get(i).unwrap_or(self).clone(),
            _ => self.clone(),
        }
    }

    /// Returns the log density of element `i`; -inf if it does not exist.
    #[inline]
    pub fn element_log_density(&self, i: usize, x: &Datum) -> f64 {
        match self {
            Dist::Iid(d) if i < d.len() => d.one().log_density(x),
            Dist::Product(d) => d.parts().get(i).map_or(f64::NEG_INFINITY, |p| p.log_density(x)),
            _ => f64::NEG_INFINITY,
        }
    }

    /// Returns how many distributions it is made of, including repeats; `None` if they
    /// are nested deeper than `depth`. May stop counting above `most`.
    pub fn parts(&self, depth: u32, most: usize) -> Option<usize> {
        let Some((parts, repeats)) = each!(self, d => d.made_of()) else { return Some(1) };
        let mut sum = 0usize;
        for p in parts.iter().filter(|p| p.is_compound()) {
            sum = sum.saturating_add(p.parts(depth.checked_sub(1)?, most)?);
            if sum > most {
                break;
            }
        }
        Some(sum.saturating_add(parts.len()).saturating_mul(repeats))
    }

    /// Returns whether it is made of other distributions.
    fn is_compound(&self) -> bool {
        each!(self, d => d.made_of()).is_some()
    }

    /// Returns the same distribution in centred form, which stores values, as elements of
    /// a product do.
    pub fn centred(self) -> Dist {
        each!(&self, d => d.centred()).unwrap_or(self)
    }
}
