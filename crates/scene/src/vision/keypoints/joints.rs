//! The joints of one person, in each form in which detectors write them.

use super::joint_lists::{by_count, known};
use super::names::usual;
use super::node::Node;
use super::{Keypoint, Keypoints, KeypointsError};
use serde_json::Value;
use std::sync::Arc;

const POINT: &str = "[x, y] or [x, y, confidence], or null if it was not found";

/// Fields with the confidences of joints that are [x, y].
const SCORES: [&str; 2] = ["keypoint_scores", "scores"];

/// Returns `keypoints` of `of` in any form; `names` has the names of joints without one.
pub(super) fn of_person(of: &Node, names: Option<&[String]>) -> Result<Keypoints, KeypointsError> {
    let Some(all) = of.get("keypoints") else { return Ok(Keypoints::default()) };
    match all.value {
        Value::Null => Ok(Keypoints::default()),
        Value::Object(_) if is_columns(&all) => columns(&all, names),
        // The third number of pcadlang's own `keypoints.json` is a standard deviation.
        Value::Object(_) => named(&all, !(of.get("best").is_some() && of.get("scene").is_some())),
        Value::Array(list) => match list.first() {
            Some(Value::Object(_)) => objects(&all),
            Some(Value::Array(_)) => rows(&all, scores(of).as_ref(), names),
            _ => triples(&all, names),
        },
        _ => Err(all.wrong("joints, or null if nobody was found")),
    }
}

/// Returns the confidences beside `keypoints`.
pub(super) fn scores<'a>(of: &Node<'a>) -> Option<Node<'a>> {
    SCORES.iter().find_map(|key| of.get(key)).filter(|n| !n.value.is_null())
}

/// Reads `{"nose": [x, y, confidence], …}`; without `confident`, the third number is something
/// else.
pub(super) fn named(all: &Node, confident: bool) -> Result<Keypoints, KeypointsError> {
    let mut points: Vec<Keypoint> = Vec::new();
    let mut known = rustc_hash::FxHashSet::default();
    for (name, n) in all.fields().filter(|(_, n)| !n.value.is_null()) {
        let numbers: Vec<Node> = n.items().collect();
        let (x, y, confidence) = match &numbers[..] {
            [x, y] => (x, y, 1.0),
            [x, y, _] if !confident => (x, y, 1.0),
            [x, y, c] => (x, y, confidence(c)?),
            _ => return Err(n.wrong(POINT)),
        };
        let name: Arc<str> = Arc::from(usual(name));
        if !known.insert(Arc::clone(&name)) {
            return Err(
                n.wrong(&format!("given only once, but `{name}` also occurs in another spelling"))
            );
        }
        let (x, y) = (x.number("a number of pixels")?, y.number("a number of pixels")?);
        points.push(Keypoint::new(name, [x, y], confidence));
    }
    Keypoints::new(points)
}

/// Returns a confidence; above 1 (networks of the SimCC kind go there) counts as 1.
fn confidence(c: &Node) -> Result<f64, KeypointsError> {
    let wanted = "a confidence of at least 0";
    let x = c.number(wanted)?;
    if x >= 0.0 { Ok(x.min(1.0)) } else { Err(c.wrong(wanted)) }
}

/// Reads `[x, y, confidence, …]`, three numbers per joint.
pub(super) fn triples(all: &Node, names: Option<&[String]>) -> Result<Keypoints, KeypointsError> {
    let numbers = all.numbers("a number")?;
    if numbers.is_empty() {
        return Ok(Keypoints::default());
    }
    let (joints, rest) = numbers.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(all.wrong("a list of x, y and confidence of each joint"));
    }
    listed(names_of(joints.len(), names, &all.place())?, joints)
}

/// Reads `[[x, y], …]` with confidences apart, or `[[x, y, confidence], …]`.
pub(super) fn rows(
    all: &Node,
    scores: Option<&Node>,
    names: Option<&[String]>,
) -> Result<Keypoints, KeypointsError> {
    let scores = scores.map(|s| s.numbers("the confidences of the joints")).transpose()?;
    if scores.as_ref().is_some_and(|s| s.len() != all.len()) {
        return Err(all.wrong("as long as its confidences"));
    }
    let joint = |(i, n): (usize, Node)| -> Result<[f64; 3], KeypointsError> {
        let score = scores.as_ref().map(|s| s.get(i).copied().unwrap_or(f64::NAN));
        match (&n.numbers("[x, y] or [x, y, confidence]")?[..], score) {
            (&[x, y], score) => Ok([x, y, score.unwrap_or(1.0)]),
            (&[x, y, c], None) => Ok([x, y, c]),
            (&[..], Some(_)) => Err(n.wrong("[x, y], a position in the picture")),
            _ => Err(n.wrong("[x, y] or [x, y, confidence]")),
        }
    };
    let joints: Vec<[f64; 3]> = all.items().enumerate().map(joint).collect::<Result<_, _>>()?;
    listed(names_of(joints.len(), names, &all.place())?, &joints)
}

