//! Where pieces of contour lie among the samples of a grid, several at a time: all that can be
//! found without reading the samples, in loops that are vectorised.

use super::super::elements::{CHANNELS, Edges, channel};
use crate::contours::ContourSlice;

/// How many pieces at a time.
pub(super) const AT_A_TIME: usize = 32;

/// A number for each piece.
type List<T> = [T; AT_A_TIME];

/// Pieces among the samples. Those that are not in view have length 0.
pub(super) struct Places {
    /// The sample above and to the left of the middle.
    pub first: List<i32>,
    /// Fractions to the right and down.
    right: List<f32>,
    down: List<f32>,
    /// The length in view, in pixels of the frame.
    pub length: List<f32>,
    /// The first of the two channels next to the orientation, and the weight of the second.
    pub channel: List<i32>,
    fraction: List<f32>,
}

impl Default for Places {
    fn default() -> Self {
        let (none, zero) = ([0; AT_A_TIME], [0.0; AT_A_TIME]);
        Places { first: none, right: zero, down: zero, length: zero, channel: none, fraction: zero }
    }
}

impl Places {
    /// Finds the pieces from one on.
    #[inline(always)]
    pub fn set(&mut self, grid: &Edges, elements: &ContourSlice<'_>, first: usize) {
        let (x, y) = (part(elements.x, first), part(elements.y, first));
        let (tx, ty) = (part(elements.tx, first), part(elements.ty, first));
        let length = part(elements.length, first);
        let count = elements.len() - first;
        for i in 0..AT_A_TIME {
            let weight = elements.weight([x[i], y[i]], [tx[i], ty[i]], length[i]);
            self.length[i] = if i < count { length[i] * weight } else { 0.0 };
            (self.first[i], self.right[i], self.down[i]) = grid.place(x[i], y[i]);
            let k = channel(tx[i], ty[i]);
            self.channel[i] = (k as i32).min(CHANNELS as i32 - 1);
            self.fraction[i] = k - self.channel[i] as f32;
        }
    }

    /// The shares of the four samples around a piece, in the first channel and in the second.
    #[inline(always)]
    pub fn shares(&self, i: usize) -> [f32; 8] {
        let (x, y, f) = (self.right[i], self.down[i], self.fraction[i]);
        let around = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
        let mut shares = [0.0; 8];
        for (i, share) in around.iter().enumerate() {
            (shares[i], shares[i + 4]) = ((1.0 - f) * share, f * share);
        }
        shares
    }
}

/// The entries of a list from one on, and zeros behind the last.
#[inline(always)]
fn part(list: &[f32], first: usize) -> List<f32> {
    let list = list.get(first..).unwrap_or_default();
    list.first_chunk().copied().unwrap_or_else(|| padded(list))
}

#[cold]
fn padded(list: &[f32]) -> List<f32> {
    let mut part = [0.0; AT_A_TIME];
    part.iter_mut().zip(list).for_each(|(to, from)| *to = *from);
    part
}
