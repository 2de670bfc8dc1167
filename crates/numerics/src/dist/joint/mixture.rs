//! Mixtures: a value from one of several distributions, with the component summed out.

use crate::dist::continuous::interval::ends;
use crate::dist::*;
use crate::num::log_sum_exp;
use smallvec::SmallVec;

/// `mixture(weights, components)`. The density is the weighted mean of the components'
/// densities.
///
/// Its support is that of the components if they agree; otherwise, for numbers, the
/// smallest interval that contains theirs. Components are in centred form: they store
/// values, not white noise. Parameter gradients are with respect to the weights, then to
/// the parameters of each component.
#[derive(Clone, Debug)]
pub struct Mixture {
    weights: Categorical,
    log_shares: Box<[f64]>,
    total: f64,
    components: Box<[Dist]>,
    support: Support,
}

impl Mixture {
    /// Creates the mixture. Fails unless there is a component, there is a weight for
    /// each, the weights are finite and not negative with a positive, finite sum, and the
    /// components are proper and have the same kind of values.
    pub fn new(weights: &[f64], components: Vec<Dist>) -> Result<Mixture, ParamError> {
        let bad = |parameter, value: String, rule| Self::bad(parameter, value, rule);
        if weights.len() != components.len() {
            let value = format!("{} for {}", weights.len(), components.len());
            return Err(bad("weights", value, "must have one number per component"));
        }
        let choice =
            Categorical::new(weights).map_err(|e| ParamError { distribution: "mixture", ..e })?;
        if let Some(c) = components.iter().find(|c| c.is_improper()) {
            return Err(bad("components", c.name().into(), "must be proper distributions"));
        }
        let components: Box<[Dist]> = components.into_iter().map(Dist::centred).collect();
        let mut supports = components.iter().map(|c| plain(c.support()));
        let first =
            supports.next().ok_or_else(|| bad("components", "none".into(), "must not be empty"))?;
        let names = || components.iter().map(Dist::name).collect::<Vec<_>>().join(", ");
        let support = supports
            .try_fold(first, union)
            .ok_or_else(|| bad("components", names(), "must have the same kind of values"))?;
        let (total, log_shares) = Mixture::log_shares(weights, Vec::new());
        Ok(Mixture { weights: choice, log_shares: log_shares.into(), total, components, support })
    }

    /// Returns the components' log densities, without their weights.
    fn scores(&self, x: &Datum) -> Vec<f64> {
        self.components.iter().map(|c| c.log_density(x)).collect()
    }

    /// Returns the posterior probability of each component given a value; `None` where
    /// the density is not positive and finite.
    pub fn responsibilities(&self, x: &Datum) -> Option<Vec<f64>> {
        let scores = self.scores(x);
        let all = Self::total(&self.log_shares, &scores);
        let share = |(w, s): (&f64, &f64)| Self::share(*w, *s, all);
        all.is_finite().then(|| self.log_shares.iter().zip(&scores).map(share).collect())
    }

    /// Returns the component distributions.
    pub(in crate::dist) fn components(&self) -> &[Dist] {
        &self.components
    }

    /// Returns the weights, the logarithms of the normalised weights, and the sum of the
    /// weights.
    pub(in crate::dist) fn shares(&self) -> (&[f64], &[f64], f64) {
        (self.weights.weights(), &self.log_shares, self.total)
    }
}

impl Mixture {
    /// Computes the log density from the components' log densities. A component with zero
    /// weight is ignored, even at its poles.
    #[inline]
    pub(in crate::dist) fn total(log_shares: &[f64], scores: &[f64]) -> f64 {
        let weighted = log_shares.iter().zip(scores).filter(|(w, _)| **w > f64::NEG_INFINITY);
        log_sum_exp(&weighted.map(|(w, s)| w + s).collect::<SmallVec<[f64; 8]>>())
    }

    /// Returns the posterior probability of a component.
    #[inline]
    pub(in crate::dist) fn share(log_share: f64, score: f64, all: f64) -> f64 {
        if log_share > f64::NEG_INFINITY { libm::exp(log_share + score - all) } else { 0.0 }
    }

    /// Returns the derivative of the log density with respect to a weight.
    #[inline]
    pub(in crate::dist) fn by_weight(score: f64, all: f64, total: f64) -> f64 {
        (libm::exp(score - all).min(f64::MAX) - 1.0) / total
    }

    /// Returns the sum of the weights and the logarithms of the normalised weights, using
    /// `into` as storage.
    pub(in crate::dist) fn log_shares(weights: &[f64], mut into: Vec<f64>) -> (f64, Vec<f64>) {
        let total: f64 = weights.iter().sum();
        into.clear();
        into.extend(weights.iter().map(|w| libm::log(*w) - libm::log(total)));
        (total, into)
    }
}

/// Converts products of real numbers to `Vector`, so that equal spaces compare equal.
fn plain(s: Support) -> Support {
    match s {
        Support::Product(one, n) if *one == Support::Real => Support::Vector(n),
        Support::Each(all) if all.iter().all(|s| *s == Support::Real) => Support::Vector(all.len()),
        other => other,
    }
}

