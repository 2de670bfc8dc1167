//! Truncation of any scalar distribution whose distribution function is known.

use crate::dist::continuous::interval::{each_node, ends, from_order, integral, order, within};
use crate::dist::param::MAX_INTEGER;
use crate::dist::*;
use crate::num::{log_diff_exp, log_sum_exp};
use core::f64::consts::LN_2;

/// The largest number of integers that are summed one by one.
const FEW: f64 = 64.0;

/// The least logarithm of an interval's probability. The log density is a difference of two
/// logarithms of that size; below, rounding would make up densities.
const LEAST_LOG_MASS: f64 = -1e13;

/// The number of draws that are tried before the distribution function is inverted.
const TRIES: u32 = 64;

/// `truncated(d, lo, hi)`: within the interval, the density of `d` divided by the
/// probability of the interval. Integers on the bounds are inside.
///
/// ln P(lo < X <= hi) is a difference of the smaller tails in log space. Where that would
/// cancel, because the density hardly changes over the interval, it is an integral by the
/// Gauss-Legendre rule; for a few integers it is a sum. Parameter gradients are those of
/// `d`, then with respect to `lo` and `hi`.
#[derive(Clone, Debug)]
pub struct Truncated {
    base: Dist,
    lo: f64,
    hi: f64,
    support: Support,
    log_mass: f64,
}

/// Truncates a distribution to an interval: a product or `iid` element by element, and a
/// normal to a [`TruncatedNormal`].
///
/// # Errors
/// It is not a distribution of numbers whose distribution function is known, or the
/// interval does not overlap the support or has no probability.
pub fn truncated(base: &Dist, lo: f64, hi: f64) -> Result<Dist, ParamError> {
    Ok(match base {
        Dist::Normal(d) => {
            check_bounds(lo, hi, false)?;
            let [mean, sd] = [d.number_mean(), d.number_sd()].map(|p| p.unwrap_or(f64::NAN));
            Dist::from(TruncatedNormal::new(mean, sd, lo, hi)?)
        }
        Dist::Iid(d) => Dist::from(Iid::new(truncated(d.one(), lo, hi)?, d.len())?),
        Dist::Product(d) => {
            let parts = d
                .parts()
                .iter()
                .map(|one| truncated(one, lo, hi))
                .collect::<Result<Vec<_>, _>>()?;
            Dist::from(Product::new(parts)?)
        }
        other => Dist::from(Truncated::new(other.clone(), lo, hi)?),
    })
}

/// Returns the reason why a distribution cannot be truncated.
fn unknown(d: &Dist) -> ParamError {
    let rule = match d {
        Dist::Flat(_) => "must be proper: for a flat prior, give the bounds to `flat(lo, hi)`",
        Dist::TruncatedNormal(_) | Dist::Truncated(_) => {
            "must not be truncated already: give all bounds in one call"
        }
        Dist::VonMises(_) => "must not be a distribution of angles, which have no bounds",
        d if d.is_scalar() => "must have a computable distribution function for these parameters",
        _ => "must be a distribution of single numbers",
    };
    Truncated::bad("d", d.name().to_owned(), rule)
}

fn check_bounds(lo: f64, hi: f64, discrete: bool) -> Result<(), ParamError> {
    let value = || format!("{lo} and {hi}");
    match () {
        () if lo.is_nan() || hi.is_nan() => {
            Err(Truncated::bad("lo to hi", value(), "must be numbers"))
        }
        () if lo == hi && !discrete => Err(Truncated::bad(
            "lo",
            value(),
            "must be below hi: an interval without width has no density",
        )),
        () if lo > hi => Err(Truncated::bad("lo", value(), "must be below hi")),
        () => Ok(()),
    }
}

impl Truncated {
    /// Creates the distribution between these bounds, which may be infinite. Fails unless
    /// `base` is over numbers, is proper, has a known distribution function, and has
    /// probability in the interval.
    pub fn new(base: Dist, lo: f64, hi: f64) -> Result<Truncated, ParamError> {
        let support = base.support();
        check_bounds(lo, hi, matches!(support, Support::Integers { .. }))?;
        if base.is_improper() || base.tails(0.0).is_none() {
            return Err(unknown(&base));
        }
        let nothing =
            |rule| Truncated::bad("lo to hi", format!("{lo} and {hi} of {}", base.name()), rule);
        let outside = "must overlap the support of `d`";
        let support = within(&support, lo, hi).ok_or_else(|| nothing(outside))?;
        let mut d = Truncated { base, lo, hi, support, log_mass: 0.0 };
        d.log_mass = d.log_mass_to(f64::INFINITY).ok_or_else(|| unknown(&d.base))?;
        if d.log_mass > LEAST_LOG_MASS {
            Ok(d)
        } else {
            let rule = "must contain some of the probability of `d`, more than exp(-1e13)";
            Err(Truncated::bad("lo to hi", format!("{lo} and {hi} of {}", d.base.name()), rule))
        }
    }

