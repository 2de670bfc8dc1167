//! Features of pictures: short lists of numbers for finding similar pictures.
//!
//! Contours give pooled distances to the nearest contour, and histograms of contour
//! length by cell and orientation, as in HOG (Dalal & Triggs 2005); keypoints give their
//! positions. The same functions serve rendered and observed pictures. Positions are in
//! units of the longer side relative to the picture's middle, so the sizes of pictures
//! need not agree. This is not a comparator: features have no density. Invariant:
//! features are finite, and their number does not depend on the picture.

use super::{ContourMap, ContourSlice, distance_transform};

/// Side in pixels of the square in which distances are computed.
const SIDE: usize = 64;
/// Distances are averaged over blocks with sides of this many pixels.
const POOL: usize = 4;
/// Upper bound of distances, in pixels of that square: a sixth of the picture.
const FAR: f32 = 10.0;
/// Cells per side, and orientations per cell, of the histograms.
const CELLS: usize = 8;
const ORIENTATIONS: usize = 4;
/// The number of features of contours.
pub const CONTOUR_FEATURES: usize = (SIDE / POOL) * (SIDE / POOL) + CELLS * CELLS * ORIENTATIONS;

/// Shifts by which a picture is moved for comparison, in units of its longer side, and
/// scales by which it is resized.
const SHIFTS: [f32; 3] = [0.0, -0.05, 0.05];
const SCALES: [f32; 3] = [1.0, 0.9, 1.11];

/// A short piece of contour, in units of the picture's longer side relative to its
/// middle; x to the right, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Its centre.
    pub at: [f32; 2],
    /// Its direction; the sign is arbitrary.
    pub along: [f32; 2],
    /// Its length.
    pub length: f32,
}

/// Converts a position in pixels of a picture to units of its longer side relative to its
/// middle.
fn centred(x: f32, y: f32, width: u32, height: u32) -> [f32; 2] {
    let longer = width.max(height).max(1) as f32;
    [(x - width as f32 / 2.0) / longer, (y - height as f32 / 2.0) / longer]
}

/// Converts rendered contours to strokes.
pub fn rendered(e: &ContourSlice) -> Vec<Stroke> {
    let longer = e.width.max(e.height).max(1) as f32;
    let stroke = |p: super::elements::Element| Stroke {
        at: centred(p.x, p.y, e.width, e.height),
        along: [p.tx, p.ty],
        length: p.length * p.weight / longer,
    };
    e.in_view().map(stroke).collect()
}

/// Converts observed contours to strokes: every point is about a pixel long.
pub fn observed(m: &ContourMap) -> Vec<Stroke> {
    let longer = m.width.max(m.height).max(1) as f32;
    let lists = m.x.iter().zip(&m.y).zip(m.tx.iter().zip(&m.ty));
    let stroke = |((x, y), (tx, ty)): ((&f32, &f32), (&f32, &f32))| Stroke {
        at: centred(*x, *y, m.width, m.height),
        along: [*tx, *ty],
        length: 1.0 / longer,
    };
    lists.map(stroke).collect()
}

/// Returns the features of contours: [`CONTOUR_FEATURES`] numbers. First come pooled
/// distances, from 0 on a contour to 1 far from any, scaled so that together they weigh
/// as much as one number. Then come the square roots of the fractions of the total length
/// in each cell and orientation, whose squares sum to 1 if there are contours.
pub fn contour_features(strokes: &[Stroke]) -> Vec<f32> {
    features_of(strokes, &turns(strokes))
}

/// Returns the features, given the orientations.
fn features_of(strokes: &[Stroke], turns: &[f32]) -> Vec<f32> {
    let mut features = pooled_distances(strokes);
    features.extend(histograms(strokes, turns));
    features
}

/// Returns the orientation of every piece, in units of the histograms' bins.
fn turns(strokes: &[Stroke]) -> Vec<f32> {
    let turn = |s: &Stroke| {
        let angle = libm::atan2f(s.along[1], s.along[0]) / std::f32::consts::PI;
        (angle - angle.floor()) * ORIENTATIONS as f32
    };
    strokes.iter().map(turn).collect()
}

