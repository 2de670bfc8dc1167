//! Flat ends seen as ellipses: a rim, a lid or a foot that is turned towards the camera.
//! The outline shows only the far half; where the near half is an edge, its height tells
//! the tilt, which an outline does not.

use crate::vision::gradient::Gradient;

/// Tilts that are tried, radians from level.
const STEP: f64 = 0.025;
const TRIED: usize = 40;
/// Places along the near half of an ellipse, without its ends, where it runs along the
/// outline.
const PLACES: usize = 25;
const ENDS: f64 = 0.35;
/// How far the near half is from the far one at least, pixels: nearer, it is the
/// outline's own edge.
const APART: f64 = 3.0;

/// Where a picture has edges, and which way they run.
pub struct Edges<'a> {
    pub gradient: &'a Gradient,
    /// A gradient that is an edge beyond doubt, above 0.
    pub strong: f32,
}

/// The tilts that `rims` of an axis tell of, radians: below 0 the lower end is turned
/// towards the camera, above 0 the upper end.
pub fn tilts() -> impl Iterator<Item = f64> {
    (0..TRIED).rev().map(|i| -tilt(i)).chain((0..TRIED).map(tilt))
}

/// One of the tilts that are tried at an end.
fn tilt(i: usize) -> f64 {
    STEP * (i + 1) as f64
}

/// How much speaks for each tilt of an end, 0 to 1: how much more of an edge the near
/// half of the ellipse is than those between it and the outline. `at` gives the place in
/// the picture by the distance from the end inwards and that across the axis; `width` the
/// half-width at such a distance; `length` is that of the axis. All in pixels.
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

/// How much of an edge the near half of an ellipse is, 0 to 1: of one whose far half ends
/// where the axis does, with the half-width there and `flat` times as high as wide.
/// `None` where it is not apart from the far half, or not within the object.
fn near_half(
    edges: &Edges,
    flat: f64,
    length: f64,
    width: &impl Fn(f64) -> f64,
    at: &impl Fn(f64, f64) -> [f64; 2],
) -> Option<f64> {
    // Where the ellipse's middle is depends on how wide the outline is there.
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
        // The normal of the ellipse, in the picture: its direction is that between two
        // places.
        let ([x1, y1], [x2, y2]) = (at(middle, 0.0), at(middle + across * s, high * c));
        let (dx, dy) = (x2 - x1, y2 - y1);
        directed(edges.gradient, [x, y], [dx, dy]) / f64::from(edges.strong)
    };
    Some((0..PLACES).map(|i| edge(i).min(1.0)).sum::<f64>() / PLACES as f64)
}

/// The change of colour along a direction at a place, per pixel; 0 beyond the picture.
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