/// Whether this is `{"x": [x of each joint], "y": …}`.
pub(super) fn is_columns(all: &Node) -> bool {
    let numbers = |key: &str| match all.value.get(key) {
        Some(Value::Array(list)) => list.iter().all(|v| v.is_number() || v.is_null()),
        _ => false,
    };
    let of_joint = |(key, _): (&str, Node)| !["x", "y", "visible"].contains(&key);
    numbers("x") && numbers("y") && !all.fields().any(of_joint)
}

/// Reads Ultralytics' `{"x": […], "y": […], "visible": […]}`.
fn columns(all: &Node, names: Option<&[String]>) -> Result<Keypoints, KeypointsError> {
    let column = |key: &str| all.get(key).map(|n| n.numbers("a number")).transpose();
    let (x, y) = (column("x")?.unwrap_or_default(), column("y")?.unwrap_or_default());
    let visible = column("visible")?.unwrap_or_else(|| vec![1.0; x.len()]);
    if x.len() != y.len() || x.len() != visible.len() {
        return Err(all.wrong("lists of the same length"));
    }
    let joints: Vec<[f64; 3]> =
        x.into_iter().zip(y).zip(visible).map(|((x, y), c)| [x, y, c]).collect();
    listed(names_of(joints.len(), names, &all.place())?, &joints)
}

/// Reads TensorFlow.js' `[{"name", "x", "y", "score"}, …]`.
fn objects(all: &Node) -> Result<Keypoints, KeypointsError> {
    let mut names = Vec::new();
    let mut joints = Vec::new();
    for n in all.items() {
        let wrong = || n.wrong("a joint {\"name\", \"x\", \"y\", \"score\"}");
        let at = n.get("position").unwrap_or_else(|| n.clone());
        let number = |of: &Node, key: &str| of.get(key).map(|x| x.number("a number")).transpose();
        let name = n.get("name").or_else(|| n.get("part")).ok_or_else(wrong)?;
        let (x, y) = number(&at, "x")?.zip(number(&at, "y")?).ok_or_else(wrong)?;
        names.push(usual(name.value.as_str().ok_or_else(wrong)?).into_owned());
        joints.push([x, y, number(&n, "score")?.unwrap_or(1.0)]);
    }
    listed(names, &joints)
}

/// Returns the names of `count` joints: the given ones in their usual spelling, or else those of
/// the list with that many.
///
/// # Errors
/// If no list is known; `place` is where the joints are in the file.
pub(super) fn names_of(
    count: usize,
    names: Option<&[String]>,
    place: &str,
) -> Result<Vec<String>, KeypointsError> {
    if let Some(given) = names.filter(|n| n.len() == count) {
        return Ok(given.iter().map(|n| usual(n).into_owned()).collect());
    }
    by_count(count).ok_or_else(|| {
        let message = format!("no known list of joints is as long as {place}, which has {count}");
        let hint = format!(
            "known are {}; name others, {{\"nose\": [x, y, confidence], …}}, or as in COCO's \
             \"categories\"",
            known()
        );
        KeypointsError::new(message).hint(hint)
    })
}

/// Makes joints of names and [x, y, confidence]. Detectors write 0, 0, a confidence of 0 or less,
/// or nothing for a joint that is missing.
pub(super) fn listed(names: Vec<String>, joints: &[[f64; 3]]) -> Result<Keypoints, KeypointsError> {
    let known = |[x, y, c]: &[f64; 3]| {
        x.is_finite() && y.is_finite() && (*x != 0.0 || *y != 0.0) && *c > 0.0
    };
    let joints = names.into_iter().zip(joints).filter(|(_, joint)| known(joint));
    let point = |(name, &[x, y, c]): (String, &[f64; 3])| Keypoint::new(name, [x, y], c.min(1.0));
    Keypoints::new(joints.map(point).collect())
}
