//! Approximate detection of people in a picture: the boxes of an SSD network (Liu et al.
//! 2016; MediaPipe's `pose_detection`).

use super::window::{Beyond, Window};
use crate::boxes::overlap;
use crate::nn::{Memory, Network, NetworkError, sigmoid};
use pcadlang_scene::vision::Photo;

/// Side of the network's input, in samples.
const SIDE: usize = 224;
/// Grids of anchors: cells along a side, and anchors per cell.
const GRIDS: [(usize, usize); 3] = [(28, 2), (14, 2), (7, 6)];
/// Number of values per anchor: a box's centre, width and height, and four points.
const NUMBERS: usize = 12;
/// Boxes with a larger intersection over union than this belong to the same person.
const OVERLAP: f64 = 0.3;

/// A person detected by the network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Detection {
    /// 0 to 1.
    pub score: f64,
    /// Left, top, right, bottom, in pixels, of the head rather than the whole person.
    pub head: [f64; 4],
    /// The window in which to detect landmarks.
    pub window: Window,
}

/// A box with its points, as positions in the view: left, top, right, bottom, then x and
/// y of each point.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    score: f64,
    numbers: [f64; NUMBERS],
}

impl Candidate {
    /// Returns the sides of its box.
    fn sides(&self) -> [f64; 4] {
        let [left, top, right, bottom, ..] = self.numbers;
        [left, top, right, bottom]
    }
}

/// The centres of all anchors, in the order of the network's outputs.
fn anchors() -> impl Iterator<Item = [f64; 2]> {
    GRIDS.into_iter().flat_map(|(n, each)| {
        (0..n * n * each).map(move |i| {
            let (x, y) = (i / each % n, i / each / n);
            [(x as f64 + 0.5) / n as f64, (y as f64 + 0.5) / n as f64]
        })
    })
}

/// Returns an error unless the network has the inputs and outputs of a person detector.
pub(super) fn check(network: &Network) -> Result<(), NetworkError> {
    let count = anchors().count();
    let outputs: Vec<&[usize]> = network.output_shapes().collect();
    if network.input_shape() == [1, SIDE, SIDE, 3]
        && outputs == [&[1, count, NUMBERS][..], &[1, count, 1]]
    {
        return Ok(());
    }
    Err(NetworkError::Format("it is not a person detector (pose_detection.tflite)".into()))
}

/// Returns the people in a view of a picture with a score of at least `least`, best
/// first.
pub(super) fn detect(
    network: &Network,
    photo: &Photo,
    view: &Window,
    least: f64,
    memory: &mut Memory,
) -> Vec<Detection> {
    let fill = |input: &mut [f32]| view.sample(photo, SIDE, [-1.0, 1.0], Beyond::Black, input);
    let outputs = network.run_in(memory, &[true, true], fill);
    let [boxes, scores] = outputs[..] else { return Vec::new() };
    let mut all: Vec<Candidate> = Vec::new();
    for ((anchor, numbers), score) in anchors().zip(boxes.chunks_exact(NUMBERS)).zip(scores) {
        let score = f64::from(sigmoid(score.clamp(-100.0, 100.0)));
        if score < least {
            continue;
        }
        let at = |k: usize| f64::from(numbers[k]) / SIDE as f64;
        let (x, y, w, h) = (at(0) + anchor[0], at(1) + anchor[1], at(2) / 2.0, at(3) / 2.0);
        let mut numbers = [x - w, y - h, x + w, y + h, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        (4..NUMBERS).for_each(|k| numbers[k] = at(k) + anchor[k % 2]);
        if numbers.iter().all(|n| n.is_finite()) {
            all.push(Candidate { score, numbers });
        }
    }
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    people(all).into_iter().filter_map(|c| found(&c, view)).collect()
}

fn found(c: &Candidate, view: &Window) -> Option<Detection> {
    let n = &c.numbers;
    let (a, b) = (view.pixel([n[0], n[1]]), view.pixel([n[2], n[3]]));
    let head = [a[0].min(b[0]), a[1].min(b[1]), a[0].max(b[0]), a[1].max(b[1])];
    let window = Window::around(view.pixel([n[4], n[5]]), view.pixel([n[6], n[7]]));
    let window = Window { mirrored: view.mirrored, ..window };
    window.is_sound().then_some(Detection { score: c.score, head, window })
}

/// Merges the candidates that overlap the best remaining one into their mean, weighted by
/// score, until none remain.
fn people(mut all: Vec<Candidate>) -> Vec<Candidate> {
    let mut out = Vec::new();
    while let Some(best) = all.first().copied() {
        let (same, rest): (Vec<_>, Vec<_>) =
            all.iter().skip(1).partition(|c| overlap(c.sides(), best.sides()) > OVERLAP);
        let (mut sums, mut total) = ([0.0; NUMBERS], 0.0);
        for c in [best].iter().chain(&same) {
            sums.iter_mut().zip(&c.numbers).for_each(|(s, n)| *s += c.score * n);
            total += c.score;
        }
        out.push(Candidate { score: best.score, numbers: sums.map(|s| s / total) });
        all = rest;
    }
    out
}
