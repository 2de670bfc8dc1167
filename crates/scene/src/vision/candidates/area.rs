//! Non-empty sets of pixels: holes, outlines and overlap.

use super::components::components;
use super::pixels::Pixels;

/// A non-empty set of pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    pub pixels: Pixels,
    /// The number of pixels that are on.
    pub count: usize,
    /// First column and row, and one past the last column and row.
    pub bounds: [usize; 4],
}

impl Area {
    /// Builds an area from its pixels; `None` if there are none.
    pub fn of(pixels: Pixels) -> Option<Area> {
        let count = pixels.words().iter().map(|word| word.count_ones() as usize).sum();
        let mut bounds = [pixels.width, pixels.height, 0, 0];
        for j in 0..pixels.height {
            let row = pixels.row(j);
            let Some(first) = row.iter().position(|word| *word != 0) else { continue };
            let last = row.iter().rposition(|word| *word != 0).unwrap_or(first);
            let left = 64 * first + row[first].trailing_zeros() as usize;
            let right = 64 * (last + 1) - row[last].leading_zeros() as usize;
            bounds = [bounds[0].min(left), bounds[1].min(j), bounds[2].max(right), j + 1];
        }
        (count > 0).then_some(Area { pixels, count, bounds })
    }

    /// True if the intersection over union with another set of the same picture is above
    /// a threshold.
    pub fn overlaps(&self, other: &Area, threshold: f64) -> bool {
        // The ratio of the sizes is an upper bound.
        let (less, more) = (self.count.min(other.count), self.count.max(other.count));
        less as f64 > threshold * more as f64 && self.iou(other) > threshold
    }

    /// Intersection over union with another set of the same picture.
    pub fn iou(&self, other: &Area) -> f64 {
        let both = self.shared(&other.pixels);
        both as f64 / (self.count + other.count - both) as f64
    }

    /// Returns the number of pixels in both sets.
    pub fn shared(&self, other: &Pixels) -> usize {
        let pairs = self.pixels.words().iter().zip(other.words());
        pairs.map(|(a, b)| (a & b).count_ones() as usize).sum()
    }

    /// Returns the union of both sets.
    pub fn union(&self, other: &Area) -> Option<Area> {
        let mut both = self.pixels.clone();
        both.add(&other.pixels);
        Area::of(both)
    }

    /// Columns and rows of the pixels that are on, in raster order.
    pub fn points(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.pixels.points()
    }

    /// True if the pixel at a position is on; false outside the picture.
    pub fn at(&self, x: f64, y: f64) -> bool {
        let (width, height) = (self.pixels.width as f64, self.pixels.height as f64);
        let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
        inside && self.pixels.has(x as usize, y as usize)
    }

    /// Returns the pixels of which one of the four neighbours is off or outside the
    /// picture, and the number of pixels at the picture's frame.
    pub fn outline(&self) -> (Vec<usize>, usize) {
        let (w, h) = (self.pixels.width, self.pixels.height);
        let inner = self.pixels.inner();
        let outline: Vec<(usize, usize)> =
            self.points().filter(|(i, j)| !inner.has(*i, *j)).collect();
        let framed =
            outline.iter().filter(|&&(i, j)| i == 0 || j == 0 || i + 1 == w || j + 1 == h).count();
        (outline.into_iter().map(|(i, j)| j * w + i).collect(), framed)
    }

    /// Fills holes: pixels that are off and not 4-connected to the outside.
    pub fn filled(self) -> Area {
        let [x0, y0, x1, y1] = self.bounds;
        let off = self.pixels.complement();
        // What is off at the sides of the bounds is connected to the outside.
        let mut outside = off.clone();
        outside.clear(x0 + 1..x1 - 1, y0 + 1..y1 - 1);
        outside.spread_within(&off);
        if outside == off {
            return self;
        }
        Area::of(outside.complement()).unwrap_or(self)
    }

    /// Returns the pixels at most `by` columns and rows away from one that is on.
    pub fn dilated(&self, by: usize) -> Pixels {
        self.pixels.dilated(by)
    }
}

/// Returns the largest component of the pixels that are on in a picture of width `w`, the
/// first one among equals; `None` if all are off.
pub fn largest(w: usize, on: &[bool]) -> Option<Area> {
    let (of, sizes) = components(w, on);
    let mut inside = vec![false; sizes.len()];
    of.iter().zip(on).for_each(|(number, on)| inside[*number as usize] = *on);
    let better =
        |best: usize, number: usize| if sizes[number] > sizes[best] { number } else { best };
    let best = (0..sizes.len()).filter(|number| inside[*number]).reduce(better)?;
    Area::of(Pixels::new(w, on.len() / w, |p| of[p] as usize == best))
}
