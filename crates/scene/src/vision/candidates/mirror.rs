//! Mirror symmetry of a region: the axes in which it is most similar to its own mirror
//! image, and its widths along them. The silhouette of an object of revolution is
//! symmetric about the projection of its axis if the camera is far enough away.

use super::area::Area;
use std::f64::consts::PI;

/// Number of angles in the initial scan, over half a turn.
const ANGLES: usize = 60;
/// Approximate number of pixels used in the scan.
const SAMPLE: usize = 200;
/// Minimum angle between the first and the second axis, radians.
const APART: f64 = PI / 6.0;

/// A mirror line: the points whose product with the unit `normal` is `offset`, pixels.
#[derive(Clone, Copy, Debug)]
pub struct Mirror {
    /// Intersection over union of the region with its mirror image.
    pub symmetry: f64,
    /// Angle of the normal, radians.
    pub angle: f64,
    /// Distance from the region's centroid along the normal.
    pub offset: f64,
    /// The centroid.
    pub centre: [f64; 2],
    /// How many of the shape's points have their mirror image in the region.
    hits: usize,
}

/// A region's points relative to its centroid, those near its outline first: whether their
/// mirror images are in the region tells mirrors apart.
struct Shape<'a> {
    area: &'a Area,
    centre: [f64; 2],
    points: Vec<[f64; 2]>,
}

impl Shape<'_> {
    fn of(area: &Area, most: usize) -> Shape<'_> {
        let mut centre = [0.0; 2];
        for (i, j) in area.points() {
            centre[0] += i as f64 + 0.5;
            centre[1] += j as f64 + 0.5;
        }
        let centre = centre.map(|c| c / area.count as f64);
        let step = area.count.div_ceil(most).max(1);
        let inner = area.pixels.inner().inner();
        let (deep, near): (Vec<_>, Vec<_>) =
            area.points().step_by(step).partition(|(i, j)| inner.has(*i, *j));
        let about =
            |(i, j): (usize, usize)| [i as f64 + 0.5 - centre[0], j as f64 + 0.5 - centre[1]];
        Shape { area, centre, points: near.into_iter().chain(deep).map(about).collect() }
    }

    /// Returns the mirror at an angle and offset, with its symmetry.
    fn mirror(&self, angle: f64, offset: f64) -> Mirror {
        let none = Mirror { symmetry: 0.0, angle, offset, centre: self.centre, hits: 0 };
        self.better(angle, offset, &none).unwrap_or(none)
    }

    /// Returns the mirror at an angle and offset if its symmetry exceeds that of another.
    fn better(&self, angle: f64, offset: f64, than: &Mirror) -> Option<Mirror> {
        let (nx, ny) = (libm::cos(angle), libm::sin(angle));
        let mut left = self.points.len().checked_sub(than.hits + 1)?;
        for [x, y] in &self.points {
            let twice = 2.0 * (nx * x + ny * y - offset);
            let (x, y) = (x - twice * nx + self.centre[0], y - twice * ny + self.centre[1]);
            if !self.area.at(x, y) {
                left = left.checked_sub(1)?;
            }
        }
        let hits = than.hits + 1 + left;
        let symmetry = hits as f64 / (2 * self.points.len() - hits) as f64;
        Some(Mirror { symmetry, angle, offset, centre: self.centre, hits })
    }

    /// Returns the best mirror near another: steps of the given size in angle and offset,
    /// halved `halvings` times.
    fn refined(&self, from: Mirror, angle: f64, offset: f64, halvings: i32) -> Mirror {
        let mut best = self.mirror(from.angle, from.offset);
        for h in 0..=halvings {
            let (a, o) = (angle / f64::from(1 << h), offset / f64::from(1 << h));
            // A few steps at each size suffice, since the scan is already close.
            for _ in 0..3 {
                let last = best;
                for (da, d) in [(-a, 0.0), (a, 0.0), (0.0, -o), (0.0, o)] {
                    best = self.better(last.angle + da, last.offset + d, &best).unwrap_or(best);
                }
                if best.symmetry <= last.symmetry {
                    break;
                }
            }
        }
        best
    }
}

/// The angle between two lines, radians.
fn between(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(PI);
    d.min(PI - d)
}

/// Returns the approximate symmetry of a region in its best mirror, for comparing many
/// regions.
pub fn symmetry(area: &Area) -> f64 {
    let shape = Shape::of(area, SAMPLE);
    let mut best = shape.mirror(0.0, 0.0);
    for i in 1..ANGLES / 2 {
        let angle = PI * i as f64 / (ANGLES / 2) as f64;
        best = shape.better(angle, 0.0, &best).unwrap_or(best);
    }
    shape.refined(best, PI / 60.0, 1.0, 1).symmetry
}

/// Returns the mirror of a region whose normal has an angle and which passes a position.
pub fn mirror_at(area: &Area, angle: f64, [x, y]: [f64; 2]) -> Mirror {
    let shape = Shape::of(area, usize::MAX);
    let (x, y) = (x - shape.centre[0], y - shape.centre[1]);
    shape.mirror(angle, x * libm::cos(angle) + y * libm::sin(angle))
}

/// Returns the best mirror, and the best one in a different direction.
pub fn mirrors(area: &Area) -> Vec<Mirror> {
    let (rough, all) = (Shape::of(area, SAMPLE), Shape::of(area, usize::MAX));
    let angle = |i: usize| PI * i as f64 / ANGLES as f64;
    let mut scan: Vec<Mirror> = (0..ANGLES).map(|i| rough.mirror(angle(i), 0.0)).collect();
    scan.sort_by(|a, b| b.symmetry.total_cmp(&a.symmetry));
    let refined = |m: &Mirror| all.refined(*m, PI / 120.0, 1.0, 4);
    // On few points, neighbouring angles are hardly distinguishable, so the best three
    // are refined.
    let better = |a: Mirror, b: Mirror| if b.symmetry > a.symmetry { b } else { a };
    let Some(first) = scan.iter().take(3).map(refined).reduce(better) else { return Vec::new() };
    let second = scan.iter().find(|m| between(m.angle, first.angle) > APART + 0.05).map(refined);
    let second = second.filter(|m| between(m.angle, first.angle) >= APART);
    let mut out: Vec<Mirror> = [first].into_iter().chain(second).collect();
    out.sort_by(|a, b| b.symmetry.total_cmp(&a.symmetry));
    out
}
