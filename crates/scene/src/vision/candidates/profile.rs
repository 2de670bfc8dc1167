//! Axes with widths, computed from a mirror of a region, in pixels of the photograph.

use super::Axis;
use super::area::Area;
use super::mirror::Mirror;
use super::rim::{Edges, rims};

/// Number of positions along an axis with widths.
const PLACES: usize = 24;
/// Number of lines across the axis per position.
const LINES: usize = 4;
/// Step across the axis, pixels.
const STEP: f64 = 0.25;

/// Returns the axis of a mirror of a region of a picture with these edges, where a pixel
/// is `scale` pixels of the photograph wide and high.
pub fn axis(edges: &Edges, area: &Area, mirror: &Mirror, scale: [f64; 2]) -> Axis {
    let normal = [libm::cos(mirror.angle), libm::sin(mirror.angle)];
    // Upwards in the picture; to the right if the axis is level.
    let up = if normal[0] > 0.0 { [normal[1], -normal[0]] } else { [-normal[1], normal[0]] };
    let on_axis = [0, 1].map(|c| mirror.centre[c] + mirror.offset * normal[c]);
    let (mut low, mut high, mut reach) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    for (i, j) in area.points() {
        let d = [i as f64 + 0.5 - on_axis[0], j as f64 + 0.5 - on_axis[1]];
        let along = d[0] * up[0] + d[1] * up[1];
        (low, high) = (low.min(along - 0.5), high.max(along + 0.5));
        reach = reach.max((d[0] * normal[0] + d[1] * normal[1]).abs() + 1.0);
    }
    let at =
        |along: f64, across: f64| [0, 1].map(|c| on_axis[c] + along * up[c] + across * normal[c]);
    let steps = (reach / STEP).ceil() as i32;
    let width = |along: f64| {
        let places = (-steps..steps).map(|s| at(along, (f64::from(s) + 0.5) * STEP));
        0.5 * STEP * places.filter(|[x, y]| area.at(*x, *y)).count() as f64
    };
    let line = |l: usize| width(low + (high - low) * (l as f64 + 0.5) / (PLACES * LINES) as f64);
    let lines: Vec<f64> = (0..PLACES * LINES).map(line).collect();
    let means: Vec<f64> =
        lines.chunks(LINES).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
    let means = smoothed(&means);
    let length = high - low;
    // By distance from the foot, linear between the centres of the parts.
    let width = |d: f64| {
        let t = (d / length * PLACES as f64 - 0.5).clamp(0.0, (PLACES - 1) as f64);
        let i = (t as usize).min(PLACES - 2);
        means[i] + (t - i as f64) * (means[i + 1] - means[i])
    };
    let foot = rims(edges, length, width, |d, x| at(low + d, x));
    let top = rims(edges, length, |d| width(length - d), |d, x| at(high - d, x));
    let across = libm::hypot(normal[0] * scale[0], normal[1] * scale[1]);
    let place = |along: f64| {
        let p = at(along, 0.0);
        [p[0] * scale[0], p[1] * scale[1]]
    };
    Axis {
        symmetry: mirror.symmetry,
        foot: place(low),
        top: place(high),
        widths: means.iter().map(|w| (w * across).max(0.25)).collect(),
        rims: foot.into_iter().rev().chain(top).collect(),
    }
}

/// Averages each value with its neighbours, which have half its weight.
fn smoothed(values: &[f64]) -> Vec<f64> {
    let at = |i: usize| values[i.min(values.len() - 1)];
    (0..values.len())
        .map(|i| 0.25 * at(i.saturating_sub(1)) + 0.5 * at(i) + 0.25 * at(i + 1))
        .collect()
}
