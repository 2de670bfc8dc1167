//! Cuts an object out around a seed, as in GrabCut (Rother et al. 2004, ACM Trans.
//! Graphics 23, 309-314): colours of the object and its surroundings are learned from the
//! last mask, and a Markov random field with stronger coupling between similar colours
//! gives the next one. Instead of a graph cut it uses mean-field inference (Kraehenbuehl
//! & Koltun 2011, NIPS), here with four neighbours, which takes a fifth of the time.

use super::area::{Area, largest};
use super::clusters::LETTERS;
use super::features::PictureFeatures;

/// Number of times colours are learned, and sweeps of mean field after each time.
const ESTIMATES: usize = 3;
const SWEEPS: usize = 10;
/// Beliefs have converged if they change by less than this.
const SETTLED: f32 = 0.02;
/// The weight of neighbours.
const LAMBDA: f32 = 0.8;
/// Bound on the log-likelihood ratio of a pixel's colour.
const CLIP: f32 = 3.0;

/// Data shared by all cuts of a picture: the letters (codebook entries) of its pixels,
/// and the similarity of neighbours.
pub struct Field {
    width: usize,
    pub codewords: Vec<u8>,
    /// Similarity of each pixel to the one on its left, with one extra entry.
    left: Vec<f32>,
    /// Similarity to the one above, with an extra row.
    above: Vec<f32>,
}

impl Field {
    /// Builds the field of a picture with these letters.
    pub fn new(picture: &PictureFeatures, codewords: Vec<u8>) -> Field {
        let (w, h) = (picture.width, picture.height);
        let squared = |p: usize, q: usize| {
            let (a, b) = (picture.lab[p], picture.lab[q]);
            (a[0] - b[0]) * (a[0] - b[0])
                + (a[1] - b[1]) * (a[1] - b[1])
                + (a[2] - b[2]) * (a[2] - b[2])
        };
        // The similarity to anything beyond the frame is 0.
        let n = w * h;
        let side = |p: usize| {
            if !p.is_multiple_of(w) && p < n { squared(p, p - 1) } else { f32::INFINITY }
        };
        let over = |p: usize| if p >= w && p < n { squared(p, p - w) } else { f32::INFINITY };
        let mut left: Vec<f32> = (0..w * h + 1).map(side).collect();
        let mut above: Vec<f32> = (0..w * h + w).map(over).collect();
        let all = left.iter().chain(&above).filter(|d| d.is_finite());
        let mean = all.map(|d| f64::from(*d)).sum::<f64>() / (2 * w * h) as f64;
        let beta = 0.5 / mean.max(1e-3) as f32;
        left.iter_mut().chain(&mut above).for_each(|d| *d = libm::expf(-beta * *d));
        Field { width: w, codewords, left, above }
    }

    /// Cuts out the object at a seed; `None` if nothing stands out.
    pub fn cut(&self, seed: &Area) -> Option<Area> {
        let by = (0.22 * (seed.count as f64).sqrt()).max(4.0) as usize;
        // Pixels with even and with odd sum of column and row.
        let mut window = [const { Vec::new() }; 2];
        for (i, j) in seed.dilated(by).points() {
            window[(i + j) % 2].push(j * self.width + i);
        }
        let mut mask = seed.pixels.bools();
        let mut belief = vec![0.0f32; mask.len()];
        for _ in 0..ESTIMATES {
            let gain = self.gains(&window, &mask)?;
            self.mean_field(&window, &gain, &mask, &mut belief);
            mask.iter_mut().zip(&belief).for_each(|(m, b)| *m = *b > 0.5);
        }
        Some(largest(self.width, &mask)?.filled())
    }

    /// Returns for each letter the log ratio of its frequency on the object and beside
    /// it; `None` if either is empty.
    fn gains(&self, window: &[Vec<usize>; 2], mask: &[bool]) -> Option<[f32; LETTERS]> {
        let mut counts = [[0u32; LETTERS]; 2];
        for &p in window.iter().flatten() {
            counts[usize::from(mask[p])][usize::from(self.codewords[p])] += 1;
        }
        let totals = counts.map(|c| c.iter().sum::<u32>());
        if totals.contains(&0) {
            return None;
        }
        // Half a pixel more per letter, so that the log ratio of unseen letters is
        // finite.
        let part = |side: usize, l: usize| {
            let all = totals[side] as f32 + 0.5 * LETTERS as f32;
            (counts[side][l] as f32 + 0.5) / all
        };
        Some(std::array::from_fn(|l| libm::logf(part(1, l) / part(0, l)).clamp(-CLIP, CLIP)))
    }

    /// Updates the belief of each pixel of the window to be on the object, starting from
    /// the last mask. The two halves of the window alternate: no two neighbours change at
    /// once, so the iteration converges.
    fn mean_field(
        &self,
        window: &[Vec<usize>; 2],
        gain: &[f32; LETTERS],
        mask: &[bool],
        belief: &mut [f32],
    ) {
        let (w, n) = (self.width, self.codewords.len());
        belief.iter_mut().zip(mask).for_each(|(b, m)| *b = f32::from(u8::from(*m)));
        for _ in 0..SWEEPS {
            let mut most = 0.0f32;
            for &p in window.iter().flatten() {
                // Without a neighbour the weight is 0, whichever pixel is used in its
                // place.
                let towards = |q: usize| 2.0 * belief[q.min(n - 1)] - 1.0;
                let pull = self.left[p] * towards(p.saturating_sub(1))
                    + self.left[p + 1] * towards(p + 1)
                    + self.above[p] * towards(p.saturating_sub(w))
                    + self.above[p + w] * towards(p + w);
                let log_odds = gain[usize::from(self.codewords[p])] + 2.0 * LAMBDA * pull;
                let new = 1.0 / (1.0 + libm::expf(-log_odds));
                most = most.max((new - belief[p]).abs());
                belief[p] = new;
            }
            if most < SETTLED {
                break;
            }
        }
    }
}