/// Returns the bounds of a space of continuous numbers; `None` for other spaces.
fn bounds(s: &Support) -> Option<(f64, f64)> {
    match s {
        Support::Circle => Some((-core::f64::consts::PI, core::f64::consts::PI)),
        Support::Integers { .. } => None,
        s => ends(s),
    }
}

/// Returns the smallest space that contains both; `None` if their values are of different
/// kinds.
pub(in crate::dist) fn union(a: Support, b: Support) -> Option<Support> {
    if a == b {
        return Some(a);
    }
    if let (Support::Integers { lo: a, hi: i }, Support::Integers { lo: b, hi: j }) = (&a, &b) {
        return Some(Support::Integers { lo: *a.min(b), hi: i.zip(*j).map(|(i, j)| i.max(j)) });
    }
    let ((a, i), (b, j)) = (bounds(&a)?, bounds(&b)?);
    let (lo, hi) = (a.min(b), i.max(j));
    Some(match (lo == f64::NEG_INFINITY, hi == f64::INFINITY) {
        (true, true) => Support::Real,
        (false, true) => Support::AtLeast { lo },
        (true, false) => Support::AtMost { hi },
        (false, false) => Support::Interval { lo, hi },
    })
}

impl Distribution for Mixture {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        self.support.clone()
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let i = self.weights.draw(rng) as usize;
        self.components[i.min(self.components.len() - 1)].sample(rng)
    }

    fn log_density(&self, x: &Datum) -> f64 {
        let score = Self::total(&self.log_shares, &self.scores(x));
        if score.is_nan() { f64::NEG_INFINITY } else { score }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let shares = self.responsibilities(x)?;
        let scores = self.scores(x);
        let all = Self::total(&self.log_shares, &scores);
        let dim = self.support.gradient_dim();
        let by_weight = |s: &f64| Self::by_weight(*s, all, self.total);
        let mut g = Gradient { x: vec![0.0; dim], params: scores.iter().map(by_weight).collect() };
        for (share, c) in shares.iter().zip(&self.components) {
            match c.gradient(x).filter(|_| *share > 0.0) {
                Some(one) => {
                    g.x.iter_mut().zip(&one.x).for_each(|(a, b)| *a += share * b);
                    g.params.extend(one.params.iter().map(|p| share * p));
                }
                None => g.params.extend(std::iter::repeat_n(0.0, c.param_count())),
            }
        }
        Some(g)
    }

    fn mean(&self) -> Option<f64> {
        let means = self.components.iter().map(Dist::mean).collect::<Option<Vec<_>>>()?;
        Some(means.iter().zip(&self.log_shares).map(|(m, w)| m * libm::exp(*w)).sum())
    }

    /// Combines the variances within and between components.
    fn sd(&self) -> Option<f64> {
        let mean = self.mean()?;
        let mut variance = 0.0;
        for (c, w) in self.components.iter().zip(&self.log_shares) {
            let (m, sd) = (c.mean()?, c.sd()?);
            variance += libm::exp(*w) * (sd * sd + (m - mean) * (m - mean));
        }
        Some(variance.sqrt())
    }

    fn tails(&self, x: f64) -> Option<Tails> {
        let shares = self.log_shares.iter().zip(&self.components);
        let likely = shares.filter(|(s, _)| **s > f64::NEG_INFINITY);
        let all: Option<Vec<(f64, Tails)>> = likely.map(|(s, c)| Some((*s, c.tails(x)?))).collect();
        Some(Tails::mixed(&all?))
    }

    fn cdf_slopes(&self, x: f64) -> Option<CdfSlopes> {
        let all = self.log_density(&Datum::Num(x));
        let whole = self.tails(x)?;
        // Differences of the smaller tail, relative to the density.
        let lower = whole.below <= whole.above;
        let part = |t: Tails| match lower {
            true => libm::exp(t.below - all),
            false => -libm::exp(t.above - all),
        };
        let (mut by_weight, mut rest) = (CdfSlopes::new(), CdfSlopes::new());
        for (share, c) in self.log_shares.iter().zip(&self.components) {
            by_weight.push((part(c.tails(x)?) - part(whole)) / self.total);
            let own = libm::exp(share + c.log_density_num(x) - all);
            match c.cdf_slopes(x).filter(|_| own > 0.0) {
                Some(cdf_slopes) => rest.extend(cdf_slopes.iter().map(|s| own * s)),
                None if own > 0.0 => return None,
                None => rest.extend(std::iter::repeat_n(0.0, c.param_count())),
            }
        }
        by_weight.extend(rest);
        Some(by_weight)
    }

    /// That of the components which the others vanish beside.
    fn pole(&self) -> Option<f64> {
        self.components.iter().filter_map(Dist::pole).min_by(f64::total_cmp)
    }

    fn has_moving_support(&self) -> bool {
        self.components.iter().any(Dist::has_moving_support)
    }

    fn made_of(&self) -> Option<(&[Dist], usize)> {
        Some((&self.components, 1))
    }
}