    /// Returns the distribution before truncation.
    pub fn base(&self) -> &Dist {
        &self.base
    }

    /// Returns whether the lower and the upper bound of the support are those of the
    /// truncation.
    fn own_bounds(&self) -> (bool, bool) {
        match ends(&self.support) {
            Some((lo, hi)) => (lo == self.lo, hi == self.hi),
            None => (false, false),
        }
    }

    fn is_discrete(&self) -> bool {
        matches!(self.support, Support::Integers { .. })
    }

    /// Returns the interval (a, b] that contains the values up to `x`. For integers, a is
    /// one below the smallest value.
    fn ends_to(&self, x: f64) -> (f64, f64) {
        match &self.support {
            Support::Integers { lo, hi } => {
                let top = hi.map_or(f64::INFINITY, |hi| hi as f64);
                (*lo as f64 - 1.0, libm::floor(x).min(top))
            }
            s => {
                let (lo, hi) = ends(s).unwrap_or((self.lo, self.hi));
                (lo, x.min(hi))
            }
        }
    }

    /// Returns the logarithm of the probability of the values up to `x` under `d`.
    fn log_mass_to(&self, x: f64) -> Option<f64> {
        let (a, b) = self.ends_to(x);
        match self.kink(a, b) {
            Some(at) => {
                Some(log_sum_exp(&[self.log_between(a, at)?, self.log_between(at, b)?]).min(0.0))
            }
            None => self.log_between(a, b),
        }
    }

    /// Returns the kink of the density between two numbers: the centre of `laplace`.
    fn kink(&self, a: f64, b: f64) -> Option<f64> {
        let Dist::Laplace(d) = &self.base else { return None };
        d.number_mean().filter(|centre| a < *centre && *centre < b)
    }

    /// Returns the logarithm of the probability of the values above `a` and up to `b`
    /// under `d`.
    fn log_between(&self, a: f64, b: f64) -> Option<f64> {
        if a >= b {
            return Some(f64::NEG_INFINITY);
        }
        if self.is_discrete() && b - a <= FEW {
            let all: Vec<f64> =
                (1..=(b - a) as i64).map(|i| self.base.log_density_num(a + i as f64)).collect();
            return Some(log_sum_exp(&all).min(0.0));
        }
        if let Some(mass) = self.narrow(a, b) {
            return Some(mass.min(0.0));
        }
        let (from, to) = (self.base.tails(a)?, self.base.tails(b)?);
        let mass = if to.below <= -LN_2 {
            log_diff_exp(to.below, from.below.min(to.below))
        } else if from.above <= -LN_2 {
            log_diff_exp(from.above, to.above.min(from.above))
        } else {
            libm::log1p(-(libm::exp(from.below) + libm::exp(to.above)).min(1.0))
        };
        Some(if mass.is_nan() { f64::NEG_INFINITY } else { mass.min(0.0) })
    }

