//! What a user pointed out in a photograph: where the object is, and what it is not.

use super::{Mask, VisionError};

/// The maximum number of corners of an outline, and of positions.
const MOST: usize = 10_000;
/// The minimum number of corners of a curve, and the number of its points from one to the next.
const CURVED: usize = 6;
const STEPS: usize = 8;

/// Where an object is in a photograph; every part is optional. Positions are in pixels of
/// the photograph, x to the right and y down from its top left corner.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hint {
    /// The object's pixels, of any resolution.
    pub mask: Option<Mask>,
    /// Positions around the object: none, or at least three. Up to five are the corners of a
    /// polygon; through more, the outline is a smooth curve ([`Hint::curve`]).
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

    /// Checks that every part can be in a photograph of this size, pixels.
    ///
    /// # Errors
    /// A number that is not finite, a length that is not above 0, a shape without an area,
    /// anything wholly outside the photograph, and a mask of other proportions.
    pub fn check(&self, width: u32, height: u32) -> Result<(), VisionError> {
        let size = [f64::from(width), f64::from(height)];
        let wrong = |why: String| Err(VisionError::Hint(why));
        let outside = |what: &str| {
            wrong(format!("{what} is outside the photograph of {width} x {height} pixels"))
        };
        if self.outline.len().max(self.at.len()).max(self.not.len()) > MOST {
            return wrong(format!("a hint has at most {MOST} positions of a kind"));
        }
        if let Some(mask) = &self.mask {
            let (w, h) = (f64::from(mask.width()), f64::from(mask.height()));
            // Another resolution has the same proportions but for a pixel.
            if (w * size[1] - h * size[0]).abs() > size[0].max(size[1]) {
                return wrong(format!(
                    "the mask of {w} x {h} pixels does not have the proportions of the photograph \
                     of {width} x {height}"
                ));
            }
            if !mask.data().contains(&true) {
                return wrong("the mask is empty: bright pixels are the object".to_owned());
            }
        }
        if !self.outline.is_empty() {
            if self.outline.len() < 3 {
                let n = self.outline.len();
                return wrong(format!("the outline needs at least 3 corners, not {n}"));
            }
            finite("the outline", self.outline.as_flattened())?;
            if self.mask.is_none()
                && !self.drawn(width, height).is_some_and(|m| m.data().contains(&true))
            {
                return wrong(format!(
                    "the outline contains no pixel of the photograph of {width} x {height} pixels"
                ));
            }
        }
        if let Some(bounds @ [x, y, w, h]) = self.bounds {
            finite("the box", &bounds)?;
            if w <= 0.0 || h <= 0.0 {
                return wrong(format!("the box needs a width and a height above 0, not {w} x {h}"));
            }
            if x >= size[0] || y >= size[1] || x + w <= 0.0 || y + h <= 0.0 {
                return outside(&format!("the box [{x}, {y}, {w}, {h}]"));
            }
        }
        if let Some(AxisHint { foot, top, width: across }) = self.axis {
            finite("the axis", &[foot, top, [across; 2]].concat())?;
            if across <= 0.0 {
                return wrong(format!("the axis needs a width above 0, not {across}"));
            }
            if foot == top {
                return wrong("the axis needs two different ends".to_owned());
            }
            let beyond = |i: usize| {
                let (low, high) = (foot[i].min(top[i]), foot[i].max(top[i]));
                high + 0.5 * across <= 0.0 || low - 0.5 * across >= size[i]
            };
            if beyond(0) || beyond(1) {
                return outside("the axis");
            }
        }
        for p @ [x, y] in self.at.iter().chain(&self.not) {
            finite("a position", p)?;
            if !((0.0..=size[0]).contains(x) && (0.0..=size[1]).contains(y)) {
                return outside(&format!("the position [{x}, {y}]"));
            }
        }
        Ok(())
    }

    /// Returns the pixels that the user drew, at the size of the photograph: the mask, or
    /// the inside of the outline (even-odd rule, by centres of pixels).
    pub fn drawn(&self, width: u32, height: u32) -> Option<Mask> {
        match &self.mask {
            Some(mask) => Some(mask.resized(width, height)),
            None if self.outline.len() >= 3 => polygon(&self.curve(), width, height),
            None => None,
        }
    }

    /// Returns the outline as the corners of a polygon: of six or more positions, points of the
    /// closed curve through them (Catmull & Rom 1974, "A class of local interpolating splines"),
    /// since a polygon through a few positions of a round outline is inside it.
    pub fn curve(&self) -> Vec<[f64; 2]> {
        let n = self.outline.len();
        if n < CURVED {
            return self.outline.clone();
        }
        let point = |i: usize| {
            let [a, b, c, d] = [n - 1, 0, 1, 2].map(|k| self.outline[(i / STEPS + k) % n]);
            let u = (i % STEPS) as f64 / STEPS as f64;
            [0, 1].map(|k| {
                let bend = u * (2.0 * a[k] - 5.0 * b[k] + 4.0 * c[k] - d[k]);
                let bend = bend + u * u * (3.0 * (b[k] - c[k]) + d[k] - a[k]);
                b[k] + 0.5 * u * (c[k] - a[k] + bend)
            })
        };
        (0..n * STEPS).map(point).collect()
    }

    /// Returns a box around the object, left, top, width and height: the one given, or that
    /// of the drawn pixels in a photograph of this size.
    pub fn around(&self, width: u32, height: u32) -> Option<[f64; 4]> {
        self.bounds.or_else(|| {
            let [left, top, right, bottom] = self.drawn(width, height)?.bounds()?;
            Some([left, top, right - left, bottom - top])
        })
    }
}

