//! Drawn contours in the form that comparators read: the one place where drawing and
//! comparing meet, since neither depends on the other.

use crate::render::{ContourSlice, Contours};
use crate::vision::Elements;

impl<'a> Elements<'a> {
    /// The elements of drawn contours.
    pub fn of(c: &'a Contours) -> Elements<'a> {
        Elements {
            x: &c.x,
            y: &c.y,
            tx: &c.tx,
            ty: &c.ty,
            length: &c.length,
            width: c.width,
            height: c.height,
        }
    }
}

impl<'a> From<ContourSlice<'a>> for Elements<'a> {
    fn from(c: ContourSlice<'a>) -> Elements<'a> {
        let ContourSlice { x, y, tx, ty, length, width, height } = c;
        Elements { x, y, tx, ty, length, width, height }
    }
}
