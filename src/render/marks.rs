//! Marked pixels of an image, so kept that a rectangle without marks is quickly told.

use super::Camera;

/// Marks at pixels. Reused from image to image.
#[derive(Default)]
pub(super) struct Marks {
    /// A bit for each pixel, row by row, and one word more.
    words: Vec<u64>,
    /// The same by blocks of eight rows of eight pixels, and a block more to the right and below.
    blocks: Vec<u64>,
    /// Blocks in a row.
    stride: usize,
    /// By squares of 4, 8 and 16 pixels a side.
    near: [Near; 3],
    width: u32,
}

/// Whether there is a mark in a square of pixels or in those to the right, below, or both; there is a row of squares above the
/// image and a column before it.
#[derive(Default)]
struct Near {
    held: Vec<bool>,
    /// Squares in a row.
    stride: usize,
    /// Their side, as a power of two.
    shift: u32,
}

/// As many bytes as pixels in a block's row, each 1.
const EACH_ROW: u64 = 0x0101_0101_0101_0101;

impl Marks {
    /// Removes all marks, for a camera's image.
    pub fn clear(&mut self, camera: &Camera) {
        self.width = camera.width;
        self.stride = camera.width as usize / 8 + 2;
        self.words.clear();
        self.words.resize(camera.pixels() / 64 + 2, 0);
        self.blocks.clear();
        self.blocks.resize(self.stride * (camera.height as usize / 8 + 2), 0);
        for (near, shift) in self.near.iter_mut().zip([2, 3, 4]) {
            let [columns, rows] = [camera.width, camera.height].map(|side| (side >> shift) as usize + 2);
            (near.stride, near.shift) = (columns, shift);
            near.held.clear();
            near.held.resize(columns * rows, false);
        }
    }

    /// Marks a pixel of the image.
    #[inline]
    pub fn set(&mut self, pixel: u32) {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let block = (y / 8) as usize * self.stride + (x / 8) as usize;
        if let (Some(word), Some(block)) = (self.words.get_mut(pixel as usize / 64), self.blocks.get_mut(block)) {
            *word |= 1 << (pixel % 64);
            *block |= 1 << (8 * (y % 8) + x % 8);
        }
        for Near { held, stride, shift } in &mut self.near {
            let at = ((y >> *shift) as usize + 1) * *stride + (x >> *shift) as usize + 1;
            for at in [at, at - 1, at - *stride, at - *stride - 1] {
                if let Some(held) = held.get_mut(at) {
                    *held = true;
                }
            }
        }
    }

    /// All marks, 64 pixels at a time.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// The marks of some pixels in a row, at most 64, as bits.
    #[inline(always)]
    pub fn window(&self, from: usize, count: usize) -> u64 {
        let Some([low, high]) = self.words.get(from / 64..).and_then(|m| m.first_chunk()) else { return 0 };
        let shift = from % 64;
        let word = (low >> shift) | (high << 1 << (63 - shift));
        if count < 64 { word & ((1 << count) - 1) } else { word }
    }

    /// Whether there is a mark in some columns and rows.
    #[inline(always)]
    pub fn hold(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2]) -> bool {
        let (columns, rows) = (right - left, bottom - top);
        // Quickly told for most: what is not longer than a square lies in four of them.
        let side = columns.max(rows);
        let Near { stride, shift, held } = &self.near[usize::from(side > 4) + usize::from(side > 8)];
        let at = ((top >> shift) + 1) * stride + (left >> shift) + 1;
        if side <= 16 && !held.get(at).is_some_and(|near| *near) {
            return false;
        }
        if side > 8 {
            return self.hold_many([left, right], [top, bottom]);
        }
        // At most two blocks each way.
        let at = top / 8 * self.stride + left / 8;
        let pair =
            |at: usize| self.blocks.get(at..).and_then(|b| b.first_chunk::<2>()).copied().unwrap_or([u64::MAX; 2]);
        let ([a, b], [c, d]) = (pair(at), pair(at + self.stride));
        let across = ((1u64 << columns) - 1) << (left % 8);
        let [first, second] = [across & 0xff, across >> 8].map(|row| row * EACH_ROW);
        let above = rows.min(8 - top % 8);
        let upper = (u64::MAX >> (64 - 8 * above)) << (8 * (top % 8));
        // Two shifts, since one of 64 is none.
        let lower = (u64::MAX >> 1) >> (63 - 8 * (rows - above));
        (((a & first) | (b & second)) & upper) | (((c & first) | (d & second)) & lower) != 0
    }

    #[inline(never)]
    fn hold_many(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2]) -> bool {
        (top..bottom).any(|row| {
            let start = row * self.width as usize;
            (left..right).step_by(64).any(|at| self.window(start + at, (right - at).min(64)) != 0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing::Uniform;

    #[test]
    fn windows_are_runs_of_bits() {
        let marks = Marks { words: vec![0x8000_0000_0000_0001u64, 0b1011, 0], ..Marks::default() };
        assert_eq!(marks.window(0, 64), marks.words[0]);
        assert_eq!(marks.window(0, 63), 1);
        assert_eq!(marks.window(63, 5), 0b10111);
        assert_eq!(marks.window(64, 2), 0b11);
        assert_eq!(marks.window(65, 64), 0b101);
        assert_eq!((marks.window(128, 8), marks.window(1 << 40, 8)), (0, 0));
    }

    #[test]
    fn rectangles_that_hold_marks_are_told() {
        let mut random = Uniform(31);
        let mut marks = Marks::default();
        let mut held = 0;
        for (width, height) in [(1, 1), (7, 90), (128, 96), (200, 33)] {
            let camera = Camera::default_for(width, height);
            let mut below = |n: u32| (random.next() * f64::from(n)) as u32;
            for _ in 0..20 {
                marks.clear(&camera);
                let set: Vec<u32> = (0..1 + width * height / 300).map(|_| below(width * height)).collect();
                set.iter().for_each(|pixel| marks.set(*pixel));
                for _ in 0..200 {
                    let [x, y] = [below(width), below(height)];
                    let most = [3, 9, 30, 200][below(4) as usize];
                    let [right, bottom] = [x + 1 + below(most.min(width - x)), y + 1 + below(most.min(height - y))];
                    let inside = |p: &u32| (x..right).contains(&(p % width)) && (y..bottom).contains(&(p / width));
                    let wanted = set.iter().any(inside);
                    let extent = [[x, right], [y, bottom]].map(|ends| ends.map(|v| v as usize));
                    assert_eq!(marks.hold(extent[0], extent[1]), wanted, "{extent:?} in {width} x {height}");
                    held += usize::from(wanted);
                }
            }
        }
        assert!((2000..14000).contains(&held), "{held}");
    }
}
