//! Places in a photograph where an object of revolution may be: where the user points, in
//! the boxes of a detector, or in regions that are nearly mirror-symmetric.

use super::ImageValue;
use super::found_objects::found;
use pcadlang_detectors::boxes::{contains, overlap, sides};
use pcadlang_detectors::objects::{FoundObject, VIEWS};
use pcadlang_engine::lang::error::Fault;
use pcadlang_numerics::platform::threads::map_side_by_side;
use pcadlang_scene::vision::candidates::{Axis, Candidate, CandidateOptions, candidates, enclosed};
use pcadlang_scene::vision::segmentation::{Guess, Method, from_mask, guesses};
use pcadlang_scene::vision::{Hint, Mask, Photo};
use std::sync::Arc;

/// The classes of COCO that are objects of revolution.
const ROUND: [&str; 7] = ["bottle", "wine glass", "cup", "bowl", "apple", "orange", "vase"];
/// The maximum number of boxes of the detector.
const BOXES: usize = 3;
/// The minimum score of an object.
const LEAST: f64 = 0.05;
/// Boxes that overlap more than this (intersection over union) are of one object.
const SAME: f64 = 0.75;
/// The weight of the best region; that of a box that is seen clearly is about 0.5, and those
/// of boxes at a click add up to 1.
const REGION: f64 = 0.03;
/// Each side of the picture that a box touches multiplies its weight by this.
const CUT_OFF: f64 = 0.6;
/// The overlap of a region's own box with one that points to a place, from which on the region
/// is a guess of the outline there.
const FILLS: f64 = 0.8;

/// A place where an object may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Its prior probability.
    pub score: f64,
    /// What points to it: a part of the hint (`drawn`, `axis`, `box`), the class that the
    /// detector sees, or `region`.
    pub source: String,
    /// Left, top, width and height, pixels of the photograph, if a box points to it.
    pub bounds: Option<[f64; 4]>,
    /// Outlines: the one that the user drew, or guesses; first of these the best symmetric
    /// one and the graph cut.
    pub masks: Vec<Mask>,
    /// Axes; their weights add up to 1.
    pub axes: Vec<PlaceAxis>,
}

/// An axis that an object in a place may have.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceAxis {
    /// The axis, in pixels of the photograph.
    pub axis: Axis,
    /// Its probability.
    pub weight: f64,
    /// The index of the outline whose axis it is.
    pub mask: usize,
}

impl Place {
    pub(super) fn guessed(
        source: &str,
        score: f64,
        bounds: Option<[f64; 4]>,
        all: &[Guess],
    ) -> Place {
        let by = |method| all.iter().filter(move |g| g.method == method);
        let first = |method| by(method).next().map(|g| g.mask.clone());
        let masks = [Method::Symmetric, Method::Cut].into_iter().filter_map(first).collect();
        let mut place = Place::outlined(source, score, bounds, masks);
        for method in Method::ALL {
            let axes = |g: &Guess| {
                // Other guesses give axes for the outline most like them.
                let nearest = place.nearest(&g.mask);
                g.axes.iter().map(|a| (a.clone(), nearest)).collect::<Vec<_>>()
            };
            let axes = by(method).flat_map(axes).collect();
            place.add(axes);
        }
        place
    }

    /// The index of the outline that overlaps a mask most.
    fn nearest(&self, mask: &Mask) -> usize {
        let overlaps = self.masks.iter().map(|m| m.overlap(mask)).enumerate();
        overlaps.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
    }

    /// Adds the axes of a method. Each method has the same weight; later axes of one have half
    /// the weight of the one before.
    fn add(&mut self, axes: Vec<(Axis, usize)>) {
        let total: f64 = (0..axes.len()).map(|i| 0.5f64.powi(i as i32)).sum();
        let weighted = axes.into_iter().enumerate();
        self.axes.extend(weighted.map(|(i, (axis, mask))| PlaceAxis {
            axis,
            weight: 0.5f64.powi(i as i32) / total,
            mask,
        }));
    }

    /// Adds the regions of a photograph of `size` pixels that fill the box, as guesses.
    fn with_regions(mut self, all: &[Candidate], size: [f64; 2]) -> Place {
        let fills = |c: &&Candidate| {
            let scale = [size[0] / f64::from(c.mask.width()), size[1] / f64::from(c.mask.height())];
            let seen = c.mask.bounds().map(|b| [0, 1, 2, 3].map(|k| b[k] * scale[k % 2]));
            let given = self.bounds.map(sides);
            given.zip(seen).is_some_and(|(a, b)| overlap(a, b) > FILLS)
        };
        let filling: Vec<&Candidate> = all.iter().filter(fills).collect();
        let mut axes = Vec::new();
        for c in filling {
            axes.extend(c.axes.iter().map(|a| (a.clone(), self.masks.len())));
            self.masks.push(c.mask.clone());
        }
        self.add(axes);
        self.axes = normalised(self.axes);
        self
    }

