//! Sets of pixels as bits: dilation, and filling from seeds, a word at a time.

use std::ops::Range;

/// A set of pixels. Each row begins with a new word, of which the lowest bit is the first
/// column; bits beyond a row's end are 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    pub width: usize,
    pub height: usize,
    words: Vec<u64>,
}

impl Pixels {
    /// Returns an empty set.
    pub fn none(width: usize, height: usize) -> Pixels {
        Pixels { width, height, words: vec![0; width.div_ceil(64) * height] }
    }

    /// Returns the pixels for which `on` holds, by their index in row-major order.
    pub fn new(width: usize, height: usize, on: impl Fn(usize) -> bool) -> Pixels {
        let mut all = Pixels::none(width, height);
        for j in 0..height {
            for (k, word) in all.row_mut(j).iter_mut().enumerate() {
                let columns = 64 * k..width.min(64 * (k + 1));
                *word = columns.rev().fold(0, |word, i| word << 1 | u64::from(on(j * width + i)));
            }
        }
        all
    }

    fn stride(&self) -> usize {
        self.width.div_ceil(64)
    }

    /// The words of a row.
    pub fn row(&self, j: usize) -> &[u64] {
        let stride = self.stride();
        &self.words[j * stride..(j + 1) * stride]
    }

    fn row_mut(&mut self, j: usize) -> &mut [u64] {
        let stride = self.stride();
        &mut self.words[j * stride..(j + 1) * stride]
    }

    /// The words of all rows.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// True if the pixel in column `i` of row `j` is on.
    pub fn has(&self, i: usize, j: usize) -> bool {
        self.words[j * self.stride() + i / 64] >> (i % 64) & 1 == 1
    }

    /// Adds the pixel in column `i` of row `j`.
    pub fn insert(&mut self, i: usize, j: usize) {
        let stride = self.stride();
        self.words[j * stride + i / 64] |= 1 << (i % 64);
    }

    /// Adds another set of the same picture.
    pub fn add(&mut self, other: &Pixels) {
        self.words.iter_mut().zip(&other.words).for_each(|(a, b)| *a |= b);
    }

    /// Removes the pixels of some columns and rows.
    pub fn clear(&mut self, columns: Range<usize>, rows: Range<usize>) {
        for j in rows {
            for (k, word) in self.row_mut(j).iter_mut().enumerate() {
                *word &= !(before(columns.end, k) & !before(columns.start, k));
            }
        }
    }

    /// Columns and rows of the pixels that are on, in raster order.
    pub fn points(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let row = |j: usize| self.row(j).iter().enumerate().map(move |(k, word)| (j, k, *word));
        (0..self.height).flat_map(row).filter(|(_, _, word)| *word != 0).flat_map(|(j, k, word)| {
            let rest = std::iter::successors(Some(word), |word| Some(word & word.wrapping_sub(1)));
            rest.take_while(|word| *word != 0)
                .map(move |word| (64 * k + word.trailing_zeros() as usize, j))
        })
    }

    /// The pixels in row-major order, true if on.
    pub fn bools(&self) -> Vec<bool> {
        let row = |j: usize| (0..self.width).map(move |i| self.has(i, j));
        (0..self.height).flat_map(row).collect()
    }

    /// The pixels that are off.
    pub fn complement(&self) -> Pixels {
        let mut out = self.clone();
        for j in 0..out.height {
            let width = out.width;
            for (k, word) in out.row_mut(j).iter_mut().enumerate() {
                *word = !*word & before(width, k);
            }
        }
        out
    }

    /// Returns the pixels that are on with all four neighbours, none of which is outside the
    /// picture.
    pub fn inner(&self) -> Pixels {
        let mut out = Pixels::none(self.width, self.height);
        for j in 1..self.height.saturating_sub(1) {
            let (row, above, below) = (self.row(j), self.row(j - 1), self.row(j + 1));
            for (k, word) in out.row_mut(j).iter_mut().enumerate() {
                *word = row[k] & above[k] & below[k] & shifted(row, k, 1) & shifted(row, k, -1);
            }
        }
        out
    }

