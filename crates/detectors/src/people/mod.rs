//! Detects the people in a photograph, with 33 landmarks and a mask for each, by two
//! small networks of MediaPipe.
//!
//! The picture is examined in several views, padded and mirrored, and so is each box where a
//! person is said to be: these networks alone miss people who are small in the picture. What
//! most views of a person agree on is the pose; poses that only other views agree on are
//! alternative hypotheses ([`Person::others`]). The result is a function of the picture and the
//! boxes alone, with the same bits on any machine and for any number of threads. The networks
//! themselves (`pcadlang-models`) and the use of the landmarks are elsewhere.

mod area;
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

use crate::boxes::{around, overlap};
use crate::nn::{Memory, Network, NetworkError};
use crate::objects::{FoundObject, View as ObjectView};
use area::Area;
use consensus::{ONE, PersonBox, Run, by_person, consensus, prominence, same, seen, sure};
use landmarks::View;
use pcadlang_numerics::platform::threads::{available, both, side_by_side};
use pcadlang_scene::vision::Photo;
use window::Window;

/// How much views are padded, as a fraction of the longer side.
const PADDINGS: [f64; 4] = [0.0, 0.3, 0.15, 0.5];
/// The maximum longer side that is processed; larger pictures are shrunk first.
const LONGEST: u32 = 1280;
/// The minimum presence of landmarks where no detector says that somebody is there.
const PRESENT: f64 = 0.5;
/// The part of the minimum confidence that others need where somebody is seen: people come in
/// company, and a picture without anyone has nobody.
const IN_COMPANY: f64 = 0.75;
/// The pose of somebody whose box is this part of the picture is that of the views of the whole
/// picture, where there are any: such boxes often leave out a part.
const LARGE: f64 = 0.6;

/// The views of a photograph in which boxes of people are looked for.
pub const VIEWS_OF_PEOPLE: &[ObjectView] = &{
    const fn seen(part: f64) -> [ObjectView; 2] {
        [ObjectView { part, mirrored: false }, ObjectView { part, mirrored: true }]
    }
    let ([a, b], [c, d]) = (seen(1.0), seen(0.67));
    [a, b, c, d]
};

/// Where to look for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Search<'a> {
    /// In the whole photograph, and in the boxes of a detector of people, which may see each of
    /// them in several views, those with the highest scores first.
    Everywhere(&'a [FoundObject]),
    /// In one box, left, top, right and bottom in pixels, for the person who fills it.
    Within([f64; 4]),
}

/// Options of the search for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindOptions {
    /// The number of views, half of them mirrored: 2, 4 or 8, with paddings of 0, 30 %,
    /// 15 % and 50 %.
    pub views: u32,
    /// The maximum number of people per view, and of boxes.
    pub most: usize,
    /// Minimum score of detections, 0 to 1.
    pub least: f64,
    /// Minimum confidence that somebody is in the picture, 0 to 1 ([`Person::sure`]); others need
    /// less.
    pub sure: f64,
}

impl Default for FindOptions {
    fn default() -> Self {
        FindOptions { views: 2, most: 2, least: 0.05, sure: 0.4 }
    }
}

/// The two networks that detect people.
#[derive(Debug)]
pub struct PeopleFinder {
    detection: Network<'static>,
    landmarks: Network<'static>,
}

impl PeopleFinder {
    /// Reads the files of a detection and of a landmark network (`pose_detection.tflite`,
    /// `pose_landmark_*.tflite`).
    ///
    /// # Errors
    /// If a file cannot be read, or contains a different network.
    pub fn new(
        detection: &'static [u8],
        landmarks: &'static [u8],
    ) -> Result<PeopleFinder, NetworkError> {
        let (landmarks, detection) = both(|| Network::read(landmarks), || Network::read(detection));
        let finder = PeopleFinder { detection: detection?, landmarks: landmarks? };
        detection::check(&finder.detection)?;
        landmarks::check(&finder.landmarks)?;
        Ok(finder)
    }

