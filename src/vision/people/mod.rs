//! People in a photograph: where they are, 33 landmarks of each, and which pixels are
//! theirs, by two small networks of MediaPipe.
//!
//! The picture is looked at in several views, padded and mirrored; what they agree on is
//! the person, what they do not are other hypotheses ([`Person::others`]). A function of
//! the picture alone, with the same bits on any machine and for any number of threads.
//! Not here: which networks there are (`pcadlang-models`), and what is made of the
//! landmarks.

mod consensus;
mod detection;
pub mod json;
mod landmarks;
pub mod networks;
#[cfg(test)]
mod tests;
mod window;

use crate::nn::{Network, NetworkError, sigmoid};
use crate::platform::threads::side_by_side;
use crate::vision::Photo;
use crate::vision::keypoints::MEDIAPIPE;
use consensus::{Run, by_person, consensus, prominence};
use landmarks::{NAMED, SIDE, View};
use std::thread::available_parallelism;
use window::Window;

/// The longest side that is looked at; larger pictures are made smaller first.
const LONGEST: u32 = 1280;
/// Views see at most this often that there is nobody.
const PRESENT: f64 = 0.5;

/// How people are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindOptions {
    /// How many views there are, half of them mirrored: 2, 4 or 8, by padding the picture
    /// by 0, 30 %, 15 % and 50 %.
    pub views: u32,
    /// How many people a view is searched for at most.
    pub most: usize,
    /// Detections of a lower score are left out, 0 to 1.
    pub least: f64,
}

impl Default for FindOptions {
    fn default() -> Self {
        FindOptions { views: 2, most: 2, least: 0.05 }
    }
}

/// A landmark of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Landmark {
    /// In pixels of the photograph.
    pub at: [f64; 2],
    /// The standard deviation of a coordinate over the views that agree, in pixels.
    pub spread: f64,
    /// How sure the network is that it can be seen, 0 to 1.
    pub visibility: f64,
    /// In metres from the middle of the hips: right and down in the picture, and away
    /// from the camera.
    pub metres: [f64; 3],
}

/// Another pose that some views of a person agree on.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// In the order of [`MEDIAPIPE`].
    pub landmarks: [Landmark; NAMED],
    /// How many views have it.
    pub views: usize,
}

/// A person that was found.
#[derive(Clone, Debug)]
pub struct Person {
    /// How much the picture is about them: how often and surely they are seen, how large,
    /// how near the middle.
    pub score: f64,
    /// How sure it is that this is a person, 0 to 1: what both networks grant, in the
    /// view where that is most.
    pub sure: f64,
    /// Left, top, right and bottom of all landmarks, in pixels.
    pub bounds: [f64; 4],
    /// The length of the torso in pixels.
    pub torso: f64,
    /// In the order of [`MEDIAPIPE`].
    pub landmarks: [Landmark; NAMED],
    /// How many views saw them, and how many of these agree.
    pub views: usize,
    /// Those that agree.
    pub agreeing: usize,
    /// What the others say, most views first.
    pub others: Vec<Hypothesis>,
    /// The masks of the views that agree, with their windows in pixels of the photograph.
    masks: Vec<(Window, Vec<f32>)>,
}

/// The two networks that find people.
#[derive(Debug)]
pub struct PeopleFinder {
    detection: Network,
    landmarks: Network,
}

impl PeopleFinder {
    /// From the files of a detection and of a landmark network (`pose_detection.tflite`,
    /// `pose_landmark_*.tflite`).
    ///
    /// # Errors
    /// If a file cannot be read, or is of another network.
    pub fn new(detection: &[u8], landmarks: &[u8]) -> Result<PeopleFinder, NetworkError> {
        let finder = PeopleFinder {
            detection: Network::read(detection)?,
            landmarks: Network::read(landmarks)?,
        };
        detection::check(&finder.detection)?;
        landmarks::check(&finder.landmarks)?;
        Ok(finder)
    }

    /// The people in a photograph, the most prominent first; `threads` views (0: as many
    /// as there are cores) are looked at side by side.
    ///
    /// # Errors
    /// Those of the networks, which sound ones do not have.
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

    /// What is seen of each person that is detected in a view of the whole picture.
    fn runs(
        &self,
        photo: &Photo,
        view: &Window,
        options: &FindOptions,
    ) -> Result<Vec<Run>, NetworkError> {
        let mut runs = Vec::new();
        let found = detection::detect(&self.detection, photo, view, options.least)?;
        for d in found.into_iter().take(options.most) {
            let Some(first) = landmarks::look(&self.landmarks, photo, &d.window)? else { continue };
            // Once more, in the window that the first look suggests.
            if let Some(view) = landmarks::look(&self.landmarks, photo, &first.next)? {
                runs.push(Run { score: d.score, found: d.window, view });
            }
        }
        Ok(runs)
    }
}

/// The person that some runs see, in pixels `scale` times smaller.
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

impl Person {
    /// A landmark by its name in [`MEDIAPIPE`].
    pub fn landmark(&self, name: &str) -> Option<&Landmark> {
        MEDIAPIPE.iter().position(|n| *n == name).and_then(|i| self.landmarks.get(i))
    }

    /// How likely each pixel is the person's, 0 to 1, in a picture of this size that
    /// shows what the photograph, `photo_width` pixels wide, shows; the mean over the
    /// views that agree.
    pub fn mask(&self, width: u32, height: u32, photo_width: u32) -> Vec<f32> {
        let scale = f64::from(photo_width) / f64::from(width.max(1));
        let mut out = Vec::with_capacity(width as usize * height as usize);
        for row in 0..height {
            for column in 0..width {
                let pixel = [column, row].map(|x| (f64::from(x) + 0.5) * scale);
                let sum: f32 =
                    self.masks.iter().map(|(window, mask)| at(mask, window.position(pixel))).sum();
                out.push(sum / self.masks.len().max(1) as f32);
            }
        }
        out
    }
}

/// The probability at a position of a window's mask, between its samples; 0 outside.
fn at(mask: &[f32], [u, v]: [f64; 2]) -> f32 {
    let (x, y) = (u * SIDE as f64, v * SIDE as f64);
    let most = SIDE as f64 - 1.0;
    if !(0.0..=most).contains(&x) || !(0.0..=most).contains(&y) {
        return 0.0;
    }
    let (left, top) = ((x as usize).min(SIDE - 2), (y as usize).min(SIDE - 2));
    let (fx, fy) = ((x - left as f64) as f32, (y - top as f64) as f32);
    let row = |r: usize| mask[r * SIDE + left] * (1.0 - fx) + mask[r * SIDE + left + 1] * fx;
    sigmoid(row(top) * (1.0 - fy) + row(top + 1) * fy)
}
