//! A detected person: landmarks and a mask.

use super::landmarks::{NAMED, SIDE};
use super::window::Window;
use crate::nn::sigmoid;
use pcadlang_scene::vision::keypoints::MEDIAPIPE;

/// A landmark of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Landmark {
    /// In pixels of the photograph.
    pub at: [f64; 2],
    /// The standard deviation of a coordinate over the agreeing views, in pixels.
    pub spread: f64,
    /// The network's confidence that it is visible, 0 to 1.
    pub visibility: f64,
    /// In metres relative to the middle of the hips: right and down in the picture, and
    /// away from the camera.
    pub metres: [f64; 3],
}

/// An alternative pose that some views of a person agree on.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// In the order of [`MEDIAPIPE`].
    pub landmarks: [Landmark; NAMED],
    /// Number of views with this pose.
    pub views: usize,
}

/// A detected person.
#[derive(Clone, Debug)]
pub struct Person {
    /// Prominence of the person in the picture: the larger, the more often and
    /// confidently they are seen, the larger they are, and the nearer to the middle.
    pub score: f64,
    /// Confidence that this is a person, 0 to 1, in the view where that is largest: a
    /// detector's score, less where landmarks do not fill its box; without a detector, at most
    /// a half.
    pub sure: f64,
    /// Left, top, right and bottom of all landmarks, in pixels.
    pub bounds: [f64; 4],
    /// The length of the torso in pixels.
    pub torso: f64,
    /// In the order of [`MEDIAPIPE`].
    pub landmarks: [Landmark; NAMED],
    /// Number of views that saw them.
    pub views: usize,
    /// Number of views that agree.
    pub agreeing: usize,
    /// Poses of the other views, most views first.
    pub others: Vec<Hypothesis>,
    /// The masks of the agreeing views, with their windows in pixels of the photograph.
    pub(super) masks: Vec<(Window, Vec<f32>)>,
}

impl Person {
    /// Returns a landmark by its name in [`MEDIAPIPE`].
    pub fn landmark(&self, name: &str) -> Option<&Landmark> {
        MEDIAPIPE.iter().position(|n| *n == name).and_then(|i| self.landmarks.get(i))
    }

    /// Returns the probability of each pixel to be the person's, 0 to 1, in a picture of
    /// this size with the same content as the photograph, which is `photo_width` pixels
    /// wide. It is the mean over the agreeing views.
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

/// Returns the interpolated probability at a position of a window's mask; 0 outside.
pub(super) fn at(mask: &[f32], [u, v]: [f64; 2]) -> f32 {
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
