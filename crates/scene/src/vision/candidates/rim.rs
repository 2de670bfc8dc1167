//! Flat ends visible as ellipses: a rim, a lid or a foot that is tilted towards the
//! camera. The outline shows only the far half; if the near half is an edge, its height
//! determines the tilt, which the outline does not.

use crate::vision::detect::gradient::Gradient;

/// Step and number of candidate tilts, radians from level.
const STEP: f64 = 0.025;
const TRIED: usize = 40;
/// Number of positions along the near half of an ellipse, excluding its ends, where it
/// runs along the outline.
const PLACES: usize = 25;
const ENDS: f64 = 0.35;
/// Minimum distance of the near half from the far one, pixels: closer to it, the edge is
/// the outline's own.
const APART: f64 = 3.0;

/// The edges of a picture and their directions.
pub struct Edges<'a> {
    pub gradient: &'a Gradient,
    /// A gradient that is certainly an edge, above 0.
    pub strong: f32,
}

/// Returns the tilts that the `rims` of an axis refer to, radians: below 0 the lower end
/// is tilted towards the camera, above 0 the upper end.
pub fn tilts() -> impl Iterator<Item = f64> {
    (0..TRIED).rev().map(|i| -tilt(i)).chain((0..TRIED).map(tilt))
}

/// Returns a candidate tilt of an end.
fn tilt(i: usize) -> f64 {
    STEP * (i + 1) as f64
}

/// Returns the evidence for each tilt of an end, 0 to 1: how much more of an edge the
/// near half of its ellipse is than those closer to the outline. `at` maps the distance
/// inwards from the end and the distance across the axis to a position in the picture;
/// `width` is the half-width at a distance from the end; `length` is that of the axis.
/// All are in pixels.
pub fn rims(
    edges: &Edges,
    length: f64,
    width: impl Fn(f64) -> f64,
    at: impl Fn(f64, f64) -> [f64; 2],
) -> Vec<f64> {
    let mut least = f64::INFINITY;
    let support = |i: usize| {
        let edge = near_half(edges, libm::sin(tilt(i)), length, &width, &at);
        let Some(edge) = edge else { return 0.0 };
        least = least.min(edge);
        edge - least
    };
    (0..TRIED).map(support).collect()
}

/// Returns the edge strength along the near half of an ellipse, 0 to 1. Its far half ends
/// where the axis does, its half-width is that of the object there, and it is `flat`
/// times as high as wide. `None` if the near half is not distinct from the far half, or
/// not within the object.
fn near_half(
    edges: &Edges,
    flat: f64,
    length: f64,
    width: &impl Fn(f64) -> f64,
    at: &impl Fn(f64, f64) -> [f64; 2],
) -> Option<f64> {
    // The position of the ellipse's centre depends on the outline's width there.
    let middle = (0..8).fold(0.0, |middle: f64, _| 0.5 * (middle + flat * width(middle)));
    let across = width(middle);
    let high = flat * across;
    if middle + high > 0.95 * length || 2.0 * high < APART {
        return None;
    }
    let edge = |i: usize| {
        let angle = ENDS + (std::f64::consts::PI - 2.0 * ENDS) * i as f64 / (PLACES - 1) as f64;
        let (c, s) = (libm::cos(angle), libm::sin(angle));
        let [x, y] = at(middle + high * s, across * c);
        // The normal of the ellipse in the picture is the direction between two
        // positions.
        let ([x1, y1], [x2, y2]) = (at(middle, 0.0), at(middle + across * s, high * c));
        let (dx, dy) = (x2 - x1, y2 - y1);
        directed(edges.gradient, [x, y], [dx, dy]) / f64::from(edges.strong)
    };
    Some((0..PLACES).map(|i| edge(i).min(1.0)).sum::<f64>() / PLACES as f64)
}

/// Returns the change of colour along a direction at a position, per pixel; 0 beyond the
/// picture.
fn directed(gradient: &Gradient, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> f64 {
    let inside = |v: f64, most: u32| v >= 0.0 && v < f64::from(most);
    if !inside(x, gradient.width) || !inside(y, gradient.height) {
        return 0.0;
    }
    let [xx, xy, yy] =
        gradient.tensor[y as usize * gradient.width as usize + x as usize].map(f64::from);
    let square = dx * dx + dy * dy;
    ((dx * dx * xx + 2.0 * dx * dy * xy + dy * dy * yy) / square.max(1e-12)).max(0.0).sqrt()
}