    fn region(c: &Candidate, score: f64) -> Place {
        let axes = of_mirrors(c.axes.clone());
        Place { masks: vec![c.mask.clone()], axes, ..Place::anywhere(score) }
    }

    /// A place with outlines, and no axes yet.
    pub(super) fn outlined(
        source: &str,
        score: f64,
        bounds: Option<[f64; 4]>,
        masks: Vec<Mask>,
    ) -> Place {
        Place { score, source: source.into(), bounds, masks, axes: Vec::new() }
    }

    /// A place that nothing points to.
    pub(super) fn anywhere(score: f64) -> Place {
        Place::outlined("region", score, None, Vec::new())
    }
}

/// Returns the axes of the only outline of a place: its best mirror and the next one.
fn of_mirrors(axes: Vec<Axis>) -> Vec<PlaceAxis> {
    let weighted = axes.into_iter().zip([0.8, 0.2]);
    normalised(weighted.map(|(axis, weight)| PlaceAxis { axis, weight, mask: 0 }).collect())
}

fn normalised(mut axes: Vec<PlaceAxis>) -> Vec<PlaceAxis> {
    let total: f64 = axes.iter().map(|a| a.weight).sum();
    axes.iter_mut().for_each(|a| a.weight /= total);
    axes
}

impl ImageValue {
    /// Returns the places where a hint leaves open that an object of revolution may be, the
    /// most probable first.
    ///
    /// # Errors
    /// If a detector fails.
    pub fn places(
        &self,
        options: &CandidateOptions,
        hint: &Hint,
    ) -> Result<Arc<Vec<Place>>, Fault> {
        self.prepared().get((*options, hint.clone()), |(options, hint)| match self.as_photo() {
            Some(photo) => places(self, photo, hint, options),
            None => {
                let mut all = regions(&enclosed(self.map()?, options));
                normalise(&mut all);
                Ok(all)
            }
        })
    }

    /// Returns the places that programs searched with its hint; `None` if none did.
    pub fn known_places(&self) -> Option<Arc<Vec<Place>>> {
        self.prepared().known(|(_, hint): &(CandidateOptions, Hint)| hint == self.hint())
    }

    /// Returns guesses by all methods for a hint with a box or an axis.
    pub(super) fn guesses(&self, photo: &Photo, hint: &Hint) -> Result<Arc<Vec<Guess>>, Fault> {
        self.prepared().get(hint.clone(), |hint| Ok(guesses(photo, hint, &Method::ALL)))
    }

    fn regions(
        &self,
        photo: &Photo,
        options: &CandidateOptions,
    ) -> Result<Arc<Vec<Candidate>>, Fault> {
        self.prepared().get(*options, |options| Ok(candidates(photo, options)))
    }
}

/// Returns the places of an image's photograph that a hint leaves open, the most probable
/// first.
///
/// # Errors
/// Those of the detector.
pub(super) fn places(
    image: &ImageValue,
    photo: &Photo,
    hint: &Hint,
    options: &CandidateOptions,
) -> Result<Vec<Place>, Fault> {
    if let Some(mask) = hint.drawn(photo.width(), photo.height()) {
        let axes = of_mirrors(from_mask(photo, &mask));
        return Ok(vec![Place { axes, ..Place::outlined("drawn", 1.0, None, vec![mask]) }]);
    }
    let search = || image.regions(photo, options);
    let size = [photo.width(), photo.height()].map(f64::from);
    if hint.axis.is_some() || hint.bounds.is_some() {
        let source = if hint.axis.is_some() { "axis" } else { "box" };
        let all = image.guesses(photo, hint)?;
        let place = Place::guessed(source, 1.0, hint.bounds, &all);
        let filling = if hint.bounds.is_some() { search()? } else { Arc::default() };
        return Ok(vec![place.with_regions(&filling, size)]);
    }
    let boxes = boxes(photo, &found(image, &VIEWS)?, hint);
    let candidates = search()?;
    let within = |o: &Seen| Hint { bounds: Some(sized(o.bounds)), ..hint.clone() };
    // Each takes as long as all the rest.
    map_side_by_side(&boxes, |(o, _)| image.guesses(photo, &within(o)).is_ok());
    let seen = boxes.iter().map(|(o, weight)| {
        let bounds = Some(sized(o.bounds));
        let all = image.guesses(photo, &within(o))?;
        Ok(Place::guessed(o.class, *weight, bounds, &all).with_regions(&candidates, size))
    });
    let mut all: Vec<Place> = seen.collect::<Result<_, Fault>>()?;
    if !hint.at.is_empty() && !all.is_empty() {
        normalise(&mut all);
        return Ok(all);
    }
    all.extend(regions(&meant(candidates.to_vec(), photo, hint)));
    normalise(&mut all);
    Ok(all)
}

/// Returns left, top, width and height of a box of left, top, right and bottom.
pub(super) fn sized([left, top, right, bottom]: [f64; 4]) -> [f64; 4] {
    [left, top, right - left, bottom - top]
}

