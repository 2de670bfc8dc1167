//! The likelihood of a network's depth of a landmark given the model's, both in metres
//! from the middle of the hips: it is near, or anywhere within a body's reach.
//!
//! A depth `z` of a landmark that the model has at `d` has the density
//! `(1 - e) N(z; d, sd^2) + e N(z; 0, REACH^2)`: a single picture is only weakly
//! informative about depth, and a network that mistakes a limb for one pointing the other
//! way is off by twice its depth. Invariant: the density is finite and never NaN, as
//! `e > 0`.

use crate::vision::VisionError;
use pcadlang_numerics::rng::Stream;

/// The standard deviation of uninformative depths, in metres: half of a body's reach
/// around its hips.
const REACH: f64 = 0.5;

/// The error model of relative depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeDepthLikelihood {
    sd: f64,
    outlier: f64,
}

impl RelativeDepthLikelihood {
    /// `sd`: the standard deviation of an inlier, in metres, positive; `outlier`: the
    /// probability of an outlier, strictly between 0 and 1.
    ///
    /// # Errors
    /// If either is outside its range.
    pub fn new(sd: f64, outlier: f64) -> Result<Self, VisionError> {
        if !(sd > 0.0 && sd < 1e9) {
            return Err(VisionError::Range {
                name: "sd",
                rule: "positive and less than 1e9",
                value: sd,
            });
        }
        if !(outlier > 0.0 && outlier < 1.0) {
            return Err(VisionError::Range {
                name: "outlier",
                rule: "strictly between 0 and 1",
                value: outlier,
            });
        }
        // So that its square does not underflow.
        Ok(RelativeDepthLikelihood { sd: sd.max(1e-100), outlier })
    }

    /// Returns the logs of the two components of the density: near, and anywhere.
    fn parts(&self, seen: f64, model: f64) -> [f64; 2] {
        let log_normal = |x: f64, sd: f64| {
            let z = x / sd;
            -0.5 * z * z - libm::log(sd) - 0.5 * libm::log(2.0 * std::f64::consts::PI)
        };
        let near = match model.is_finite() {
            true => libm::log1p(-self.outlier) + log_normal(seen - model, self.sd),
            false => f64::NEG_INFINITY,
        };
        [near, libm::log(self.outlier) + log_normal(seen, REACH)]
    }

    /// Returns the log density of a finite depth given the model's.
    pub fn log_density(&self, seen: f64, model: f64) -> f64 {
        let [near, off] = self.parts(seen, model);
        let most = near.max(off);
        most + libm::log(libm::exp(near - most) + libm::exp(off - most))
    }

    /// Returns the derivative of the log density with respect to the model's depth.
    pub fn slope(&self, seen: f64, model: f64) -> f64 {
        let [near, off] = self.parts(seen, model);
        let share = 1.0 / (1.0 + libm::exp(off - near));
        if share > 0.0 { share * ((seen - model) / self.sd) / self.sd } else { 0.0 }
    }

    /// Samples a depth given the model's.
    pub fn sample(&self, model: f64, rng: &mut Stream) -> f64 {
        let off = rng.uniform() < self.outlier || !model.is_finite();
        let (middle, sd) = if off { (0.0, REACH) } else { (model, self.sd) };
        middle + sd * rng.standard_normal()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    #[test]
    fn the_density_integrates_to_one_and_has_its_slope() {
        for (sd, outlier, model) in [(0.1, 0.05, 0.3), (0.02, 0.5, -1.0), (0.3, 0.01, 0.0)] {
            let l = RelativeDepthLikelihood::new(sd, outlier).unwrap();
            let at = |i: i32| f64::from(i) * 1e-3;
            let sum: f64 =
                (-6000..6000).map(|i| 1e-3 * libm::exp(l.log_density(at(i), model))).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{sum}");
            for seen in [-0.8, -0.1, 0.0, 0.25, 1.1] {
                let by =
                    (l.log_density(seen, model + 1e-6) - l.log_density(seen, model - 1e-6)) / 2e-6;
                let slope = l.slope(seen, model);
                assert!((by - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{by} {slope}");
            }
        }
    }

    #[test]
    fn far_off_it_is_an_outlier_and_ranges_are_checked() {
        let l = RelativeDepthLikelihood::new(0.1, 0.05).unwrap();
        let off = libm::log(0.05) - libm::log(REACH) - 0.5 * libm::log(2.0 * std::f64::consts::PI);
        for model in [1e200, -1e300, f64::INFINITY, f64::NAN] {
            assert!(
                (l.log_density(0.0, model) - off).abs() < 1e-12 && l.slope(0.0, model) == 0.0,
                "{model}"
            );
        }
        assert!(
            RelativeDepthLikelihood::new(1e-300, 1e-300).unwrap().log_density(0.0, 1.0).is_finite()
        );
        for (sd, outlier) in
            [(0.0, 0.1), (f64::NAN, 0.1), (1e9, 0.1), (0.1, 0.0), (0.1, 1.0), (0.1, f64::NAN)]
        {
            assert!(RelativeDepthLikelihood::new(sd, outlier).is_err(), "{sd} {outlier}");
        }
    }

    #[test]
    fn draws_are_those_of_the_mixture() {
        let l = RelativeDepthLikelihood::new(0.1, 0.3).unwrap();
        let mut rng = StreamKey::new(4, 0, Purpose::PREDICT).stream(0, 0, 0);
        let n = 40_000;
        let all: Vec<f64> = (0..n).map(|_| l.sample(0.4, &mut rng)).collect();
        let mean = all.iter().sum::<f64>() / f64::from(n);
        let square = all.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        assert!((mean - 0.7 * 0.4).abs() < 0.01, "{mean}");
        assert!((square - (0.7 * (0.16 + 0.01) + 0.3 * REACH * REACH)).abs() < 0.01, "{square}");
    }
}
