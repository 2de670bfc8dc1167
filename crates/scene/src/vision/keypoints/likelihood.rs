//! The likelihood of a detection given the joint's position in the model: it is near the
//! joint, or anywhere in the picture.
//!
//! All positions are in pixels. A detection `z` of a joint at `p` has the density
//! `(1 - e) N(z; p, s^2 I) + e / area` with `e = 1 - c (1 - outlier)` for a detector's
//! confidence `c`: a detection of full confidence is an outlier with probability
//! `outlier`, and one of confidence 0 is uninformative. `s^2 = sd^2 + offset^2`, because
//! the model's joint may be off, too; the true joint then lies between it and the
//! detection. A detector with several hypotheses gives positions `z_m` with probabilities
//! `w_m`, of which one belongs to the joint and the others are uniform:
//! `((1 - e) sum_m w_m N(z_m; p, s^2 I) + e / area) / area^(M - 1)`. The model may miss a
//! fraction of the joints, which have 8 times the standard deviation, so that a distant
//! body is still pulled towards its detected joints. Invariant: the density is finite and
//! never NaN, as `e > 0`.

use crate::vision::VisionError;
use pcadlang_numerics::rng::Stream;
use smallvec::{SmallVec, smallvec};

/// The unit of the standard deviations of an error model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Percent of the image's diagonal.
    #[default]
    Diagonal,
    /// Lengths of the person's torso.
    Torso,
}

/// The error model.
#[derive(Clone, Debug, PartialEq)]
pub struct KeypointOptions {
    /// The standard deviation of an inlier along each axis; positive.
    pub sd: f64,
    /// The probability that a detection of full confidence is an outlier; strictly
    /// between 0 and 1.
    pub outlier: f64,
    /// The standard deviation along each axis of the true joint about the model's; not
    /// negative.
    pub offset: f64,
    /// The unit of `sd`, `offset` and `systematic`.
    pub unit: Unit,
    /// The fraction of joints that are farther off in the model; from 0 to less than 1.
    pub misses: f64,
    /// The standard deviation along each axis of an error that detector and model have in
    /// common; not negative. Detections are uninformative about it, so it enters the
    /// uncertainty of joints ([`KeypointLikelihood::located`]) and not the density.
    pub systematic: f64,
}

/// Factor on the standard deviation of detections about joints that the model misses; the
/// model is off then.
const MISS: f64 = 8.0;

impl Default for KeypointOptions {
    fn default() -> Self {
        KeypointOptions {
            sd: 1.5,
            outlier: 0.05,
            offset: 0.0,
            unit: Unit::Diagonal,
            misses: 0.0,
            systematic: 0.0,
        }
    }
}

/// The detected position of a joint, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// The positions and their probabilities, which sum to 1: at least one.
    places: SmallVec<[([f64; 2], f64); 3]>,
    /// The detector's confidence, clamped to 0..=1.
    pub confidence: f64,
}

impl Detection {
    /// Builds a detection with a single position.
    pub fn new(at: [f64; 2], confidence: f64) -> Self {
        Detection { places: smallvec![(at, 1.0)], confidence }
    }

    /// Adds alternative positions with positive weights relative to the first position's
    /// weight of 1.
    #[must_use]
    pub fn or(mut self, others: impl Iterator<Item = ([f64; 2], f64)>) -> Self {
        self.places.extend(others);
        let sum: f64 = self.places.iter().map(|p| p.1).sum();
        self.places.iter_mut().for_each(|p| p.1 /= sum);
        self
    }
}

/// The error model for one image size. Positions are in pixels. Its density integrates to
/// 1 if joints are well inside the image, where outliers are uniform.
#[derive(Clone, Debug)]
pub struct KeypointLikelihood {
    width: f64,
    height: f64,
    /// Of a detection about the model's joint: `sd` and `offset` combined.
    sd: f64,
    /// Of the true joint about the model's.
    offset: f64,
    outlier: f64,
    misses: f64,
    systematic: f64,
    log_peak: f64,
    log_area: f64,
}

/// The terms of a detection's density that do not depend on the joint.
#[derive(Clone, Debug)]
pub struct DetectionConstants {
    /// Per position, the logs of its components at the joint.
    peaks: Logs,
    /// The log of the component of outliers.
    off: f64,
}

/// Per position: as a good detection, and of a missed joint.
type Logs = SmallVec<[[f64; 2]; 3]>;

