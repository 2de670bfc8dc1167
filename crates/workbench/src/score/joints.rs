//! Detected joints in a picture against labelled ones: the percentage of correct
//! keypoints (Yang and Ramanan 2013).

use indexmap::IndexMap;

/// The scored joints, each of which occurs on both sides (`l_…`, `r_…`).
const PARTS: [&str; 6] = ["shoulder", "elbow", "wrist", "hip", "knee", "ankle"];

/// The labelled joints of one person.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointsTruth {
    /// Positions in pixels of the picture, x to the right, y down.
    pub joints: IndexMap<String, [f64; 2]>,
}

/// The error of detected joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointsError {
    /// The number of labelled limb joints.
    pub labelled: usize,
    /// The number of those without a detection within 0.2 torso lengths (PCKt@0.2 counts
    /// the others).
    pub missed: usize,
    /// The mean distance of the detected joints from their labels, in pixels; NaN if
    /// there are none.
    pub pixels: f64,
}

impl JointsTruth {
    /// Returns the mean distance from a shoulder to the opposite hip, over the pairs that
    /// are labelled.
    fn torso(&self) -> Option<f64> {
        let across = |a: &str, b: &str| Some(distance(self.joints.get(a)?, self.joints.get(b)?));
        let both = [across("l_shoulder", "r_hip"), across("r_shoulder", "l_hip")];
        let known: Vec<f64> = both.into_iter().flatten().collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }

    /// Returns whether a limb joint is labelled, and a torso length is known.
    pub fn is_enough(&self) -> bool {
        self.torso().is_some() && limbs().any(|name| self.joints.contains_key(&name))
    }

    /// Computes the error of detected joints. A joint that was not detected counts as
    /// missed; without a torso length all joints do.
    pub fn error(&self, found: &IndexMap<String, [f64; 2]>) -> JointsError {
        let torso = self.torso();
        let (mut error, mut sum, mut seen) =
            (JointsError { labelled: 0, missed: 0, pixels: f64::NAN }, 0.0, 0u32);
        for name in limbs() {
            let Some(truth) = self.joints.get(&name) else { continue };
            let d = found.get(&name).map(|at| distance(truth, at)).filter(|d| d.is_finite());
            error.labelled += 1;
            error.missed += usize::from(!d.zip(torso).is_some_and(|(d, torso)| d <= 0.2 * torso));
            if let Some(d) = d {
                (sum, seen) = (sum + d, seen + 1);
            }
        }
        if seen > 0 {
            error.pixels = sum / f64::from(seen);
        }
        error
    }
}

/// Returns the names of all limb joints.
fn limbs() -> impl Iterator<Item = String> {
    PARTS.iter().flat_map(|p| ["l_", "r_"].map(|side| format!("{side}{p}")))
}

fn distance(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(all: &[(&str, [f64; 2])]) -> IndexMap<String, [f64; 2]> {
        all.iter().map(|(n, p)| ((*n).to_owned(), *p)).collect()
    }

    #[test]
    fn a_joint_is_found_within_a_fifth_of_the_torso() {
        // The torso is 50 long.
        let labelled = [
            ("l_shoulder", [0.0, 0.0]),
            ("r_hip", [30.0, 40.0]),
            ("l_knee", [0.0, 90.0]),
            ("nose", [5.0, 5.0]),
        ];
        let truth = JointsTruth { joints: joints(&labelled) };
        let found =
            joints(&[("l_shoulder", [10.0, 0.0]), ("r_hip", [30.0, 50.5]), ("nose", [500.0, 5.0])]);
        let e = truth.error(&found);
        assert_eq!((e.labelled, e.missed), (3, 2));
        assert!((e.pixels - 10.25).abs() < 1e-12);
        assert_eq!(truth.error(&truth.joints).missed, 0);
        let nothing = truth.error(&IndexMap::new());
        assert!(nothing.missed == 3 && nothing.pixels.is_nan());
    }

    #[test]
    fn without_a_torso_nothing_is_found() {
        let truth = JointsTruth { joints: joints(&[("l_knee", [0.0, 90.0])]) };
        assert_eq!(truth.error(&truth.joints).missed, 1);
        assert!(!truth.is_enough());
    }
}