    /// Computes the same for an interval in which the density changes little; `None` for
    /// others.
    fn narrow(&self, a: f64, b: f64) -> Option<f64> {
        if self.is_discrete() || !(b - a).is_finite() {
            return None;
        }
        let at = |share: f64| self.base.log_density_num(a + share * (b - a));
        let all = [at(0.0), at(0.25), at(0.5), at(0.75), at(1.0)];
        let (least, most) =
            all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(*x), m.max(*x)));
        let little = most.is_finite() && most - least < 0.5;
        // A mixture may have a peak between these points.
        if !little || matches!(self.base, Dist::Mixture(_)) {
            return None;
        }
        Some(most + libm::log(integral(a, b, |x| libm::exp(self.base.log_density_num(x) - most))))
    }

    /// Returns the derivatives of the logarithm of the interval's probability with
    /// respect to the parameters of `d`.
    fn mass_slopes(&self) -> Option<Vec<f64>> {
        let (a, b) = self.ends_to(f64::INFINITY);
        let count = self.base.param_count();
        let mut sum = vec![0.0; count];
        let mut add = |x: f64, weight: f64| {
            if let Some(g) = self.base.gradient(&Datum::Num(x)) {
                sum.iter_mut().zip(&g.params).for_each(|(s, p)| *s += weight * p);
            }
        };
        // The mean of the derivatives of the log density.
        if self.is_discrete() && b - a <= FEW {
            for i in 1..=(b - a) as i64 {
                let x = a + i as f64;
                add(x, libm::exp(self.base.log_density_num(x) - self.log_mass));
            }
            return Some(sum);
        }
        if self.kink(a, b).is_none()
            && !self.is_end_of_base(a)
            && !self.is_end_of_base(b)
            && self.narrow(a, b).is_some()
        {
            each_node(a, b, |x, w| {
                add(x, w * libm::exp(self.base.log_density_num(x) - self.log_mass))
            });
            return Some(sum);
        }
        for (x, sign) in [(b, 1.0), (a, -1.0)] {
            let density = self.base.log_density_num(x);
            let weight = sign * libm::exp(density - self.log_mass);
            if weight != 0.0 && density.is_finite() && !self.is_end_of_base(x) {
                let cdf_slopes = self.base.cdf_slopes(x)?;
                sum.iter_mut().zip(&cdf_slopes).for_each(|(s, v)| *s += weight * v);
            }
        }
        Some(sum)
    }

    /// Returns whether a number is at or outside an end of the support of `d`, so that
    /// the probability beyond it stays 0.
    fn is_end_of_base(&self, x: f64) -> bool {
        let least = |lo: f64| if self.is_discrete() { x < lo } else { x <= lo };
        ends(&self.base.support()).is_some_and(|(lo, hi)| least(lo) || x >= hi)
    }

    /// Returns the smallest value up to which this proportion of the probability lies.
    fn quantile(&self, share: f64) -> f64 {
        let target = libm::log(share) + self.log_mass;
        let enough = |x: f64| self.log_mass_to(x).is_none_or(|mass| mass >= target);
        if let Support::Integers { lo, hi } = &self.support {
            let most = hi.map_or(MAX_INTEGER, |hi| hi as f64);
            let (mut below, mut at, mut step) = (*lo as f64 - 1.0, *lo as f64, 1.0);
            while at < most && !enough(at) {
                (below, at, step) = (at, (at + step).min(most), step * 2.0);
            }
            while at - below > 1.0 {
                let middle = libm::floor(below + 0.5 * (at - below));
                if enough(middle) { at = middle } else { below = middle }
            }
            return at;
        }
        let (lo, hi) = ends(&self.support).unwrap_or((self.lo, self.hi));
        let (mut below, mut at) = (order(lo.max(f64::MIN)), order(hi.min(f64::MAX)));
        while at - below > 1 {
            let middle = below + (at - below) / 2;
            if enough(from_order(middle)) { at = middle } else { below = middle }
        }
        from_order(at)
    }
}

impl Distribution for Truncated {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        self.support.clone()
    }

    /// Draws by rejection if the interval is likely, otherwise by inverting the
    /// distribution function.
    fn sample(&self, rng: &mut Stream) -> Datum {
        if self.log_mass > -LN_2 * 4.0 {
            for _ in 0..TRIES {
                let x = self.base.sample(rng);
                if self.support.contains(&x) {
                    return x;
                }
            }
        }
        let x = self.quantile(rng.open_uniform());
        let (lo, hi) = ends(&self.support).unwrap_or((self.lo, self.hi));
        let x = x.clamp(lo.max(f64::MIN), hi.min(f64::MAX));
        Datum::Num(if self.support == Support::Positive { x.max(f64::MIN_POSITIVE) } else { x })
    }

    fn log_density(&self, x: &Datum) -> f64 {
        match x {
            Datum::Num(x) if self.support.contains_num(*x) => {
                self.base.log_density_num(*x) - self.log_mass
            }
            _ => f64::NEG_INFINITY,
        }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        let mut g = self.base.gradient(x)?;
        let mass = self.mass_slopes()?;
        g.params.iter_mut().zip(&mass).for_each(|(p, m)| *p -= m);
        let at = |bound: f64, own: bool| match own && !self.is_discrete() && bound.is_finite() {
            true => libm::exp(self.base.log_density_num(bound) - self.log_mass),
            false => 0.0,
        };
        let own = self.own_bounds();
        g.params.extend([at(self.lo, own.0), -at(self.hi, own.1)]);
        Some(g)
    }

    fn param_count(&self) -> usize {
        self.base.param_count() + 2
    }

    fn pole(&self) -> Option<f64> {
        let hi = |s: &Support| ends(s).map(|(_, hi)| hi);
        self.base.pole().filter(|_| hi(&self.support) == hi(&self.base.support()))
    }

    fn has_moving_support(&self) -> bool {
        true
    }

    fn by_bounds(&self, lo: f64, hi: f64) -> Option<Vec<f64>> {
        let (own_lo, own_hi) = self.own_bounds();
        let (of_lo, of_hi) = (if own_lo { lo } else { 0.0 }, if own_hi { hi } else { 0.0 });
        let mut by = self.base.by_ends(lo - of_lo, hi - of_hi)?;
        by.extend([of_lo, of_hi]);
        Some(by)
    }

    fn made_of(&self) -> Option<(&[Dist], usize)> {
        Some((std::slice::from_ref(&self.base), 1))
    }
}
