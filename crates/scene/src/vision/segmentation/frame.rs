//! A rectangle about a presumed axis: where an object is thought to be.

use crate::vision::Hint;

/// A rectangle that may lean. Its own coordinates are across the axis to the right and along
/// it downwards, from its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    pub centre: [f64; 2],
    /// How far the axis leans to the right, radians.
    pub lean: f64,
    /// Half the size across and along the axis, above 0.
    pub half: [f64; 2],
    /// True if the axis was pointed out, false if it is only the middle of a box.
    pub axis: bool,
}

/// Frames much larger than the picture are no evidence; as a multiple of its longer side.
const LARGEST: f64 = 4.0;
/// Minimum ratio of a frame's sides; thinner ones are taken to be this thick.
const THIN: f64 = 0.04;

impl Frame {
    /// Returns where an object is by a hint, in pixels of a photograph: the rectangle about
    /// the axis, or else the part of the box that is in the picture. `None` without either
    /// or if they are beside the picture.
    pub fn of(hint: &Hint, width: u32, height: u32) -> Option<Frame> {
        let (width, height) = (f64::from(width), f64::from(height));
        if let Some(axis) = hint.axis {
            let d = [0, 1].map(|c| axis.top[c] - axis.foot[c]);
            let length = libm::hypot(d[0], d[1]);
            let frame = Frame {
                centre: [0, 1].map(|c| 0.5 * (axis.top[c] + axis.foot[c])),
                lean: libm::atan2(d[0], -d[1]),
                half: [0.5 * axis.width, 0.5 * length],
                axis: true,
            };
            return frame.usable(width, height);
        }
        let [left, top, w, h] = hint.bounds?;
        let (x0, x1) = (left.max(0.0), (left + w).min(width));
        let (y0, y1) = (top.max(0.0), (top + h).min(height));
        Frame::upright([x0, y0, x1, y1]).usable(width, height)
    }

    /// An upright frame: left, top, right and bottom.
    pub fn upright([x0, y0, x1, y1]: [f64; 4]) -> Frame {
        let centre = [0.5 * (x0 + x1), 0.5 * (y0 + y1)];
        Frame { centre, lean: 0.0, half: [0.5 * (x1 - x0), 0.5 * (y1 - y0)], axis: false }
    }

    /// Returns the frame, at least [`THIN`], if it is of a size that can be looked at.
    fn usable(mut self, width: f64, height: f64) -> Option<Frame> {
        let longer = self.half[0].max(self.half[1]);
        if !(longer > 0.0 && self.half[0].min(self.half[1]) > 0.0) {
            return None;
        }
        self.half = self.half.map(|h| h.max(THIN * longer));
        let reach = self.reach();
        let meets = |c: usize, size: f64| {
            self.centre[c] + reach[c] > 0.0 && self.centre[c] - reach[c] < size
        };
        let sane = longer <= LARGEST * width.max(height);
        (sane && meets(0, width) && meets(1, height)).then_some(self)
    }

    /// The direction across the axis, to the right; the one along it, downwards, is a
    /// quarter of a turn from it.
    pub fn across(&self) -> [f64; 2] {
        [libm::cos(self.lean), libm::sin(self.lean)]
    }

    /// Half the size of the upright rectangle around it.
    pub fn reach(&self) -> [f64; 2] {
        let [c, s] = self.across().map(f64::abs);
        let [w, h] = self.half;
        [w * c + h * s, w * s + h * c]
    }

    /// Converts a position to the frame's coordinates.
    pub fn within(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([c, s], x, y) = (self.across(), x - self.centre[0], y - self.centre[1]);
        [x * c + y * s, y * c - x * s]
    }

    /// Converts a position in the frame's coordinates to one in the picture.
    pub fn outside(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.across();
        [self.centre[0] + u * c - v * s, self.centre[1] + u * s + v * c]
    }
}
