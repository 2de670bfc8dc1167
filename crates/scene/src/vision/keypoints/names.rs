//! The joints that detectors name: COCO's 17, MediaPipe's 33 and others, with `l_` and `r_` for
//! the person's own left and right, and their match with the landmarks of a scene.

use super::joint_lists::{HAND, face};
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

/// Other joints of the common lists, which have no side.
const MIDDLE: [&str; 8] =
    ["neck", "head_top", "mid_shoulder", "mid_hip", "pelvis", "thorax", "chest", "upper_neck"];

/// Other joints of the feet; each name follows `l_` or `r_`.
const TOES: [&str; 2] = ["big_toe", "small_toe"];

/// Joints of arms and legs; each name follows `l_` or `r_`.
const LIMBS: [&str; 6] = ["shoulder", "elbow", "wrist", "hip", "knee", "ankle"];

/// Names of joints that are close enough to count as one where a detector has only the first and a
/// rig only the second, or the other way round; each follows `l_` or `r_`. MediaPipe's foot index
/// is the tip of the big toe, its index and pinky are the knuckles of these fingers.
const SAME: [[&str; 2]; 4] =
    [["big_toe", "foot_index"], ["index_mcp", "index"], ["pinky_mcp", "pinky"], ["hand", "wrist"]];

/// Returns the name in the spelling of these lists: `left_eye`, `LEFT_EYE`, `LEye` and `eye.L`
/// become `l_eye`. Other names are unchanged.
pub(super) fn usual(name: &str) -> Cow<'_, str> {
    if well_known(name) {
        return Cow::Borrowed(name);
    }
    let mut words = words(name);
    let side = |w: &str| match w {
        "l" | "left" => Some("l"),
        "r" | "right" => Some("r"),
        _ => None,
    };
    let given = match &words[..] {
        [first, .., last] => {
            side(first).map(|s| (0, s)).or(side(last).map(|s| (words.len() - 1, s)))
        }
        _ => None,
    };
    let prefix = given.map(|(at, side)| {
        words.remove(at);
        side
    });
    let plain = words.join("_");
    let point = plain.strip_prefix("face_").and_then(|n| n.parse().ok()).map(face);
    let rest = point.or_else(|| finger(&plain)).unwrap_or(plain);
    let short = prefix.map_or(rest.clone(), |side| format!("{side}_{rest}"));
    if well_known(&short) { Cow::Owned(short) } else { Cow::Borrowed(name) }
}

/// Splits a name into words in small letters: at separators, and before capitals (`LBigToe`).
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let letters: Vec<char> = name.chars().take(LONGEST).collect();
    for (i, &c) in letters.iter().enumerate() {
        let before = i.checked_sub(1).and_then(|i| letters.get(i)).copied().unwrap_or('_');
        let small = |c: Option<&char>| c.is_some_and(|c| c.is_lowercase());
        let begins = c.is_uppercase() && (before.is_lowercase() || small(letters.get(i + 1)));
        let separates = matches!(c, '_' | '-' | ' ' | '.' | ':');
        if (begins || separates) && words.last().is_some_and(|w| !w.is_empty()) {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| !separates) {
            word.extend(c.to_lowercase());
        }
    }
    words.retain(|w| !w.is_empty());
    words
}

/// The number of letters of a name that are looked at.
const LONGEST: usize = 40;

/// Returns the name of a point of a hand that COCO-WholeBody counts (`forefinger2`) or MediaPipe
/// calls a finger's (`index_finger_mcp`).
fn finger(name: &str) -> Option<String> {
    if name == "hand_root" {
        return Some("hand".to_owned());
    }
    let plain = name.replace("forefinger", "index").replace("_finger", "");
    let counted = plain.strip_suffix(['1', '2', '3', '4']).and_then(|finger| {
        let at = HAND.iter().position(|n| n.strip_suffix("_tip") == Some(finger))?;
        let number = plain.chars().last()?.to_digit(10)? as usize;
        HAND.get(at + number - 4)
    });
    Some(counted.map_or(plain, |n| (*n).to_owned()))
}