impl KeypointLikelihood {
    /// Builds the model for an image of this size and a torso of this length, all in
    /// pixels.
    ///
    /// # Errors
    /// If a side or an option is outside its range; the torso is only checked if it is
    /// the unit.
    pub fn new(
        width: f64,
        height: f64,
        torso: f64,
        options: &KeypointOptions,
    ) -> Result<Self, VisionError> {
        let positive = |name, value: f64| match value > 0.0 && value < 1e9 {
            true => Ok(value),
            false => Err(VisionError::Range { name, rule: "positive and less than 1e9", value }),
        };
        let (width, height) = (positive("width", width)?, positive("height", height)?);
        let unit = match options.unit {
            Unit::Diagonal => (width * width + height * height).sqrt() / 100.0,
            Unit::Torso => positive("torso", torso)?,
        };
        let not_negative =
            |name, value: f64| if value == 0.0 { Ok(0.0) } else { positive(name, value) };
        let offset = not_negative("offset", options.offset)? * unit;
        let systematic = not_negative("systematic", options.systematic)? * unit;
        let own = positive("sd", options.sd)? * unit;
        let sd = (own * own + offset * offset).sqrt();
        // So that its square does not underflow.
        let sd = sd.max(1e-100);
        let outlier = options.outlier;
        if !(outlier > 0.0 && outlier < 1.0) {
            return Err(VisionError::Range {
                name: "outlier",
                rule: "strictly between 0 and 1",
                value: outlier,
            });
        }
        let misses = options.misses;
        if !(0.0..1.0).contains(&misses) {
            return Err(VisionError::Range {
                name: "misses",
                rule: "from 0 to less than 1",
                value: misses,
            });
        }
        let log_peak = -libm::log(2.0 * std::f64::consts::PI * sd * sd);
        let log_area = libm::log(width * height);
        Ok(KeypointLikelihood {
            width,
            height,
            sd,
            offset,
            outlier,
            misses,
            systematic,
            log_peak,
            log_area,
        })
    }

    /// The standard deviation of an inlier about the model's joint along each axis, in
    /// pixels.
    pub fn sd(&self) -> f64 {
        self.sd
    }

    /// The variance along an axis of the error that detector and model have in common, in
    /// squared pixels.
    pub fn systematic_variance(&self) -> f64 {
        self.systematic * self.systematic
    }

    /// Returns the probability that a detection of this confidence is an outlier.
    pub fn outlier(&self, confidence: f64) -> f64 {
        // NaN counts as no confidence.
        let confidence = if confidence > 0.0 { confidence.min(1.0) } else { 0.0 };
        1.0 - confidence * (1.0 - self.outlier)
    }

    /// Returns what the density of a detection needs, wherever the joint is.
    pub fn constants(&self, seen: &Detection) -> DetectionConstants {
        let e = self.outlier(seen.confidence);
        let logs = [1.0 - self.misses, self.misses / (MISS * MISS)]
            .map(|share| libm::log(share) + self.log_peak);
        let peak = |(_, share): &([f64; 2], f64)| {
            let good = libm::log1p(-e) + libm::log(*share);
            logs.map(|log| good + log)
        };
        DetectionConstants {
            peaks: seen.places.iter().map(peak).collect(),
            off: libm::log(e) - self.log_area,
        }
    }

    /// Returns the logs of the components of the density, without the factor for the
    /// other positions, one for each position; `known` has that for an outlier.
    fn parts(&self, known: &DetectionConstants, seen: &Detection, joint: Option<[f64; 2]>) -> Logs {
        let Some([x, y]) = joint.filter(|j| j.iter().all(|c| c.is_finite())) else {
            return seen.places.iter().map(|_| [f64::NEG_INFINITY; 2]).collect();
        };
        let near = |((at, _), peaks): (&([f64; 2], f64), &[f64; 2])| {
            let (dx, dy) = ((at[0] - x) / self.sd, (at[1] - y) / self.sd);
            let r2 = 0.5 * (dx * dx + dy * dy);
            [peaks[0] - r2, peaks[1] - r2 / (MISS * MISS)]
        };
        seen.places.iter().zip(&known.peaks).map(near).collect()
    }

    /// Returns the probability that each position belongs to the joint, well or as a
    /// miss, and that none does.
    fn shares(&self, known: &DetectionConstants, seen: &Detection, joint: [f64; 2]) -> (Logs, f64) {
        let mut near = self.parts(known, seen, Some(joint));
        let most = greatest(&near, known.off);
        let mut off = libm::exp(known.off - most);
        near.iter_mut().flatten().for_each(|n| *n = libm::exp(*n - most));
        let share = 1.0 / near.iter().flatten().fold(off, |sum, n| sum + n);
        near.iter_mut().flatten().chain([&mut off]).for_each(|n| *n *= share);
        (near, off)
    }

