//! The observations of a case, as arguments of `--observe`.

use super::dataset::Case;
use pcadlang_library::Program;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{files, inputs};
use serde_json::{Map, Value};
use std::path::PathBuf;

/// The kind, or else the name, of the `data` item for the picture.
const IMAGE: &str = "image";
/// The kind, or else the name, of the `data` item for detected keypoints.
const KEYPOINTS: &str = "keypoints";

/// The detected keypoints of a dataset, by case.
pub struct Detections {
    path: PathBuf,
    people: Map<String, Value>,
}

impl Detections {
    /// Reads `{case: {"keypoints": {…} or null, …}, …}`.
    pub fn open(path: PathBuf) -> Result<Detections, Failure> {
        match serde_json::from_slice(&files::read(&path)?) {
            Ok(Value::Object(people)) => Ok(Detections { path, people }),
            Ok(_) => Err(plain(format!(
                "{}: expected a JSON object with one entry per case",
                path.display()
            ))),
            Err(e) => Err(plain(format!("{}: {e}", path.display()))),
        }
    }

    /// Returns the entry of a case, if a person was detected in its picture.
    fn of(&self, case: &str) -> Option<&Value> {
        self.people.get(case).filter(|p| p["keypoints"].as_object().is_some_and(|k| !k.is_empty()))
    }
}

/// An observation: the kind of its `data` item, its file, and the entry's name in a file
/// with several entries.
pub type Observation = (&'static str, PathBuf, Option<String>);

/// Returns the observations of a case: its picture, and its keypoints if any were
/// detected.
pub fn observations_for(case: &Case, detections: Option<&Detections>) -> Vec<Observation> {
    let mut all = vec![(IMAGE, case.image.clone(), None)];
    if let Some(d) = detections.filter(|d| d.of(&case.name).is_some()) {
        all.push((KEYPOINTS, d.path.clone(), Some(case.name.clone())));
    }
    all
}

/// Returns the bytes that the draws of a case depend on: those of its files and of its
/// keypoints.
pub fn bytes(case: &Case, detections: Option<&Detections>) -> Vec<u8> {
    // A file that cannot be read is reported when the case is run.
    let mut all = std::fs::read(&case.image).unwrap_or_default();
    all.extend(case.camera.as_ref().map(|c| inputs::camera_bytes(c)).unwrap_or_default());
    all.extend(
        detections
            .and_then(|d| d.of(&case.name))
            .map(Value::to_string)
            .unwrap_or_default()
            .into_bytes(),
    );
    all
}

/// The names of a program's `data` items for the observations.
pub struct Items {
    image: String,
    keypoints: Option<String>,
}

impl Items {
    /// Finds the items. An item for keypoints is required only if `keypoints` is true.
    pub fn of(program: &Program, keypoints: bool) -> Result<Items, Failure> {
        let data = program.interface().data;
        let of_kind = |kind: &str| {
            let mut all =
                data.iter().filter(|d| d.ty.as_deref() == Some(kind)).map(|d| d.name.clone());
            (all.next(), all.next().is_some())
        };
        let only = |kind: &str| match of_kind(kind) {
            (Some(name), false) => Ok(name),
            (Some(_), true) => Err(plain(format!(
                "the program observes several items of kind `{kind}`, expected one"
            ))),
            (None, _) => match data.iter().find(|d| d.name == kind) {
                Some(d) => Ok(d.name.clone()),
                None => Err(Failure::Plain(
                    format!("the program observes no item of kind `{kind}`"),
                    Some(format!("declare one: data NAME: {kind};")),
                )),
            },
        };
        Ok(Items {
            image: only(IMAGE)?,
            keypoints: keypoints.then(|| only(KEYPOINTS)).transpose()?,
        })
    }

    /// Formats an observation as an argument of `--observe`.
    pub fn spec(&self, (what, path, id): &Observation) -> String {
        let name = if *what == IMAGE {
            &self.image
        } else {
            self.keypoints.as_ref().unwrap_or(&self.image)
        };
        let id = id.as_ref().map_or(String::new(), |id| format!("#{id}"));
        format!("{name}={}{id}", path.display())
    }
}
