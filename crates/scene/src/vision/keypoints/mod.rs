//! Keypoints: the detected joints of a person, and their likelihood given the joints of a
//! model.
//!
//! This module reads the output of pose detectors, picks one person, and holds the error
//! model. It is not a detector, and it has no knowledge of bodies: a joint is a name.
//! Invariant of [`Keypoints`]: names are unique, numbers finite, and confidences in
//! 0..=1.
//!
//! [`People::parse`] reads the layouts of `docs/reference/formats.md` and distinguishes them by
//! their shape: joints by name, and the output of OpenPose, MMPose, AlphaPose, Ultralytics, RTMLib,
//! MediaPipe, DeepLabCut, SLEAP, and COCO with what resembles it. Joints without names are in one
//! of the orders of `joint_lists.rs`. `null` for a person means that nobody was detected, and for
//! a joint that it was not; the confidence is from 0 to 1, more counts as 1, and is optional.
//!
//! `"width"` and `"height"`, beside `"keypoints"` or in COCO's `"images"`, give the size
//! of the image in whose pixels the positions are.

mod arrays;
mod coco;
mod joint_lists;
mod joints;
mod labels;
mod layouts;
mod likelihood;
mod mediapipe;
mod names;
mod node;
mod openpose;
mod people;
mod relative_depth;
mod tables;
mod undistort;

#[cfg(test)]
mod calibration_tests;
#[cfg(test)]
mod formats_tests;

pub use likelihood::{Detection, DetectionConstants, KeypointLikelihood, KeypointOptions, Unit};
pub use names::{COCO, MEDIAPIPE, matching};
pub use node::KeypointsError;
pub use people::{People, split_id};
pub use relative_depth::RelativeDepthLikelihood;

use rustc_hash::FxHashSet;
use std::sync::Arc;

/// A detected joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Keypoint {
    /// Its name, normalised to the spelling of [`COCO`] and [`MEDIAPIPE`] if it is in
    /// those lists.
    pub name: Arc<str>,
    /// From the left edge, in pixels; a fraction of the width if the set is normalised.
    pub x: f64,
    /// From the top edge, in pixels; a fraction of the height if the set is normalised.
    pub y: f64,
    /// The detector's confidence, 0 to 1; 1 if the detector does not report it.
    pub confidence: f64,
    /// Alternative positions, if the detector has several hypotheses.
    pub others: Vec<Alternative>,
}

/// An alternative position of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternative {
    /// As [`Keypoint::x`].
    pub x: f64,
    /// As [`Keypoint::y`].
    pub y: f64,
    /// Probability relative to that of the joint's main position: positive.
    pub weight: f64,
}

impl Keypoint {
    /// Builds a keypoint with a single position.
    pub fn new(name: impl Into<Arc<str>>, [x, y]: [f64; 2], confidence: f64) -> Keypoint {
        Keypoint { name: name.into(), x, y, confidence, others: Vec::new() }
    }
}

/// The detected joints of one person; empty if nobody was detected.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keypoints {
    points: Vec<Keypoint>,
    normalised: bool,
    size: Option<(u32, u32)>,
    /// The length of the torso in pixels, overriding the one computed from the points.
    torso: Option<f64>,
}

/// Diagonals of a torso.
const ACROSS: [[&str; 2]; 2] = [["l_shoulder", "r_hip"], ["r_shoulder", "l_hip"]];
/// Lower bound of a torso's length, as a fraction of the longer side of the box around
/// all joints: a strongly foreshortened torso does not measure a person's size.
const LEAST_TORSO: f64 = 0.2;

