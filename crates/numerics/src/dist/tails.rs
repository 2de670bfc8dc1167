//! The log probabilities on both sides of a number, which truncation is based on.

use crate::num::{log_diff_exp, log_sum_exp};
use smallvec::SmallVec;

/// The logarithms of P(X <= x) and of P(X > x). Each is accurate where it is the smaller
/// one, however small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tails {
    /// ln P(X <= x).
    pub below: f64,
    /// ln P(X > x).
    pub above: f64,
}

/// One derivative per parameter.
pub type CdfSlopes = SmallVec<[f64; 3]>;

impl From<(f64, f64)> for Tails {
    fn from((below, above): (f64, f64)) -> Tails {
        Tails { below, above }
    }
}

impl Tails {
    /// All of the probability lies below.
    pub const ALL_BELOW: Tails = Tails { below: 0.0, above: f64::NEG_INFINITY };
    /// None of the probability lies below.
    pub const NONE_BELOW: Tails = Tails { below: f64::NEG_INFINITY, above: 0.0 };

    /// Computes both from the logarithm of the probability below.
    pub fn from_below(below: f64) -> Tails {
        let below = below.min(0.0);
        Tails { below, above: log_diff_exp(0.0, below) }
    }

    /// Computes both from the logarithm of the probability above.
    pub fn from_above(above: f64) -> Tails {
        Tails::from_below(above).swapped()
    }

    /// Exchanges the two sides.
    pub fn swapped(self) -> Tails {
        Tails { below: self.above, above: self.below }
    }

    /// Returns the tails of a mixture from the logarithms of the normalised weights and
    /// the components' tails.
    pub(super) fn mixed(all: &[(f64, Tails)]) -> Tails {
        let sum = |of: fn(&Tails) -> f64| {
            log_sum_exp(&all.iter().map(|(share, t)| share + of(t)).collect::<SmallVec<[f64; 8]>>())
                .min(0.0)
        };
        Tails { below: sum(|t| t.below), above: sum(|t| t.above) }
    }
}

/// Returns dP(X <= x)/da divided by the density at x, by a central difference of fourth
/// order of the logarithm of the smaller tail. `tails` takes the parameter; `log_density`
/// is that at x. NaN where the tails beside this parameter are not computed.
pub(super) fn speed_by_differences(
    a: f64,
    log_density: f64,
    tails: impl Fn(f64) -> Option<Tails>,
) -> f64 {
    let h = 2e-3 * a;
    let around = [0.0, 1.0, -1.0, 2.0, -2.0].map(|k| tails(a + k * h));
    let [Some(here), Some(up), Some(down), Some(up2), Some(down2)] = around else {
        return f64::NAN;
    };
    let lower = here.below < here.above;
    let part = |t: Tails| if lower { t.below } else { t.above };
    let slope = (8.0 * (part(up) - part(down)) - (part(up2) - part(down2))) / (12.0 * h);
    let speed = slope * libm::exp(part(here) - log_density);
    match speed.is_finite() {
        true if lower => speed,
        true => -speed,
        false => 0.0,
    }
}