fn pooled_distances(strokes: &[Stroke]) -> Vec<f32> {
    let mut set = vec![false; SIDE * SIDE];
    for s in strokes {
        let [x, y] = s.at.map(|v| (v + 0.5) * SIDE as f32);
        if x >= 0.0 && y >= 0.0 && x < SIDE as f32 && y < SIDE as f32 {
            set[y as usize * SIDE + x as usize] = true;
        }
    }
    let distances = distance_transform(SIDE as u32, SIDE as u32, &set).values;
    let blocks = SIDE / POOL;
    let mut pooled = vec![0.0; blocks * blocks];
    for (i, d) in distances.iter().enumerate() {
        pooled[i / SIDE / POOL * blocks + i % SIDE / POOL] +=
            d.min(FAR) / (FAR * (POOL * POOL) as f32);
    }
    let weight = 1.0 / blocks as f32;
    pooled.iter().map(|p| p * weight).collect()
}

/// Returns length by cell and orientation; each piece is split linearly between the
/// nearest cells and orientations.
fn histograms(strokes: &[Stroke], turns: &[f32]) -> Vec<f32> {
    let mut lengths = vec![0.0f32; CELLS * CELLS * ORIENTATIONS];
    let sound = |s: &Stroke| (s.at[0] + s.at[1] + s.along[0] + s.along[1] + s.length).is_finite();
    for (s, &turn) in strokes.iter().zip(turns).filter(|(s, _)| sound(s)) {
        let [x, y] = s.at.map(|v| (v + 0.5) * CELLS as f32 - 0.5);
        for (column, wx) in split(x) {
            for (row, wy) in split(y) {
                let inside = |i: i32| (0..CELLS as i32).contains(&i);
                if !(inside(column) && inside(row)) {
                    continue;
                }
                for (o, wo) in split(turn) {
                    let bin = o.rem_euclid(ORIENTATIONS as i32) as usize;
                    lengths[(row as usize * CELLS + column as usize) * ORIENTATIONS + bin] +=
                        s.length * wx * wy * wo;
                }
            }
        }
    }
    let total: f32 = lengths.iter().sum();
    if total > 0.0 {
        lengths.iter_mut().for_each(|l| *l = (*l / total).sqrt());
    }
    lengths
}

/// Returns the integers next to a number and their linear weights.
fn split(x: f32) -> [(i32, f32); 2] {
    let low = x.floor();
    [(low as i32, 1.0 - (x - low)), (low as i32 + 1, x - low)]
}

/// Returns the features of keypoints, some of which may be missing, from their positions
/// in pixels of a picture.
pub fn keypoint_features(points: &[Option<[f64; 2]>], width: u32, height: u32) -> Vec<f32> {
    // Missing points are placed in the middle; distant ones are clamped.
    let near = |x: f64| x.clamp(-1e9, 1e9) as f32;
    let at = |p: &Option<[f64; 2]>| {
        p.map_or([0.0; 2], |p| centred(near(p[0]), near(p[1]), width, height))
    };
    points
        .iter()
        .flat_map(at)
        .map(|v| if v.is_finite() { v.clamp(-10.0, 10.0) } else { 0.0 })
        .collect()
}

/// The features of an observed picture, to which others are compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Query {
    /// Its features, unmoved and slightly moved.
    variants: Vec<Vec<f32>>,
    /// The weight of each feature.
    weights: Vec<f32>,
}

impl Query {
    /// Builds a query that compares features directly.
    pub fn new(features: Vec<f32>) -> Query {
        Query { weights: vec![1.0; features.len()], variants: vec![features] }
    }

    /// Builds a query from contours that also compares them after small shifts (a
    /// twentieth of the longer side) and scalings (a tenth), so that a scene of the right
    /// shape is found even if it is slightly displaced.
    pub fn contours(strokes: &[Stroke]) -> Query {
        let turns = turns(strokes);
        let moved = |(dx, dy, scale): (f32, f32, f32)| {
            let to = |s: &Stroke| Stroke { at: [s.at[0] * scale + dx, s.at[1] * scale + dy], ..*s };
            features_of(&strokes.iter().map(to).collect::<Vec<_>>(), &turns)
        };
        Query { variants: movements().map(moved).collect(), weights: vec![1.0; CONTOUR_FEATURES] }
    }

