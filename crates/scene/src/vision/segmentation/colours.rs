//! What is known about each pixel around an object before its outline is: whether its colour
//! is one of the object, how far out it is in the frame, and what was pointed out.

use super::window::Window;
use crate::vision::Hint;
use crate::vision::candidates::clusters::{LETTERS, codebook};

/// The prior log odds that a pixel is on the object: how fast they fall from the centre of
/// the frame outwards, their bounds, and the power of the curve that bounds the object, two and
/// a half.
const FALL: f64 = 6.0;
const BOUNDS: [f64; 2] = [-4.0, 3.0];
const POWER: f64 = 2.5;
/// Bound on the log odds of a colour.
const CLIP: f32 = 3.0;
/// The number of pixels of all colours alike that both histograms begin with.
const BEFORE: f32 = 20.0;
/// The weight in histograms of a pixel beyond the frame.
const BEYOND: f32 = 0.6;
/// How much of the prior stays when colours are learned from an outline.
const KEPT: f32 = 0.3;
/// How far beyond the frame pixels may be on the object, as a multiple of its size.
pub const LOOSE: f32 = 1.03;
/// How far pixels around a click are meant by it, as a part of the object's longer side.
const CLICK: f64 = 0.02;
/// How much a click changes the log odds around it, and how far, as a part of the object's
/// longer side.
const CLICKED: f64 = 6.0;
const AROUND: f64 = 0.1;

/// What is known about the pixels of a window, in row-major order.
pub struct Known {
    letters: Vec<u8>,
    /// The log odds that a pixel is on the object by its position alone.
    pub prior: Vec<f32>,
    /// The distance from the frame's centre, 1 at the frame.
    pub out: Vec<f32>,
    /// The weight of a pixel in histograms.
    weights: Vec<f32>,
    /// 1 where the object was pointed out, -1 where something beside it was, 0 elsewhere.
    pub pointed: Vec<f32>,
    width: usize,
}

impl Known {
    /// Reads a window with what was pointed out.
    pub fn new(window: &Window, hint: &Hint) -> Known {
        let frame = &window.frame;
        let place = |at: [f64; 2]| {
            let [u, v] = frame.within(at);
            [(u / frame.half[0]).abs(), (v / frame.half[1]).abs()]
        };
        let longer = 2.0 * frame.half[0].max(frame.half[1]);
        let distance = |click: &[f64; 2], [x, y]: [f64; 2]| {
            let click = window.within(*click);
            libm::hypot(click[0] - x, click[1] - y)
        };
        let clicked = |at: [f64; 2]| {
            let around = |clicks: &[[f64; 2]]| {
                let near =
                    |click| libm::exp(-0.5 * (distance(click, at) / (AROUND * longer)).powi(2));
                clicks.iter().map(near).fold(0.0, f64::max)
            };
            CLICKED * (around(&hint.at) - around(&hint.not))
        };
        let prior = |at: [f64; 2]| {
            let [u, v] = place(at);
            let out = libm::pow(u * u * u.sqrt() + v * v * v.sqrt(), 1.0 / POWER);
            ((FALL * (1.0 - out)).clamp(BOUNDS[0], BOUNDS[1]) + clicked(at)) as f32
        };
        let out: Vec<f32> =
            window.centres().map(|at| place(at)[0].max(place(at)[1]) as f32).collect();
        let weight = |(at, out): ([f64; 2], &f32)| match (window.shown(at), *out < LOOSE) {
            (false, _) => 0.0,
            (true, false) => BEYOND,
            (true, true) => 1.0,
        };
        let reach = (CLICK * longer).max(0.8);
        let near = |clicks: &[[f64; 2]], at: [f64; 2]| {
            clicks.iter().any(|click| distance(click, at) <= reach)
        };
        let pointed = |at: [f64; 2]| match (near(&hint.at, at), near(&hint.not, at)) {
            (true, false) => 1.0,
            (false, true) => -1.0,
            _ => 0.0,
        };
        Known {
            letters: codebook(&window.picture),
            prior: window.centres().map(prior).collect(),
            weights: window.centres().zip(&out).map(weight).collect(),
            out,
            pointed: window.centres().map(pointed).collect(),
            width: window.picture.width,
        }
    }

    /// Returns the probability that each pixel is on the object by its position and by an
    /// outline, if there is one yet: the fraction of its surroundings that is inside.
    pub fn belief(&self, outline: Option<&[bool]>) -> Vec<f32> {
        let prior = self.prior.iter().map(|odds| 1.0 / (1.0 + libm::expf(-odds)));
        let mut belief: Vec<f32> = match outline {
            None => prior.collect(),
            Some(on) => {
                let on: Vec<f32> = on.iter().map(|on| f32::from(u8::from(*on))).collect();
                let (w, h) = (self.width as u32, (on.len() / self.width.max(1)) as u32);
                let soft = crate::vision::detect::gradient::smoothed(w, h, &on, 1.5);
                prior.zip(soft).map(|(p, soft)| KEPT * p + (1.0 - KEPT) * soft).collect()
            }
        };
        for (p, b) in belief.iter_mut().enumerate() {
            *b = match (self.out[p] < LOOSE, self.pointed[p]) {
                (_, 1.0) => 1.0,
                (_, -1.0) | (false, _) => 0.0,
                _ => *b,
            };
        }
        belief
    }

    /// Returns for each pixel the log ratio of its colour's frequency on the object and
    /// beside it, as far as that is known from a belief in each pixel.
    pub fn colours(&self, belief: &[f32]) -> Vec<f32> {
        let mut counts = [[1e-3f32; LETTERS]; 2];
        let mut all = [1.0f32; LETTERS];
        for ((letter, b), weight) in self.letters.iter().zip(belief).zip(&self.weights) {
            let l = usize::from(*letter);
            counts[0][l] += (1.0 - b) * weight;
            counts[1][l] += b * weight;
            all[l] += 1.0;
        }
        let sum = all.iter().sum::<f32>();
        let totals = counts.map(|c| c.iter().sum::<f32>() + BEFORE);
        let part = |side: usize, l: usize| (counts[side][l] + BEFORE * all[l] / sum) / totals[side];
        let odds: [f32; LETTERS] =
            std::array::from_fn(|l| libm::logf(part(1, l) / part(0, l)).clamp(-CLIP, CLIP));
        self.letters.iter().map(|l| odds[usize::from(*l)]).collect()
    }
}