impl Keypoints {
    /// Builds a set of keypoints in pixels.
    ///
    /// # Errors
    /// If a name occurs twice, a position is not finite, or a confidence is not in 0..=1.
    pub fn new(points: Vec<Keypoint>) -> Result<Keypoints, KeypointsError> {
        let mut names = FxHashSet::default();
        for p in &points {
            if !names.insert(&p.name) {
                return Err(KeypointsError::new(format!("the keypoint `{}` occurs twice", p.name)));
            }
            if !(p.x.is_finite() && p.y.is_finite()) {
                return Err(KeypointsError::new(format!(
                    "the position of the keypoint `{}` is not finite",
                    p.name
                )));
            }
            let sound = |o: &Alternative| {
                o.x.is_finite() && o.y.is_finite() && o.weight > 0.0 && o.weight.is_finite()
            };
            if !p.others.iter().all(sound) {
                return Err(KeypointsError::new(format!(
                    "an alternative position of the keypoint `{}` is not finite",
                    p.name
                )));
            }
            if !(0.0..=1.0).contains(&p.confidence) {
                let (name, c) = (&p.name, p.confidence);
                return Err(KeypointsError::new(format!(
                    "the confidence of `{name}` must be from 0 to 1, got {c}"
                )));
            }
        }
        Ok(Keypoints { points, ..Keypoints::default() })
    }

    /// Interprets the same numbers as fractions of the image's width and height.
    fn into_normalised(self) -> Keypoints {
        Keypoints { normalised: true, ..self }
    }

    /// The joints.
    pub fn points(&self) -> &[Keypoint] {
        &self.points
    }

    /// True if there are no joints.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// True if positions are fractions of the image's width and height, as in MediaPipe's
    /// files.
    pub fn is_normalised(&self) -> bool {
        self.normalised
    }

    /// Width and height in pixels of the image that they were detected in, if known.
    pub fn size(&self) -> Option<(u32, u32)> {
        self.size
    }

    /// Returns the same joints at the positions of `points`, in the same units and with
    /// one point per joint.
    #[must_use]
    pub fn moved(&self, points: &[Keypoint]) -> Keypoints {
        let moved = |(p, to): (&Keypoint, &Keypoint)| Keypoint {
            x: to.x,
            y: to.y,
            others: to.others.clone(),
            ..p.clone()
        };
        Keypoints { points: self.points.iter().zip(points).map(moved).collect(), ..self.clone() }
    }

    /// Records the size of the image; a size given in the file takes precedence.
    #[must_use]
    pub fn in_image(self, width: u32, height: u32) -> Keypoints {
        let known = (width > 0 && height > 0).then_some((width, height));
        Keypoints { size: self.size.or(known), ..self }
    }

    /// Sets the length of the torso in pixels, whatever the joints are.
    #[must_use]
    pub fn with_torso(self, torso: f64) -> Keypoints {
        Keypoints { torso: Some(torso), ..self }
    }

    /// Returns the length of the torso in pixels of an image of this size: the mean
    /// distance from a shoulder to the opposite hip over the detected pairs, and at least
    /// a fifth of the box around all joints. It is 0 without joints.
    pub fn torso(&self, size: (u32, u32)) -> f64 {
        if let Some(torso) = self.torso {
            return torso;
        }
        let find = |name: &str| {
            self.points.iter().find(|p| &*p.name == name).map(|p| self.position(p, size))
        };
        let across = |[a, b]: [&str; 2]| {
            let (a, b) = (find(a)?, find(b)?);
            Some(libm::hypot(a[0] - b[0], a[1] - b[1]))
        };
        let known: Vec<f64> = ACROSS.into_iter().filter_map(across).collect();
        let long = known.iter().sum::<f64>() / known.len().max(1) as f64;
        let places = || self.points.iter().map(|p| self.position(p, size));
        let extent = |axis: usize| {
            let along = || places().map(move |p| p[axis]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        long.max(LEAST_TORSO * extent(0).max(extent(1)))
    }

    /// Returns the detection of a joint, in pixels of an image of this size.
    pub fn detection(&self, of: &Keypoint, size: (u32, u32)) -> Detection {
        let one = Detection::new(self.position(of, size), of.confidence);
        match of.others.is_empty() {
            true => one,
            false => one.or(of.others.iter().map(|o| (self.scaled([o.x, o.y], size), o.weight))),
        }
    }

    /// Returns the position of a joint in pixels of an image of this size, if the set is
    /// in its pixels or normalised.
    pub fn position(&self, of: &Keypoint, (width, height): (u32, u32)) -> [f64; 2] {
        self.scaled([of.x, of.y], (width, height))
    }

    fn scaled(&self, [x, y]: [f64; 2], (width, height): (u32, u32)) -> [f64; 2] {
        match self.normalised {
            true => [x * f64::from(width), y * f64::from(height)],
            false => [x, y],
        }
    }
}
