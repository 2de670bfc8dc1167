//! MediaPipe's landmarks: of its solutions and its tasks, in Python, in JavaScript, and as the
//! JSON of protocol buffers.

use super::joint_lists::{Extra, HAND};
use super::names::MEDIAPIPE;
use super::node::Node;
use super::people::Person;
use super::{Keypoint, Keypoints, KeypointsError};
use serde_json::Value;

/// Fields with the landmarks of a body.
pub(super) const KEYS: [&str; 4] = ["pose_landmarks", "poseLandmarks", "landmarks", "landmark"];

/// Fields with those of hands, beside them.
const HANDS: [(&str, Extra); 4] = [
    ("left_hand_landmarks", Extra::LeftHand),
    ("leftHandLandmarks", Extra::LeftHand),
    ("right_hand_landmarks", Extra::RightHand),
    ("rightHandLandmarks", Extra::RightHand),
];

/// Reads an object with landmarks, or landmarks: 33 of them, or a list of them per person. Ids
/// are 1, 2, ….
pub(super) fn people(root: &Node, size: Option<(u32, u32)>) -> Result<Vec<Person>, KeypointsError> {
    let field = |key: &&str| root.get(key);
    let bodies = lists(&KEYS.iter().find_map(field).unwrap_or_else(|| root.clone()))?;
    let hands: Vec<(Vec<Node>, Extra)> = HANDS
        .iter()
        .filter_map(|(key, hand)| Some((root.get(key)?, *hand)))
        .map(|(n, hand)| Ok((lists(&n)?, hand)))
        .collect::<Result<_, KeypointsError>>()?;
    let several = bodies.len() > 1;
    let one = |(i, list): (usize, &Node)| {
        let mut points = landmarks(list, &MEDIAPIPE.map(str::to_owned))?;
        for (hand, part) in &hands {
            if let (Some(hand), Some(names)) = (hand.get(i), part.names(HAND.len())) {
                points.extend(landmarks(hand, &names)?);
            }
        }
        let id = if several { (i + 1).to_string() } else { String::new() };
        let keypoints = Keypoints::new(points)?.into_normalised().sized(size);
        Ok(Person { id, keypoints, ..Person::default() })
    };
    if bodies.is_empty() {
        return Ok(vec![Person::default()]);
    }
    bodies.iter().enumerate().map(one).collect()
}

/// Returns the list of landmarks of each person.
fn lists<'a>(all: &Node<'a>) -> Result<Vec<Node<'a>>, KeypointsError> {
    // Protocol buffers have one more level.
    let inner = |n: Node<'a>| n.get("landmark").unwrap_or(n);
    let all = inner(all.clone());
    match all.value {
        Value::Null => Ok(Vec::new()),
        Value::Array(items) => match items.first() {
            None => Ok(Vec::new()),
            Some(v) if v.is_array() || v.get("landmark").is_some() => {
                Ok(all.items().map(inner).collect())
            }
            Some(_) => Ok(vec![all]),
        },
        _ => Err(all.wrong("a list of 33 landmarks")),
    }
}

fn landmarks(list: &Node, names: &[String]) -> Result<Vec<Keypoint>, KeypointsError> {
    if list.value.as_array().is_some_and(Vec::is_empty) {
        return Ok(Vec::new());
    }
    let wanted = "{\"x\": …, \"y\": …, \"visibility\": …}";
    if list.len() != names.len() {
        return Err(list.wrong(&format!("a list of {} landmarks {wanted}", names.len())));
    }
    let mut points = Vec::new();
    for (n, name) in list.items().zip(names) {
        let coordinate = |key: &str| match n.get(key) {
            Some(x) => x.number("a fraction of the image's side"),
            None => Err(n.wrong(&format!("a landmark {wanted}"))),
        };
        let visible = n.get("visibility").filter(|v| !v.value.is_null());
        let visible = visible.map(|v| v.number("a visibility from 0 to 1")).transpose()?;
        let confidence = visible.unwrap_or(1.0).clamp(0.0, 1.0);
        points.push(Keypoint::new(&**name, [coordinate("x")?, coordinate("y")?], confidence));
    }
    // A model that reports none gives null in Python, nothing in protocol buffers, 0 in JavaScript.
    if points.iter().all(|p| p.confidence == 0.0) {
        points.iter_mut().for_each(|p| p.confidence = 1.0);
    }
    Ok(points)
}