/// A box where the detector sees a vessel or a fruit, of whatever class: the mean of boxes
/// that overlap, weighted by the squares of their scores (after Solovyev et al. 2021,
/// "Weighted boxes fusion", Image and Vision Computing 107, 104117).
pub(super) struct Seen {
    /// The class with the highest score.
    pub class: &'static str,
    pub bounds: [f64; 4],
    /// The sum of the scores, over the number of views, and the sum of their squares.
    score: f64,
    sure: f64,
}

/// Returns the boxes that may be meant, with their weights, the best first.
pub(super) fn boxes(photo: &Photo, objects: &[FoundObject], hint: &Hint) -> Vec<(Seen, f64)> {
    let clicked = !hint.at.is_empty();
    let round = |o: &&FoundObject| o.score >= LEAST && ROUND.contains(&o.name());
    let meant = |o: &Seen| {
        hint.at.iter().all(|p| contains(o.bounds, *p))
            && !hint.not.iter().any(|p| contains(o.bounds, *p))
    };
    let (width, height) = (f64::from(photo.width()), f64::from(photo.height()));
    let weight = |o: &Seen| {
        let [l, t, r, b] = o.bounds;
        if clicked {
            return o.score * clicks(o.bounds, &hint.at);
        }
        let off = [0.5 * (l + r) / width - 0.5, 0.5 * (t + b) / height - 0.5];
        let central = libm::exp(-2.0 * (off[0] * off[0] + off[1] * off[1]));
        let area = (r - l) * (b - t) / (width * height);
        let touched = [l < 0.01 * width, t < 0.01 * height, r > 0.99 * width, b > 0.99 * height];
        let cut_off = touched.into_iter().filter(|t| *t).map(|_| CUT_OFF).product::<f64>();
        o.score * central * area.sqrt().sqrt() * cut_off
    };
    let share = |o: &FoundObject| o.score / VIEWS.len() as f64;
    let mut all: Vec<Seen> = Vec::new();
    for o in objects.iter().filter(round) {
        match all.iter_mut().find(|s| overlap(s.bounds, o.bounds) > SAME) {
            Some(s) => {
                let sure = o.score * o.score;
                let mean = |k: usize| (s.sure * s.bounds[k] + sure * o.bounds[k]) / (s.sure + sure);
                s.bounds = [0, 1, 2, 3].map(mean);
                (s.score, s.sure) = (s.score + share(o), s.sure + sure);
            }
            None => all.push(Seen {
                class: o.name(),
                bounds: o.bounds,
                score: share(o),
                sure: o.score * o.score,
            }),
        }
    }
    let mut all: Vec<(Seen, f64)> =
        all.into_iter().filter(meant).map(|o| (weight(&o), o)).map(|(w, o)| (o, w)).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(BOXES);
    all
}

/// Returns how well clicks fit the object in a box of left, top, right and bottom: they are
/// about its middle, with a standard deviation of a quarter of each side. Of a thing and what
/// is in it, the smaller one is preferred by the square root of its area, half as much as the
/// density of clicks would: fruit in a bowl is clicked where the bowl is meant. Several
/// clicks, which are not independent, count as one.
fn clicks([l, t, r, b]: [f64; 4], at: &[[f64; 2]]) -> f64 {
    let (middle, half) =
        ([0.5 * (l + r), 0.5 * (t + b)], [r - l, b - t].map(|s| f64::max(0.5 * s, 0.5)));
    let off = |p: &[f64; 2]| [0, 1].map(|c| (p[c] - middle[c]) / half[c]);
    let far = at.iter().map(off).map(|[x, y]| x * x + y * y).sum::<f64>() / at.len() as f64;
    libm::exp(-2.0 * far) / libm::sqrt(half[0] * half[1])
}

/// Returns regions as places; the best one has the weight [`REGION`].
pub(super) fn regions(all: &[Candidate]) -> Vec<Place> {
    let most = all.iter().map(|c| c.score).fold(0.0, f64::max);
    match all {
        [] => vec![Place::anywhere(REGION)],
        _ => all.iter().map(|c| Place::region(c, REGION * c.score / most)).collect(),
    }
}

/// Makes the scores probabilities.
pub(super) fn normalise(places: &mut [Place]) {
    let total: f64 = places.iter().map(|p| p.score).sum();
    places.iter_mut().for_each(|p| p.score /= total);
}

/// Returns the regions that clicks leave open; all of them if none fits.
fn meant(mut all: Vec<Candidate>, photo: &Photo, hint: &Hint) -> Vec<Candidate> {
    let size = [photo.width(), photo.height()].map(f64::from);
    let has = |c: &Candidate, p: [f64; 2]| c.mask.at([p[0] / size[0], p[1] / size[1]]);
    let fits =
        |c: &Candidate| hint.at.iter().all(|p| has(c, *p)) && !hint.not.iter().any(|p| has(c, *p));
    if all.iter().any(fits) {
        all.retain(fits);
    }
    all
}
