//! The derivatives of the contour ratio with respect to the rendered elements: those of
//! the interpolated table and of the groups' matched scores. On grid lines, where the
//! score has a kink, they are one-sided.

use super::super::field::{PER_RADIAN, channels_of};
use super::match_capacity::NO_GROUP;
use super::{ContourRatio, Scratch};
use crate::contours::ContourSlice;

impl ContourRatio {
    /// Computes the derivatives of [`ContourRatio::log_likelihood`] with respect to each
    /// element's x, y, length (pixels) and angle (radians, from right to down) into
    /// `out`.
    pub fn gradient(
        &self,
        elements: &ContourSlice<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<[f64; 4]>,
    ) {
        out.clear();
        out.resize(elements.len(), [0.0; 4]);
        // Fills in every group's assignments.
        self.log_likelihood_with(elements, scratch);
        let samples = self.grid.width as usize * self.grid.height as usize;
        let factor = self.options.weight / self.options.unit;
        let length: f64 = elements
            .in_view()
            .map(|e| (f64::from(e.length * e.weight) * self.percent).min(1e4))
            .sum();
        // With too little contour in view, each unit of length reduces the penalty.
        let missing = if length < self.options.least {
            -self.options.nothing * libm::log(1.0 - self.options.foreground) / self.options.least
        } else {
            0.0
        };
        for e in elements.in_view() {
            let Some(place) = out.get_mut(e.index) else { continue };
            let (low, high, f) = channels_of(e.tx, e.ty);
            let corners = self.grid.corners(e.x, e.y);
            // The score per unit length in each channel, and its derivatives over the
            // grid.
            let read = |k: usize| {
                let [a, b, c, d] = corners.at.map(|at| match self.cells.get(k * samples + at) {
                    Some(cell) if cell.group == NO_GROUP => f64::from(cell.score),
                    Some(cell) => scratch.slope(&self.capacity, cell.group, f64::from(cell.score)),
                    None => 0.0,
                });
                let (fx, fy) = (f64::from(corners.fx), f64::from(corners.fy));
                let (top, bottom) = (a + fx * (b - a), c + fx * (d - c));
                [top + fy * (bottom - top), (1.0 - fy) * (b - a) + fy * (d - c), bottom - top]
            };
            let (a, b, f) = (read(low), read(high), f64::from(f));
            let [value, dx, dy] = [0, 1, 2].map(|i| a[i] + f * (b[i] - a[i]));
            let (by_length, weight) = (factor * (value + missing), f64::from(e.weight));
            let by = factor * f64::from(e.length) * weight * self.percent;
            let border =
                elements.view_slope(&e).map(|s| s * by_length * f64::from(e.length) * self.percent);
            *place = [
                by * dx * f64::from(self.grid.sx) + border[0],
                by * dy * f64::from(self.grid.sy) + border[1],
                by_length * weight * self.percent,
                by * (b[0] - a[0]) * f64::from(PER_RADIAN),
            ];
            place.iter_mut().filter(|g| !g.is_finite()).for_each(|g| *g = 0.0);
        }
    }
}
