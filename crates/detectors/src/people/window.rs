//! Square windows of a picture, rotated and optionally mirrored, as input of networks.

use core::f64::consts::{FRAC_PI_2, PI, TAU};
use pcadlang_scene::vision::Photo;

/// A square in a picture. Positions in it run from 0 to 1, right and down along its own
/// sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Its centre, in pixels.
    pub centre: [f64; 2],
    /// Its side, in pixels.
    pub side: f64,
    /// Its clockwise rotation, in radians.
    pub turn: f64,
    /// True if left and right are exchanged in it.
    pub mirrored: bool,
}

/// The value of pixels beyond the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beyond {
    Black,
    /// The nearest pixel.
    Edge,
}

impl Window {
    /// Returns a window with the whole picture in its middle, padded on every side by a
    /// fraction of its longer side.
    pub fn whole(width: u32, height: u32, padding: f64) -> Window {
        let centre = [f64::from(width) / 2.0, f64::from(height) / 2.0];
        Window {
            centre,
            side: f64::from(width.max(height)) * (1.0 + 2.0 * padding),
            turn: 0.0,
            mirrored: false,
        }
    }

    /// Returns the window of a person: centred at the hips, and rotated so that a second
    /// point, whose distance gives its size, is above them; as in MediaPipe.
    pub(super) fn around(hips: [f64; 2], above: [f64; 2]) -> Window {
        let [dx, dy] = [above[0] - hips[0], above[1] - hips[1]];
        let turn = FRAC_PI_2 - libm::atan2(-dy, dx);
        let turn = turn - TAU * libm::floor((turn + PI) / TAU);
        Window { centre: hips, side: 2.5 * libm::hypot(dx, dy), turn, mirrored: false }
    }

    /// Returns the pixel at a position.
    pub fn pixel(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let along = if self.mirrored { -self.side } else { self.side };
        let (x, y) = ((u - 0.5) * along, (v - 0.5) * self.side);
        let (sin, cos) = libm::sincos(self.turn);
        [self.centre[0] + cos * x - sin * y, self.centre[1] + sin * x + cos * y]
    }

    /// Returns the position of a pixel.
    pub fn position(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.turn);
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let (u, v) = ((cos * dx + sin * dy) / self.side, (cos * dy - sin * dx) / self.side);
        [if self.mirrored { -u } else { u } + 0.5, v + 0.5]
    }

    /// Returns whether a window can be sampled: its numbers are finite and its size is
    /// reasonable.
    pub(super) fn is_sound(&self) -> bool {
        let all = [self.centre[0], self.centre[1], self.turn, self.side];
        all.iter().all(|x| x.is_finite()) && (1e-3..1e7).contains(&self.side)
    }

    /// Fills `out` with `n` x `n` samples of the picture, with red, green and blue from `lo`
    /// (black) to `hi`. Samples are interpolated linearly; sample (i, j) is at (i / n, j
    /// / n), as in MediaPipe.
    pub(super) fn sample(
        &self,
        photo: &Photo,
        n: usize,
        [lo, hi]: [f32; 2],
        beyond: Beyond,
        out: &mut [f32],
    ) {
        let rgb = photo.rgb();
        let (width, height) = (i64::from(rgb.width()), i64::from(rgb.height()));
        let at = |x: i64, y: i64| -> [f32; 3] {
            let is_in = (0..width).contains(&x) && (0..height).contains(&y);
            if beyond == Beyond::Black && !is_in {
                return [0.0; 3];
            }
            let (x, y) = (x.clamp(0, width - 1) as u32, y.clamp(0, height - 1) as u32);
            rgb.get_pixel(x, y).0.map(f32::from)
        };
        let scale = (hi - lo) / 255.0;
        let mut samples = out.as_chunks_mut::<3>().0.iter_mut();
        // Positions are linear in the sample's row and column.
        let (start, right, down) =
            (self.pixel([0.0, 0.0]), self.pixel([1.0, 0.0]), self.pixel([0.0, 1.0]));
        for j in 0..n {
            for (i, sample) in samples.by_ref().take(n).enumerate() {
                let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
                let [x, y] =
                    [0, 1].map(|k| start[k] + u * (right[k] - start[k]) + v * (down[k] - start[k]));
                let (left, top) = (libm::floor(x), libm::floor(y));
                let (fx, fy) = ((x - left) as f32, (y - top) as f32);
                let (left, top) = (left as i64, top as i64);
                let (a, b) = (at(left, top), at(left + 1, top));
                let (c, d) = (at(left, top + 1), at(left + 1, top + 1));
                for (k, s) in sample.iter_mut().enumerate() {
                    let (ab, cd) = (a[k] * (1.0 - fx) + b[k] * fx, c[k] * (1.0 - fx) + d[k] * fx);
                    *s = lo + scale * (ab * (1.0 - fy) + cd * fy);
                }
            }
        }
    }
}
