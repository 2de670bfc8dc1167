//! OpenPose's people, and those that AlphaPose writes in its forms `open` and `cmu`.

use super::joint_lists::Extra;
use super::joints::triples;
use super::node::Node;
use super::people::{Person, number};
use super::{Keypoints, KeypointsError};

/// Fields with the people, and with their bodies; the older ones last.
const PEOPLE: [&str; 2] = ["people", "bodies"];
const BODY: [&str; 3] = ["pose_keypoints_2d", "pose_keypoints", "joints"];

/// Fields with other joints, since version 1.2 with `_2d` at the end.
const EXTRAS: [(&str, Extra); 3] = [
    ("face_keypoints", Extra::Face),
    ("hand_left_keypoints", Extra::LeftHand),
    ("hand_right_keypoints", Extra::RightHand),
];

/// Whether an object has people in this layout.
pub(super) fn is_openpose(root: &Node) -> bool {
    PEOPLE.iter().filter_map(|key| root.get(key)).any(|people| {
        people.value.is_array()
            && people.items().all(|p| BODY.iter().any(|key| p.get(key).is_some()))
    })
}

/// Reads the people of a picture.
pub(super) fn people(root: &Node) -> Result<Vec<Person>, KeypointsError> {
    let Some(all) = PEOPLE.iter().find_map(|key| root.get(key)) else { return Ok(Vec::new()) };
    let mut people: Vec<Person> = all.items().map(|n| person(&n)).collect::<Result<_, _>>()?;
    let points = || people.iter().flat_map(|p| p.keypoints.points());
    let below = points().any(|p| p.x < 0.0 || p.y < 0.0);
    if below && points().all(|p| p.x.abs() <= 1.0 && p.y.abs() <= 1.0) {
        let error = all.wrong("in pixels or fractions of the picture, not from -1 to 1");
        return Err(error.hint("run OpenPose with --keypoint_scale 0 or 3"));
    }
    if people.len() > 1 {
        number(&mut people);
    }
    Ok(people)
}

fn person(n: &Node) -> Result<Person, KeypointsError> {
    let mut points = Vec::new();
    if let Some(body) = BODY.iter().find_map(|key| n.get(key)) {
        points.extend(triples(&body, None)?.points().iter().cloned());
    }
    for (key, part) in EXTRAS {
        let list = n.get(&format!("{key}_2d")).or_else(|| n.get(key));
        let Some(list) = list.filter(|l| l.len() > 0) else { continue };
        let Some(names) = part.names(list.len() / 3) else {
            return Err(list.wrong("x, y and confidence of 70 points of a face or 21 of a hand"));
        };
        points.extend(triples(&list, Some(&names))?.points().iter().cloned());
    }
    Ok(Person { keypoints: Keypoints::new(points)?, ..Person::default() })
}
