//! Parts of a photograph in which people are looked for: the whole, or a box where a person
//! is said to be.

use super::consensus::{FILLED, PersonBox, Run};
use super::detection::{Detection, detect};
use super::landmarks::{self, View};
use super::window::Window;
use super::{FindOptions, PRESENT, PeopleFinder};
use crate::boxes::overlap;
use crate::nn::Memory;
use pcadlang_scene::vision::Photo;

/// A box is looked at with this much around it, on each side, as a fraction of its longer side.
const AROUND: f64 = 0.1;
/// Landmarks are also looked for in a window of this many times the longer side of a box.
const AROUND_ALL: f64 = 1.25;
/// The minimum overlap of the landmarks' box with one that a user drew.
const DRAWN: f64 = 0.2;
/// The minimum presence of landmarks in a detector's box: it is low where others are in front.
const HIDDEN: f64 = 0.05;
/// Beyond the first detections of a view, those with a lower score than this are hardly ever
/// people.
const FIRST: usize = 2;
const PROBABLE: f64 = 0.3;

/// A part of a photograph.
#[derive(Clone, Copy, Debug)]
pub(super) struct Area {
    window: Window,
    /// The box of one person.
    person: Option<PersonBox>,
    size: [f64; 2],
}

impl Area {
    /// The whole of a photograph of some size, with padding.
    pub fn whole((width, height): (u32, u32), padding: f64) -> Area {
        let size = [width, height].map(f64::from);
        Area { window: Window::whole(width, height, padding), person: None, size }
    }

    /// The surroundings of a person's box in such a photograph, with more padding.
    pub fn around(person: PersonBox, size: (u32, u32), padding: f64) -> Area {
        let window = square(person.bounds, 1.0 + 2.0 * (AROUND + padding));
        Area { window, person: Some(person), ..Area::whole(size, 0.0) }
    }

    /// Returns the runs of the networks that see a person there; in a box, those of whoever
    /// fills it.
    pub fn runs(
        &self,
        finder: &PeopleFinder,
        photo: &Photo,
        mirrored: bool,
        options: &FindOptions,
        memory: &mut Memory,
    ) -> Vec<Run> {
        let view = Window { mirrored, ..self.window };
        let found = detect(&finder.detection, photo, &view, options.least, memory);
        let probable = |(i, d): &(usize, Detection)| *i < FIRST || d.score > PROBABLE;
        let found = found.into_iter().take(options.most).enumerate().filter(probable);
        let mut runs = Vec::new();
        for (_, d) in found {
            if let Some(view) = twice(finder, photo, &d.window, memory) {
                runs.push(Run { score: d.score, in_box: None, found: d.window, view });
            }
        }
        let Some(person) = self.person else {
            runs.retain(|r| r.view.presence > PRESENT);
            return runs;
        };
        // The network of landmarks expects the hips in the middle: of a whole person, or else of
        // one whose upper half is seen.
        let [left, top, right, bottom] = person.bounds;
        let upper = [left, top, right, 2.0 * bottom - top];
        for bounds in [person.bounds, upper] {
            let window = Window { mirrored, ..square(bounds, AROUND_ALL) };
            let seen = twice(finder, photo, &window, memory);
            runs.extend(seen.map(|view| Run {
                score: 0.0,
                in_box: None,
                found: view.window,
                view,
            }));
            let filling: Vec<Run> =
                runs.drain(..).filter_map(|run| self.filling(run, person)).collect();
            if !filling.is_empty() {
                return filling;
            }
        }
        runs
    }

    /// Returns a run as that of the person in a box, if that one fills it.
    fn filling(&self, run: Run, person: PersonBox) -> Option<Run> {
        let (fills, present) = match person.score {
            Some(_) => (FILLED, HIDDEN),
            None => (DRAWN, PRESENT),
        };
        let fit = overlap(run.view.bounds(self.size), person.bounds);
        let seen = fit > fills && run.view.presence > present;
        let score = run.score.max(person.score.unwrap_or(1.0));
        seen.then_some(Run { score, in_box: Some(person), ..run })
    }
}

/// Detects landmarks in a window, then in the window that they suggest.
fn twice(
    finder: &PeopleFinder,
    photo: &Photo,
    window: &Window,
    memory: &mut Memory,
) -> Option<View> {
    let network = &finder.landmarks;
    let first = landmarks::run_landmarks(network, photo, window, false, memory)?;
    landmarks::run_landmarks(network, photo, &first.next, true, memory)
}

/// An upright window about the middle of a box, its side a multiple of the box's longer side.
fn square([left, top, right, bottom]: [f64; 4], times: f64) -> Window {
    let centre = [0.5 * (left + right), 0.5 * (top + bottom)];
    Window { centre, side: times * (right - left).max(bottom - top), turn: 0.0, mirrored: false }
}