    /// Returns the people in a photograph, the most prominent first. `threads` views (0:
    /// as many as [`available`]) are processed in parallel.
    pub fn find(
        &self,
        photo: &Photo,
        search: Search,
        options: &FindOptions,
        threads: usize,
    ) -> Vec<Person> {
        let longer = photo.width().max(photo.height());
        let small = (longer > LONGEST).then(|| photo.shrunk(LONGEST));
        let looked_at = small.as_ref().unwrap_or(photo);
        let scale = f64::from(longer) / f64::from(longer.min(LONGEST));
        let size = (looked_at.width(), looked_at.height());
        let paddings = PADDINGS.into_iter().take(options.views.div_ceil(2).clamp(1, 4) as usize);
        let in_box =
            |bounds: [f64; 4], score| PersonBox { bounds: bounds.map(|x| x / scale), score };
        let areas: Vec<Area> = match search {
            Search::Within(bounds) => {
                paddings.map(|p| Area::around(in_box(bounds, None), size, p)).collect()
            }
            Search::Everywhere(objects) => {
                let whole = paddings.map(|p| Area::whole(size, p));
                let around =
                    |o: &FoundObject| Area::around(in_box(o.bounds, Some(o.score)), size, 0.0);
                let people = said_to_be_people(
                    objects,
                    IN_COMPANY * options.sure,
                    (photo.width(), photo.height()),
                );
                whole.chain(people.into_iter().take(options.most).map(around)).collect()
            }
        };
        let views = areas.iter().flat_map(|area| [false, true].map(|mirrored| (area, mirrored)));
        let mut looked: Vec<_> = views.map(|view| (view, Vec::new())).collect();
        let threads = if threads == 0 { available() } else { threads };
        // A view and its mirror image, which take as long, go to different threads.
        let mut parts: Vec<Vec<_>> = (0..threads.min(looked.len())).map(|_| Vec::new()).collect();
        let count = parts.len().max(1);
        looked.iter_mut().enumerate().for_each(|(i, view)| parts[i % count].push(view));
        side_by_side(parts, |_, part| {
            let mut memory = Memory::default();
            for ((area, mirrored), runs) in part {
                *runs = area.runs(self, looked_at, *mirrored, options, &mut memory);
            }
        });
        let runs: Vec<Run> = looked.into_iter().flat_map(|(_, runs)| runs).collect();
        let each = by_person(runs, [size.0, size.1].map(f64::from)).into_iter();
        let mut people: Vec<Person> = each.filter_map(|runs| person(&runs, size, scale)).collect();
        people.sort_by(|a, b| b.sure.total_cmp(&a.sure));
        let least = match people.first() {
            Some(p) if p.sure >= options.sure => IN_COMPANY * options.sure,
            _ => options.sure,
        };
        people.retain(|p| p.sure >= least);
        let mut all: Vec<Person> = Vec::new();
        for person in people {
            if !all.iter().any(|other| same(other, &person)) {
                all.push(person);
            }
        }
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        all
    }
}

/// Returns the people among objects, those with the highest scores first, each once, in a
/// photograph of this size: those with at least some score, the most prominent first.
fn said_to_be_people(objects: &[FoundObject], least: f64, size: (u32, u32)) -> Vec<&FoundObject> {
    let mut all: Vec<&FoundObject> = Vec::new();
    for o in objects.iter().filter(|o| o.name() == "person" && o.score >= least) {
        if !all.iter().any(|other| overlap(other.bounds, o.bounds) > ONE) {
            all.push(o);
        }
    }
    let prominence = |o: &FoundObject| {
        let [left, top, right, bottom] = o.bounds;
        let middle = [0.5 * (left + right), 0.5 * (top + bottom)];
        o.score * prominence(middle, (right - left).max(bottom - top), size)
    };
    all.sort_by(|a, b| prominence(b).total_cmp(&prominence(a)));
    all
}

/// Combines the runs of a person in a picture of some size, scaling pixels by `scale`.
fn person(all: &[Run], size: (u32, u32), scale: f64) -> Option<Person> {
    let longer = |[left, top, right, bottom]: [f64; 4]| (right - left).max(bottom - top);
    let large = LARGE * f64::from(size.0.max(size.1));
    let in_large_box = |r: &Run| r.in_box.is_some_and(|b| longer(b.bounds) >= large);
    let seen_whole = all.iter().any(|r| r.in_box.is_none());
    let runs: Vec<Run> = all.iter().filter(|r| !(seen_whole && in_large_box(r))).cloned().collect();
    let mut c = consensus(&runs)?;
    let inside = |l: &Landmark| {
        [l.at[0].clamp(0.0, f64::from(size.0)), l.at[1].clamp(0.0, f64::from(size.1))]
    };
    let sure = sure(all, around(c.landmarks.iter().map(inside)));
    let poses = c.others.iter_mut().map(|h| &mut h.landmarks).chain([&mut c.landmarks]);
    for l in poses.flatten() {
        l.at = l.at.map(|x| x * scale);
        l.spread *= scale;
    }
    let mask = |i: &usize| {
        let View { window, mask, .. } = &runs[*i].view;
        let centre = window.centre.map(|x| x * scale);
        (Window { centre, side: window.side * scale, ..*window }, mask.clone())
    };
    Some(Person {
        score: seen(all, size),
        sure,
        bounds: around(c.landmarks.iter().map(|l| l.at)),
        torso: c.torso * scale,
        views: runs.len(),
        agreeing: c.agreeing.len(),
        masks: c.agreeing.iter().map(mask).collect(),
        landmarks: c.landmarks,
        others: c.others,
    })
}
