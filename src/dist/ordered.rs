//! Sorted values of one distribution: mixture components in an order, cut points.

use super::mixture::union;
use super::support::is_ascending;
use super::{Datum, Dist, Distribution, Gradient, ParamError, Support, product};
use crate::num::{accumulate, ln_gamma};
use crate::rng::Stream;

/// How often draws of unlike parts are tried for one in order.
const TRIES: u32 = 10_000;

/// `ordered(d, n)`: n independent numbers of `d` in ascending order, one choice. The
/// density is n! times the product of those of `d`. Gradients by parameters are those of
/// `d`, summed.
///
/// `ordered([d1, d2, …])`: a number of each, in ascending order. The density is the
/// product of theirs, not divided by the probability of that order, which is known for
/// parts that are alike only: so it counts as improper, and its `sample` gives a place to
/// start from (draws that came out in order; after 10000 tries sorted ones). Gradients by
/// parameters are those of each in turn.
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
    /// So many numbers of a distribution; fails unless it is one of continuous numbers,
    /// and for more than 2^32 - 2.
    pub fn new(one: Dist, n: usize) -> Result<Ordered, ParamError> {
        if !is_continuous(&one) {
            return Err(ParamError::new(
                "ordered",
                "d",
                one.name(),
                "must be a distribution of continuous numbers",
            ));
        }
        if n >= u32::MAX as usize {
            return Err(ParamError::new("ordered", "n", n, "must be below 2^32 - 1"));
        }
        Ok(Ordered { parts: Parts::Alike(one), n })
    }

    /// A number of each of these; fails unless they are distributions of continuous
    /// numbers.
    pub fn of(parts: Vec<Dist>) -> Result<Ordered, ParamError> {
        let rule = "must hold distributions of continuous numbers";
        if let Some(d) = parts.iter().find(|d| !is_continuous(d)) {
            return Err(ParamError::new("ordered", "d", d.name(), rule));
        }
        let around = |a: Support, d: &Dist| union(a, d.support());
        let first = parts.first().map_or(Support::Real, Dist::support);
        let support = parts.iter().try_fold(first, around);
        let support = support
            .ok_or_else(|| ParamError::new("ordered", "d", "different kinds of values", rule))?;
        Ok(Ordered { n: parts.len(), parts: Parts::Unlike(parts.into(), support) })
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// The distributions of the numbers: one that all of them have, or one for each.
    pub fn distinct(&self) -> &[Dist] {
        match &self.parts {
            Parts::Alike(one) => std::slice::from_ref(one),
            Parts::Unlike(all, _) => all,
        }
    }

    /// How often each of them occurs.
    pub(super) fn repeats(&self) -> usize {
        if self.is_alike() { self.n } else { 1 }
    }

    /// Whether all numbers have one distribution.
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
        "ordered"
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
}