    /// Returns the log density of a detection. `joint` is the model's position; if it has
    /// none (behind the camera), every detection is an outlier.
    pub fn log_density(&self, seen: &Detection, joint: Option<[f64; 2]>) -> f64 {
        self.log_density_with(&self.constants(seen), seen, joint)
    }

    /// [`KeypointLikelihood::log_density`] with the constants of the detection.
    pub fn log_density_with(
        &self,
        known: &DetectionConstants,
        seen: &Detection,
        joint: Option<[f64; 2]>,
    ) -> f64 {
        let near = self.parts(known, seen, joint);
        log_sum(&near, known.off) - (near.len() - 1) as f64 * self.log_area
    }

    /// Returns the derivative of the log density with respect to the joint's position.
    pub fn gradient(&self, seen: &Detection, joint: [f64; 2]) -> [f64; 2] {
        self.gradient_with(&self.constants(seen), seen, joint)
    }

    /// [`KeypointLikelihood::gradient`] with the constants of the detection.
    pub fn gradient_with(
        &self,
        known: &DetectionConstants,
        seen: &Detection,
        joint: [f64; 2],
    ) -> [f64; 2] {
        let (shares, _) = self.shares(known, seen, joint);
        let mut slope = [0.0; 2];
        for ((at, _), [well, miss]) in seen.places.iter().zip(shares) {
            let pull = well + miss / (MISS * MISS);
            if pull > 0.0 {
                (0..2).for_each(|i| slope[i] += pull * (at[i] - joint[i]) / (self.sd * self.sd));
            }
        }
        slope
    }

    /// Returns the mean position of the true joint given a detection and the model's
    /// position, and the variance along an axis (averaged over the two).
    pub fn located(&self, seen: &Detection, joint: [f64; 2]) -> ([f64; 2], f64) {
        let (shares, off) = self.shares(&self.constants(seen), seen, joint);
        let between = self.offset * self.offset;
        let own = (self.sd * self.sd - between).max(0.0);
        // The variance of the mixture of hits, misses and outliers: within each
        // component, and between them.
        let (mut shift, mut square, mut within) = ([0.0; 2], 0.0, off * between);
        for ((at, _), both) in seen.places.iter().zip(shares) {
            for (share, wider) in
                both.into_iter().zip([1.0, MISS]).filter(|(share, _)| *share > 0.0)
            {
                let both = wider * wider * self.sd * self.sd;
                let between = both - own;
                let weight = between / both;
                let to = [0, 1].map(|i| weight * (at[i] - joint[i]));
                (0..2).for_each(|i| shift[i] += share * to[i]);
                square += share * (to[0] * to[0] + to[1] * to[1]);
                within += share * between * (1.0 - weight);
            }
        }
        let apart = 0.5 * (square - shift[0] * shift[0] - shift[1] * shift[1]);
        ([0, 1].map(|i| joint[i] + shift[i]), within + apart.max(0.0) + self.systematic_variance())
    }

    /// Returns the position of a detection that most probably belongs to the joint.
    pub fn meant(&self, seen: &Detection, joint: [f64; 2]) -> [f64; 2] {
        let (shares, _) = self.shares(&self.constants(seen), seen, joint);
        let all = seen.places.iter().zip(shares).map(|((at, _), [well, miss])| (*at, well + miss));
        all.reduce(|a, b| if b.1 > a.1 { b } else { a }).map_or(joint, |(at, _)| at)
    }

    /// Samples as many positions as a detection has.
    pub fn sample(
        &self,
        seen: &Detection,
        joint: Option<[f64; 2]>,
        rng: &mut Stream,
    ) -> SmallVec<[[f64; 2]; 3]> {
        let mut meant = None;
        if let Some(at) = joint
            && rng.uniform() >= self.outlier(seen.confidence)
        {
            let mut left = if seen.places.len() > 1 { rng.uniform() } else { 0.0 };
            let found = seen.places.iter().position(|p| {
                left -= p.1;
                left < 0.0
            });
            meant = Some((found.unwrap_or(0), at));
        }
        let missed = meant.is_some() && self.misses > 0.0 && rng.uniform() < self.misses;
        let sd = if missed { MISS * self.sd } else { self.sd };
        let one = |i: usize| match meant {
            Some((m, [x, y])) if m == i => {
                [x + sd * rng.standard_normal(), y + sd * rng.standard_normal()]
            }
            _ => [self.width * rng.uniform(), self.height * rng.uniform()],
        };
        (0..seen.places.len()).map(one).collect()
    }
}

