//! COCO's annotations and results, and the lists of people that MMPose, AlphaPose and Ultralytics
//! write in their likeness.

use super::joint_lists::Extra;
use super::joints::{of_person, triples};
use super::names::usual;
use super::node::Node;
use super::people::{Person, number};
use super::{Keypoints, KeypointsError};
use rustc_hash::FxHashMap;
use serde_json::Value;

/// The fields of COCO-WholeBody with more joints.
const EXTRAS: [(&str, Extra); 4] = [
    ("foot_kpts", Extra::Feet),
    ("face_kpts", Extra::Face),
    ("lefthand_kpts", Extra::LeftHand),
    ("righthand_kpts", Extra::RightHand),
];

/// Fields with a person's own id.
const IDS: [&str; 2] = ["id", "track_id"];

/// A picture of the file.
struct Image<'a> {
    size: Option<(u32, u32)>,
    file: Option<&'a str>,
}

/// Reads a list of people; `root` has images and categories, if there are any.
pub(super) fn people(all: &Node, root: &Node) -> Result<Vec<Person>, KeypointsError> {
    if !all.value.is_array() {
        return Err(all.wrong("a list of annotations"));
    }
    let entries = |key: &str| {
        let list = root.value.get(key).and_then(Value::as_array);
        list.into_iter().flatten().filter_map(|v| Some((v.get("id")?.to_string(), v)))
    };
    let images: FxHashMap<String, Image> = entries("images")
        .map(|(id, v)| {
            let file = v.get("file_name").and_then(Value::as_str);
            (id, Image { size: Node::root(v).size(), file })
        })
        .collect();
    let categories: FxHashMap<String, Vec<String>> = entries("categories")
        .filter_map(|(id, v)| {
            let names = v.get("keypoints")?.as_array()?.iter();
            Some((id, names.map(|s| s.as_str().map(str::to_owned)).collect::<Option<_>>()?))
        })
        .collect();
    let mut people: Vec<Person> = Vec::new();
    for n in all.items().filter(|n| n.get("keypoints").is_some()) {
        let category = n.value.get("category_id").and_then(|id| categories.get(&id.to_string()));
        let mut person = instance(&n, category.map(Vec::as_slice))?;
        if let Some(id) = n.get("image_id") {
            person = person.of_picture(&id.id()?);
            if let Some(image) = images.get(&id.value.to_string()) {
                person.keypoints = person.keypoints.sized(image.size);
                if let Some(file) = image.file {
                    person = person.of_picture(file);
                }
            }
        }
        people.push(person);
    }
    if people.len() > 1 || people.iter().any(|p| !p.image.is_empty()) {
        number(&mut people);
    }
    Ok(people)
}

/// Reads the people of one picture; `names` has those of the joints.
pub(super) fn instances(
    all: &Node,
    names: Option<&[String]>,
) -> Result<Vec<Person>, KeypointsError> {
    all.items().map(|n| instance(&n, names)).collect()
}

fn instance(n: &Node, names: Option<&[String]>) -> Result<Person, KeypointsError> {
    let body = of_person(n, names)?;
    let (normalised, mut points) = (body.is_normalised(), body.points().to_vec());
    for (key, part) in EXTRAS {
        let Some(list) = n.get(key).filter(|l| l.len() > 0) else { continue };
        let Some(names) = part.names(list.len() / 3) else {
            return Err(list.wrong("x, y and v of COCO-WholeBody's joints"));
        };
        points.extend(triples(&list, Some(&names))?.points().iter().cloned());
    }
    let keypoints = Keypoints::new(points)?;
    let keypoints = if normalised { keypoints.into_normalised() } else { keypoints };
    let id = IDS.iter().find_map(|key| n.get(key)).filter(|id| !id.value.is_null());
    let id = id.map(|id| id.id()).transpose()?.unwrap_or_default();
    Ok(Person { id, keypoints, ..Person::default() })
}

/// Returns the names of joints in MMPose's description of a data set.
pub(super) fn names(of: Option<&Node>) -> Option<Vec<String>> {
    let by_number = of?.get("keypoint_id2name")?;
    let count = by_number.fields().count();
    let name =
        |i: usize| by_number.get(&i.to_string())?.value.as_str().map(|s| usual(s).into_owned());
    (0..count).map(name).collect()
}
