//! Combines several views of a person: which views agree, what they agree on, and which
//! poses the others have.
//!
//! Means over views are poor, since views have several modes (an arm here or there, left
//! and right exchanged). Instead, each landmark is the median over the views that agree
//! with the view that has most agreement.

use super::landmarks::{NAMED, SeenLandmark, View};
use super::person::{Hypothesis, Landmark, Person};
use super::window::Window;
use crate::boxes::overlap;

/// Shoulders, elbows, wrists, hips, knees, ankles.
const LIMBS: [usize; 12] = [11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28];
/// Landmarks this far apart, in lengths of the torso, have an agreement of exp(-1/2).
const NEAR: f64 = 0.3;
/// Views with more agreement than this, 0 to 1, have the same pose.
const AGREEING: f64 = 0.5;

/// Landmarks whose box overlaps a detector's by more than this (intersection over union) are of the
/// person in it.
pub(super) const FILLED: f64 = 0.3;
/// Two boxes of people that overlap by more than this are of one person.
pub(super) const ONE: f64 = 0.6;

/// A view with the score and the window of its detection.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub score: f64,
    /// The box that the person fills, if one was said to be there.
    pub in_box: Option<PersonBox>,
    pub found: Window,
    pub view: View,
}

/// A box where a person is said to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PersonBox {
    /// Left, top, right and bottom, in pixels.
    pub bounds: [f64; 4],
    /// How likely a detector takes it to be one, 0 to 1; `None` if a user drew it.
    pub score: Option<f64>,
}

/// Groups runs in a photograph of some size by person: those in the same box, or which fill it;
/// others, if their windows are at about the same position and of about the same size. People
/// are in the order of their first run.
pub(super) fn by_person(mut runs: Vec<Run>, size: [f64; 2]) -> Vec<Vec<Run>> {
    runs.sort_by_key(|r| r.in_box.is_none());
    let mut people: Vec<Vec<Run>> = Vec::new();
    for run in runs {
        let boxed = |p: &&Vec<Run>| run.in_box.is_some() && p[0].in_box == run.in_box;
        let fit = |p: &Vec<Run>| {
            let bounds = p[0].in_box.filter(|_| run.in_box.is_none())?.bounds;
            Some(overlap(run.view.bounds(size), bounds)).filter(|fit| *fit > FILLED)
        };
        let near = |p: &Vec<Run>| {
            let (centre, side) = middle(p);
            let apart = distance(run.found.centre, centre);
            p[0].in_box.is_none()
                && run.in_box.is_none()
                && apart < 0.25 * side.min(run.found.side)
                && run.found.side < 2.0 * side
                && side < 2.0 * run.found.side
        };
        let filled = || {
            let fits = people.iter().enumerate().filter_map(|(i, p)| Some((i, fit(p)?)));
            fits.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
        };
        let at = people.iter().position(|p| boxed(&p)).or_else(filled);
        match at.or_else(|| people.iter().position(near)) {
            Some(i) => people[i].push(run),
            None => people.push(vec![run]),
        }
    }
    people
}

/// Returns the mean centre and side of the windows of a person.
fn middle(runs: &[Run]) -> ([f64; 2], f64) {
    let n = runs.len().max(1) as f64;
    let mean = |f: &dyn Fn(&Run) -> f64| runs.iter().map(f).sum::<f64>() / n;
    ([mean(&|r| r.found.centre[0]), mean(&|r| r.found.centre[1])], mean(&|r| r.found.side))
}

/// Returns the prominence of a person in a picture of this size: it increases with the
/// number and score of detections, and with [`prominence`].
pub(super) fn seen(runs: &[Run], size: (u32, u32)) -> f64 {
    let (centre, side) = middle(runs);
    let seen: f64 = runs.iter().map(|r| r.score).sum();
    seen * prominence(centre, side, size)
}

/// The prominence of something of this middle and longer side, in pixels, in a picture of this
/// size: it increases with its size, and towards the middle.
pub(super) fn prominence(middle: [f64; 2], side: f64, (width, height): (u32, u32)) -> f64 {
    let off = libm::hypot(middle[0] / f64::from(width) - 0.5, middle[1] / f64::from(height) - 0.5);
    side / f64::from(width.max(height)) * libm::exp(-2.0 * off)
}

/// Returns the confidence that the runs of a person see one, whose consensus has these bounds: in a
/// detector's box its score, at most halved where the person does not fill it; in a box that a
/// user drew the presence of landmarks. Elsewhere also at most half the score of the first
/// network, which often errs (docs/measurements/detectors.md).
pub(super) fn sure(runs: &[Run], bounds: [f64; 4]) -> f64 {
    let each = |r: &Run| match r.in_box {
        Some(PersonBox { bounds: around, score: Some(score) }) => {
            0.5 * score * (1.0 + overlap(bounds, around))
        }
        Some(_) => r.view.presence,
        None => r.view.presence.min(0.5 * r.score),
    };
    runs.iter().map(each).fold(0.0, f64::max)
}