fn finite(what: &str, numbers: &[f64]) -> Result<(), VisionError> {
    match numbers.iter().find(|x| !x.is_finite()) {
        Some(x) => Err(VisionError::Hint(format!("{what} needs finite numbers, not {x}"))),
        None => Ok(()),
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
        assert_eq!(hint.around(6, 4), Some([1.0, 1.0, 3.0, 2.0]));
    }

    #[test]
    fn few_corners_are_a_polygon_and_more_a_curve() {
        let circle = |n: usize| {
            let at = |i| libm::sincos(i as f64 / n as f64 * std::f64::consts::TAU);
            (0..n).map(at).map(|(s, c)| [50.0 + 40.0 * c, 50.0 + 40.0 * s]).collect()
        };
        let area = |n: usize| {
            let hint = Hint { outline: circle(n), ..Hint::default() };
            let mask = hint.drawn(100, 100).expect("an outline");
            mask.data().iter().filter(|on| **on).count() as f64 / (40.0 * 40.0)
        };
        // Squares and pentagons as they are: n/2 sin(2 pi/n).
        assert!((area(4) - 2.0).abs() < 0.02 && (area(5) - 2.378).abs() < 0.02);
        // The octagon would have 2.83.
        assert!((area(8) - std::f64::consts::PI).abs() < 0.05, "{}", area(8));
        // The curve goes through the positions.
        let hint = Hint { outline: circle(7), ..Hint::default() };
        let through: Vec<[f64; 2]> = hint.curve().into_iter().step_by(STEPS).collect();
        assert_eq!(through, hint.outline);
    }

    #[test]
    fn an_outline_beyond_the_picture_is_cut_off() {
        let corners = vec![[-5.0, -5.0], [50.0, -5.0], [50.0, 50.0], [-5.0, 50.0]];
        let hint = Hint { outline: corners, ..Hint::default() };
        assert!(hint.drawn(6, 4).expect("a polygon").data().iter().all(|m| *m));
        assert!(Hint::default().drawn(6, 4).is_none());
    }

    #[test]
    fn what_cannot_be_in_the_photograph_is_an_error() {
        let said = |hint: Hint| hint.check(60, 40).expect_err("an error").to_string();
        let corners = vec![[1.0, 1.0], [4.0, 1.0], [4.0, 3.0]];
        let mask = |w, h| Mask::new(w, h, vec![true; (w * h) as usize]).ok();
        let axis = |foot, top, width| Hint {
            axis: Some(AxisHint { foot, top, width }),
            ..Hint::default()
        };
        let bounds = |b| Hint { bounds: Some(b), ..Hint::default() };
        let at = |p| Hint { at: vec![p], ..Hint::default() };
        let whole = Hint {
            mask: mask(31, 20),
            outline: corners.clone(),
            bounds: Some([-5.0, -5.0, 90.0, 90.0]),
            not: vec![[60.0, 40.0]],
            ..axis([30.0, 50.0], [30.0, -5.0], 10.0)
        };
        assert!(whole.check(60, 40).is_ok() && Hint::default().check(60, 40).is_ok());
        for (hint, problem) in [
            (Hint { mask: mask(40, 60), ..Hint::default() }, "proportions"),
            (Hint { mask: Mask::new(3, 2, vec![false; 6]).ok(), ..Hint::default() }, "empty"),
            (Hint { outline: corners[..2].to_vec(), ..Hint::default() }, "at least 3 corners"),
            (
                Hint {
                    outline: corners.iter().map(|c| [c[0] + 60.0, c[1]]).collect(),
                    ..Hint::default()
                },
                "60 x 40",
            ),
            (bounds([0.0, 0.0, -1.0, 5.0]), "above 0"),
            (bounds([60.0, 0.0, 1.0, 5.0]), "60 x 40"),
            (bounds([0.0, f64::NAN, 1.0, 5.0]), "not NaN"),
            (axis([3.0, 3.0], [3.0, 3.0], 2.0), "different ends"),
            (axis([3.0, 3.0], [3.0, 9.0], 0.0), "above 0"),
            (axis([-9.0, 3.0], [-9.0, 9.0], 2.0), "60 x 40"),
            (at([61.0, 3.0]), "60 x 40"),
            (at([f64::INFINITY, 3.0]), "not inf"),
            (Hint { not: vec![[0.0; 2]; MOST + 1], ..Hint::default() }, "at most"),
        ] {
            let said = said(hint);
            assert!(said.contains(problem), "{said}");
        }
    }
}