/// True if the name is in one of the lists.
pub(super) fn well_known(name: &str) -> bool {
    let sided = |rest: &str| TOES.contains(&rest) || HAND.contains(&rest);
    MEDIAPIPE.contains(&name)
        || MIDDLE.contains(&name)
        || name.strip_prefix("l_").or(name.strip_prefix("r_")).is_some_and(sided)
        || name.strip_prefix("face_").is_some_and(|n| n.parse::<u8>().is_ok_and(|n| n < 70))
}

/// True if a rig need not have this joint: the well-known ones except those of arms and
/// legs.
pub(super) fn may_lack(name: &str) -> bool {
    well_known(name) && !name.get(2..).is_some_and(|rest| LIMBS.contains(&rest))
}

/// Returns the other name of a joint that [`SAME`] has.
fn alias(name: &str) -> Option<String> {
    let (side, rest) = name.split_at_checked(2).filter(|(side, _)| ["l_", "r_"].contains(side))?;
    let other = SAME.iter().find_map(|[a, b]| match rest {
        r if r == *a => Some(b),
        r if r == *b => Some(a),
        _ => None,
    })?;
    Some(format!("{side}{other}"))
}

/// Maximum number of landmarks listed in a message.
const LISTED: usize = 24;

/// Returns for each detected joint the index of the landmark of the same name, in whatever spelling
/// of the common lists, or else of a landmark in the same place that was not detected itself
/// (`l_foot_index` for `l_big_toe`). Well-known joints that a rig may lack (eyes, ears, fingers,
/// heels, …) have `None` if the scene does not have such a landmark.
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
    let spelled: Vec<Cow<'_, str>> = landmarks.iter().map(|l| usual(l)).collect();
    let landmark = |name: &str| {
        let same = landmarks.iter().position(|l| *l == name);
        same.or_else(|| spelled.iter().position(|l| *l == name))
    };
    let seen = |name: &str| detected.points().iter().any(|p| &*p.name == name);
    for p in detected.points() {
        let other = || alias(&p.name).filter(|n| !seen(n)).and_then(|n| landmark(&n));
        let at = landmark(&p.name).or_else(other);
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
            ("LBigToe", "l_big_toe"),
            ("leftShoulder", "l_shoulder"),
            ("Right Ear", "r_ear"),
            ("knee.L", "l_knee"),
            ("foot_index_right", "r_foot_index"),
            ("MidHip", "mid_hip"),
            ("face-54", "l_mouth"),
            ("face-3", "face_3"),
            ("left_hand_root", "l_hand"),
            ("right_forefinger2", "r_index_pip"),
            ("left_thumb1", "l_thumb_cmc"),
            ("right_pinky_finger4", "r_pinky_tip"),
            ("LEFT_INDEX_FINGER_DIP", "l_index_dip"),
            ("left_wing", "left_wing"),
            ("face-70", "face-70"),
            ("Tail", "Tail"),
            ("left", "left"),
            ("", ""),
            ("_.", "_."),
            ("thumb5", "thumb5"),
            ("é.L", "é.L"),
        ] {
            assert_eq!(usual(name), expected);
        }
        assert!(COCO.iter().all(|n| MEDIAPIPE.contains(n)));
        let limbs: Vec<_> = COCO.into_iter().filter(|n| !may_lack(n)).collect();
        assert_eq!(limbs, COCO[5..]);
        assert!(may_lack("neck") && may_lack("l_heel") && !may_lack("tail") && !may_lack("é_hip"));
        assert!(may_lack("r_big_toe") && may_lack("face_9") && may_lack("mid_hip"));
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
        let feet = ["l_foot_index", "r_foot_index", "RShoulder", "l_index"];
        assert_eq!(
            matching(&of(&["l_big_toe", "r_shoulder", "r_big_toe", "r_foot_index"]), &feet, none)
                .unwrap(),
            [Some(0), Some(2), None, Some(1)],
            "a joint that was detected itself goes first"
        );
        assert_eq!(
            matching(&of(&["l_index_mcp", "l_index_tip", "l_hand"]), &feet, none).unwrap(),
            [Some(3), None, None]
        );
        assert_eq!(matching(&of(&["l_foot_index"]), &["l_big_toe"], none).unwrap(), [Some(0)]);
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
