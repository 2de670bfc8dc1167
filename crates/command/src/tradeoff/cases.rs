//! Cases with ground truth: what a program observes, and the truth.
//!
//! Invariant: the truth is used for scores only; a run observes what `evaluate` would
//! give it.

use super::truth::{self, Truth};
use crate::args::Tradeoff;
use crate::evaluate::{Dataset, Detections, Items, Layout, observations_for};
use pcadlang_library::Program;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{files, inputs};
use std::path::{Path, PathBuf};

/// A case.
pub struct Case {
    /// Its name.
    pub name: String,
    /// The observations, as arguments of `--observe`.
    pub observe: Vec<String>,
    /// Its camera.
    pub camera: Option<PathBuf>,
    /// The ground truth.
    pub truth: Truth,
    /// The files that the ground truth was read from.
    said: Vec<PathBuf>,
}

impl Case {
    /// Returns all files that the results depend on.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let observed = self.observe.iter().map(|spec| PathBuf::from(inputs::file_of(spec)));
        observed.chain(self.camera.clone()).chain(self.said.clone())
    }
}

/// The file with the reference posterior of a case without pictures.
const REFERENCE: &str = "reference.json";

/// Opens all cases below a folder that have ground truth. The program's interface
/// determines what is observed.
pub fn open(a: &Tradeoff, program: &Program) -> Result<Vec<Case>, Failure> {
    let folders = folders(&a.cases)?;
    if folders.iter().any(|f| f.join(REFERENCE).is_file()) {
        return folders
            .iter()
            .filter(|f| f.join(REFERENCE).is_file())
            .map(|f| posterior(f, program))
            .collect();
    }
    let Dataset { layout, cases, .. } = Dataset::open(&a.cases)?;
    let detections = a.keypoints.clone().map(Detections::open).transpose()?;
    let items = Items::of(program, detections.is_some())?;
    let mut truths = match layout {
        Layout::People => Some(truth::people(&a.cases)?),
        Layout::Folders => None,
    };
    let mut all = Vec::new();
    for case in cases {
        let camera = case.camera.clone().or_else(|| a.inputs.camera.clone());
        let folder = a.cases.join(&case.name);
        let (found, said) = match &mut truths {
            Some(people) => (
                people.shift_remove(&case.name).map(Truth::Joints),
                vec![a.cases.join(truth::LABELS)],
            ),
            None => (
                truth::surface(&folder, camera.as_deref())?.map(Truth::Surface),
                truth::SURFACE
                    .iter()
                    .map(|name| folder.join(name))
                    .filter(|p| p.is_file())
                    .collect(),
            ),
        };
        let Some(truth) = found else { continue };
        let observe =
            observations_for(&case, detections.as_ref()).iter().map(|o| items.spec(o)).collect();
        all.push(Case { name: case.name, observe, camera, truth, said });
    }
    match all.is_empty() {
        true => Err(Failure::Plain(
            format!("{}: no case has ground truth", a.cases.display()),
            Some(
                "ground truth is CASE/depth.npy or CASE/gt.npz, keypoints in annotations.json, or CASE/reference.json"
                    .into(),
            ),
        )),
        false => Ok(all),
    }
}

/// Returns the subfolders of a folder, in order of name.
fn folders(path: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries = std::fs::read_dir(path).map_err(|e| plain(format!("{}: {e}", path.display())))?;
    let mut all: Vec<PathBuf> =
        entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.is_dir()).collect();
    all.sort();
    Ok(all)
}

/// Opens a case without pictures: files named after `data` items, and a reference
/// posterior.
fn posterior(folder: &Path, program: &Program) -> Result<Case, Failure> {
    let name = folder.file_name().and_then(|n| n.to_str()).unwrap_or("case").to_owned();
    let data = program.interface().data;
    let mut there: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(|e| plain(format!("{}: {e}", folder.display())))?
        .filter_map(|e| Some(e.ok()?.path()))
        // The program must not observe the truth, whatever its `data` items are called.
        .filter(|p| p.is_file() && !p.ends_with(REFERENCE))
        .collect();
    there.sort();
    let item = |path: &PathBuf| {
        let stem = path.file_stem()?.to_str()?;
        data.iter().find(|d| d.name == stem).map(|d| format!("{}={}", d.name, path.display()))
    };
    let observe = there.iter().filter_map(item).collect();
    let path = folder.join(REFERENCE);
    let text = files::read(&path)?;
    let truth = truth::reference(&text).map_err(|e| plain(format!("{}: {e}", path.display())))?;
    Ok(Case { name, observe, camera: None, truth: Truth::Posterior(truth), said: vec![path] })
}
