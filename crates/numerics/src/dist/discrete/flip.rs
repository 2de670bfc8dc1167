//! The Bernoulli distribution.

use crate::dist::batch::Member;
use crate::dist::*;
use crate::num::{expit, log1p_exp};

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

    /// Returns the derivative of the log probability with respect to `p`, where it is
    /// finite.
    #[inline]
    fn slope(&self, x: bool) -> f64 {
        if x { 1.0 / self.p } else { -1.0 / (1.0 - self.p) }
    }

    /// Returns the probabilities of true and false.
    fn probabilities(&self) -> (f64, f64) {
        (self.p, 1.0 - self.p)
    }
}

/// Converts an observed value to a truth value: data often use 1 and 0 for true and false.
fn truth(x: &Datum) -> Option<bool> {
    match x {
        Datum::Bool(x) => Some(*x),
        Datum::Num(1.0) => Some(true),
        Datum::Num(0.0) => Some(false),
        _ => None,
    }
}

/// `flip(logit = l)`: true with the log odds `l`, whose probabilities keep their digits
/// where `p` would round to 0 or 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlipLogit {
    logit: f64,
}

impl FlipLogit {
    pub(in crate::dist) fn of(logit: f64) -> Result<FlipLogit, ParamError> {
        Ok(FlipLogit { logit })
    }

    /// Returns the log probability of a truth value.
    #[inline]
    pub fn log_probability(&self, x: bool) -> f64 {
        -log1p_exp(if x { -self.logit } else { self.logit })
    }

    /// Returns the derivative of the log probability with respect to the log odds.
    #[inline]
    fn slope(&self, x: bool) -> f64 {
        if x { expit(-self.logit) } else { -expit(self.logit) }
    }

    /// Returns the probabilities of true and false.
    fn probabilities(&self) -> (f64, f64) {
        (expit(self.logit), expit(-self.logit))
    }
}

/// Implements the distribution of a truth value, which counts as 1 or 0 in batches.
macro_rules! of_truth {
    ($($Family:ident)*) => {$(
        impl Member<1> for $Family {
            #[inline]
            fn log_density(&self, x: f64) -> f64 {
                self.log_probability(x != 0.0)
            }

            #[inline]
            fn slopes(&self, x: f64, _: bool) -> (f64, [f64; 1]) {
                (0.0, [self.slope(x != 0.0)])
            }
        }

        impl Distribution for $Family {
            fn name(&self) -> &'static str {
                Self::NAME
            }

            fn support(&self) -> Support {
                Support::Boolean
            }

            fn sample(&self, rng: &mut Stream) -> Datum {
                Datum::Bool(rng.uniform() < self.probabilities().0)
            }

            #[inline]
            fn log_density(&self, x: &Datum) -> f64 {
                truth(x).map_or(f64::NEG_INFINITY, |x| self.log_probability(x))
            }

            fn gradient(&self, x: &Datum) -> Option<Gradient> {
                let x = truth(x).filter(|x| self.log_probability(*x).is_finite())?;
                Some(Gradient { x: Vec::new(), params: vec![self.slope(x)] })
            }

            fn mean(&self) -> Option<f64> {
                Some(self.probabilities().0)
            }

            fn sd(&self) -> Option<f64> {
                let (p, q) = self.probabilities();
                Some((p * q).sqrt())
            }
        }
    )*};
}

of_truth!(Flip FlipLogit);
