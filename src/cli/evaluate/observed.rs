//! What a case gives its program to observe.

use super::dataset::Case;
use crate::cli::{Failure, files, plain};
use pcadlang::Program;
use serde_json::{Map, Value};
use std::path::PathBuf;

/// The kind of `data` item that the picture is for.
const IMAGE: &str = "image";
/// The kind, or the name, of the `data` item that detected keypoints are for.
const KEYPOINTS: &str = "keypoints";

/// Detected keypoints of a dataset, by case.
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

    /// The entry of a case in which somebody was found.
    fn of(&self, case: &str) -> Option<&Value> {
        self.people.get(case).filter(|p| p["keypoints"].as_object().is_some_and(|k| !k.is_empty()))
    }
}

/// Something to observe: what it is, its file, and the entry of the file where it holds
/// several.
pub type Observation = (&'static str, PathBuf, Option<String>);

/// What a case gives: its picture, and its keypoints if there are any.
pub fn observations_for(case: &Case, detections: Option<&Detections>) -> Vec<Observation> {
    let mut all = vec![(IMAGE, case.image.clone(), None)];
    if let Some(d) = detections.filter(|d| d.of(&case.name).is_some()) {
        all.push((KEYPOINTS, d.path.clone(), Some(case.name.clone())));
    }
    all
}

/// The bytes that the draws of a case depend on: those of its files, and of its entry
/// among the keypoints.
pub fn bytes(case: &Case, detections: Option<&Detections>) -> Vec<u8> {
    // A file that cannot be read is an error when the case is run.
    let mut all = std::fs::read(&case.image).unwrap_or_default();
    all.extend(case.camera.as_ref().and_then(|c| std::fs::read(c).ok()).unwrap_or_default());
    all.extend(
        detections
            .and_then(|d| d.of(&case.name))
            .map(Value::to_string)
            .unwrap_or_default()
            .into_bytes(),
    );
    all
}

/// The `data` items of a program that observations are for.
pub struct Items {
    image: String,
    keypoints: Option<String>,
}

impl Items {
    /// Finds them; keypoints are looked for only if there are any.
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

    /// An observation as `--observe` takes it.
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
