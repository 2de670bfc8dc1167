//! The layouts of keypoint files, distinguished by their shape; the [parent](super) lists
//! them.
//!
//! This file finds the people of a file, each layout's reader is beside it; `joints.rs` reads one
//! person, `people.rs` chooses one.

use super::joint_lists::known;
use super::joints::{named, of_person, rows, scores};
use super::node::Node;
use super::people::{People, Person, file_names, number};
use super::{Keypoints, KeypointsError, arrays, coco, labels, mediapipe, openpose, tables};
use crate::vision::npy;
use serde_json::Value;

impl People {
    /// Reads a file in one of the layouts of the [parent module](super).
    ///
    /// # Errors
    /// If it has an unknown layout, or contains an invalid value; the message has its path, or
    /// its line.
    pub fn parse(bytes: &[u8]) -> Result<People, KeypointsError> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if npy::is_npy(bytes) || bytes.starts_with(b"PK\x03\x04") {
            return people(&Node::root(&arrays::read(bytes)?)).map(People::new);
        }
        if bytes.starts_with(b"\x89HDF") {
            let error = KeypointsError::new("it is an HDF5 file, which is not read");
            return Err(error
                .hint("write CSV: DeepLabCut with save_as_csv = True, SLEAP as an analysis CSV"));
        }
        let begins = bytes.iter().find(|b| !b.is_ascii_whitespace()).copied().unwrap_or(b'{');
        if begins.is_ascii_alphanumeric() || b",\"-.+".contains(&begins) {
            let text = String::from_utf8_lossy(bytes);
            if labels::is_labels(&text) {
                return labels::people(&text).map(People::new);
            }
            if tables::is_table(&text) {
                return tables::people(&text).map(People::new);
            }
        }
        let document = serde_json::from_slice(bytes)
            .map_err(|e| KeypointsError::new(format!("not JSON: {e}")))?;
        people(&Node::root(&document)).map(People::new)
    }

    fn new(mut all: Vec<Person>) -> People {
        fractions_if_small(&mut all);
        People { all }
    }
}

/// Returns the error that a document has none of the layouts.
fn unknown(root: &Node) -> KeypointsError {
    let layouts = "one person's {\"nose\": [x, y, confidence], …}, people by id {\"ID\": \
                   {\"keypoints\": {…}}, …}, or the output of OpenPose, MMPose, AlphaPose, \
                   Ultralytics, RTMLib, MediaPipe, DeepLabCut, SLEAP, COCO or its results";
    root.wrong(layouts).hint(format!("joints without names are known in lists of {}", known()))
}

/// Returns all people of a document.
pub(super) fn people(root: &Node) -> Result<Vec<Person>, KeypointsError> {
    match root.value {
        Value::Null => Ok(Vec::new()),
        Value::Array(items) => list(root, items),
        Value::Object(_) => object(root),
        _ => Err(unknown(root)),
    }
}

fn list(root: &Node, items: &[Value]) -> Result<Vec<Person>, KeypointsError> {
    let any = |key: &str| items.iter().any(|v| v.get(key).is_some());
    match items.first() {
        None => Ok(Vec::new()),
        Some(_) if any("instances") => frames(root, None),
        Some(_) if any("keypoints") => coco::people(root, root),
        Some(Value::Object(first)) => match mediapipe::KEYS.iter().any(|key| any(key)) {
            true => pictures(root),
            false if first.contains_key("x") => mediapipe::people(root, None),
            false => Err(unknown(root)),
        },
        Some(Value::Array(_)) => match depth(root.value) {
            (_, Value::Object(o)) if o.contains_key("keypoints") => pictures(root),
            (_, Value::Array(_)) => pictures(root),
            (_, Value::Object(_)) => mediapipe::people(root, None),
            (2.., Value::Number(_) | Value::Null) => numbers(root, None),
            _ => Err(unknown(root)),
        },
        Some(_) => Err(unknown(root)),
    }
}

fn object(root: &Node) -> Result<Vec<Person>, KeypointsError> {
    if let Some(all) = root.get("annotations") {
        return coco::people(&all, root);
    }
    if openpose::is_openpose(root) {
        return openpose::people(root);
    }
    if let Some(all) = root.get("instance_info") {
        return frames(&all, coco::names(root.get("meta_info").as_ref()).as_deref());
    }
    if let Some(all) = root.get("predictions").filter(|n| n.value.is_array()) {
        return people(&all);
    }
    if mediapipe::KEYS.iter().any(|k| root.get(k).is_some()) {
        return mediapipe::people(root, root.size());
    }
    if let Some(all) = root.get("keypoints") {
        return match depth(all.value) {
            (3.., Value::Number(_) | Value::Null) => numbers(&all, scores(root).as_ref()),
            _ => Ok(vec![person(root)?]),
        };
    }
    let is_person = |n: &Node| {
        n.get("keypoints").is_some()
            || mediapipe::KEYS.iter().any(|k| n.get(k).is_some())
            || openpose::is_openpose(n)
    };
    if root.fields().any(|(_, n)| is_person(&n)) {
        return by_id(root);
    }
    if root.fields().any(|(_, n)| !(n.value.is_array() || n.value.is_null())) {
        return Err(unknown(root));
    }
    Ok(vec![Person { keypoints: named(root, true)?, ..Person::default() }])
}

