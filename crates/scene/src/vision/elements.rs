//! Rendered contours as the comparators read them, and what the comparators have in
//! common: percent of the diagonal, which elements are in view, and errors. This is not a
//! renderer and does not depend on meshes. Invariant: elements that are not finite or lie
//! outside the picture have weight 0, so NaN cannot enter a score.

use crate::contours::ContourSlice;
use thiserror::Error;

/// One element, in pixels of its frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element {
    /// Position.
    pub x: f32,
    /// Position.
    pub y: f32,
    /// Tangent.
    pub tx: f32,
    /// Tangent.
    pub ty: f32,
    /// Length in pixels, above 0.
    pub length: f32,
    /// The fraction in view: 1 inside, 0 from half a pixel outside the border, linear
    /// between.
    pub weight: f32,
    /// Its index in the slices.
    pub index: usize,
}

impl ContourSlice<'_> {
    /// Length of the frame's diagonal in pixels.
    pub fn diagonal(&self) -> f64 {
        diagonal(self.width, self.height)
    }

    /// The elements that are finite, have a positive length, and are at least partly in
    /// view.
    #[inline(always)]
    pub(super) fn in_view(&self) -> impl Iterator<Item = Element> {
        let (w, h) = (self.width as f32, self.height as f32);
        let lists =
            self.x.iter().zip(self.y).zip(self.tx.iter().zip(self.ty)).zip(self.length).enumerate();
        lists.filter_map(move |(index, (((&x, &y), (&tx, &ty)), &length))| {
            let sound = (x + y + tx + ty + length).is_finite() && length > 0.0;
            let weight = (x.min(w - x).min(y).min(h - y) + 0.5).clamp(0.0, 1.0);
            (sound && weight > 0.0).then_some(Element { x, y, tx, ty, length, weight, index })
        })
    }
}

impl ContourSlice<'_> {
    /// Returns the derivatives of an element's weight with respect to its x and y: within
    /// half a pixel of the border, those of the nearest side.
    pub(super) fn view_slope(&self, e: &Element) -> [f64; 2] {
        let (w, h) = (self.width as f32, self.height as f32);
        let sides = [(e.x, 0, 1.0), (w - e.x, 0, -1.0), (e.y, 1, 1.0), (h - e.y, 1, -1.0)];
        let mut slope = [0.0; 2];
        if e.weight < 1.0
            && let Some((_, axis, sign)) = sides.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
        {
            slope[axis] = sign;
        }
        slope
    }
}

/// Why a comparator could not be prepared or evaluated.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ComparatorError {
    /// The frame has no pixels or too many.
    #[error("cannot compare at {width} x {height} pixels: each side must be 1 to 16384 pixels")]
    Size {
        /// Requested width, in pixels.
        width: u32,
        /// Requested height, in pixels.
        height: u32,
    },
    /// An option is out of its range.
    #[error("{option} must be {range}")]
    Option {
        /// The option's name.
        option: &'static str,
        /// The allowed values.
        range: &'static str,
    },
    /// The observed map's lists have different lengths.
    #[error("the observed contours are invalid: their lists differ in length")]
    Map,
    /// A quantised picture with unsuitable labels.
    #[error(
        "a colour-reduced picture needs one label per pixel, each below the number of colours, 1 to 256"
    )]
    Labels,
}

/// Returns the length in pixels of the diagonal of a `width` x `height` picture.
pub(super) fn diagonal(width: u32, height: u32) -> f64 {
    let (w, h) = (f64::from(width), f64::from(height));
    (w * w + h * h).sqrt()
}

/// Returns an error unless both sides are 1 to 16384.
pub(super) fn check_size(width: u32, height: u32) -> Result<(), ComparatorError> {
    let fine = |n: u32| (1..=16384).contains(&n);
    if fine(width) && fine(height) { Ok(()) } else { Err(ComparatorError::Size { width, height }) }
}

/// Returns an error unless `value` is finite and `holds` is true.
pub(super) fn check(
    option: &'static str,
    range: &'static str,
    value: f64,
    holds: bool,
) -> Result<(), ComparatorError> {
    if value.is_finite() && holds { Ok(()) } else { Err(ComparatorError::Option { option, range }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_view_drops_what_cannot_be_scored() {
        let nan = f32::NAN;
        let e = ContourSlice {
            x: &[5.0, nan, 5.0, 5.0, -3.0, 0.0, 5.0],
            y: &[5.0, 5.0, 5.0, 5.0, 5.0, 5.0, f32::INFINITY],
            tx: &[1.0, 1.0, nan, 1.0, 1.0, 1.0, 1.0],
            ty: &[0.0; 7],
            length: &[1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0],
            width: 10,
            height: 10,
        };
        let kept: Vec<(usize, f32)> = e.in_view().map(|e| (e.index, e.weight)).collect();
        assert_eq!(kept, [(0, 1.0), (5, 0.5)]);
    }

    #[test]
    fn the_shortest_list_counts() {
        let long: &[f32] = &[1.0; 3];
        let all = ContourSlice {
            x: long,
            y: long,
            tx: long,
            ty: long,
            length: long,
            width: 9,
            height: 9,
        };
        let two: &[f32] = &[1.0; 2];
        for e in [
            ContourSlice { x: two, ..all },
            ContourSlice { y: two, ..all },
            ContourSlice { tx: two, ..all },
            ContourSlice { ty: two, ..all },
            ContourSlice { length: two, ..all },
        ] {
            assert_eq!((e.len(), e.in_view().count()), (2, 2));
        }
        assert_eq!(all.len(), 3);
    }

    #[test]
    fn sizes() {
        assert_eq!(diagonal(3, 4), 5.0);
        assert!(
            check_size(0, 4).is_err()
                && check_size(4, 16385).is_err()
                && check_size(1, 16384).is_ok()
        );
    }
}
