//! The normal distribution between two bounds, however far from the mean.
//!
//! Everything is relative to the density at the *anchor*, the point of the interval
//! nearest to the mean, and in units of sd. So nothing underflows in the tails, where the
//! interval's probability does.

use crate::dist::continuous::interval::integral;
use crate::dist::draw::standard;
use crate::dist::*;
use crate::num::mills_ratio;
use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

/// The largest distance of the interval from the mean, in units of sd: its square still
/// fits a double.
const FARTHEST: f64 = 1e150;

/// `truncated_normal(mean, sd, lo, hi)`; bounds may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruncatedNormal {
    mean: f64,
    sd: f64,
    lo: f64,
    hi: f64,
    /// The bounds in units of sd from the mean.
    low: f64,
    high: f64,
    /// The integral of the density in these units, divided by the density at the anchor.
    mass: f64,
}

impl TruncatedNormal {
    pub(in crate::dist) fn of(
        mean: f64,
        sd: f64,
        lo: f64,
        hi: f64,
    ) -> Result<TruncatedNormal, ParamError> {
        let bounds = || format!("{lo} and {hi}");
        if lo.is_nan() || hi.is_nan() || lo >= hi {
            return Err(Self::bad("lo", bounds(), "must be below hi"));
        }
        let (low, high) = (standard(lo, mean, sd), standard(hi, mean, sd));
        if !(low < FARTHEST && high > -FARTHEST) {
            return Err(Self::bad("lo to hi", bounds(), "must be within 1e150 sd of the mean"));
        }
        let mut d = TruncatedNormal { mean, sd, lo, hi, low, high, mass: 0.0 };
        d.mass = d.relative_mass();
        if d.mass > 0.0 {
            Ok(d)
        } else {
            Err(Self::bad("lo to hi", bounds(), "must have positive width in units of sd"))
        }
    }

    /// Returns the width in units of sd.
    fn width(&self) -> f64 {
        standard(self.hi, self.lo, self.sd)
    }

    /// Returns the distance of the interval from the mean, in units of sd; 0 if the mean
    /// is inside.
    fn distance(&self) -> f64 {
        self.low.max(-self.high).max(0.0)
    }

    /// Returns the integral of exp(-(z^2 - anchor^2) / 2).
    fn relative_mass(&self) -> f64 {
        if self.low < 0.0 && self.high > 0.0 {
            let (left, right) =
                (libm::erf(-self.low * FRAC_1_SQRT_2), libm::erf(self.high * FRAC_1_SQRT_2));
            return FRAC_PI_2.sqrt() * (left + right);
        }
        let (a, w) = (self.distance(), self.width());
        let fall = w * (a + 0.5 * w);
        if fall > 1.0 {
            let rest = if fall < 800.0 { libm::exp(-fall) * mills_ratio(a + w) } else { 0.0 };
            return mills_ratio(a) - rest;
        }
        integral(0.0, w, |t| libm::exp(-t * (a + 0.5 * t)))
    }

    /// Returns the density at a bound divided by the interval's probability, in units of
    /// sd.
    fn edge(&self, z: f64) -> f64 {
        let a = self.distance();
        libm::exp(-0.5 * (z.abs() - a) * (z.abs() + a)) / self.mass
    }

    /// Returns the first two moments of the distance inwards from the anchor (from the
    /// mean if it is inside), in units of sd.
    fn moments(&self) -> (f64, f64) {
        let a = self.distance();
        let (from, to) = if self.low < 0.0 && self.high > 0.0 {
            (self.low.max(-12.0), self.high.min(12.0))
        } else {
            // Beyond this point the density is below exp(-50) of that at the anchor.
            (0.0, self.width().min(100.0 / (a + (a * a + 100.0).sqrt())))
        };
        let panels = 64;
        let step = (to - from) / f64::from(panels);
        let mut sums = [0.0; 3];
        for i in 0..panels {
            let (left, right) = (from + step * f64::from(i), from + step * f64::from(i + 1));
            for (k, s) in sums.iter_mut().enumerate() {
                let power = |t: f64| [1.0, t, t * t][k];
                *s += integral(left, right, |t| power(t) * libm::exp(-t * (a + 0.5 * t)));
            }
        }
        (sums[1] / sums[0], sums[2] / sums[0])
    }

