//! Matches detected joints to the landmarks of a scene.

use super::error::first;
use super::names::may_lack;
use super::{Keypoints, KeypointsError};

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
