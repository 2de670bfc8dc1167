//! Derivatives of values with respect to parameters while the stored coordinates are
//! fixed. Gradients through a trace need them in addition to those of the densities.

use super::{Datum, Dist, Support};
use crate::rng::{Purpose, StreamKey};

impl Dist {
    /// Returns the number of parameter derivatives in [`Dist::gradient`]. It is the same
    /// for all values, so it is counted at one draw.
    pub fn param_count(&self) -> usize {
        match self {
            Dist::Iid(d) => d.one().param_count(),
            Dist::Product(d) => d.parts().iter().map(Dist::param_count).sum(),
            _ => {
                let x = self.sample(&mut StreamKey::new(0, 0, Purpose::VALUES).stream(0, 0, 0));
                self.gradient(&x).map_or(0, |g| g.params.len())
            }
        }
    }

    /// Returns whether the support of the continuous values depends on the parameters.
    pub fn has_moving_support(&self) -> bool {
        match self {
            Dist::Uniform(_) | Dist::TruncatedNormal(_) | Dist::HalfCauchy(_) => true,
            Dist::Iid(d) => d.one().has_moving_support(),
            Dist::Product(d) => d.parts().iter().any(Dist::has_moving_support),
            Dist::Custom(d) => d.has_moving_support(),
            Dist::Truncated(_) => true,
            Dist::Flat(d) => d.is_bounded(),
            Dist::Ordered(d) => d.distinct().iter().any(Dist::has_moving_support),
            Dist::Mixture(d) => d.components().iter().any(Dist::has_moving_support),
            _ => false,
        }
    }

    /// For a number x(y) that is stored as an unconstrained coordinate y: returns the
    /// derivatives with respect to the parameters, with y fixed, of f(x(y)) + log
    /// |dx/dy|, where `by` is df/dx. `None` if they are not known.
    pub fn by_bounds(&self, x: &Datum, by: f64) -> Option<Vec<f64>> {
        let x = x.num()?;
        // With respect to the lower and the upper bound.
        let (lo, hi) = match self.support() {
            // x = lo + (hi - lo) p, log |dx/dy| = log (hi - lo) + log p + log (1 - p).
            Support::Interval { lo, hi } => {
                let (width, p) = (hi - lo, (x - lo) / (hi - lo));
                (by * (1.0 - p) - 1.0 / width, by * p + 1.0 / width)
            }
            Support::AtLeast { .. } => (by, 0.0),
            Support::AtMost { .. } => (0.0, by),
            _ => (0.0, 0.0),
        };
        match self {
            Dist::Uniform(_) => Some(vec![lo, hi]),
            Dist::TruncatedNormal(_) => Some(vec![0.0, 0.0, lo, hi]),
            Dist::HalfCauchy(_) => Some(vec![lo, 0.0]),
            Dist::Flat(_) => Some(vec![lo, hi]),
            Dist::Truncated(d) => {
                let (own_lo, own_hi) = d.own_bounds();
                if d.base().has_moving_support() && !(own_lo && own_hi) {
                    return None;
                }
                let mut by = vec![0.0; d.base().param_count()];
                by.extend([if own_lo { lo } else { 0.0 }, if own_hi { hi } else { 0.0 }]);
                Some(by)
            }
            d if d.has_moving_support() => None,
            d => Some(vec![0.0; d.param_count()]),
        }
    }

    /// For a value mean + L z made from white noise z: returns the derivatives with
    /// respect to z of a function whose derivatives with respect to the value are `by`.
    pub fn from_noncentred_vjp(&self, by: &[f64]) -> Option<Vec<f64>> {
        match self {
            Dist::MvNormal(d) => Some(d.vjp_noise(by)),
            Dist::Gp(d) => Some(d.vjp_noise(by)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dist::{HalfCauchy, Normal, Uniform};

    #[test]
    fn bounds_move_values_as_differences_say() {
        let (y, slope) = (0.7, 1.3);
        // f(x) = slope x, plus the log Jacobian.
        let f = |d: &Dist| {
            let (x, jacobian) = d.support().from_free(&[y]);
            slope * x.num().unwrap() + jacobian
        };
        let uniform = |p: [f64; 2]| Dist::Uniform(Uniform::new(p[0], p[1]).unwrap());
        let cauchy = |p: [f64; 2]| Dist::HalfCauchy(HalfCauchy::new(p[0], p[1]).unwrap());
        for make in [&uniform as &dyn Fn([f64; 2]) -> Dist, &cauchy] {
            let at = [0.5, 2.0];
            let d = make(at);
            let (x, _) = d.support().from_free(&[y]);
            let found = d.by_bounds(&x, slope).unwrap();
            for i in 0..2 {
                let moved = |h: f64| {
                    let mut p = at;
                    p[i] += h;
                    f(&make(p))
                };
                assert!(
                    (found[i] - (moved(1e-6) - moved(-1e-6)) / 2e-6).abs() < 1e-6,
                    "{i}: {found:?}"
                );
            }
        }
        let normal = Dist::Normal(Normal::new(0.0, 1.0).unwrap());
        assert_eq!(normal.by_bounds(&Datum::Num(0.3), 1.0), Some(vec![0.0, 0.0]));
        assert!(!normal.has_moving_support());
    }
}
