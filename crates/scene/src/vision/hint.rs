//! What a user pointed out in a photograph: where the object is, and what it is not.

use super::Mask;

/// Where an object is in a photograph; every part is optional. Positions are in pixels of
/// the photograph, x to the right and y down from its top left corner.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hint {
    /// The object's pixels, of any resolution.
    pub mask: Option<Mask>,
    /// Corners of a polygon around the object: none, or at least three.
    pub outline: Vec<[f64; 2]>,
    /// A box around the object: left, top, width and height, both above 0.
    pub bounds: Option<[f64; 4]>,
    /// The object's axis.
    pub axis: Option<AxisHint>,
    /// Positions on the object.
    pub at: Vec<[f64; 2]>,
    /// Positions beside it.
    pub not: Vec<[f64; 2]>,
}

/// The axis of an object of revolution as it appears in a photograph, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisHint {
    /// The end on which the object stands.
    pub foot: [f64; 2],
    /// The other end.
    pub top: [f64; 2],
    /// The full width of the object across the axis, above 0.
    pub width: f64,
}

impl Hint {
    /// True if nothing was pointed out.
    pub fn is_empty(&self) -> bool {
        *self == Hint::default()
    }

    /// Returns the pixels that the user drew, at the size of the photograph: the mask, or
    /// the inside of the outline (even-odd rule, by centres of pixels).
    pub fn drawn(&self, width: u32, height: u32) -> Option<Mask> {
        match &self.mask {
            Some(mask) => Some(mask.resized(width, height)),
            None if self.outline.len() >= 3 => polygon(&self.outline, width, height),
            None => None,
        }
    }
}

/// Returns the pixels whose centres are inside a polygon by the even-odd rule.
pub(super) fn polygon(corners: &[[f64; 2]], width: u32, height: u32) -> Option<Mask> {
    let mut inside = vec![false; width as usize * height as usize];
    for (j, row) in inside.chunks_mut(width.max(1) as usize).enumerate() {
        let y = j as f64 + 0.5;
        let sides = corners.iter().zip(corners.iter().cycle().skip(1));
        let mut crossings: Vec<f64> = sides
            .filter(|(a, b)| (a[1] <= y) != (b[1] <= y))
            .map(|(a, b)| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            .collect();
        crossings.sort_by(f64::total_cmp);
        for between in crossings.chunks_exact(2) {
            let column = |x: f64| ((x - 0.5).ceil().max(0.0) as usize).min(row.len());
            let (first, last) = (column(between[0]), column(between[1]));
            row[first..last.max(first)].fill(true);
        }
    }
    Mask::new(width, height, inside).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_contains_the_centres_of_its_pixels() {
        let corners = vec![[1.0, 1.0], [4.0, 1.0], [4.0, 3.0], [1.0, 3.0]];
        let hint = Hint { outline: corners, ..Hint::default() };
        let mask = hint.drawn(6, 4).expect("a polygon");
        let on: Vec<usize> = (0..24).filter(|i| mask.data()[*i]).collect();
        assert_eq!(on, [7, 8, 9, 13, 14, 15]);
    }

    #[test]
    fn an_outline_beyond_the_picture_is_cut_off() {
        let corners = vec![[-5.0, -5.0], [50.0, -5.0], [50.0, 50.0], [-5.0, 50.0]];
        let hint = Hint { outline: corners, ..Hint::default() };
        assert!(hint.drawn(6, 4).expect("a polygon").data().iter().all(|m| *m));
        assert!(Hint::default().drawn(6, 4).is_none());
    }
}
