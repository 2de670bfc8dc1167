//! Any distribution, by value: scalar families without allocation, the rest behind a shared pointer.

use super::*;
use std::sync::Arc;

/// A distribution.
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
    Flip(Flip),
    UniformDiscrete(UniformDiscrete),
    Binomial(Binomial),
    Poisson(Poisson),
    Categorical(Arc<Categorical>),
    Dirichlet(Arc<Dirichlet>),
    MvNormal(Arc<MvNormal>),
    Gp(Arc<Gp>),
    Iid(Arc<Iid>),
    Product(Arc<Product>),
    /// A host's own.
    Custom(Arc<dyn Distribution>),
}

macro_rules! each {
    ($self:ident, $d:ident => $e:expr) => {
        match $self {
            Dist::Normal($d) => $e,
            Dist::LogNormal($d) => $e,
            Dist::Uniform($d) => $e,
            Dist::Beta($d) => $e,
            Dist::Gamma($d) => $e,
            Dist::Exponential($d) => $e,
            Dist::HalfNormal($d) => $e,
            Dist::HalfCauchy($d) => $e,
            Dist::StudentT($d) => $e,
            Dist::Flip($d) => $e,
            Dist::UniformDiscrete($d) => $e,
            Dist::Binomial($d) => $e,
            Dist::Poisson($d) => $e,
            Dist::Categorical($d) => $e,
            Dist::Dirichlet($d) => $e,
            Dist::MvNormal($d) => $e,
            Dist::Gp($d) => $e,
            Dist::Iid($d) => $e,
            Dist::Product($d) => $e,
            Dist::Custom($d) => $e,
        }
    };
}

impl Dist {
    /// See [`Distribution::name`].
    pub fn name(&self) -> &'static str {
        each!(self, d => d.name())
    }

    /// See [`Distribution::support`].
    pub fn support(&self) -> Support {
        each!(self, d => d.support())
    }

    /// See [`Distribution::sample`].
    pub fn sample(&self, rng: &mut Stream) -> Datum {
        each!(self, d => d.sample(rng))
    }

    /// See [`Distribution::log_density`]; never NaN.
    #[inline]
    pub fn log_density(&self, x: &Datum) -> f64 {
        let d = each!(self, d => d.log_density(x));
        if d.is_nan() { f64::NEG_INFINITY } else { d }
    }

    /// See [`Distribution::gradient`].
    pub fn gradient(&self, x: &Datum) -> Option<Gradient> {
        each!(self, d => d.gradient(x))
    }

    /// Whether its values are single numbers or bools.
    pub fn is_scalar(&self) -> bool {
        match self {
            Dist::Dirichlet(_) | Dist::MvNormal(_) | Dist::Gp(_) | Dist::Iid(_) | Dist::Product(_) => false,
            Dist::Custom(d) => !matches!(
                d.support(),
                Support::Simplex(_) | Support::Vector(_) | Support::Repeat(..) | Support::Product(_)
            ),
            _ => true,
        }
    }

    /// The number of independent elements, if it is an array of such.
    pub fn elements(&self) -> Option<usize> {
        match self {
            Dist::Iid(d) => Some(d.count()),
            Dist::Product(d) => Some(d.elements().len()),
            _ => None,
        }
    }

    /// The distribution of an element; the distribution itself where there are none.
    pub fn element(&self, i: usize) -> Dist {
        match self {
            Dist::Iid(d) => d.element().clone(),
            Dist::Product(d) => d.elements().get(i).cloned().unwrap_or_else(|| self.clone()),
            _ => self.clone(),
        }
    }

    /// The log density of an element's value.
    pub fn element_log_density(&self, i: usize, x: &Datum) -> f64 {
        match self {
            Dist::Iid(d) => d.element().log_density(x),
            Dist::Product(d) => d.elements().get(i).map_or(f64::NEG_INFINITY, |d| d.log_density(x)),
            _ => self.log_density(x),
        }
    }

    /// Whether it is a linear image of white noise: [`whiten`](Dist::whiten) and [`colour`](Dist::colour) work.
    pub fn is_gaussian(&self) -> bool {
        match self {
            Dist::Normal(_) | Dist::MvNormal(_) | Dist::Gp(_) => true,
            Dist::Iid(d) => d.element().is_gaussian() && d.element().is_scalar(),
            Dist::Product(d) => d.elements().iter().all(|d| matches!(d, Dist::Normal(_))),
            _ => false,
        }
    }

    /// The white noise behind a value of a Gaussian distribution.
    pub fn whiten(&self, x: &Datum) -> Option<Vec<f64>> {
        match (self, x) {
            (Dist::Normal(d), Datum::Num(x)) => Some(vec![d.whiten_num(*x)]),
            (Dist::MvNormal(d), Datum::Vec(x)) => d.whiten_vec(x),
            (Dist::Gp(d), Datum::Vec(x)) => d.whiten_vec(x),
            (Dist::Iid(_) | Dist::Product(_), x) if self.is_gaussian() => {
                let n = self.elements().filter(|n| x.len() == Some(*n))?;
                (0..n).map(|i| self.element(i).whiten(&x.element(i)?)?.first().copied()).collect()
            }
            _ => None,
        }
    }

    /// The value of white noise, of a Gaussian distribution.
    pub fn colour(&self, z: &[f64]) -> Option<Datum> {
        match self {
            Dist::Normal(d) => z.first().map(|z| Datum::Num(d.colour_num(*z))),
            Dist::MvNormal(d) => d.colour_vec(z).map(|v| Datum::Vec(v.into())),
            Dist::Gp(d) => d.colour_vec(z).map(|v| Datum::Vec(v.into())),
            Dist::Iid(_) | Dist::Product(_) if self.is_gaussian() && self.elements() == Some(z.len()) => {
                let items = z.iter().enumerate().map(|(i, z)| self.element(i).colour(&[*z]));
                items.collect::<Option<Vec<_>>>().map(Datum::from_elements)
            }
            _ => None,
        }
    }

    /// Whether a trace keeps the white noise behind a value instead of the value.
    pub fn is_stored_whitened(&self) -> bool {
        matches!(self, Dist::Gp(d) if !d.is_centred())
    }

    /// Draws what a trace keeps.
    pub fn sample_stored(&self, rng: &mut Stream) -> Datum {
        match self {
            Dist::Gp(d) if !d.is_centred() => d.sample_noise(rng),
            _ => self.sample(rng),
        }
    }

    /// The log density of what a trace keeps.
    #[inline]
    pub fn log_density_stored(&self, x: &Datum) -> f64 {
        match self {
            Dist::Gp(d) if !d.is_centred() => d.log_density_noise(x),
            _ => self.log_density(x),
        }
    }

    /// The value of what a trace keeps.
    pub fn realise(&self, x: &Datum) -> Datum {
        match (self, x) {
            (Dist::Gp(d), Datum::Vec(z)) if !d.is_centred() => {
                d.colour_vec(z).map_or_else(|| x.clone(), |v| Datum::Vec(v.into()))
            }
            _ => x.clone(),
        }
    }

    /// What a trace keeps for a value; `None` if the value does not fit.
    pub fn unrealise(&self, x: &Datum) -> Option<Datum> {
        match (self, x) {
            (Dist::Gp(d), Datum::Vec(v)) if !d.is_centred() => d.whiten_vec(v).map(|z| Datum::Vec(z.into())),
            (Dist::Gp(d), _) if !d.is_centred() => None,
            _ => Some(x.clone()),
        }
    }

    /// The support of what a trace keeps.
    pub fn stored_support(&self) -> Support {
        self.support()
    }
}
