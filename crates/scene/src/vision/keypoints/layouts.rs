//! The layouts of keypoint files, distinguished by their shape; the [parent](super) lists
//! them.
//!
//! This file only parses: `people.rs` chooses the person, and `matching.rs` matches the
//! joints.

use super::names::{COCO, MEDIAPIPE, usual};
use super::node::Node;
use super::people::{People, Person};
use super::{Keypoint, Keypoints, KeypointsError};
use serde_json::Value;
use std::sync::Arc;

const LAYOUTS: &str = "one person's {\"nose\": [x, y, confidence], …}, people by id {\"ID\": {\"keypoints\": {…}}, …}, \
                       COCO's \"annotations\" or results, or MediaPipe's \"pose_landmarks\"";
const POINT: &str = "[x, y] or [x, y, confidence], or null if it was not found";

/// Names of the field with MediaPipe's landmarks.
const MEDIAPIPE_KEYS: [&str; 2] = ["pose_landmarks", "landmarks"];

impl People {
    /// Reads a file in one of the layouts of the [parent module](super).
    ///
    /// # Errors
    /// If it is not JSON, has an unknown layout, or contains an invalid value; the
    /// message has its path.
    pub fn parse(bytes: &[u8]) -> Result<People, KeypointsError> {
        let document = serde_json::from_slice(bytes)
            .map_err(|e| KeypointsError::new(format!("not JSON: {e}")))?;
        people(&Node::root(&document)).map(|all| People { all })
    }
}

/// Returns all people of a document.
fn people(root: &Node) -> Result<Vec<Person>, KeypointsError> {
    match root.value {
        Value::Null => Ok(Vec::new()),
        Value::Array(items) => match items.first() {
            None => Ok(Vec::new()),
            Some(v) if v.get("keypoints").is_some() => coco(root, root),
            Some(Value::Array(_)) => mediapipe(root, None),
            Some(v) if v.get("x").is_some() => mediapipe(root, None),
            Some(_) => Err(root.wrong(LAYOUTS)),
        },
        Value::Object(_) => {
            if let Some(all) = root.get("annotations") {
                return coco(&all, root);
            }
            if let Some(all) = MEDIAPIPE_KEYS.iter().find_map(|k| root.get(k)) {
                return mediapipe(&all, root.size());
            }
            if root.get("keypoints").is_some() {
                return Ok(vec![person(root)?]);
            }
            let is_person = |n: &Node| {
                n.get("keypoints").is_some() || MEDIAPIPE_KEYS.iter().any(|k| n.get(k).is_some())
            };
            if root.fields().any(|(_, n)| is_person(&n)) {
                let one = |(id, n): (&str, Node)| Ok(Person { id: id.to_owned(), ..person(&n)? });
                return root.fields().map(one).collect();
            }
            if root.fields().any(|(_, n)| !(n.value.is_array() || n.value.is_null())) {
                return Err(root.wrong(LAYOUTS));
            }
            Ok(vec![Person { keypoints: named(root)?, ..Person::default() }])
        }
        _ => Err(root.wrong(LAYOUTS)),
    }
}

/// Reads `{"keypoints": …}`; null means nobody.
fn person(of: &Node) -> Result<Person, KeypointsError> {
    let keypoints = match (of.value, of.get("keypoints")) {
        (Value::Null, _) => Keypoints::default(),
        (_, Some(all)) => match all.value {
            Value::Null => Keypoints::default(),
            Value::Object(_) => named(&all)?,
            Value::Array(_) => triples(&all, None)?,
            _ => return Err(all.wrong("an object of joints, or null if nobody was found")),
        },
        (_, None) => {
            if let Some(all) = MEDIAPIPE_KEYS.iter().find_map(|k| of.get(k)) {
                let mut found = mediapipe(&all, of.size())?;
                if found.len() > 1 {
                    return Err(all.wrong("the landmarks of one person"));
                }
                return Ok(Person { id: String::new(), ..found.pop().unwrap_or_default() });
            }
            return Err(of.wrong("an object with `keypoints`"));
        }
    };
    Ok(Person { keypoints: sized(keypoints, of.size()), ..Person::default() })
}

fn sized(k: Keypoints, size: Option<(u32, u32)>) -> Keypoints {
    size.map_or(k.clone(), |(w, h)| k.in_image(w, h))
}

/// Reads `{"nose": [x, y, confidence], …}`.
fn named(all: &Node) -> Result<Keypoints, KeypointsError> {
    let mut points: Vec<Keypoint> = Vec::new();
    for (name, n) in all.fields().filter(|(_, n)| !n.value.is_null()) {
        let numbers: Vec<Node> = n.items().collect();
        let (x, y, confidence) = match &numbers[..] {
            [x, y] => (x, y, 1.0),
            [x, y, c] => (x, y, confidence(c)?),
            _ => return Err(n.wrong(POINT)),
        };
        let name = Arc::from(usual(name));
        if points.iter().any(|p| p.name == name) {
            return Err(
                n.wrong(&format!("given only once, but `{name}` also occurs in another spelling"))
            );
        }
        let (x, y) = (x.number("a number of pixels")?, y.number("a number of pixels")?);
        points.push(Keypoint::new(name, [x, y], confidence));
    }
    Keypoints::new(points)
}

fn confidence(c: &Node) -> Result<f64, KeypointsError> {
    let wanted = "a confidence from 0 to 1";
    let x = c.number(wanted)?;
    if (0.0..=1.0).contains(&x) { Ok(x) } else { Err(c.wrong(wanted)) }
}

