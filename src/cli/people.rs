//! Which person of a photograph a run is about, and what it says of the people found there.

use clap::Args;
use pcadlang::lang::builtins::scene::ImageValue;
use pcadlang::lang::value::Value;
use pcadlang::vision::people::Person;
use std::path::PathBuf;

/// Which person of a photograph is meant, and what finds people.
#[derive(Args, Clone, Debug, Default)]
pub struct Who {
    /// Which person in the photograph, 1 being the most prominent: sets the program's `person`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub person: Option<u32>,
    /// A box in pixels of the photograph: selects the person who fills it best. Sets the program's
    /// `near`
    #[arg(long = "box", value_name = "X,Y,W,H", value_parser = rectangle)]
    pub near: Option<[f64; 4]>,
    /// A folder with networks to detect people with, instead of the built-in ones:
    /// pose_detection.tflite, pose_landmark_heavy.tflite, …_full or …_lite
    #[arg(long, value_name = "DIR")]
    pub models: Option<PathBuf>,
}

/// `X,Y,W,H`.
fn rectangle(text: &str) -> Result<[f64; 4], String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|x| x.trim().parse().ok()).filter(|x: &f64| x.is_finite()).collect();
    match numbers[..] {
        [x, y, w, h] if text.split(',').count() == 4 && w > 0.0 && h > 0.0 => Ok([x, y, w, h]),
        _ => Err("four numbers X,Y,W,H with a positive width and height were expected".into()),
    }
}

/// The joints of a body; landmarks of faces and hands would outnumber them.
const BODY: [&str; 12] = [
    "l_shoulder",
    "r_shoulder",
    "l_elbow",
    "r_elbow",
    "l_wrist",
    "r_wrist",
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
];

/// Networks are less sure than this of most things that are no people, and of few people (docs/detector.md).
const DOUBTFUL: f64 = 0.5;

/// That nobody was found, that others may be meant, that little of a body is in the picture. `person` counts from 1.
pub fn warnings(name: &str, image: &Value, person: u32) -> Vec<String> {
    let image = image.downcast::<ImageValue>();
    let Some((image, people)) = image.and_then(|i| Some((i, i.people()?))) else { return Vec::new() };
    if people.is_empty() {
        return vec![format!(
            "nobody was found in `{name}`: the program has only the rest of the picture to go by, which seldom finds a body \
             (another detector's joints: --keypoints FILE)"
        )];
    }
    let Some(chosen) = people.get((person as usize).saturating_sub(1)) else {
        return vec![format!("only {} people were found in `{name}`: there is no person {person}", people.len())];
    };
    let mut all = Vec::new();
    if chosen.sure < DOUBTFUL {
        all.push(format!(
            "it is doubtful that `{name}` shows a person: the networks are {:.0} % sure (look at the overlay, or at `pcadlang detect`)",
            100.0 * chosen.sure
        ));
    }
    if people.len() > 1 {
        all.push(format!(
            "several people were found in `{name}`, of whom person {person} is meant; others with --person N or --box X,Y,W,H \
             (`pcadlang detect` lists them)"
        ));
    }
    let inside = inside(chosen, image.size());
    if 2 * inside < BODY.len() {
        all.push(format!(
            "most of the body is outside the picture: {inside} of {} shoulders, elbows, wrists, hips, knees and ankles are inside; \
             of the others only the prior tells",
            BODY.len()
        ));
    }
    all
}

/// How many of the body's joints are inside a picture of this size.
fn inside(p: &Person, (width, height): (u32, u32)) -> usize {
    let within = |at: [f64; 2]| (0.0..f64::from(width)).contains(&at[0]) && (0.0..f64::from(height)).contains(&at[1]);
    BODY.iter().filter(|name| p.landmark(name).is_some_and(|l| within(l.at))).count()
}
