//! Sets of pixels: components, holes, outlines, dilation and overlap.

/// A non-empty set of pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    pub width: usize,
    pub height: usize,
    /// In row-major order.
    pub on: Vec<bool>,
    /// The number of pixels that are on.
    pub count: usize,
    /// First column and row, and one past the last column and row.
    pub bounds: [usize; 4],
    /// The same as `on`, 64 pixels per word.
    words: Vec<u64>,
}

impl Area {
    /// Builds a set from pixels in row-major order; `None` if all are off.
    pub fn new(width: usize, height: usize, on: Vec<bool>) -> Option<Area> {
        let word =
            |bits: &[bool]| bits.iter().rev().fold(0u64, |word, on| word << 1 | u64::from(*on));
        let words: Vec<u64> = on.chunks(64).map(word).collect();
        let count = words.iter().map(|w| w.count_ones() as usize).sum();
        let mut bounds = [width, height, 0, 0];
        for (j, row) in on.chunks(width.max(1)).enumerate() {
            let Some(first) = row.iter().position(|on| *on) else { continue };
            let last = row.iter().rposition(|on| *on).unwrap_or(first);
            bounds = [bounds[0].min(first), bounds[1].min(j), bounds[2].max(last + 1), j + 1];
        }
        (count > 0).then_some(Area { width, height, on, count, bounds, words })
    }

    /// Whether the intersection over union with another set of the same picture is above
    /// a threshold.
    pub fn overlaps(&self, other: &Area, threshold: f64) -> bool {
        // The ratio of the sizes is an upper bound.
        let (less, more) = (self.count.min(other.count), self.count.max(other.count));
        less as f64 > threshold * more as f64 && self.iou(other) > threshold
    }

    /// Intersection over union with another set of the same picture.
    pub fn iou(&self, other: &Area) -> f64 {
        let both = self.shared(other);
        both as f64 / (self.count + other.count - both) as f64
    }

    /// Returns the number of pixels in both sets.
    pub fn shared(&self, other: &Area) -> usize {
        self.words.iter().zip(&other.words).map(|(a, b)| (a & b).count_ones() as usize).sum()
    }

    /// Returns the union of both sets.
    pub fn union(&self, other: &Area) -> Option<Area> {
        Area::new(
            self.width,
            self.height,
            self.on.iter().zip(&other.on).map(|(a, b)| a | b).collect(),
        )
    }

    /// Columns and rows of the pixels that are on, in raster order.
    pub fn points(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let [x0, y0, x1, y1] = self.bounds;
        let all = (y0..y1).flat_map(move |j| (x0..x1).map(move |i| (i, j)));
        all.filter(|&(i, j)| self.on[j * self.width + i])
    }

    /// Whether the pixel at a position is on; false outside the picture.
    pub fn at(&self, x: f64, y: f64) -> bool {
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside && self.on[y as usize * self.width + x as usize]
    }

    /// Returns the pixels of which one of the four neighbours is off or outside the
    /// picture, and the number of pixels at the picture's frame.
    pub fn outline(&self) -> (Vec<usize>, usize) {
        let (w, h) = (self.width, self.height);
        let (mut outline, mut framed) = (Vec::new(), 0);
        for (i, j) in self.points() {
            let p = j * w + i;
            if i == 0 || j == 0 || i + 1 == w || j + 1 == h {
                framed += 1;
                outline.push(p);
            } else if ![p - 1, p + 1, p - w, p + w].iter().all(|q| self.on[*q]) {
                outline.push(p);
            }
        }
        (outline, framed)
    }

