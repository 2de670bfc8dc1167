//! Detects the people in a photograph, with 33 landmarks and a mask for each, by two
//! small networks of MediaPipe.
//!
//! The picture is examined in several views, padded and mirrored. What most of them agree
//! on is the person; poses that only other views agree on are alternative hypotheses
//! ([`Person::others`]). The result is a function of the picture alone, with the same
//! bits on any machine and for any number of threads. The networks themselves
//! (`pcadlang-models`) and the use of the landmarks are elsewhere.

mod consensus;
mod detection;
pub mod json;
mod landmarks;
pub mod networks;
mod person;
#[cfg(test)]
mod tests;
mod window;

pub use person::{Hypothesis, Landmark, Person};

use crate::nn::{Network, NetworkError};
use consensus::{Run, by_person, consensus, prominence};
use landmarks::View;
use pcadlang_numerics::platform::threads::side_by_side;
use pcadlang_scene::vision::Photo;
use std::thread::available_parallelism;
use window::Window;

/// The maximum longer side that is processed; larger pictures are shrunk first.
const LONGEST: u32 = 1280;
/// If a run has a presence above this, runs with a lower one are ignored.
const PRESENT: f64 = 0.5;

/// Options of the search for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindOptions {
    /// The number of views, half of them mirrored: 2, 4 or 8, with paddings of 0, 30 %,
    /// 15 % and 50 %.
    pub views: u32,
    /// The maximum number of people per view.
    pub most: usize,
    /// Minimum score of detections, 0 to 1.
    pub least: f64,
}

impl Default for FindOptions {
    fn default() -> Self {
        FindOptions { views: 2, most: 2, least: 0.05 }
    }
}

/// The two networks that detect people.
#[derive(Debug)]
pub struct PeopleFinder {
    detection: Network,
    landmarks: Network,
}

impl PeopleFinder {
    /// Reads the files of a detection and of a landmark network (`pose_detection.tflite`,
    /// `pose_landmark_*.tflite`).
    ///
    /// # Errors
    /// If a file cannot be read, or contains a different network.
    pub fn new(detection: &[u8], landmarks: &[u8]) -> Result<PeopleFinder, NetworkError> {
        let finder = PeopleFinder {
            detection: Network::read(detection)?,
            landmarks: Network::read(landmarks)?,
        };
        detection::check(&finder.detection)?;
        landmarks::check(&finder.landmarks)?;
        Ok(finder)
    }

    /// Returns the people in a photograph, the most prominent first. `threads` views (0:
    /// the number of cores) are processed in parallel.
    ///
    /// # Errors
    /// Errors of the networks, which valid ones do not have.
    pub fn find(
        &self,
        photo: &Photo,
        options: &FindOptions,
        threads: usize,
    ) -> Result<Vec<Person>, NetworkError> {
        let longer = photo.width().max(photo.height());
        let small = (longer > LONGEST).then(|| photo.shrunk(LONGEST));
        let looked_at = small.as_ref().unwrap_or(photo);
        let scale = f64::from(longer) / f64::from(longer.min(LONGEST));
        let (width, height) = (looked_at.width(), looked_at.height());
        let paddings =
            [0.0, 0.3, 0.15, 0.5].into_iter().take(options.views.div_ceil(2).clamp(1, 4) as usize);
        let whole = |padding| Window::whole(width, height, padding);
        let views: Vec<Window> =
            paddings.flat_map(|p| [whole(p), Window { mirrored: true, ..whole(p) }]).collect();
        let mut seen: Vec<_> = views.into_iter().map(|view| (view, Ok(Vec::new()))).collect();
        let threads =
            if threads == 0 { available_parallelism().map_or(1, usize::from) } else { threads };
        let share = seen.len().div_ceil(threads).max(1);
        side_by_side(seen.chunks_mut(share), |_, part| {
            part.iter_mut().for_each(|(view, runs)| *runs = self.runs(looked_at, view, options));
        });
        let mut runs: Vec<Run> =
            seen.into_iter().map(|(_, runs)| runs).collect::<Result<Vec<_>, _>>()?.concat();
        if runs.iter().any(|r| r.view.presence > PRESENT) {
            runs.retain(|r| r.view.presence > PRESENT);
        }
        let mut people: Vec<(f64, Vec<Run>)> =
            by_person(runs).into_iter().map(|p| (prominence(&p, width, height), p)).collect();
        people.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(people.into_iter().filter_map(|(score, runs)| person(score, &runs, scale)).collect())
    }

    /// Returns a run for each person detected in a view of the whole picture.
    fn runs(
        &self,
        photo: &Photo,
        view: &Window,
        options: &FindOptions,
    ) -> Result<Vec<Run>, NetworkError> {
        let mut runs = Vec::new();
        let found = detection::detect(&self.detection, photo, view, options.least)?;
        for d in found.into_iter().take(options.most) {
            let Some(first) = landmarks::run_landmarks(&self.landmarks, photo, &d.window)? else {
                continue;
            };
            // A second time, in the window that the first view suggests.
            if let Some(view) = landmarks::run_landmarks(&self.landmarks, photo, &first.next)? {
                runs.push(Run { score: d.score, found: d.window, view });
            }
        }
        Ok(runs)
    }
}

/// Combines the runs of a person, scaling pixels by `scale`.
fn person(score: f64, runs: &[Run], scale: f64) -> Option<Person> {
    let mut c = consensus(runs)?;
    let all = c.others.iter_mut().map(|h| &mut h.landmarks).chain([&mut c.landmarks]);
    for l in all.flatten() {
        l.at = l.at.map(|x| x * scale);
        l.spread *= scale;
    }
    let along = |axis: usize| c.landmarks.iter().map(move |l| l.at[axis]);
    let least = |axis| along(axis).fold(f64::INFINITY, f64::min);
    let most = |axis| along(axis).fold(f64::NEG_INFINITY, f64::max);
    let mask = |i: &usize| {
        let View { window, mask, .. } = &runs[*i].view;
        let centre = window.centre.map(|x| x * scale);
        (Window { centre, side: window.side * scale, ..*window }, mask.clone())
    };
    Some(Person {
        score,
        sure: runs.iter().map(|r| r.score.min(r.view.presence)).fold(0.0, f64::max),
        bounds: [least(0), least(1), most(0), most(1)],
        torso: c.torso * scale,
        views: runs.len(),
        agreeing: c.agreeing.len(),
        masks: c.agreeing.iter().map(mask).collect(),
        landmarks: c.landmarks,
        others: c.others,
    })
}