    /// Builds a query from keypoints, weighted by confidence, that also compares them
    /// after the same movements. Missing ones are ignored.
    pub fn keypoints(
        points: &[Option<[f64; 2]>],
        confidence: &[f64],
        width: u32,
        height: u32,
    ) -> Query {
        let here = keypoint_features(points, width, height);
        let moved = |(dx, dy, scale): (f32, f32, f32)| {
            here.chunks(2)
                .flat_map(|p| [p[0] * scale + dx, p.get(1).map_or(0.0, |y| y * scale + dy)])
                .collect()
        };
        let weight = |(i, p): (usize, &Option<[f64; 2]>)| match p {
            Some(_) => [confidence.get(i).map_or(1.0, |c| *c as f32); 2],
            None => [0.0; 2],
        };
        let weights = points.iter().enumerate().flat_map(weight).collect();
        Query { variants: movements().map(moved).collect(), weights }
    }

    /// The number of features.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// True if there are no features.
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// Returns the squared distance to features of the same kind: the minimum over all
    /// variants.
    pub fn distance(&self, features: &[f32]) -> f32 {
        let to = |v: &Vec<f32>| -> f32 {
            let terms =
                v.iter().zip(features).zip(&self.weights).map(|((a, b), w)| w * (a - b) * (a - b));
            // NaN, which a user's detector may produce, is infinitely far.
            Some(terms.sum::<f32>()).filter(|d| !d.is_nan()).unwrap_or(f32::INFINITY)
        };
        self.variants.iter().map(to).fold(f32::INFINITY, f32::min)
    }
}

