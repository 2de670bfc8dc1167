//! The joints that detectors name: COCO's 17 and MediaPipe's 33, with `l_` and `r_` for
//! the person's own left and right, and their match with the landmarks of a scene.

use super::node::first;
use super::{Keypoints, KeypointsError};
use std::borrow::Cow;

/// COCO's joints in its order (Lin et al. 2014, "Microsoft COCO: Common Objects in
/// Context").
pub const COCO: [&str; 17] = [
    "nose",
    "l_eye",
    "r_eye",
    "l_ear",
    "r_ear",
    "l_shoulder",
    "r_shoulder",
    "l_elbow",
    "r_elbow",
    "l_wrist",
    "r_wrist",
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
];

/// MediaPipe Pose's landmarks in its order (Bazarevsky et al. 2020, "BlazePose").
pub const MEDIAPIPE: [&str; 33] = [
    "nose",
    "l_eye_inner",
    "l_eye",
    "l_eye_outer",
    "r_eye_inner",
    "r_eye",
    "r_eye_outer",
    "l_ear",
    "r_ear",
    "l_mouth",
    "r_mouth",
    "l_shoulder",
    "r_shoulder",
    "l_elbow",
    "r_elbow",
    "l_wrist",
    "r_wrist",
    "l_pinky",
    "r_pinky",
    "l_index",
    "r_index",
    "l_thumb",
    "r_thumb",
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
    "l_heel",
    "r_heel",
    "l_foot_index",
    "r_foot_index",
];

/// Joints of other common lists that a rig may lack.
const MORE: [&str; 2] = ["neck", "head_top"];

/// Returns the name in the spelling of these lists: `left_eye` and `LEFT_EYE` become
/// `l_eye`, `mouth_left` becomes `l_mouth`. Other names are unchanged.
pub(super) fn usual(name: &str) -> Cow<'_, str> {
    let lower = name.to_ascii_lowercase();
    let short = match (lower.strip_prefix("left_"), lower.strip_prefix("right_"), &*lower) {
        (Some(rest), ..) => format!("l_{rest}"),
        (_, Some(rest), _) => format!("r_{rest}"),
        (.., "mouth_left") => "l_mouth".into(),
        (.., "mouth_right") => "r_mouth".into(),
        _ => lower,
    };
    if well_known(&short) { Cow::Owned(short) } else { Cow::Borrowed(name) }
}

fn well_known(name: &str) -> bool {
    MEDIAPIPE.contains(&name) || MORE.contains(&name)
}

/// True if a rig need not have this joint: the well-known ones except those of arms and
/// legs.
pub(super) fn may_lack(name: &str) -> bool {
    let limb = ["shoulder", "elbow", "wrist", "hip", "knee", "ankle"];
    well_known(name) && !name.get(2..).is_some_and(|rest| limb.contains(&rest))
}

/// Maximum number of landmarks listed in a message.
const LISTED: usize = 24;

/// Returns for each detected joint the index of the landmark of the same name. Well-known
/// joints that a rig may lack (eyes, ears, fingers, heels, …) have `None` if the scene
/// does not have such a landmark.
///
/// `nearest` returns the most similar name, for the message.
///
/// # Errors
/// If a detected joint is neither a landmark nor one of those; the message has its name
/// and the existing landmarks.
pub fn matching(
    detected: &Keypoints,
    landmarks: &[&str],
    nearest: impl Fn(&str, &[&str]) -> Option<String>,
) -> Result<Vec<Option<usize>>, KeypointsError> {
    let mut found = Vec::with_capacity(detected.points().len());
    for p in detected.points() {
        let at = landmarks.iter().position(|l| *l == &*p.name);
        if at.is_none() && !may_lack(&p.name) {
            let e = KeypointsError::new(format!(
                "`{}` was detected, but the scene has no such landmark",
                p.name
            ));
            return Err(match nearest(&p.name, landmarks) {
                _ if landmarks.is_empty() => e.hint("it has no landmarks"),
                Some(n) => e.hint(format!(
                    "did you mean `{n}`? It has {}",
                    first(landmarks.iter().copied(), LISTED)
                )),
                None => e.hint(format!("it has {}", first(landmarks.iter().copied(), LISTED))),
            });
        }
        found.push(at);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::keypoints::Keypoint;

    #[test]
    fn spellings_of_one_joint() {
        for (name, expected) in [
            ("left_eye", "l_eye"),
            ("RIGHT_FOOT_INDEX", "r_foot_index"),
            ("l_wrist", "l_wrist"),
            ("mouth_right", "r_mouth"),
            ("Nose", "nose"),
            ("left_wing", "left_wing"),
            ("Tail", "Tail"),
        ] {
            assert_eq!(usual(name), expected);
        }
        assert!(COCO.iter().all(|n| MEDIAPIPE.contains(n)));
        let limbs: Vec<_> = COCO.into_iter().filter(|n| !may_lack(n)).collect();
        assert_eq!(limbs, COCO[5..]);
        assert!(may_lack("neck") && may_lack("l_heel") && !may_lack("tail") && !may_lack("é_hip"));
    }

    fn of(names: &[&str]) -> Keypoints {
        let point = |n: &&str| Keypoint::new(*n, [1.0, 2.0], 1.0);
        Keypoints::new(names.iter().map(point).collect()).unwrap()
    }

    #[test]
    fn joints_find_their_landmarks() {
        let none = |_: &str, _: &[&str]| None;
        let rig = ["l_wrist", "nose", "tail"];
        assert_eq!(
            matching(&of(&["tail", "l_eye", "nose"]), &rig, none).unwrap(),
            [Some(2), None, Some(1)]
        );
        assert_eq!(matching(&of(&[]), &[], none).unwrap(), []);
        let said = |d: &[&str], rig: &[&str]| {
            let near =
                |_: &str, l: &[&str]| l.first().filter(|_| l.len() > 1).map(|n| n.to_string());
            matching(&of(d), rig, near).unwrap_err().to_string()
        };
        assert_eq!(
            said(&["nose", "l_wirst"], &rig),
            "`l_wirst` was detected, but the scene has no such landmark; did you mean `l_wrist`? \
             It has l_wrist, nose, tail"
        );
        assert_eq!(
            said(&["wing"], &["a"]),
            "`wing` was detected, but the scene has no such landmark; it has a"
        );
        assert_eq!(
            said(&["l_hip"], &[]),
            "`l_hip` was detected, but the scene has no such landmark; it has no landmarks"
        );
    }
}