/// The detection on which the views of a person agree.
#[derive(Clone, Debug)]
pub(super) struct Consensus {
    pub landmarks: [Landmark; NAMED],
    /// The median length of the torso over the views, in pixels.
    pub torso: f64,
    /// Indices of the agreeing runs.
    pub agreeing: Vec<usize>,
    /// Poses that other views agree on, most views first.
    pub others: Vec<Hypothesis>,
}

/// Returns the consensus of at least one run; `None` without runs.
pub(super) fn consensus(runs: &[Run]) -> Option<Consensus> {
    let torso = median(runs.iter().map(|r| length(&r.view)).collect())?.max(1e-3);
    let mut left: Vec<usize> = (0..runs.len()).collect();
    let (mut first, mut others) = (None, Vec::new());
    while let Some(best) = most_agreed(runs, &left, torso) {
        let with = &runs[best].view;
        let (agreeing, rest): (Vec<usize>, Vec<usize>) = left
            .iter()
            .partition(|i| **i == best || agreement(&runs[**i].view, with, torso) > AGREEING);
        let landmarks = medians(runs, &agreeing)?;
        match first {
            None => first = Some((landmarks, agreeing)),
            Some(_) => others.push(Hypothesis { landmarks, views: agreeing.len() }),
        }
        left = rest;
    }
    let (landmarks, agreeing) = first?;
    others.sort_by_key(|h| core::cmp::Reverse(h.views));
    Some(Consensus { landmarks, torso, agreeing, others })
}

/// Returns the run, among some, with which the others agree most, weighted by their
/// confidence; the first one among equals.
fn most_agreed(runs: &[Run], among: &[usize], torso: f64) -> Option<usize> {
    let support = |i: usize| -> f64 {
        let each = |j: &usize| {
            let other = &runs[*j];
            agreement(&runs[i].view, &other.view, torso) * other.view.presence * other.score
        };
        among.iter().map(each).sum()
    };
    let better = |best: Option<(usize, f64)>, i: &usize| {
        let s = support(*i);
        if best.is_none_or(|(_, most)| s > most) { Some((*i, s)) } else { best }
    };
    among.iter().fold(None, better).map(|(i, _)| i)
}

/// Returns the agreement of two views on a pose, 0 to 1.
fn agreement(a: &View, b: &View, torso: f64) -> f64 {
    likeness(|i| distance(a.landmarks[i].at, b.landmarks[i].at) / torso)
}

/// Returns whether two people are one who was found twice.
pub(super) fn same(a: &Person, b: &Person) -> bool {
    let alike = likeness(|i| distance(a.landmarks[i].at, b.landmarks[i].at) / a.torso);
    alike > AGREEING || overlap(a.bounds, b.bounds) > ONE
}

/// Returns how alike two poses are, 0 to 1, whose landmarks have some distances in torsos.
fn likeness(apart: impl Fn(usize) -> f64) -> f64 {
    let near = |i: &usize| {
        let d = apart(*i) / NEAR;
        libm::exp(-0.5 * d * d)
    };
    LIMBS.iter().map(near).sum::<f64>() / LIMBS.len() as f64
}

/// Returns the mean distance from a shoulder to the opposite hip.
fn length(view: &View) -> f64 {
    let [a, b, c, d] = [11, 24, 12, 23].map(|i| view.landmarks[i].at);
    0.5 * (distance(a, b) + distance(c, d))
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

fn medians(runs: &[Run], among: &[usize]) -> Option<[Landmark; NAMED]> {
    let mut out = [Landmark::default(); NAMED];
    for (k, landmark) in out.iter_mut().enumerate() {
        let each = |f: &dyn Fn(&SeenLandmark) -> f64| {
            median(among.iter().map(|i| f(&runs[*i].view.landmarks[k])).collect())
        };
        let at = [each(&|s| s.at[0])?, each(&|s| s.at[1])?];
        let squares = among.iter().map(|i| {
            let d = distance(runs[*i].view.landmarks[k].at, at);
            d * d
        });
        // Standard deviation of one coordinate.
        let spread = libm::sqrt(squares.sum::<f64>() / (2 * among.len()) as f64);
        let metres = [each(&|s| s.metres[0])?, each(&|s| s.metres[1])?, each(&|s| s.metres[2])?];
        *landmark = Landmark { at, spread, visibility: each(&|s| s.visibility)?, metres };
    }
    Some(out)
}

/// Returns the median; of two middle numbers the lower one.
fn median(mut xs: Vec<f64>) -> Option<f64> {
    xs.sort_by(f64::total_cmp);
    xs.get(xs.len().checked_sub(1)? / 2).copied()
}
