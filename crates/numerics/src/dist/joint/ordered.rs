//! Independent numbers in ascending order, such as ordered mixture components or cut
//! points.

use crate::dist::joint::mixture::union;
use crate::dist::joint::product;
use crate::dist::support::is_ascending;
use crate::dist::*;
use crate::num::{accumulate, ln_gamma};

/// The number of draws that are tried for one in ascending order, if the parts differ.
const TRIES: u32 = 10_000;

/// `ordered(d, n)`: n independent numbers from `d` in ascending order, as one choice. The
/// density is n! times the product of the densities under `d`. Parameter gradients are
/// those of `d`, summed.
///
/// `ordered([d1, d2, …])`: one number from each, in ascending order. The density is the
/// product of theirs. It is not divided by the probability of that order, which is known
/// only if all parts are the same; the distribution therefore counts as improper, and its
/// `sample` only gives a starting point (a draw in ascending order or, after 10000 tries,
/// a sorted one). Parameter gradients are those of each part in turn.
#[derive(Clone, Debug)]
pub struct Ordered {
    parts: Parts,
    n: usize,
}

#[derive(Clone, Debug)]
enum Parts {
    Alike(Dist),
    Unlike(Box<[Dist]>, Support),
}

impl Ordered {
    /// Creates the distribution of n ordered numbers from one distribution; fails unless
    /// it is over continuous numbers, and if n is above 2^32 - 2.
    pub fn new(one: Dist, n: usize) -> Result<Ordered, ParamError> {
        if !is_continuous(&one) {
            return Err(Self::bad("d", one.name(), "must be a distribution of continuous numbers"));
        }
        if n >= u32::MAX as usize {
            return Err(Self::bad("n", n, "must be below 2^32 - 1"));
        }
        Ok(Ordered { parts: Parts::Alike(one), n })
    }

    /// Creates the distribution of one number from each part, in ascending order; fails
    /// unless all parts are over continuous numbers.
    pub fn of(parts: Vec<Dist>) -> Result<Ordered, ParamError> {
        let rule = "must hold distributions of continuous numbers";
        if let Some(d) = parts.iter().find(|d| !is_continuous(d)) {
            return Err(Self::bad("d", d.name(), rule));
        }
        let around = |a: Support, d: &Dist| union(a, d.support());
        let first = parts.first().map_or(Support::Real, Dist::support);
        let support = parts.iter().try_fold(first, around);
        let support = support.ok_or_else(|| Self::bad("d", "different kinds of values", rule))?;
        Ok(Ordered { n: parts.len(), parts: Parts::Unlike(parts.into(), support) })
    }

    /// Returns the number of values.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Returns whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Returns the distributions of the numbers: a single one if all are the same,
    /// otherwise one for each number.
    pub fn distinct(&self) -> &[Dist] {
        match &self.parts {
            Parts::Alike(one) => std::slice::from_ref(one),
            Parts::Unlike(all, _) => all,
        }
    }

    /// Returns whether all numbers have the same distribution.
    fn is_alike(&self) -> bool {
        matches!(self.parts, Parts::Alike(_))
    }

    fn parts(&self) -> impl Iterator<Item = &Dist> {
        self.distinct().iter().cycle().take(self.n)
    }
}

fn is_continuous(d: &Dist) -> bool {
    let support = d.support();
    support.is_number() && !support.is_discrete()
}

impl Distribution for Ordered {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        let one = match &self.parts {
            Parts::Alike(one) => one.support(),
            Parts::Unlike(_, around) => around.clone(),
        };
        Support::Ascending(Box::new(one), self.n)
    }

    fn is_improper(&self) -> bool {
        !self.is_alike() || self.distinct().iter().any(Dist::is_improper)
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let mut draw = || self.parts().filter_map(|p| p.sample(rng).num()).collect::<Vec<f64>>();
        let mut xs = draw();
        for _ in 0..TRIES {
            if self.is_alike() || is_ascending(&xs) {
                break;
            }
            xs = draw();
        }
        xs.sort_by(f64::total_cmp);
        xs.into()
    }

    fn log_density(&self, x: &Datum) -> f64 {
        if !x.with_numbers(self.n, is_ascending).unwrap_or(false) {
            return f64::NEG_INFINITY;
        }
        let orders = if self.is_alike() { ln_gamma(self.n as f64 + 1.0) } else { 0.0 };
        let score = orders + product::score(self.parts(), self.n, x);
        if score.is_nan() { f64::NEG_INFINITY } else { score }
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        if !self.log_density(x).is_finite() {
            return None;
        }
        match self.is_alike() {
            true => product::slopes(self.parts(), self.n, x, |all, one| accumulate(all, &one)),
            false => product::slopes(self.parts(), self.n, x, |all, one| all.extend(one)),
        }
    }

    fn has_moving_support(&self) -> bool {
        self.distinct().iter().any(Dist::has_moving_support)
    }

    fn made_of(&self) -> Option<(&[Dist], usize)> {
        Some((self.distinct(), if self.is_alike() { self.n } else { 1 }))
    }
}