    /// Returns the pixels at most `by` columns and rows away from one that is on.
    pub fn dilated(&self, by: usize) -> Pixels {
        let (mut from, mut to) = (self.clone(), self.clone());
        // At the frame only half of what is near a pixel is there to be shifted.
        let mut reach = 0;
        while reach < by {
            let step = (reach + 1).min(by - reach);
            for j in 0..self.height {
                let row = from.row(j);
                if row.iter().all(|word| *word == 0) {
                    continue;
                }
                for (k, word) in to.row_mut(j).iter_mut().enumerate() {
                    let sides = shifted(row, k, step as isize) | shifted(row, k, -(step as isize));
                    *word |= sides & before(self.width, k);
                }
            }
            from.words.copy_from_slice(&to.words);
            let stride = self.stride();
            for (word, above) in to.words.iter_mut().skip(step * stride).zip(&from.words) {
                *word |= above;
            }
            for (word, below) in to.words.iter_mut().zip(from.words.iter().skip(step * stride)) {
                *word |= below;
            }
            from.words.copy_from_slice(&to.words);
            reach += step;
        }
        to
    }

    /// Adds all pixels of `room` that are 4-connected within it to one that is on. All that
    /// are on must be in it.
    pub fn spread_within(&mut self, room: &Pixels) {
        let mut changed = (0..self.height).fold(false, |any, j| self.spread_row(room, j) | any);
        while changed {
            changed = false;
            let up = (1..self.height).map(|j| (j - 1, j));
            let down = (1..self.height).rev().map(|j| (j, j - 1));
            for (from, to) in up.chain(down) {
                let mut any = false;
                for k in 0..self.stride() {
                    let new = self.row(from)[k] & room.row(to)[k] & !self.row(to)[k];
                    self.row_mut(to)[k] |= new;
                    any |= new != 0;
                }
                if any {
                    self.spread_row(room, to);
                    changed = true;
                }
            }
        }
    }

    /// Does so within a row, and returns whether any pixel is on.
    fn spread_row(&mut self, room: &Pixels, j: usize) -> bool {
        let (row, room) = (self.row_mut(j), room.row(j));
        let mut next = 0;
        for (word, room) in row.iter_mut().zip(room) {
            *word = upwards(*word | next & room, *room);
            next = *word >> 63;
        }
        let mut next = 0;
        for (word, room) in row.iter_mut().zip(room).rev() {
            let flipped = upwards((*word | next & room).reverse_bits(), room.reverse_bits());
            *word = flipped.reverse_bits();
            next = *word << 63;
        }
        row.iter().any(|word| *word != 0)
    }
}

/// The bits of a row's word `k` that are columns before `end`.
fn before(end: usize, k: usize) -> u64 {
    let columns = end.saturating_sub(64 * k);
    if columns >= 64 { u64::MAX } else { (1 << columns) - 1 }
}

/// Returns word `k` of a row that is shifted to later columns by `by`.
fn shifted(row: &[u64], k: usize, by: isize) -> u64 {
    let word = |k: isize| usize::try_from(k).ok().and_then(|k| row.get(k)).copied().unwrap_or(0);
    let (whole, part) = (by.div_euclid(64), by.rem_euclid(64) as u32);
    let k = k as isize - whole;
    let carried = word(k - 1).checked_shr(64 - part).unwrap_or(0);
    word(k) << part | carried
}