/// Reads COCO's `[x, y, v, …]`, three numbers per joint.
fn triples(all: &Node, names: Option<&[String]>) -> Result<Keypoints, KeypointsError> {
    let count = names.map_or(COCO.len(), <[String]>::len);
    if all.len() != 3 * count || !all.value.is_array() {
        return Err(
            all.wrong(&format!("a list of {} numbers, x, y and v of {count} joints", 3 * count))
        );
    }
    let numbers: Vec<f64> = all.items().map(|n| n.number("a number")).collect::<Result<_, _>>()?;
    let mut points = Vec::new();
    for (i, (joint, place)) in
        numbers.chunks_exact(3).zip(all.items().skip(2).step_by(3)).enumerate()
    {
        let &[x, y, v] = joint else { continue };
        if v < 0.0 {
            return Err(place.wrong("0 for a joint that is missing, or more"));
        }
        if v > 0.0 {
            let name = names
                .and_then(|n| n.get(i))
                .map_or(COCO.get(i).copied().unwrap_or_default(), String::as_str);
            points.push(Keypoint::new(&*usual(name), [x, y], v.min(1.0)));
        }
    }
    Keypoints::new(points)
}

/// Reads COCO's annotations or results; `root` has images and categories, if there are
/// any.
fn coco(all: &Node, root: &Node) -> Result<Vec<Person>, KeypointsError> {
    if !all.value.is_array() {
        return Err(all.wrong("a list of annotations"));
    }
    let categories = root.get("categories");
    let images = root.get("images");
    let with_id = |list: &Option<Node>, id: &Value| -> Option<Value> {
        let found = list.as_ref()?.value.as_array()?.iter().find(|v| v.get("id") == Some(id));
        found.cloned()
    };
    let mut people: Vec<Person> = Vec::new();
    for n in all.items() {
        let Some(list) = n.get("keypoints") else { continue };
        let category = n.get("category_id").and_then(|id| with_id(&categories, id.value));
        let names: Option<Vec<String>> =
            category.as_ref().and_then(|c| c.get("keypoints")).and_then(|names| {
                names
                    .as_array()?
                    .iter()
                    .map(|s| s.as_str().map(str::to_owned))
                    .collect::<Option<Vec<_>>>()
            });
        let mut keypoints = triples(&list, names.as_deref())?;
        let mut of_image = Vec::new();
        if let Some(id) = n.get("image_id") {
            of_image.push(id.id()?);
            if let Some(image) = with_id(&images, id.value) {
                keypoints = sized(keypoints, Node::root(&image).size());
                let file = image.get("file_name").and_then(Value::as_str).map(std::path::Path::new);
                of_image.extend(
                    file.and_then(|f| f.file_stem()).and_then(|s| s.to_str()).map(str::to_owned),
                );
            }
        }
        let id = n.get("id").map(|id| id.id()).transpose()?.unwrap_or_default();
        people.push(Person { id, image: of_image, keypoints });
    }
    number(&mut people);
    Ok(people)
}

/// Gives people without an id that of the image, with `/1`, `/2`, … if it shows several
/// people.
fn number(people: &mut [Person]) {
    let image = |p: &Person| p.image.first().cloned().unwrap_or_default();
    let images: Vec<String> = people.iter().map(image).collect();
    for (i, p) in people.iter_mut().enumerate().filter(|(_, p)| p.id.is_empty()) {
        let of = &images[i];
        let several = images.iter().filter(|o| *o == of).count() > 1;
        let before = images[..i].iter().filter(|o| *o == of).count();
        p.id = match (of.is_empty(), several) {
            (true, _) => (before + 1).to_string(),
            (false, true) => format!("{of}/{}", before + 1),
            (false, false) => of.clone(),
        };
    }
}

/// Reads MediaPipe's landmarks: 33 of them, or a list of them per person. Ids are 1, 2,
/// ….
fn mediapipe(all: &Node, size: Option<(u32, u32)>) -> Result<Vec<Person>, KeypointsError> {
    // The older interface has one more level.
    let inner = all.get("landmark");
    let all = inner.as_ref().unwrap_or(all);
    let lists: Vec<Node> = match all.value {
        Value::Null => return Ok(vec![Person::default()]),
        Value::Array(items) if items.first().is_some_and(Value::is_array) => all.items().collect(),
        Value::Array(items) if items.is_empty() => return Ok(vec![Person::default()]),
        Value::Array(_) => vec![all.clone()],
        _ => return Err(all.wrong("a list of 33 landmarks")),
    };
    let several = lists.len() > 1;
    let one = |(i, list): (usize, &Node)| {
        let id = if several { (i + 1).to_string() } else { String::new() };
        Ok(Person { id, image: Vec::new(), keypoints: sized(landmarks(list)?, size) })
    };
    lists.iter().enumerate().map(one).collect()
}

fn landmarks(list: &Node) -> Result<Keypoints, KeypointsError> {
    if list.len() != MEDIAPIPE.len() {
        return Err(list.wrong("a list of 33 landmarks {\"x\": …, \"y\": …, \"visibility\": …}"));
    }
    let mut points = Vec::new();
    for (n, name) in list.items().zip(MEDIAPIPE) {
        let coordinate = |key: &str| match n.get(key) {
            Some(x) => x.number("a fraction of the image's side"),
            None => Err(n.wrong("a landmark {\"x\": …, \"y\": …, \"visibility\": …}")),
        };
        let confidence = n.get("visibility").map_or(Ok(1.0), |c| confidence(&c))?;
        points.push(Keypoint::new(name, [coordinate("x")?, coordinate("y")?], confidence));
    }
    Keypoints::new(points).map(Keypoints::into_normalised)
}

#[cfg(test)]
#[path = "layouts_tests.rs"]
mod tests;
