//! The networks that find people: the program's own, or those of a folder.

use crate::failure::{Failure, plain};
use crate::files;
use pcadlang_detectors::people::{PeopleFinder, networks};
use std::borrow::Cow;
use std::path::Path;

/// Landmark networks in a folder, the best first.
const LANDMARKS: [&str; 3] =
    ["pose_landmark_heavy.tflite", "pose_landmark_full.tflite", "pose_landmark_lite.tflite"];
const DETECTION: &str = "pose_detection.tflite";

/// Loads the networks of a folder, or else the built-in ones.
pub fn finder(folder: Option<&Path>) -> Result<PeopleFinder, Failure> {
    let (detection, landmarks, from) = match folder {
        None => {
            let (detection, landmarks) = networks::files();
            (Cow::Borrowed(detection), Cow::Borrowed(landmarks), "the program's own".to_owned())
        }
        Some(folder) => {
            let best =
                LANDMARKS.iter().map(|n| folder.join(n)).find(|p| p.exists()).ok_or_else(|| {
                    plain(format!(
                        "{}: none of {} was found",
                        folder.display(),
                        LANDMARKS.join(", ")
                    ))
                })?;
            // The detection network is the same for all landmark networks.
            let path = folder.join(DETECTION);
            let detection = match path.exists() {
                true => Cow::Owned(files::read(&path)?),
                false => Cow::Borrowed(networks::files().0),
            };
            (detection, Cow::Owned(files::read(&best)?), folder.display().to_string())
        }
    };
    PeopleFinder::new(&detection, &landmarks).map_err(|e| plain(format!("{from}: {e}")))
}

/// Makes this process detect people with the networks of a folder.
pub fn choose(folder: Option<&Path>) -> Result<(), Failure> {
    if let Some(folder) = folder {
        networks::choose(finder(Some(folder))?);
    }
    Ok(())
}
