//! The improper flat prior: its density is 1 between its bounds, so it cannot be sampled.

use crate::dist::*;

/// `flat(lo, hi)`: all numbers, or those on one side of a bound. Its log density is 0
/// there. Its `sample` only gives a start for a chain: as in Stan, uniform(-2, 2) in the
/// unconstrained space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    lo: f64,
    hi: f64,
}

impl Default for Flat {
    fn default() -> Self {
        Flat::EVERYWHERE
    }
}

impl Flat {
    /// The flat prior over all numbers.
    pub const EVERYWHERE: Flat = Flat { lo: f64::NEG_INFINITY, hi: f64::INFINITY };

    pub(in crate::dist) fn of(lo: f64, hi: f64) -> Result<Flat, ParamError> {
        let bad = |rule| Err(Self::bad("lo to hi", format!("{lo} and {hi}"), rule));
        match () {
            () if lo.is_nan() || hi.is_nan() => bad("must be numbers"),
            () if lo >= hi || lo == f64::INFINITY || hi == f64::NEG_INFINITY => {
                bad("must have numbers between them")
            }
            () if lo.is_finite() && hi.is_finite() => bad(
                "must have an infinite end: between two finite bounds use uniform(lo, hi), which is proper",
            ),
            () => Ok(Flat { lo, hi }),
        }
    }
}

impl Scalar for Flat {
    const IMPROPER: bool = true;

    fn number_support(&self) -> Support {
        match (self.lo, self.hi) {
            (lo, _) if lo.is_finite() => Support::AtLeast { lo },
            (_, hi) if hi.is_finite() => Support::AtMost { hi },
            _ => Support::Real,
        }
    }

    /// Draws a starting point, uniform on (-2, 2) in the unconstrained space.
    fn draw(&self, rng: &mut Stream) -> f64 {
        self.number_support().from_free_scalar(4.0 * rng.open_uniform() - 2.0).0
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if x.is_finite() && x >= self.lo && x <= self.hi { 0.0 } else { f64::NEG_INFINITY }
    }

    fn slope(&self, _x: f64) -> Slope {
        Slope::new(0.0, [0.0, 0.0])
    }

    fn by_bounds(&self, lo: f64, hi: f64) -> Option<CdfSlopes> {
        (self.lo.is_finite() || self.hi.is_finite()).then(|| smallvec![lo, hi])
    }
}
