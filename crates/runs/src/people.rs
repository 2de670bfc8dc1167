//! The person of a photograph whom a run fits: who is meant, and whether anyone was found.

use crate::args::Job;
use crate::failure::Failure;
use crate::inputs::Ready;
use crate::verdict::Judgement;
use clap::Args;
use pcadlang_detectors::people::Person;
use pcadlang_library::scene::ImageValue;
use pcadlang_scene::vision::Mask;
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
    /// Fit a body even if no person is seen in the photograph
    #[arg(long)]
    pub anyway: bool,
}

/// The joints of a body; landmarks of faces and hands are left out, since they would
/// outnumber them.
pub const BODY: &[&str] = COCO.split_at(5).1;

/// What to do where nobody was found.
pub const ANYWAY: &str = "say where someone is, --box X,Y,W,H or --at X,Y; --anyway fits a body to \
                          contours alone, which seldom finds anyone";

/// Returns the name of the photograph, the image, the people whom the program found there, the
/// most prominent first, and the number of the one whom it fits, from 1; `None` if the program
/// looks for nobody.
fn seen<'a>(job: &Job, ready: &'a Ready) -> Option<(&'a str, &'a ImageValue, Vec<Person>, usize)> {
    let (name, _) = ready.named_image.as_ref().filter(|_| ready.chooses)?;
    let image = ready.image()?;
    Some((name, image, image.people()?, job.inputs.who.person.unwrap_or(1) as usize))
}

/// Says that nobody was found, if the program looks for people and the user asks for no body
/// anyway.
///
/// # Errors
/// If the program fails, for example where nobody fills a box.
pub fn nobody(job: &Job, ready: &Ready) -> Result<Option<Judgement>, Failure> {
    if ready.chooses && ready.image().is_some_and(|i| i.people().is_none()) {
        // A program looks for people when it runs first.
        ready.model.simulate(job.sampling.seed, 0)?;
    }
    let Some((name, _, people, person)) = seen(job, ready) else { return Ok(None) };
    let why = match people.len() {
        n if n >= person || job.inputs.who.anyway => return Ok(None),
        0 => format!("no person is seen in `{name}`"),
        n => format!("there is no person {person} in `{name}`, where {n} are seen"),
    };
    Ok(Some(Judgement::nobody(&why)))
}

/// Judges the pixels of a body, if the program fits a person of a photograph.
pub fn judged(job: &Job, ready: &Ready, body: &Mask) -> Option<Judgement> {
    let (_, image, people, person) = seen(job, ready)?;
    Some(Judgement::of_person(body, people.get(person - 1)?, image.size()))
}

/// Warns if another person may be meant.
pub fn several(job: &Job, ready: &Ready) -> Option<String> {
    let (name, image, people, person) = seen(job, ready)?;
    (people.len() > 1 && image.hint().is_empty()).then(|| {
        format!(
            "several people were found in `{name}`; person {person} is used. Choose another with \
             --person N, --at X,Y or --box X,Y,W,H (`pcadlang detect` lists them)"
        )
    })
}

/// Counts the body's joints inside a picture of this size.
pub fn inside(p: &Person, (width, height): (u32, u32)) -> usize {
    let within = |at: [f64; 2]| {
        (0.0..f64::from(width)).contains(&at[0]) && (0.0..f64::from(height)).contains(&at[1])
    };
    BODY.iter().filter(|name| p.landmark(name).is_some_and(|l| within(l.at))).count()
}
