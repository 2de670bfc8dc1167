//! The landmarks of one person in a window, by MediaPipe's `pose_landmark` networks
//! (Bazarevsky et al. 2020, "BlazePose").

use super::window::{Beyond, Window};
use crate::boxes::around;
use crate::nn::{Memory, Network, NetworkError, sigmoid};
use pcadlang_scene::vision::Photo;
use pcadlang_scene::vision::keypoints::MEDIAPIPE;

/// Side of the network's input and of its mask, in samples.
pub(super) const SIDE: usize = 256;
/// Number of named landmarks, and of all landmarks, of which two more define the next
/// window.
pub(super) const NAMED: usize = MEDIAPIPE.len();
const ALL: usize = 39;
/// Side of a heat map in cells, and the radius around a landmark in which it is read.
const MAP: usize = 64;
const REACH: usize = 3;
/// A heat map whose maximum around a landmark is lower than this is ignored.
const LOWEST: f32 = 0.5;

/// A landmark that a network detects in one window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SeenLandmark {
    /// In pixels of the picture.
    pub at: [f64; 2],
    /// 0 to 1.
    pub visibility: f64,
    /// In metres relative to the middle of the hips: right and down in the picture, and
    /// away from the camera.
    pub metres: [f64; 3],
}

/// The output of a network for a window.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub window: Window,
    /// Confidence that there is a person, 0 to 1.
    pub presence: f64,
    /// In the order of [`MEDIAPIPE`].
    pub landmarks: [SeenLandmark; NAMED],
    /// The window that these landmarks suggest.
    pub next: Window,
    /// Logits of the person's mask, in row-major order of the window.
    pub mask: Vec<f32>,
}

impl View {
    /// Returns left, top, right and bottom of the landmarks, within a picture of this size.
    pub fn bounds(&self, size: [f64; 2]) -> [f64; 4] {
        around(self.landmarks.iter().map(|l| [0, 1].map(|k| l.at[k].clamp(0.0, size[k]))))
    }
}

/// Returns an error unless the network has the inputs and outputs of a landmark network.
pub(super) fn check(network: &Network) -> Result<(), NetworkError> {
    let outputs: Vec<&[usize]> = network.output_shapes().collect();
    let wanted: [&[usize]; 5] =
        [&[1, 5 * ALL], &[1, 1], &[1, SIDE, SIDE, 1], &[1, MAP, MAP, ALL], &[1, 3 * ALL]];
    if network.input_shape() == [1, SIDE, SIDE, 3] && outputs == wanted {
        return Ok(());
    }
    Err(NetworkError::Format("it is not a landmark network (pose_landmark_*.tflite)".into()))
}

/// Returns the same landmark on the other side of the body.
fn other_side(i: usize) -> usize {
    match i {
        1..=3 => i + 3,
        4..=6 => i - 3,
        7..NAMED if i % 2 == 1 => i + 1,
        7..NAMED => i - 1,
        _ => i,
    }
}

/// Runs the network on a window of a picture, with its mask or without (empty then); `None` if
/// the output is not finite or suggests an unusable window.
pub(super) fn run_landmarks(
    network: &Network,
    photo: &Photo,
    window: &Window,
    with_mask: bool,
    memory: &mut Memory,
) -> Option<View> {
    let fill = |input: &mut [f32]| window.sample(photo, SIDE, [0.0, 1.0], Beyond::Edge, input);
    let outputs = network.run_in(memory, &[true, true, with_mask, true, true], fill);
    let [points, presence, mask, maps, metres] = outputs[..] else { return None };
    let (sin, cos) = libm::sincos(window.turn);
    let one = |k: usize| {
        let i = if window.mirrored { other_side(k) } else { k };
        let p = &points[5 * i..][..5];
        let at = window.pixel(refined(maps, i, [p[0], p[1]].map(|x| f64::from(x) / SIDE as f64)));
        let m = [0, 1, 2].map(|j| f64::from(metres[3 * i + j]));
        let across = if window.mirrored { -m[0] } else { m[0] };
        let metres = [cos * across - sin * m[1], sin * across + cos * m[1], m[2]];
        SeenLandmark { at, visibility: f64::from(sigmoid(p[3])), metres }
    };
    let next =
        Window { mirrored: window.mirrored, ..Window::around(one(NAMED).at, one(NAMED + 1).at) };
    let landmarks: [SeenLandmark; NAMED] = core::array::from_fn(one);
    let numbers =
        landmarks.iter().flat_map(|l| l.at.iter().chain(&l.metres).chain([&l.visibility]));
    let sound = next.is_sound() && numbers.chain([&f64::from(presence[0])]).all(|x| x.is_finite());
    sound.then(|| View {
        window: *window,
        presence: f64::from(presence[0]),
        landmarks,
        next,
        mask: mask.to_vec(),
    })
}

/// Returns a position, refined to the mean of the landmark's heat map around it if that
/// is confident.
fn refined(maps: &[f32], landmark: usize, at: [f64; 2]) -> [f64; 2] {
    let cell = at.map(|x| x * MAP as f64);
    if !cell.iter().all(|c| (0.0..MAP as f64).contains(c)) {
        return at;
    }
    let [column, row] = cell.map(|c| c as usize);
    let (mut sum, mut highest, mut mean) = (0.0, 0f32, [0.0, 0.0]);
    for r in row.saturating_sub(REACH)..(row + REACH + 1).min(MAP) {
        for c in column.saturating_sub(REACH)..(column + REACH + 1).min(MAP) {
            let heat = sigmoid(maps[(r * MAP + c) * ALL + landmark]);
            highest = highest.max(heat);
            sum += f64::from(heat);
            mean[0] += c as f64 * f64::from(heat);
            mean[1] += r as f64 * f64::from(heat);
        }
    }
    if highest >= LOWEST { mean.map(|m| m / (MAP as f64 * sum)) } else { at }
}
