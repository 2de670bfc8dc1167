//! A set of pixels of an image, with a fast test of whether a rectangle contains any of
//! them.

use crate::render::Camera;
use crate::render::simd::vectorised;

/// A set of pixels. Reused from image to image.
#[derive(Default)]
pub(in crate::render) struct PixelBitmap {
    /// A bit for each pixel, row by row, and at least one spare word.
    words: Vec<u64>,
    /// For each pixel, the side of the smallest square with the pixel in its upper left
    /// corner that contains a set pixel; [`FAR`] if that is larger than [`SIDE`]. Padded
    /// with columns on the right and a row below.
    reach: Vec<u8>,
    /// Entries of `reach` per row.
    stride: usize,
    /// A copy of part of a row, read while the row is written.
    read: Vec<u8>,
    /// The first and last column, and row, with a set pixel; empty if the first is the
    /// larger.
    columns: [usize; 2],
    rows: [usize; 2],
    width: u32,
}

/// The largest side of a square that a single entry of `reach` answers for.
const SIDE: usize = 16;
/// Rows are processed in multiples of this many pixels, which makes whole vectors.
const WIDE: usize = 64;
/// Stands for any side larger than [`SIDE`].
const FAR: u8 = SIDE as u8 + 1;

impl PixelBitmap {
    /// Removes all pixels and resizes to a camera's image.
    pub fn clear(&mut self, camera: &Camera) {
        self.width = camera.width;
        self.stride = (camera.width as usize).next_multiple_of(WIDE) + WIDE;
        (self.columns, self.rows) = ([usize::MAX, 0], [usize::MAX, 0]);
        self.words.clear();
        self.words.resize(camera.pixels() / 64 + 2, 0);
        self.reach.clear();
        self.reach.resize(self.stride * (camera.height as usize + 1), FAR);
    }

    /// Adds a pixel of the image.
    #[inline]
    pub fn set(&mut self, pixel: u32) {
        let [row, column] = [pixel / self.width, pixel % self.width].map(|v| v as usize);
        let at = row * self.stride + column;
        self.rows = [self.rows[0].min(row), self.rows[1].max(row)];
        self.columns = [self.columns[0].min(column), self.columns[1].max(column)];
        if let (Some(word), Some(reach)) =
            (self.words.get_mut(pixel as usize / 64), self.reach.get_mut(at))
        {
            *word |= 1 << (pixel % 64);
            *reach = 1;
        }
    }

    /// Must be called after the last pixel is set, before rectangles are tested.
    pub fn finish(&mut self) {
        let PixelBitmap {
            reach, stride, read, columns: [left, right], rows: [top, bottom], ..
        } = self;
        if *top > *bottom {
            return;
        }
        // Whole vectors of entries, and [`SIDE`] more that are only read.
        let (first, stride) = (left.saturating_sub(SIDE) / WIDE * WIDE, *stride);
        let count = (*right + 1 - first).next_multiple_of(WIDE);
        let columns = first..first + count + SIDE;
        read.resize(count + SIDE, FAR);
        vectorised(
            #[inline(always)]
            || {
                for row in (top.saturating_sub(SIDE)..=*bottom).rev() {
                    let (above, below) = reach.split_at_mut((row + 1) * stride);
                    let own =
                        above.get_mut(row * stride..).and_then(|row| row.get_mut(columns.clone()));
                    let (Some(own), Some(below)) = (own, below.get(columns.clone())) else {
                        return;
                    };
                    // A square is its first pixel, and the squares one shorter that begin
                    // to the right, below and diagonally.
                    for ((own, down), corner) in
                        own[..count].iter_mut().zip(&below[..count]).zip(&below[1..])
                    {
                        *own = (*own).min((*down).min(*corner) + 1);
                    }
                    for step in [1, 4] {
                        read.copy_from_slice(own);
                        let [a, b, c] = [1, 2, 3].map(|n| &read[n * step..][..count]);
                        let more = step as u8;
                        for (((own, a), b), c) in own[..count].iter_mut().zip(a).zip(b).zip(c) {
                            *own = (*own).min(*a + more).min((*b + 2 * more).min(*c + 3 * more));
                        }
                    }
                }
            },
        );
    }

    /// The bits of all pixels, 64 per word.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// The bits of up to 64 consecutive pixels.
    #[inline(always)]
    pub fn window(&self, from: usize, count: usize) -> u64 {
        let Some([low, high]) = self.words.get(from / 64..).and_then(|m| m.first_chunk()) else {
            return 0;
        };
        let shift = from % 64;
        let word = (low >> shift) | (high << 1 << (63 - shift));
        if count < 64 { word & ((1 << count) - 1) } else { word }
    }

