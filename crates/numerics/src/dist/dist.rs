//! Any distribution, by value: most scalar families are stored inline, the others behind
//! a pointer.

use super::*;
use crate::rng::Stream;
use std::sync::Arc;

/// A distribution of any family, at most 48 bytes.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub enum Dist {
    Normal(Normal),
    LogNormal(LogNormal),
    Uniform(Uniform),
    Beta(Beta),
    Gamma(Gamma),
    Exponential(Exponential),
    HalfNormal(HalfNormal),
    HalfCauchy(HalfCauchy),
    StudentT(StudentT),
    InvGamma(InvGamma),
    Cauchy(Cauchy),
    Laplace(Laplace),
    VonMises(VonMises),
    Weibull(Weibull),
    NegBinomial(NegBinomial),
    Geometric(Geometric),
    Flat(Flat),
    Flip(Flip),
    UniformDiscrete(UniformDiscrete),
    Binomial(Binomial),
    Poisson(Poisson),
    Categorical(Categorical),
    TruncatedNormal(Arc<TruncatedNormal>),
    Truncated(Arc<Truncated>),
    Multinomial(Arc<Multinomial>),
    Lkj(Arc<Lkj>),
    Wishart(Arc<Wishart>),
    Ordered(Arc<Ordered>),
    Mixture(Arc<Mixture>),
    Dirichlet(Arc<Dirichlet>),
    MvNormal(Arc<MvNormal>),
    Gp(Arc<Gp>),
    Iid(Arc<Iid>),
    Product(Arc<Product>),
    /// A distribution provided by a host program.
    Custom(Arc<dyn Distribution>),
}

const _: () = assert!(size_of::<Dist>() <= 48);

/// Evaluates the same expression for every family.
macro_rules! each {
    ($dist:expr, $d:ident => $body:expr) => {
        match $dist {
            Dist::Normal($d) => $body,
            Dist::LogNormal($d) => $body,
            Dist::Uniform($d) => $body,
            Dist::Beta($d) => $body,
            Dist::Gamma($d) => $body,
            Dist::Exponential($d) => $body,
            Dist::HalfNormal($d) => $body,
            Dist::HalfCauchy($d) => $body,
            Dist::StudentT($d) => $body,
            Dist::InvGamma($d) => $body,
            Dist::Cauchy($d) => $body,
            Dist::Laplace($d) => $body,
            Dist::VonMises($d) => $body,
            Dist::Weibull($d) => $body,
            Dist::NegBinomial($d) => $body,
            Dist::Geometric($d) => $body,
            Dist::Flat($d) => $body,
            Dist::TruncatedNormal($d) => $body,
            Dist::Truncated($d) => $body,
            Dist::Multinomial($d) => $body,
            Dist::Lkj($d) => $body,
            Dist::Wishart($d) => $body,
            Dist::Ordered($d) => $body,
            Dist::Mixture($d) => $body,
            Dist::Flip($d) => $body,
            Dist::UniformDiscrete($d) => $body,
            Dist::Binomial($d) => $body,
            Dist::Poisson($d) => $body,
            Dist::Categorical($d) => $body,
            Dist::Dirichlet($d) => $body,
            Dist::MvNormal($d) => $body,
            Dist::Gp($d) => $body,
            Dist::Iid($d) => $body,
            Dist::Product($d) => $body,
            Dist::Custom($d) => $body,
        }
    };
}

/// Defines inherent methods that forward to [`Distribution`].
macro_rules! forward {
    ($($(#[$doc:meta])* $name:ident($($arg:ident: $ty:ty),*) -> $out:ty;)*) => {
        $($(#[$doc])* pub fn $name(&self, $($arg: $ty),*) -> $out { each!(self, d => d.$name($($arg),*)) })*
    };
}

impl Dist {
    forward! {
        /// See [`Distribution::name`].
        name() -> &str;
        /// See [`Distribution::support`].
        support() -> Support;
        /// See [`Distribution::sample`].
        sample(rng: &mut Stream) -> Datum;
        /// See [`Distribution::log_density`].
        #[inline]
        log_density(x: &Datum) -> f64;
        /// See [`Distribution::gradient`].
        gradient(x: &Datum) -> Option<Gradient>;
        /// See [`Distribution::is_gaussian`].
        is_gaussian() -> bool;
        /// See [`Distribution::whiten`].
        whiten(x: &Datum) -> Option<Vec<f64>>;
        /// See [`Distribution::colour`].
        colour(z: &[f64]) -> Option<Datum>;
        /// See [`Distribution::is_scalar`].
        is_scalar() -> bool;
        /// See [`Distribution::is_improper`].
        is_improper() -> bool;
        /// See [`Distribution::is_stored_whitened`].
        is_stored_whitened() -> bool;
        /// See [`Distribution::sample_stored`].
        sample_stored(rng: &mut Stream) -> Datum;
        /// See [`Distribution::log_density_stored`].
        #[inline]
        log_density_stored(s: &Datum) -> f64;
        /// See [`Distribution::gradient_stored`].
        gradient_stored(s: &Datum) -> Option<Gradient>;
        /// See [`Distribution::from_noncentred`].
        from_noncentred(s: &Datum) -> Datum;
        /// See [`Distribution::to_noncentred`].
        to_noncentred(value: &Datum) -> Option<Datum>;
        /// See [`Distribution::stored_support`].
        stored_support() -> Support;
        /// See [`Distribution::mean`].
        mean() -> Option<f64>;
        /// See [`Distribution::sd`].
        sd() -> Option<f64>;
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
            _ => self.log_density(&Datum::Bool(x)),
        }
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

    /// Returns how many distributions it is made of, including repeats; `None` if they
    /// are nested deeper than `depth`. May stop counting above `most`.
    pub fn parts(&self, depth: u32, most: usize) -> Option<usize> {
        let inside = |parts: &[Dist]| {
            let mut sum = 0usize;
            for p in parts.iter().filter(|p| p.is_compound()) {
                sum = sum.saturating_add(p.parts(depth.checked_sub(1)?, most)?);
                if sum > most {
                    break;
                }
            }
            Some(sum.saturating_add(parts.len()))
        };
        match self {
            Dist::Iid(d) => Some(inside(std::slice::from_ref(d.one()))?.saturating_mul(d.len())),
            Dist::Ordered(d) => Some(inside(d.distinct())?.saturating_mul(d.repeats())),
            Dist::Truncated(d) => inside(std::slice::from_ref(d.base())),
            Dist::Product(d) => inside(d.parts()),
            Dist::Mixture(d) => inside(d.components()),
            _ => Some(1),
        }
    }

    /// Returns whether it is made of other distributions.
    fn is_compound(&self) -> bool {
        matches!(
            self,
            Dist::Iid(_)
                | Dist::Ordered(_)
                | Dist::Truncated(_)
                | Dist::Product(_)
                | Dist::Mixture(_)
        )
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

    /// Returns the same distribution in centred form, which stores values, as elements of
    /// a product do.
    pub fn centred(self) -> Dist {
        match self {
            Dist::Gp(d) if d.is_stored_whitened() => Dist::Gp(Arc::new(d.to_centred())),
            Dist::MvNormal(d) if d.is_stored_whitened() => Dist::MvNormal(Arc::new(d.to_centred())),
            other => other,
        }
    }
}
