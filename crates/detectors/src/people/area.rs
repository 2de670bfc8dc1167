//! Parts of a photograph in which people are looked for: the whole, or a box where a person
//! is said to be.

use super::consensus::{PersonBox, Run};
use super::detection::{Detection, detect};
use super::landmarks::{self, View};
use super::window::Window;
use super::{FindOptions, PeopleFinder};
use crate::boxes::overlap;
use crate::nn::NetworkError;
use pcadlang_scene::vision::Photo;

/// A box is looked at with this much around it, on each side, as a fraction of its longer side.
const AROUND: f64 = 0.1;
/// If nobody is detected in a box, landmarks are looked for in a window of this many times its
/// longer side.
const AROUND_ALL: f64 = 1.25;
/// The minimum overlap (intersection over union) of a detector's box with that of the landmarks
/// of the person in it, and of a box that a user drew.
pub(super) const DETECTED: f64 = 0.3;
pub(super) const DRAWN: f64 = 0.2;
/// Beyond the first detections of a view, those with a lower score than this are hardly ever
/// people.
const FIRST: usize = 2;
const PROBABLE: f64 = 0.3;
/// The minimum presence of the person in a box.
const PRESENT: f64 = 0.5;

/// A part of a photograph.
#[derive(Clone, Copy, Debug)]
pub(super) struct Area {
    window: Window,
    /// The box of one person.
    person: Option<PersonBox>,
    /// The minimum overlap of the box with that of the person's landmarks.
    fills: f64,
    size: [f64; 2],
}

impl Area {
    /// The whole of a photograph of some size, with padding.
    pub fn whole((width, height): (u32, u32), padding: f64) -> Area {
        let size = [width, height].map(f64::from);
        Area { window: Window::whole(width, height, padding), person: None, fills: 0.0, size }
    }

    /// The surroundings of a person's box in such a photograph, with more padding.
    pub fn around(person: PersonBox, fills: f64, size: (u32, u32), padding: f64) -> Area {
        let window = square(person.bounds, 1.0 + 2.0 * (AROUND + padding));
        Area { window, person: Some(person), fills, ..Area::whole(size, 0.0) }
    }

    /// Returns a run for each person detected there, one at most in a box.
    ///
    /// # Errors
    /// Errors of the networks.
    pub fn runs(
        &self,
        finder: &PeopleFinder,
        photo: &Photo,
        mirrored: bool,
        options: &FindOptions,
    ) -> Result<Vec<Run>, NetworkError> {
        let view = Window { mirrored, ..self.window };
        let found = detect(&finder.detection, photo, &view, options.least)?;
        let mut runs = Vec::new();
        let probable = |(i, d): &(usize, Detection)| *i < FIRST || d.score > PROBABLE;
        for (_, d) in found.into_iter().take(options.most).enumerate().filter(probable) {
            if let Some(view) = twice(finder, photo, &d.window)? {
                let score = self.person.map_or(d.score, |b| b.score.max(d.score));
                runs.push(Run { score, in_box: self.person, found: d.window, view });
            }
        }
        let Some(PersonBox { bounds, score }) = self.person else { return Ok(runs) };
        if let Some(run) = self.filling(runs, bounds) {
            return Ok(vec![run]);
        }
        // The network expects the hips in the middle: of a whole person, or of one whose upper
        // half is seen.
        let [left, top, right, bottom] = bounds;
        let upper = [left, top, right, 2.0 * bottom - top];
        let mut all = Vec::new();
        for whole in [bounds, upper] {
            let window = Window { mirrored, ..square(whole, AROUND_ALL) };
            let seen = twice(finder, photo, &window)?;
            all.extend(seen.map(|view| Run {
                score,
                in_box: self.person,
                found: view.window,
                view,
            }));
        }
        Ok(self.filling(all, bounds).into_iter().collect())
    }

    /// Returns the run of the person who fills a box.
    fn filling(&self, runs: impl IntoIterator<Item = Run>, bounds: [f64; 4]) -> Option<Run> {
        let fit = |r: &Run| overlap(r.view.bounds(self.size), bounds);
        let fits = |r: &Run| r.view.presence > PRESENT && fit(r) > self.fills;
        runs.into_iter().filter(fits).max_by(|a, b| fit(a).total_cmp(&fit(b)))
    }
}

/// Detects landmarks in a window, then in the window that they suggest.
fn twice(
    finder: &PeopleFinder,
    photo: &Photo,
    window: &Window,
) -> Result<Option<View>, NetworkError> {
    match landmarks::run_landmarks(&finder.landmarks, photo, window)? {
        Some(first) => landmarks::run_landmarks(&finder.landmarks, photo, &first.next),
        None => Ok(None),
    }
}

/// An upright window about the middle of a box, its side a multiple of the box's longer side.
fn square([left, top, right, bottom]: [f64; 4], times: f64) -> Window {
    let centre = [0.5 * (left + right), 0.5 * (top + bottom)];
    Window { centre, side: times * (right - left).max(bottom - top), turn: 0.0, mirrored: false }
}