    /// True if a rectangle, which may be empty, may contain a set pixel: false only if
    /// the square with the same upper left corner that covers it contains none.
    #[inline(always)]
    pub fn may_hold(&self, [[left, right], [top, bottom]]: [[usize; 2]; 2]) -> bool {
        let side = right.wrapping_sub(left).max(bottom.wrapping_sub(top));
        let reach = self.reach.get(top * self.stride + left).copied().unwrap_or_default();
        (usize::from(reach) <= side) | (side > SIDE)
    }

    /// True if a rectangle that is not empty contains a set pixel.
    #[inline(always)]
    pub fn intersects(&self, [[left, right], [top, bottom]]: [[usize; 2]; 2]) -> bool {
        let (columns, rows) = (right - left, bottom - top);
        // Three squares in a line, at both ends and in the middle, cover a rectangle that
        // is at most three times as long as wide.
        let side = columns.min(rows);
        let (across, down) = (columns - side, rows - side);
        if side > SIDE || across + down > 2 * side {
            return self.intersects_long([left, right], [top, bottom], side.min(SIDE));
        }
        let at = top * self.stride + left;
        let near = |at: usize| self.reach.get(at).is_some_and(|reach| usize::from(*reach) <= side);
        near(at)
            | near(at + across / 2 + down / 2 * self.stride)
            | near(at + across + down * self.stride)
    }

    /// As [`PixelBitmap::intersects`], for any rectangle, covered by squares of a given side.
    #[inline(never)]
    fn intersects_long(
        &self,
        [left, right]: [usize; 2],
        [top, bottom]: [usize; 2],
        side: usize,
    ) -> bool {
        (top..bottom).step_by(side).any(|y| {
            let row = y.min(bottom - side) * self.stride;
            (left..right).step_by(side).any(|x| {
                let reach = self.reach.get(row + x.min(right - side));
                reach.is_some_and(|reach| usize::from(*reach) <= side)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing::Uniform;

    #[test]
    fn windows_are_runs_of_bits() {
        let bitmap = PixelBitmap {
            words: vec![0x8000_0000_0000_0001u64, 0b1011, 0],
            ..PixelBitmap::default()
        };
        assert_eq!(bitmap.window(0, 64), bitmap.words[0]);
        assert_eq!(bitmap.window(0, 63), 1);
        assert_eq!(bitmap.window(63, 5), 0b10111);
        assert_eq!(bitmap.window(64, 2), 0b11);
        assert_eq!(bitmap.window(65, 64), 0b101);
        assert_eq!((bitmap.window(128, 8), bitmap.window(1 << 40, 8)), (0, 0));
    }

    #[test]
    fn rectangles_that_hold_marks_are_told() {
        let mut random = Uniform(31);
        let mut bitmap = PixelBitmap::default();
        let mut held = 0;
        for (width, height) in [(1, 1), (7, 90), (128, 96), (200, 33)] {
            let camera = Camera::default_for(width, height);
            let mut below = |n: u32| (random.next() * f64::from(n)) as u32;
            for _ in 0..20 {
                bitmap.clear(&camera);
                let set: Vec<u32> =
                    (0..1 + width * height / 300).map(|_| below(width * height)).collect();
                set.iter().for_each(|pixel| bitmap.set(*pixel));
                bitmap.finish();
                for _ in 0..200 {
                    let [x, y] = [below(width), below(height)];
                    let most = [3, 9, 30, 200][below(4) as usize];
                    let [right, bottom] =
                        [x + 1 + below(most.min(width - x)), y + 1 + below(most.min(height - y))];
                    let inside = |p: &u32| {
                        (x..right).contains(&(p % width)) && (y..bottom).contains(&(p / width))
                    };
                    let wanted = set.iter().any(inside);
                    let extent = [[x, right], [y, bottom]].map(|ends| ends.map(|v| v as usize));
                    assert_eq!(
                        bitmap.intersects(extent),
                        wanted,
                        "{extent:?} in {width} x {height}"
                    );
                    assert!(!wanted || bitmap.may_hold(extent), "{extent:?} in {width} x {height}");
                    held += usize::from(wanted);
                }
            }
        }
        assert!((2000..14000).contains(&held), "{held}");
    }
}
