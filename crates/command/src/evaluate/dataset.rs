//! The cases of a dataset: their names, pictures and cameras.
//!
//! Invariant: no other files of a dataset are opened. Ground truth beside the pictures,
//! or in other fields of `annotations.json`, cannot reach a run.

use pcadlang_engine::lang::load::reason;
use pcadlang_report::evaluation::{MARK, PREDICTIONS, TABLE};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files;
use serde::Deserialize;
use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

/// The list of people of a dataset.
const ANNOTATIONS: &str = "annotations.json";
/// Possible names of the picture in a case's folder; the first that exists is used.
const IMAGES: [&str; 3] = ["image.png", "image.jpg", "image.jpeg"];
/// The camera file in a case's folder.
const CAMERA: &str = "camera.json";

/// One picture to run the program on.
#[derive(Clone, Debug)]
pub struct Case {
    /// The name: that of the folder, or the person's id. A plain file name.
    pub name: String,
    /// The picture.
    pub image: PathBuf,
    /// The camera, if it is known.
    pub camera: Option<PathBuf>,
}

/// The layout of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// One folder per case.
    Folders,
    /// People listed in `annotations.json`.
    People,
}

/// The cases of a dataset.
#[derive(Debug)]
pub struct Dataset {
    /// Its layout.
    pub layout: Layout,
    /// Its cases: folders in order of name, people in the order of the list.
    pub cases: Vec<Case>,
    /// Folders without a picture.
    pub skipped: Vec<String>,
}

/// The only fields of `annotations.json` that are read.
#[derive(Deserialize)]
struct Annotations {
    people: Vec<Person>,
}

#[derive(Deserialize)]
struct Person {
    id: String,
    image: String,
}

impl Dataset {
    /// Finds the cases below a folder.
    pub fn open(path: &Path) -> Result<Dataset, Failure> {
        let dataset = if path.join(ANNOTATIONS).is_file() { people(path)? } else { folders(path)? };
        if dataset.cases.is_empty() {
            return Err(unknown(path));
        }
        let mut seen = HashSet::new();
        for case in &dataset.cases {
            if !is_file_name(&case.name) {
                return Err(plain(format!(
                    "{}: the case name {:?} cannot be used as a folder name",
                    path.display(),
                    case.name
                )));
            }
            if !seen.insert(&case.name) {
                return Err(plain(format!(
                    "{}: the case {} occurs twice",
                    path.display(),
                    case.name
                )));
            }
        }
        Ok(dataset)
    }
}

/// Checks that every name of `--only` is that of a case.
pub fn known<'a>(
    dataset: &Path,
    only: &[String],
    names: impl Iterator<Item = &'a str>,
) -> Result<(), Failure> {
    let names: Vec<&str> = names.collect();
    match only.iter().find(|n| !names.contains(&n.as_str())) {
        None => Ok(()),
        Some(n) => {
            let hint = match pcadlang_syntax::diag::nearest(n, names.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("there are {}", names.join(", ")),
            };
            Err(Failure::Plain(
                format!("{}: there is no case {n:?}", dataset.display()),
                Some(hint),
            ))
        }
    }
}

fn people(path: &Path) -> Result<Dataset, Failure> {
    let file = path.join(ANNOTATIONS);
    let all: Annotations = serde_json::from_slice(&files::read(&file)?).map_err(|e| {
        let expected = r#"expected {"people": [{"id": …, "image": FILE}, …]}"#;
        Failure::Plain(format!("{}: {e}", file.display()), Some(expected.into()))
    })?;
    let mut cases = Vec::new();
    for Person { id, image } in all.people {
        // The picture must lie in the dataset's folder.
        if image.is_empty()
            || Path::new(&image).components().any(|c| !matches!(c, Component::Normal(_)))
        {
            return Err(plain(format!(
                "{}: the image of {id}, {image:?}, is not a file in the same folder",
                file.display()
            )));
        }
        cases.push(Case { name: id, image: path.join(image), camera: None });
    }
    Ok(Dataset { layout: Layout::People, cases, skipped: Vec::new() })
}

fn folders(path: &Path) -> Result<Dataset, Failure> {
    let unreadable = |e| plain(format!("cannot read {}: {}", path.display(), reason(&e)));
    let (mut cases, mut skipped) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(path).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let folder = entry.path();
        if name.starts_with('.') || !folder.is_dir() {
            continue;
        }
        match IMAGES.iter().map(|i| folder.join(i)).find(|i| i.is_file()) {
            Some(image) => {
                let camera = Some(folder.join(CAMERA)).filter(|c| c.is_file());
                cases.push(Case { name, image, camera });
            }
            None => skipped.push(name),
        }
    }
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    skipped.sort();
    Ok(Dataset { layout: Layout::Folders, cases, skipped })
}

fn unknown(path: &Path) -> Failure {
    let hint = if IMAGES.iter().any(|i| path.join(i).is_file()) {
        "this is a single case; give its parent folder, and its name with --only"
    } else {
        "expected folders that each contain image.png, or an annotations.json with people"
    };
    Failure::Plain(format!("{}: not a dataset", path.display()), Some(hint.into()))
}

/// Returns whether a folder of that name can be placed among the files of an evaluation.
fn is_file_name(name: &str) -> bool {
    let taken = [MARK, TABLE, PREDICTIONS].iter().any(|f| f.eq_ignore_ascii_case(name));
    let odd = |c: char| c.is_control() || matches!(c, '/' | '\\' | ':');
    !name.is_empty() && name.len() <= 200 && !name.starts_with('.') && !name.contains(odd) && !taken
}
