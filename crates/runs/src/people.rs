//! Selects a person of a photograph for a run, and warns about the people detected there.

use clap::Args;
use pcadlang_detectors::people::Person;
use pcadlang_engine::lang::value::Value;
use pcadlang_library::scene::ImageValue;
use pcadlang_scene::vision::keypoints::COCO;
use std::path::PathBuf;

/// Which person of a photograph is meant, and what finds people.
#[derive(Args, Clone, Debug, Default)]
pub struct PersonArgs {
    /// Which person in the photograph, 1 being the most prominent: sets the program's
    /// `person`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub person: Option<u32>,
    /// A folder with networks to detect people with, instead of the built-in ones:
    /// pose_detection.tflite, pose_landmark_heavy.tflite, …_full or …_lite
    #[arg(long, value_name = "DIR")]
    pub models: Option<PathBuf>,
}

/// The joints of a body; landmarks of faces and hands are left out, since they would
/// outnumber them.
const BODY: &[&str] = COCO.split_at(5).1;

/// The networks' confidence is below this for most false detections, and for few people
/// (docs/measurements/detectors.md).
const DOUBTFUL: f64 = 0.5;

/// Warns if no person was found, if another person may be meant, or if little of the body
/// is in the picture. `person` counts from 1.
pub fn warnings(name: &str, image: &Value, person: u32) -> Vec<String> {
    let image = image.downcast::<ImageValue>();
    let Some((image, people)) = image.and_then(|i| Some((i, i.people()?))) else {
        return Vec::new();
    };
    if people.is_empty() {
        return vec![format!(
            "no person was found in `{name}`: without detected joints the body is seldom found \
             (--keypoints FILE gives the joints found by another detector)"
        )];
    }
    let Some(chosen) = people.get((person as usize).saturating_sub(1)) else {
        return vec![format!(
            "only {} people were found in `{name}`, so there is no person {person}",
            people.len()
        )];
    };
    let mut all = Vec::new();
    if chosen.sure < DOUBTFUL {
        all.push(format!(
            "`{name}` may not show a person: the networks' confidence is {:.0}% (see the overlay, \
             or `pcadlang detect`)",
            100.0 * chosen.sure
        ));
    }
    if people.len() > 1 && image.hint().is_empty() {
        all.push(format!(
            "several people were found in `{name}`; person {person} is used. Choose another with \
             --person N, --at X,Y or --box X,Y,W,H (`pcadlang detect` lists them)"
        ));
    }
    let inside = inside(chosen, image.size());
    if 2 * inside < BODY.len() {
        all.push(format!(
            "most of the body is outside the picture: {inside} of {} shoulders, elbows, wrists, \
             hips, knees and ankles are inside; the others are determined by the prior alone",
            BODY.len()
        ));
    }
    all
}

/// Counts the body's joints inside a picture of this size.
fn inside(p: &Person, (width, height): (u32, u32)) -> usize {
    let within = |at: [f64; 2]| {
        (0.0..f64::from(width)).contains(&at[0]) && (0.0..f64::from(height)).contains(&at[1])
    };
    BODY.iter().filter(|name| p.landmark(name).is_some_and(|l| within(l.at))).count()
}