fn greatest(near: &[[f64; 2]], off: f64) -> f64 {
    near.iter().flatten().copied().fold(off, f64::max)
}

/// Returns the log of the sum of these exponentials, of which the last is finite.
fn log_sum(near: &[[f64; 2]], off: f64) -> f64 {
    let most = greatest(near, off);
    let rest: f64 = near.iter().flatten().chain([&off]).map(|x| libm::exp(x - most)).sum();
    most + libm::log(rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    fn options(sd: f64, outlier: f64) -> KeypointOptions {
        KeypointOptions { sd, outlier, ..KeypointOptions::default() }
    }

    fn one(at: [f64; 2], confidence: f64) -> Detection {
        Detection::new(at, confidence)
    }

    fn model(sd: f64, outlier: f64) -> KeypointLikelihood {
        KeypointLikelihood::new(400.0, 300.0, 0.0, &options(sd, outlier)).unwrap()
    }

    #[test]
    fn the_density_integrates_to_one() {
        for (sd, outlier, confidence, misses) in [
            (1.5, 0.05, 1.0, 0.0),
            (1.0, 0.3, 0.4, 0.0),
            (2.0, 0.05, 0.0, 0.0),
            (0.5, 0.1, 0.8, 0.3),
        ] {
            let o = KeypointOptions { misses, ..options(sd, outlier) };
            let m = KeypointLikelihood::new(400.0, 300.0, 0.0, &o).unwrap();
            let mut sum = 0.0;
            for j in 0..600 {
                for i in 0..800 {
                    let z = [0.5 * (f64::from(i) + 0.5), 0.5 * (f64::from(j) + 0.5)];
                    sum +=
                        0.25 * libm::exp(m.log_density(&one(z, confidence), Some([180.3, 140.2])));
                }
            }
            assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        }
    }

    #[test]
    fn values_by_hand_and_limits() {
        let m = model(1.0, 0.05);
        assert_eq!(m.sd(), 5.0, "one percent of 500 pixels");
        let at = |r: f64| m.log_density(&one([100.0 + r, 100.0], 1.0), Some([100.0, 100.0]));
        let density = |r: f64| {
            0.95 * libm::exp(-r * r / 50.0) / (2.0 * std::f64::consts::PI * 25.0)
                + 0.05 / (400.0 * 300.0)
        };
        for r in [0.0, 1.0, 7.0, 20.0, 30.0] {
            assert!((at(r) - libm::log(density(r))).abs() < 1e-12);
        }
        let off = libm::log(0.05 / 120_000.0);
        assert_eq!(at(1e200), off);
        for nowhere in [None, Some([f64::NAN, 0.0]), Some([0.0, f64::INFINITY])] {
            assert!((m.log_density(&one([1.0, 2.0], 1.0), nowhere) - off).abs() < 1e-12);
        }
        assert!(
            (m.log_density(&one([1.0, 1.0], 0.0), Some([1.0, 1.0])) + libm::log(120_000.0)).abs()
                < 1e-12
        );
        assert_eq!(m.outlier(1.0), 0.050000000000000044, "{}", m.outlier(1.0));
        assert!(
            model(1e-300, 1e-300).log_density(&one([1.0, 1.0], 1.0), Some([2.0, 1.0])).is_finite()
        );
    }

    #[test]
    fn sizes_are_positive_and_less_than_a_thousand_million() {
        let options = options(1.0, 0.05);
        for (width, fits) in
            [(1e9, false), (999_999_999.0, true), (1e-9, true), (0.0, false), (f64::NAN, false)]
        {
            assert_eq!(
                KeypointLikelihood::new(width, 300.0, 0.0, &options).is_ok(),
                fits,
                "{width}"
            );
        }
    }

    #[test]
    fn the_gradient_is_that_of_central_differences() {
        let m = model(1.5, 0.1);
        for joint in
            [[200.0, 150.0], [203.0, 148.5], [210.0, 170.0], [225.0, 150.0], [260.0, 150.0]]
        {
            for confidence in [1.0, 0.5, 0.01, 0.0] {
                let z = [200.0, 150.0];
                let g = m.gradient(&one(z, confidence), joint);
                for axis in 0..2 {
                    let shifted = |h: f64| {
                        let mut p = joint;
                        p[axis] += h;
                        m.log_density(&one(z, confidence), Some(p))
                    };
                    let slope = (shifted(1e-4) - shifted(-1e-4)) / 2e-4;
                    assert!((g[axis] - slope).abs() < 1e-6, "{joint:?} {confidence} {g:?} {slope}");
                }
            }
        }
    }

    #[test]
    fn a_joint_lies_between_the_model_and_the_detection() {
        let options = KeypointOptions { offset: 0.8, ..options(0.6, 0.1) };
        let m = KeypointLikelihood::new(400.0, 300.0, 0.0, &options).unwrap();
        assert!((m.sd() - 5.0).abs() < 1e-12, "both spreads: 3 and 4 pixels");
        let (seen, joint) = ([103.0, 96.0], [100.0, 100.0]);
        // By quadrature over the true joint: N(q; joint, 4) times the density of the
        // detection about q.
        let own = KeypointLikelihood::new(
            400.0,
            300.0,
            0.0,
            &KeypointOptions { offset: 0.0, ..options.clone() },
        )
        .unwrap();
        for confidence in [1.0, 0.3, 0.0] {
            let (mut mass, mut mean, mut square) = (0.0, [0.0; 2], 0.0);
            for i in -80..=80 {
                for j in -80..=80 {
                    let d = [f64::from(i) * 0.25, f64::from(j) * 0.25];
                    let q = [joint[0] + d[0], joint[1] + d[1]];
                    let prior = libm::exp(-(d[0] * d[0] + d[1] * d[1]) / 32.0);
                    let w = prior * libm::exp(own.log_density(&one(seen, confidence), Some(q)));
                    mass += w;
                    (mean[0], mean[1]) = (mean[0] + w * q[0], mean[1] + w * q[1]);
                    square += w * (d[0] * d[0] + d[1] * d[1]);
                }
            }
            let mean = mean.map(|x| x / mass);
            let shift = [mean[0] - joint[0], mean[1] - joint[1]];
            let variance = 0.5 * (square / mass - shift[0] * shift[0] - shift[1] * shift[1]);
            let (at, found) = m.located(&one(seen, confidence), joint);
            assert!(
                (at[0] - mean[0]).abs() < 1e-3 && (at[1] - mean[1]).abs() < 1e-3,
                "{at:?} {mean:?}"
            );
            assert!((found - variance).abs() < 1e-2, "{found} {variance}");
            let wider = KeypointOptions { systematic: 0.4, ..options.clone() };
            let wider = KeypointLikelihood::new(400.0, 300.0, 0.0, &wider).unwrap();
            let (same, wide) = wider.located(&one(seen, confidence), joint);
            assert!(
                same == at && (wide - found - 4.0).abs() < 1e-9,
                "two pixels more: {wide} {found}"
            );
        }
        let exact = model(1.0, 0.05);
        assert_eq!(
            exact.located(&one(seen, 1.0), joint),
            (joint, 0.0),
            "without an offset the model's joint is the joint"
        );
    }

    #[test]
    fn draws_have_the_stated_spread() {
        let m = model(1.0, 0.2);
        let mut rng = StreamKey::new(3, 0, Purpose::PREDICT).stream(0, 0, 0);
        let n = 40_000;
        let (mut near, mut square) = (0.0, 0.0);
        for _ in 0..n {
            let z = m.sample(&one([0.0; 2], 0.5), Some([200.0, 150.0]), &mut rng)[0];
            let r2 = (z[0] - 200.0) * (z[0] - 200.0) + (z[1] - 150.0) * (z[1] - 150.0);
            if r2 < 400.0 {
                near += 1.0;
                square += r2;
            }
        }
        // The normal part has exp(-8) beyond 4 standard deviations, and the uniform part
        // a hundredth within them.
        let expected =
            0.4 * (1.0 - libm::exp(-8.0)) + 0.6 * std::f64::consts::PI * 400.0 / 120_000.0;
        assert!((near / f64::from(n) - expected).abs() < 0.01, "{}", near / f64::from(n));
        assert!((square / near - 50.0).abs() < 4.0, "{}", square / near);
        let m = model(1.0, 0.2);
        assert!((0..100).all(|_| m.sample(&one([0.0; 2], 1.0), None, &mut rng)[0][1] < 300.0));
    }

    #[test]
    fn options_are_checked() {
        let of = |w: f64, sd: f64, outlier: f64| {
            KeypointLikelihood::new(w, 10.0, 0.0, &options(sd, outlier))
        };
        assert!(of(10.0, 1.0, 0.1).is_ok());
        for (w, sd, outlier) in [
            (0.0, 1.0, 0.1),
            (f64::NAN, 1.0, 0.1),
            (1.0, 0.0, 0.1),
            (1.0, f64::INFINITY, 0.1),
            (1.0, 1.0, 0.0),
            (1.0, 1.0, 1.0),
        ] {
            assert!(of(w, sd, outlier).is_err());
        }
    }
}