    /// Draws the distance inwards from the anchor, for an interval on one side of the
    /// mean: by rejection from an exponential truncated to the interval (Robert 1995,
    /// "Simulation of truncated normal variables").
    fn tail(&self, rng: &mut Stream) -> f64 {
        let (a, w) = (self.distance(), self.width());
        let rate = 0.5 * (a + (a * a + 4.0).sqrt());
        let share = -libm::expm1(-rate * w);
        // rate - a, without cancellation, and the point where the ratio of the densities
        // is greatest.
        let excess = 2.0 / (a + (a * a + 4.0).sqrt());
        let best = excess.min(w);
        loop {
            let t = (-libm::log1p(-rng.open_uniform() * share) / rate).min(w);
            let log_ratio = excess * (t - best) - 0.5 * (t - best) * (t + best);
            if libm::log(rng.open_uniform()) <= log_ratio {
                return t;
            }
        }
    }
}

impl Scalar for TruncatedNormal {
    fn number_support(&self) -> Support {
        match (self.lo == f64::NEG_INFINITY, self.hi == f64::INFINITY) {
            (true, true) => Support::Real,
            (false, true) => Support::AtLeast { lo: self.lo },
            (true, false) => Support::AtMost { hi: self.hi },
            (false, false) => Support::Interval { lo: self.lo, hi: self.hi },
        }
    }

    fn draw(&self, rng: &mut Stream) -> f64 {
        let x = if self.low >= 0.0 {
            self.lo + self.sd * self.tail(rng)
        } else if self.high <= 0.0 {
            self.hi - self.sd * self.tail(rng)
        } else if self.high - self.low < 2.5 {
            loop {
                let z = self.low + (self.high - self.low) * rng.open_uniform();
                if libm::log(rng.open_uniform()) <= -0.5 * z * z {
                    break self.mean + self.sd * z;
                }
            }
        } else {
            loop {
                let z = rng.standard_normal();
                if (self.low..=self.high).contains(&z) {
                    break self.mean + self.sd * z;
                }
            }
        };
        x.clamp(self.lo, self.hi).clamp(f64::MIN, f64::MAX)
    }

    #[inline]
    fn log_density_num(&self, x: f64) -> f64 {
        if !(x >= self.lo && x <= self.hi && x.is_finite()) {
            return f64::NEG_INFINITY;
        }
        let norm = -libm::log(self.sd) - libm::log(self.mass);
        if self.low < 0.0 && self.high > 0.0 {
            let z = standard(x, self.mean, self.sd);
            return norm - 0.5 * z * z;
        }
        // From the anchor inwards: accurate at the bound, however far from the mean it
        // is.
        let t = if self.low >= 0.0 {
            standard(x, self.lo, self.sd)
        } else {
            standard(self.hi, x, self.sd)
        };
        norm - t * (self.distance() + 0.5 * t)
    }

    fn slope(&self, x: f64) -> Slope {
        let z = standard(x, self.mean, self.sd);
        let at_low = if self.low == f64::NEG_INFINITY { 0.0 } else { self.edge(self.low) };
        let at_high = if self.high == f64::INFINITY { 0.0 } else { self.edge(self.high) };
        let moment = |z: f64, edge: f64| if edge == 0.0 { 0.0 } else { z * edge };
        let by_mean = z - at_low + at_high;
        let by_sd = z * z - 1.0 - moment(self.low, at_low) + moment(self.high, at_high);
        let sd = self.sd;
        Slope::new(-z / sd, [by_mean / sd, by_sd / sd, at_low / sd, -at_high / sd])
    }

    fn by_bounds(&self, lo: f64, hi: f64) -> Option<CdfSlopes> {
        Some(smallvec![0.0, 0.0, lo, hi])
    }

    fn number_mean(&self) -> Option<f64> {
        let (first, _) = self.moments();
        Some(if self.low >= 0.0 {
            self.lo + self.sd * first
        } else if self.high <= 0.0 {
            self.hi - self.sd * first
        } else {
            self.mean + self.sd * first
        })
    }

    fn number_sd(&self) -> Option<f64> {
        let (first, second) = self.moments();
        Some(self.sd * (second - first * first).max(0.0).sqrt())
    }
}
