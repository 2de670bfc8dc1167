//! The derivatives of the chamfer score with respect to the rendered elements. The score
//! is piecewise smooth: on grid lines, and where a different piece becomes the nearest,
//! they are one-sided.

use super::super::elements::Element;
use super::super::elements::{PER_RADIAN, channel};
use super::reverse::Piece;
use super::{Chamfer, Mode, NOTHING, Scratch};
use crate::contours::ContourSlice;

impl Chamfer {
    /// Computes the derivatives of [`Chamfer::log_likelihood`] with respect to each
    /// element's x, y, length (pixels) and angle (radians, from right to down) into
    /// `out`, and returns the derivative with respect to sigma.
    pub fn gradient(
        &self,
        elements: &ContourSlice<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<[f64; 4]>,
    ) -> f64 {
        out.clear();
        out.resize(elements.len(), [0.0; 4]);
        let sigma = self.options.sigma;
        let square = sigma * sigma;
        let (forward, back) = (self.forward(elements), self.back(elements, scratch));
        let share = if back.is_some() { 0.5 } else { 1.0 };
        let rho = share * (forward.mean() + back.map_or(0.0, |b| b.mean()));
        let outer = -share * rho / square;
        let mean = forward.mean();
        // Derivatives with respect to a length and, per unit length, its distance.
        let slopes = |length: f64, mean: f64, d: f64| match self.options.mode {
            Mode::Mean => (outer * (d - mean) / length, outer / length),
            Mode::Sum => (self.log_normal(d), -d / square),
        };
        if forward.length > 0.0 {
            for e in elements.in_view() {
                let (read, slope) = self.read(&e);
                let d = self.cut(read);
                let (by_length, by_distance) = slopes(forward.length, mean, d);
                let Some(place) = out.get_mut(e.index) else { continue };
                let (length, weight) = (f64::from(e.length) * self.percent, f64::from(e.weight));
                if !self.is_cut(f64::from(read)) {
                    let by = length * weight * by_distance;
                    let [dx, dy, turn] = slope.map(|s| by * f64::from(s));
                    (place[0], place[1], place[3]) = (dx, dy, turn);
                }
                place[2] = by_length * weight * self.percent;
                let border = elements.view_slope(&e);
                place[0] += by_length * length * border[0];
                place[1] += by_length * length * border[1];
            }
        }
        if let (Some(reverse), Some(back)) = (&self.reverse, back)
            && back.length > 0.0
        {
            let turn = self.turn();
            let seen: Vec<Option<Element>> = by_index(elements);
            let mean = back.mean();
            reverse.each(elements, turn, &mut Scratch::default(), |length, distance, pair| {
                let d = f64::from(distance) * self.percent;
                let Some([point, piece]) = pair.filter(|_| !self.is_cut(d) && d < NOTHING) else {
                    return;
                };
                let (_, by_distance) = slopes(back.length, mean, d);
                let by = by_distance * f64::from(length) * self.percent * self.percent;
                let index = piece.index as usize;
                let (Some(place), Some(Some(e))) = (out.get_mut(index), seen.get(index)) else {
                    return;
                };
                let slope = distance_slope(point, piece, turn);
                place.iter_mut().zip(slope).for_each(|(p, s)| *p += by * s);
                let border = elements.view_slope(e);
                place[0] -= by * border[0] * elements.diagonal();
                place[1] -= by * border[1] * elements.diagonal();
            });
        }
        out.iter_mut().flatten().filter(|g| !g.is_finite()).for_each(|g| *g = 0.0);
        let by_sigma = match self.options.mode {
            Mode::Mean => rho * rho / (square * sigma) - 1.0 / sigma,
            Mode::Sum => {
                let one = |s: &super::ChamferSums| s.second / (square * sigma) - s.length / sigma;
                one(&forward) + back.as_ref().map_or(0.0, one)
            }
        };
        if by_sigma.is_finite() { by_sigma } else { 0.0 }
    }

    fn is_cut(&self, distance: f64) -> bool {
        self.options.truncate.is_some_and(|t| distance >= t)
    }
}

fn by_index(elements: &ContourSlice<'_>) -> Vec<Option<Element>> {
    let mut all = vec![None; elements.len()];
    elements.in_view().for_each(|e| all[e.index] = Some(e));
    all
}

/// The derivatives of the distance from an observed point to a rendered piece, in pixels,
/// with respect to the piece's x, y, length and angle.
fn distance_slope(point: &Piece, piece: &Piece, turn: f32) -> [f64; 4] {
    let (p, e) = (&point.edge, &piece.edge);
    let (dx, dy) = (p.x - e.x, p.y - e.y);
    let along = dx * e.tx + dy * e.ty;
    let held = along.clamp(-e.half, e.half);
    let (ux, uy) = (dx - held * e.tx, dy - held * e.ty);
    let distance = (ux * ux + uy * uy).sqrt();
    // On the piece itself the distance has a kink; 0 is used as its derivative.
    let (ux, uy) = if distance > 0.0 { (ux / distance, uy / distance) } else { (0.0, 0.0) };
    let by_length =
        if along.abs() > e.half { -0.5 * along.signum() * (ux * e.tx + uy * e.ty) } else { 0.0 };
    let mut by_angle = -held * (uy * e.tx - ux * e.ty);
    if turn > 0.0 {
        // The shorter way around.
        let d = channel(e.tx, e.ty) - p.turn;
        let half = 0.5 * super::CHANNELS as f32;
        let sign = if d.abs() > half { -d.signum() } else { d.signum() };
        by_angle += turn * PER_RADIAN * sign;
    }
    [-ux, -uy, by_length, by_angle].map(f64::from)
}