/// The shifts and scales to compare with, the identity first.
fn movements() -> impl Iterator<Item = (f32, f32, f32)> {
    SCALES.into_iter().flat_map(|s| {
        SHIFTS.into_iter().flat_map(move |x| SHIFTS.into_iter().map(move |y| (x, y, s)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of pieces in a picture of the given size.
    fn circle(cx: f32, cy: f32, r: f32, width: u32, height: u32) -> Vec<Stroke> {
        let n = 400;
        let at = |f: fn(f32) -> f32, c: f32| -> Vec<f32> {
            (0..n).map(|i| c + r * f(i as f32 / n as f32 * std::f32::consts::TAU)).collect()
        };
        let (x, y) = (at(libm::cosf, cx), at(libm::sinf, cy));
        let tx: Vec<f32> = y.iter().map(|y| (y - cy) / r).collect();
        let ty: Vec<f32> = x.iter().map(|x| (cx - x) / r).collect();
        let length = vec![1.0; n];
        rendered(&ContourSlice { x: &x, y: &y, tx: &tx, ty: &ty, length: &length, width, height })
    }

    #[test]
    fn features_do_not_depend_on_the_size_of_the_picture() {
        let (a, b) = (circle(60.0, 70.0, 30.0, 128, 128), circle(120.0, 140.0, 60.0, 256, 256));
        let (a, b) = (contour_features(&a), contour_features(&b));
        assert_eq!(a.len(), CONTOUR_FEATURES);
        let d = Query::new(a.clone()).distance(&b);
        assert!(d < 1e-4, "{d}");
        assert_eq!(a, contour_features(&circle(60.0, 70.0, 30.0, 128, 128)));
        let squares: f32 = a[(SIDE / POOL) * (SIDE / POOL)..].iter().map(|x| x * x).sum();
        assert!((squares - 1.0).abs() < 1e-5);
    }

    #[test]
    fn rendered_and_observed_contours_agree() {
        let strokes = circle(60.0, 70.0, 30.0, 128, 100);
        let mut map = ContourMap::new(128, 100);
        for s in &strokes {
            map.x.push(s.at[0] * 128.0 + 64.0);
            map.y.push(s.at[1] * 128.0 + 50.0);
            // The sign of a tangent is arbitrary.
            map.tx.push(-s.along[0]);
            map.ty.push(-s.along[1]);
            map.strength.push(0.7);
        }
        let d = Query::new(contour_features(&strokes)).distance(&contour_features(&observed(&map)));
        assert!(d < 2e-3, "{d}");
    }

    #[test]
    fn strokes_are_in_units_of_the_longer_side_from_the_middle() {
        // The second one is on the border, so half of it is in view.
        let (x, y): (&[f32], &[f32]) = (&[64.0, 0.0], &[25.0, 50.0]);
        let (tx, ty): (&[f32], &[f32]) = (&[1.0, 0.0], &[0.0, 1.0]);
        let drawn =
            rendered(&ContourSlice { x, y, tx, ty, length: &[2.0, 1.0], width: 128, height: 100 });
        let inside = Stroke { at: [0.0, -0.1953125], along: [1.0, 0.0], length: 2.0 / 128.0 };
        let border = Stroke { at: [-0.5, 0.0], along: [0.0, 1.0], length: 0.5 / 128.0 };
        assert_eq!(drawn, [inside, border]);
        let mut map = ContourMap::new(128, 100);
        map.x.push(64.0);
        map.y.push(25.0);
        map.tx.push(1.0);
        map.ty.push(0.0);
        map.strength.push(0.7);
        assert_eq!(observed(&map), [Stroke { length: 1.0 / 128.0, ..inside }]);
    }

    #[test]
    fn distances_order_pictures_and_small_movements_are_forgiven() {
        let here = circle(64.0, 64.0, 30.0, 128, 128);
        let q = Query::contours(&here);
        let to = |x: f32, r: f32| q.distance(&contour_features(&circle(x, 64.0, r, 128, 128)));
        assert_eq!(to(64.0, 30.0), 0.0);
        assert!(
            to(64.0, 30.0) < to(68.0, 30.0)
                && to(68.0, 30.0) < to(80.0, 30.0)
                && to(80.0, 30.0) < to(80.0, 10.0)
        );
        let stiff = Query::new(contour_features(&here))
            .distance(&contour_features(&circle(70.4, 64.0, 30.0, 128, 128)));
        assert!(to(70.4, 30.0) < 0.2 * stiff, "{} against {stiff}", to(70.4, 30.0));
    }

    #[test]
    fn nothing_in_view_and_nonsense_are_features_too() {
        let none = contour_features(&[]);
        assert!(none.len() == CONTOUR_FEATURES && none.iter().all(|x| x.is_finite()));
        let off = Stroke { at: [9.0, f32::NAN], along: [f32::NAN, 0.0], length: 1.0 };
        assert!(contour_features(&[off]).iter().all(|x| x.is_finite()));
        assert_eq!(Query::new(vec![0.0]).distance(&[f32::NAN]), f32::INFINITY);
    }

    #[test]
    fn keypoints_that_were_moved_or_made_smaller_or_larger_are_found_again() {
        let at = |points: [[f64; 2]; 2]| points.map(Some);
        let q = Query::keypoints(&at([[20.0, 80.0], [90.0, 10.0]]), &[1.0, 1.0], 100, 100);
        let to = |points: [[f64; 2]; 2]| q.distance(&keypoint_features(&at(points), 100, 100));
        // Unmoved; smaller; smaller, to the right and up; larger.
        for points in [
            [[20.0, 80.0], [90.0, 10.0]],
            [[23.0, 77.0], [86.0, 14.0]],
            [[28.0, 72.0], [91.0, 9.0]],
            [[16.7, 83.3], [94.4, 5.6]],
        ] {
            assert!(to(points) < 1e-9, "{points:?}: {}", to(points));
        }
        // Anisotropic scaling is not matched.
        assert!(to([[23.0, 83.0], [86.0, 6.0]]) > 1e-3);
    }

    #[test]
    fn missing_keypoints_do_not_count() {
        let q = Query::keypoints(&[Some([50.0, 50.0]), None], &[1.0, 1.0], 100, 100);
        let there =
            |second: Option<[f64; 2]>| keypoint_features(&[Some([50.0, 50.0]), second], 100, 100);
        assert_eq!(q.distance(&there(Some([0.0, 0.0]))), 0.0);
        assert_eq!(q.distance(&there(None)), 0.0);
        assert!(q.distance(&keypoint_features(&[Some([80.0, 50.0]), None], 100, 100)) > 0.01);
        assert_eq!(keypoint_features(&[Some([f64::NAN, 1e300])], 100, 100), [0.0, 10.0]);
    }
}
