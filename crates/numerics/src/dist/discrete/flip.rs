//! The Bernoulli distribution.

use crate::dist::batch::Member;
use crate::dist::*;

/// `flip(p)`: true with probability `p`. Observed numbers 1 and 0 count as true and
/// false.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flip {
    p: f64,
}

impl Flip {
    pub(in crate::dist) fn of(p: f64) -> Result<Flip, ParamError> {
        Ok(Flip { p })
    }

    /// Returns the log probability of a truth value.
    #[inline]
    pub fn log_probability(&self, x: bool) -> f64 {
        if x { libm::log(self.p) } else { libm::log1p(-self.p) }
    }

    /// Converts an observed value to a truth value: data often use 1 and 0 for true and
    /// false.
    fn truth(x: &Datum) -> Option<bool> {
        match x {
            Datum::Bool(x) => Some(*x),
            Datum::Num(1.0) => Some(true),
            Datum::Num(0.0) => Some(false),
            _ => None,
        }
    }

    /// Returns the derivative of the log probability with respect to `p`, where it is
    /// finite.
    #[inline]
    fn by_p(&self, x: bool) -> f64 {
        if x { 1.0 / self.p } else { -1.0 / (1.0 - self.p) }
    }
}

/// Truth values count as 1 and 0.
impl Member<1> for Flip {
    #[inline]
    fn log_density(&self, x: f64) -> f64 {
        self.log_probability(x != 0.0)
    }

    #[inline]
    fn slopes(&self, x: f64) -> (f64, [f64; 1]) {
        (0.0, [self.by_p(x != 0.0)])
    }
}

impl Distribution for Flip {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn support(&self) -> Support {
        Support::Boolean
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        Datum::Bool(rng.uniform() < self.p)
    }

    #[inline]
    fn log_density(&self, x: &Datum) -> f64 {
        Flip::truth(x).map_or(f64::NEG_INFINITY, |x| self.log_probability(x))
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let x = Flip::truth(x).filter(|x| self.log_probability(*x).is_finite())?;
        Some(Gradient { x: Vec::new(), params: vec![self.by_p(x)] })
    }

    fn mean(&self) -> Option<f64> {
        Some(self.p)
    }

    fn sd(&self) -> Option<f64> {
        Some((self.p * (1.0 - self.p)).sqrt())
    }
}