/// Reads `{"ID": person or pictures' people, …}`.
fn by_id(root: &Node) -> Result<Vec<Person>, KeypointsError> {
    let mut all = Vec::new();
    for (id, n) in root.fields() {
        if openpose::is_openpose(&n) {
            let people = openpose::people(&n)?;
            all.extend(people.into_iter().map(|p| p.of_picture(id)));
        } else {
            let files = file_names(id).map(str::to_owned).to_vec();
            all.push(Person { id: id.to_owned(), files, ..person(&n)? });
        }
    }
    number(&mut all);
    Ok(all)
}

/// Reads `{"keypoints": …}`, or MediaPipe's landmarks of one person; null means nobody.
fn person(of: &Node) -> Result<Person, KeypointsError> {
    if of.value.is_null() {
        return Ok(Person::default());
    }
    if of.get("keypoints").is_none() {
        if !mediapipe::KEYS.iter().any(|k| of.get(k).is_some()) {
            return Err(of.wrong("an object with `keypoints`"));
        }
        let mut found = mediapipe::people(of, of.size())?;
        if found.len() > 1 {
            return Err(of.wrong("the landmarks of one person"));
        }
        return Ok(Person { id: String::new(), ..found.pop().unwrap_or_default() });
    }
    let keypoints = of_person(of, None)?.sized(of.size());
    Ok(Person { keypoints, ..Person::default() })
}

/// Reads MMPose's `[{"frame_id", "instances": […]}, …]`, or the instances of a single picture.
fn frames(all: &Node, names: Option<&[String]>) -> Result<Vec<Person>, KeypointsError> {
    let mut people = Vec::new();
    if all.items().any(|n| n.get("keypoints").is_some()) {
        people = coco::instances(all, names)?;
        if people.len() > 1 {
            number(&mut people);
        }
        return Ok(people);
    }
    for n in all.items() {
        let Some(instances) = n.get("instances") else {
            return Err(n.wrong("a frame {\"frame_id\", \"instances\"}"));
        };
        let frame = n.get("frame_id").map(|id| id.id()).transpose()?.unwrap_or_default();
        let found = coco::instances(&instances, names)?;
        people.extend(found.into_iter().map(|p| p.of_picture(&frame)));
    }
    number(&mut people);
    Ok(people)
}

/// Reads a list with the people of each picture, which are numbered from 1 if there are several.
fn pictures(all: &Node) -> Result<Vec<Person>, KeypointsError> {
    let mut found = Vec::new();
    for (i, n) in all.items().enumerate() {
        let of_picture = people(&n)?.into_iter().map(|p| match all.len() {
            1 => p,
            _ => Person { id: String::new(), counted: true, ..p }.of_picture(&(i + 1).to_string()),
        });
        found.extend(of_picture);
    }
    number(&mut found);
    Ok(found)
}

/// Reads RTMLib's arrays, people x joints x 2 with confidences apart, or people x joints x 3, or
/// those of one person; also the two arrays in a list.
fn numbers(all: &Node, scores: Option<&Node>) -> Result<Vec<Person>, KeypointsError> {
    let one = |n: &Node, scores: Option<&Node>| -> Result<Person, KeypointsError> {
        Ok(Person { keypoints: rows(n, scores, None)?, ..Person::default() })
    };
    match depth(all.value).0 {
        2 => Ok(vec![one(all, scores)?]),
        3 => {
            let by_person: Option<Vec<Node>> = scores.map(|s| s.items().collect());
            if by_person.as_ref().is_some_and(|s| s.len() != all.len()) {
                return Err(all.wrong("as long as its confidences"));
            }
            let score = |i: usize| by_person.as_ref().and_then(|s| s.get(i));
            let each = all.items().enumerate().map(|(i, n)| one(&n, score(i)));
            let mut people: Vec<Person> = each.collect::<Result<_, _>>()?;
            if people.len() > 1 {
                number(&mut people);
            }
            Ok(people)
        }
        4 => match &all.items().collect::<Vec<_>>()[..] {
            [positions, scores] => numbers(positions, Some(scores)),
            _ => Err(unknown(all)),
        },
        _ => Err(unknown(all)),
    }
}

/// Returns how deep lists are nested, along the first element of each other than an empty list,
/// and what is innermost.
fn depth(value: &Value) -> (usize, &Value) {
    let (mut at, mut deep) = (value, 0);
    while let Value::Array(list) = at {
        deep += 1;
        let full = |v: &&Value| v.as_array().is_none_or(|list| !list.is_empty());
        match list.iter().find(full).or(list.first()) {
            Some(inner) => at = inner,
            None => break,
        }
    }
    (deep, at)
}

/// The least number of joints whose positions show whether they are pixels.
const SHOWN: usize = 4;

/// Makes positions fractions of the picture's sides, if all of all people are within two pixels of
/// its corner: many tools write either, and do not say which. Those of joints beside the picture
/// exceed 1.
fn fractions_if_small(people: &mut [Person]) {
    let points = || people.iter().flat_map(|p| p.keypoints.points());
    let small = |x: f64| (-1.0..=2.0).contains(&x);
    if points().count() >= SHOWN && points().all(|p| small(p.x) && small(p.y)) {
        for p in people {
            p.keypoints = std::mem::take(&mut p.keypoints).into_normalised();
        }
    }
}

impl Keypoints {
    /// Records the size of the picture, if the file has it.
    pub(super) fn sized(self, size: Option<(u32, u32)>) -> Keypoints {
        match size {
            Some((w, h)) => self.in_image(w, h),
            None => self,
        }
    }
}

#[cfg(test)]
#[path = "layouts_tests.rs"]
mod tests;