    /// Fills holes: pixels that are off and not 4-connected to the outside.
    pub fn filled(self) -> Area {
        let [x0, y0, x1, y1] = self.bounds;
        let (w, h) = (x1 - x0, y1 - y0);
        let whole = |p: usize| (y0 + p / w) * self.width + x0 + p % w;
        let off: Vec<bool> = (0..w * h).map(|p| !self.on[whole(p)]).collect();
        let mut outside = vec![false; off.len()];
        let mut stack: Vec<usize> = (0..off.len())
            .filter(|p| {
                off[*p] && (p.is_multiple_of(w) || p % w + 1 == w || *p < w || p / w + 1 == h)
            })
            .collect();
        stack.iter().for_each(|p| outside[*p] = true);
        while let Some(p) = stack.pop() {
            for q in neighbours(w, h, p).into_iter().flatten() {
                if off[q] && !outside[q] {
                    outside[q] = true;
                    stack.push(q);
                }
            }
        }
        if outside == off {
            return self;
        }
        let mut on = self.on.clone();
        (0..off.len()).filter(|p| !outside[*p]).for_each(|p| on[whole(p)] = true);
        Area::new(self.width, self.height, on).unwrap_or(self)
    }

    /// Returns the pixels at most `by` columns and rows away from one that is on.
    pub fn dilated(&self, by: usize) -> Vec<bool> {
        let [x0, y0, x1, y1] = self.bounds;
        let (left, right) = (x0.saturating_sub(by), (x1 + by).min(self.width));
        let mut wide = vec![false; self.on.len()];
        for j in y0..y1 {
            let row = &self.on[j * self.width..(j + 1) * self.width];
            spread(row.iter().copied(), by, |i| wide[j * self.width + i] = true);
        }
        let mut out = vec![false; self.on.len()];
        for i in left..right {
            let column = wide.iter().skip(i).step_by(self.width).copied();
            spread(column, by, |j| out[j * self.width + i] = true);
        }
        out
    }
}

/// Calls `mark` with all positions of a line that are at most `by` away from one that is
/// on.
fn spread(line: impl ExactSizeIterator<Item = bool>, by: usize, mut mark: impl FnMut(usize)) {
    let n = line.len();
    let mut done = 0;
    for (i, _) in line.enumerate().filter(|(_, on)| *on) {
        let end = (i + by + 1).min(n);
        (done.max(i.saturating_sub(by))..end).for_each(&mut mark);
        done = end;
    }
}

/// Returns the four neighbours of a pixel of a picture of the given width and height.
pub fn neighbours(w: usize, h: usize, p: usize) -> [Option<usize>; 4] {
    let (i, j) = (p % w, p / w);
    [
        (i > 0).then(|| p - 1),
        (i + 1 < w).then(|| p + 1),
        (j > 0).then(|| p - w),
        (j + 1 < h).then(|| p + w),
    ]
}

/// Returns the component number of every pixel, and the sizes of the components:
/// 4-connected pixels of the same label.
pub fn components(w: usize, h: usize, label: impl Fn(usize) -> u32) -> (Vec<u32>, Vec<usize>) {
    let mut of = vec![u32::MAX; w * h];
    let mut sizes = Vec::new();
    let mut stack = Vec::new();
    for start in 0..w * h {
        if of[start] != u32::MAX {
            continue;
        }
        let (number, mut size) = (sizes.len() as u32, 0);
        of[start] = number;
        stack.push(start);
        while let Some(p) = stack.pop() {
            size += 1;
            for q in neighbours(w, h, p).into_iter().flatten() {
                if of[q] == u32::MAX && label(q) == label(p) {
                    of[q] = number;
                    stack.push(q);
                }
            }
        }
        sizes.push(size);
    }
    (of, sizes)
}

/// Returns the largest component of some pixels, the first one among equals; `None` if
/// all are off.
pub fn largest(w: usize, h: usize, on: &[bool]) -> Option<Area> {
    let (of, sizes) = components(w, h, |p| u32::from(on[p]));
    let mut best: Option<(usize, u32)> = None;
    for p in (0..on.len()).filter(|p| on[*p]) {
        let size = sizes[of[p] as usize];
        if best.is_none_or(|(s, _)| size > s) {
            best = Some((size, of[p]));
        }
    }
    let (_, number) = best?;
    Area::new(w, h, of.iter().map(|o| *o == number).collect())
}