/// Spreads bits to higher ones within `room`, by doubling.
fn upwards(mut bits: u64, mut room: u64) -> u64 {
    let mut by = 1;
    while by < 64 {
        bits |= room & bits << by;
        room &= room << by;
        by *= 2;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::super::area::Area;
    use super::super::components::components;
    use super::*;
    use proptest::prelude::*;

    const HEIGHT: usize = 9;

    /// Pictures one, two and three words wide.
    fn pictures() -> impl Strategy<Value = Pixels> {
        let picture = |width: usize| {
            let one = proptest::collection::vec(0u8..4, width * HEIGHT);
            (one, 1u8..4)
                .prop_map(move |(values, below)| Pixels::new(width, HEIGHT, |p| values[p] < below))
        };
        prop_oneof![Just(5usize), Just(64), Just(67), Just(130)].prop_flat_map(picture)
    }

    /// Labels of the components by spreading the least index until nothing changes.
    fn least(pixels: &Pixels) -> Vec<usize> {
        let w = pixels.width;
        let mut of: Vec<usize> = (0..w * HEIGHT).collect();
        let on = |p: usize| pixels.has(p % w, p / w);
        loop {
            let last = of.clone();
            for p in 0..of.len() {
                let left = (p % w > 0).then(|| (p, p - 1));
                let above = (p >= w).then(|| (p, p - w));
                for (p, q) in [left, above].into_iter().flatten().filter(|(p, q)| on(*p) == on(*q))
                {
                    let both = of[p].min(of[q]);
                    (of[p], of[q]) = (both, both);
                }
            }
            if of == last {
                return of;
            }
        }
    }

    proptest! {
        #[test]
        fn sets_of_bits_are_those_of_single_pixels(pixels in pictures(), by in 0usize..80) {
            let (w, h) = (pixels.width, pixels.height);
            let on = |i: usize, j: usize| pixels.has(i, j);
            let all = (0..h).flat_map(|j| (0..w).map(move |i| (i, j)));
            let points: Vec<_> = all.clone().filter(|(i, j)| on(*i, *j)).collect();
            prop_assert_eq!(pixels.points().collect::<Vec<_>>(), points.clone());
            let off = Pixels::new(w, h, |p| !on(p % w, p / w));
            prop_assert_eq!(pixels.complement(), off);
            let near = |p: usize| {
                let (i, j) = (p % w, p / w);
                points.iter().any(|(k, l)| k.abs_diff(i) <= by && l.abs_diff(j) <= by)
            };
            prop_assert_eq!(pixels.dilated(by), Pixels::new(w, h, near));
            let inner = |p: usize| {
                let (i, j) = (p % w, p / w);
                let framed = i == 0 || j == 0 || i + 1 == w || j + 1 == h;
                on(i, j) && !framed && on(i - 1, j) && on(i + 1, j) && on(i, j - 1) && on(i, j + 1)
            };
            prop_assert_eq!(pixels.inner(), Pixels::new(w, h, inner));
        }

        #[test]
        fn components_and_holes_are_those_by_single_pixels(pixels in pictures()) {
            let w = pixels.width;
            let least = least(&pixels);
            let (of, sizes) = components(w, &pixels.bools());
            let mut firsts: Vec<usize> = least.clone();
            firsts.sort_unstable();
            firsts.dedup();
            let number = |p: usize| firsts.binary_search(&least[p]).map(|n| n as u32);
            prop_assert!((0..of.len()).all(|p| Ok(of[p]) == number(p)));
            let size = |first: &usize| least.iter().filter(|l| *l == first).count();
            prop_assert_eq!(sizes, firsts.iter().map(size).collect::<Vec<_>>());
            if let Some(area) = Area::of(pixels.clone()) {
                let framed = |p: usize| p.is_multiple_of(w) || p % w + 1 == w || p < w || p / w + 1 == HEIGHT;
                let open: Vec<usize> = (0..of.len()).filter(|p| framed(*p)).map(|p| least[p]).collect();
                let filled = |p: usize| pixels.has(p % w, p / w) || !open.contains(&least[p]);
                prop_assert_eq!(area.filled().pixels, Pixels::new(w, HEIGHT, filled));
            }
        }
    }
}
