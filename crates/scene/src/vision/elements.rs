//! Rendered contours as the comparators read them, and what the comparators have in
//! common: percent of the diagonal, which elements are in view, and errors. This is not a
//! renderer and does not depend on meshes. Invariant: elements that are not finite or lie
//! outside the picture have weight 0, so NaN cannot enter a score.
//!
//! Distances to the observed contours are a grid of samples in percent of the diagonal, with at
//! least [`FIELD_SIDE`] samples on its longer side for any frame, so that coarse and fine frames
//! read the same distances. Invariant: every sample is finite, within 0..=100, and
//! interpolation is continuous.

use super::distance_transform::{Columns, Envelope, FARTHEST};
use super::pictures::contour_map::ContourMap;
use crate::contours::ContourSlice;
use pcadlang_numerics::num::simd::vectorised;
use thiserror::Error;

/// One element, in pixels of its frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element {
    /// Position.
    pub x: f32,
    /// Position.
    pub y: f32,
    /// Tangent.
    pub tx: f32,
    /// Tangent.
    pub ty: f32,
    /// Length in pixels, above 0.
    pub length: f32,
    /// The fraction in view: 1 inside, 0 from half a pixel outside the border, linear
    /// between.
    pub weight: f32,
    /// Its index in the slices.
    pub index: usize,
}

impl ContourSlice<'_> {
    /// Length of the frame's diagonal in pixels.
    pub fn diagonal(&self) -> f64 {
        diagonal(self.width, self.height)
    }

    /// The elements that are finite, have a positive length, and are at least partly in
    /// view.
    #[inline(always)]
    pub(super) fn in_view(&self) -> impl Iterator<Item = Element> {
        let lists =
            self.x.iter().zip(self.y).zip(self.tx.iter().zip(self.ty)).zip(self.length).enumerate();
        lists.filter_map(move |(index, (((&x, &y), (&tx, &ty)), &length))| {
            let weight = self.weight([x, y], [tx, ty], length);
            (weight > 0.0).then_some(Element { x, y, tx, ty, length, weight, index })
        })
    }

    /// Returns the weight of an element: see [`Element`]. It is 0 if a number is not finite or
    /// the length not positive.
    #[inline(always)]
    pub(super) fn weight(&self, [x, y]: [f32; 2], [tx, ty]: [f32; 2], length: f32) -> f32 {
        let (w, h) = (self.width as f32, self.height as f32);
        let sound = (x + y + tx + ty + length).is_finite() & (length > 0.0);
        let weight = (x.min(w - x).min(y).min(h - y) + 0.5).clamp(0.0, 1.0);
        if sound { weight } else { 0.0 }
    }
}

impl ContourSlice<'_> {
    /// Returns the derivatives of an element's weight with respect to its x and y: within
    /// half a pixel of the border, those of the nearest side.
    pub(super) fn view_slope(&self, e: &Element) -> [f64; 2] {
        let (w, h) = (self.width as f32, self.height as f32);
        let sides = [(e.x, 0, 1.0), (w - e.x, 0, -1.0), (e.y, 1, 1.0), (h - e.y, 1, -1.0)];
        let mut slope = [0.0; 2];
        if e.weight < 1.0
            && let Some((_, axis, sign)) = sides.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
        {
            slope[axis] = sign;
        }
        slope
    }
}

/// Why a comparator could not be prepared or evaluated.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ComparatorError {
    /// The frame has no pixels or too many.
    #[error("cannot compare at {width} x {height} pixels: each side must be 1 to 16384 pixels")]
    Size {
        /// Requested width, in pixels.
        width: u32,
        /// Requested height, in pixels.
        height: u32,
    },
    /// An option is out of its range.
    #[error("{option} must be {range}")]
    Option {
        /// The option's name.
        option: &'static str,
        /// The allowed values.
        range: &'static str,
    },
    /// The observed map's lists have different lengths.
    #[error("the observed contours are invalid: their lists differ in length")]
    Map,
    /// A quantised picture with unsuitable labels.
    #[error(
        "a colour-reduced picture needs one label per pixel, each below the number of colours, 1 to 256"
    )]
    Labels,
}

/// Returns the length in pixels of the diagonal of a `width` x `height` picture.
pub(super) fn diagonal(width: u32, height: u32) -> f64 {
    let (w, h) = (f64::from(width), f64::from(height));
    (w * w + h * h).sqrt()
}

/// Returns an error unless both sides are 1 to 16384.
pub(super) fn check_size(width: u32, height: u32) -> Result<(), ComparatorError> {
    let fine = |n: u32| (1..=16384).contains(&n);
    if fine(width) && fine(height) { Ok(()) } else { Err(ComparatorError::Size { width, height }) }
}

/// Returns an error unless `value` is finite and `holds` is true.
pub(super) fn check(
    option: &'static str,
    range: &'static str,
    value: f64,
    holds: bool,
) -> Result<(), ComparatorError> {
    if value.is_finite() && holds { Ok(()) } else { Err(ComparatorError::Option { option, range }) }
}

/// Minimum number of samples on the longer side of a field. At 256, the error of bilinear
/// interpolation of |d| is at most 0.1 % of the diagonal.
pub const FIELD_SIDE: u32 = 256;

/// Number of orientation channels, `PI / 8` apart.
pub(super) const CHANNELS: usize = 8;

/// Channels per radian.
pub(super) const PER_RADIAN: f32 = CHANNELS as f32 / std::f32::consts::PI;

/// An observed contour point as a short straight piece, in grid units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    /// Position of the middle.
    pub x: f32,
    /// Position of the middle.
    pub y: f32,
    /// Unit tangent.
    pub tx: f32,
    /// Unit tangent.
    pub ty: f32,
    /// Half the length along the tangent.
    pub half: f32,
    /// Orientation in channels, 0..8.
    pub turn: f32,
}

impl Edge {
    /// Distance from a point to the piece, in grid units.
    #[inline(always)]
    pub fn distance(&self, x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - self.x, y - self.y);
        let along = dx * self.tx + dy * self.ty;
        // A clamp, written so that it vectorises.
        let along = if along < -self.half { -self.half } else { along };
        let along = if along > self.half { self.half } else { along };
        let (ex, ey) = (dx - along * self.tx, dy - along * self.ty);
        (ex * ex + ey * ey).sqrt()
    }
}

/// The observed contours in a grid's units.
#[derive(Debug, Clone)]
pub(super) struct Edges {
    /// Grid width.
    pub width: u32,
    /// Grid height.
    pub height: u32,
    /// Grid units per pixel of the frame, horizontally.
    pub sx: f32,
    /// Grid units per pixel of the frame, vertically.
    pub sy: f32,
    /// Percent of the diagonal per grid unit.
    pub percent: f32,
    /// The points, in the order of the map, without those that are not finite or outside
    /// the picture.
    pub edges: Vec<Edge>,
}

impl Edges {
    /// Resamples a map for a frame of `width` x `height`.
    pub fn new(map: &ContourMap, width: u32, height: u32) -> Result<Self, ComparatorError> {
        check_size(width, height)?;
        let n = map.x.len();
        if [map.y.len(), map.tx.len(), map.ty.len(), map.strength.len()].iter().any(|&m| m != n) {
            return Err(ComparatorError::Map);
        }
        let longer = width.max(height);
        let scale =
            if longer < FIELD_SIDE { f64::from(FIELD_SIDE) / f64::from(longer) } else { 1.0 };
        let side = |n: u32| ((f64::from(n) * scale).round() as u32).max(1);
        let (gw, gh) = (side(width), side(height));
        let mx = gw as f32 / map.width.max(1) as f32;
        let my = gh as f32 / map.height.max(1) as f32;
        let mut edges = Vec::with_capacity(n);
        for i in 0..n {
            let (x, y) = (map.x[i] * mx, map.y[i] * my);
            let (ux, uy) = (map.tx[i] * mx, map.ty[i] * my);
            let norm = (ux * ux + uy * uy).sqrt();
            let inside = x >= 0.0 && y >= 0.0 && x <= gw as f32 && y <= gh as f32;
            if !inside || !norm.is_finite() || norm <= 0.0 {
                continue;
            }
            let (tx, ty) = (ux / norm, uy / norm);
            // A pixel of the map is as long as the line that crosses it: 1 along an axis,
            // sqrt 2 along a diagonal.
            let half = 0.5 * norm / map.tx[i].abs().max(map.ty[i].abs());
            edges.push(Edge { x, y, tx, ty, half, turn: channel(tx, ty) });
        }
        let percent = (100.0 / diagonal(gw, gh)) as f32;
        Ok(Edges {
            width: gw,
            height: gh,
            sx: gw as f32 / width as f32,
            sy: gh as f32 / height as f32,
            percent,
            edges,
        })
    }

    /// Returns the grid samples around a point of the frame.
    #[inline(always)]
    pub fn corners(&self, x: f32, y: f32) -> Corners {
        let (first, fx, fy) = self.place(x, y);
        let (first, [right, below]) = (first as usize, self.steps());
        Corners { at: [first, first + right, first + below, first + below + right], fx, fy }
    }

    /// Returns the sample above and to the left of a point of the frame, and the fractions to
    /// the right and down.
    #[inline(always)]
    pub fn place(&self, x: f32, y: f32) -> (i32, f32, f32) {
        let (w, h) = (self.width as i32, self.height as i32);
        let gx = (x * self.sx - 0.5).clamp(0.0, (w - 1) as f32);
        let gy = (y * self.sy - 0.5).clamp(0.0, (h - 1) as f32);
        let (x0, y0) = ((gx as i32).min((w - 2).max(0)), (gy as i32).min((h - 2).max(0)));
        (y0 * w + x0, gx - x0 as f32, gy - y0 as f32)
    }

    /// Returns how many samples further on the next ones to the right and down are.
    #[inline(always)]
    pub fn steps(&self) -> [usize; 2] {
        let (w, h) = (self.width as usize, self.height as usize);
        [usize::from(w > 1), if h > 1 { w } else { 0 }]
    }
}

/// The four samples around a point and the fractions between them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corners {
    /// Indices: top left, top right, bottom left, bottom right.
    pub at: [usize; 4],
    /// Fraction to the right.
    pub fx: f32,
    /// Fraction down.
    pub fy: f32,
}

impl Corners {
    /// Returns the interpolated value, and its derivatives per grid unit.
    #[inline(always)]
    pub fn read(&self, field: &[f32]) -> (f32, f32, f32) {
        let [a, b, c, d] = self.at.map(|i| field[i]);
        let (fx, fy) = (self.fx, self.fy);
        let (top, bottom) = (a + fx * (b - a), c + fx * (d - c));
        (top + fy * (bottom - top), (1.0 - fy) * (b - a) + fy * (d - c), bottom - top)
    }
}

/// Returns the orientation of a tangent in channels: the angle modulo PI, times 8 / PI,
/// within 0..8. The arctangent is Abramowitz & Stegun 1964, 4.4.49 (error 2e-8): it has no
/// branches, so loops with it are vectorised.
#[inline(always)]
pub(super) fn channel(tx: f32, ty: f32) -> f32 {
    let (x, y) = (tx.abs(), ty.abs());
    let (less, more) = if y > x { (x, y) } else { (y, x) };
    let t = if more > 0.0 { less / more } else { 0.0 };
    let s = t * t;
    let series = [
        -0.016_165_737,
        0.042_909_61,
        -0.075_289_64,
        0.106_562_64,
        -0.142_088_99,
        0.199_935_51,
        -0.333_331_45,
        1.0,
    ];
    let angle = t * series.iter().fold(0.002_866_225_7, |sum, c| sum * s + c);
    let k = angle * PER_RADIAN;
    let k = if y > x { 0.5 * CHANNELS as f32 - k } else { k };
    let k = if (tx < 0.0) != (ty < 0.0) { CHANNELS as f32 - k } else { k };
    if k < CHANNELS as f32 { k } else { 0.0 }
}

/// Returns the smaller difference of two orientations in channels, 0..=4.
#[inline(always)]
pub(super) fn turn_between(a: f32, b: f32) -> f32 {
    let d = (a - b).abs();
    let other = CHANNELS as f32 - d;
    if other < d { other } else { d }
}

/// Returns the two channels next to a tangent's orientation and the weight of the second.
#[inline]
pub(super) fn channels_of(tx: f32, ty: f32) -> (usize, usize, f32) {
    let k = channel(tx, ty);
    let low = (k as usize).min(CHANNELS - 1);
    (low, (low + 1) % CHANNELS, k - low as f32)
}

/// Nearest edges of a grid's samples.
#[derive(Debug, Clone)]
pub(super) struct Nearest {
    /// Distance in percent of the diagonal, at most 100.
    pub distance: Vec<f32>,
    /// Index into [`Edges::edges`]; `u32::MAX` if no edge was found within reach.
    pub edge: Vec<u32>,
}

/// The edges that the distance transform finds along a row of samples, one list per
/// property, padded by a missing edge on both sides.
struct Row {
    x: Vec<f32>,
    y: Vec<f32>,
    tx: Vec<f32>,
    ty: Vec<f32>,
    half: Vec<f32>,
    edge: Vec<u32>,
}

impl Row {
    /// A row of missing edges, which are too far away to be the nearest of any sample.
    fn nothing(width: usize) -> Self {
        let list = |v: f32| vec![v; width + 2];
        let (x, y, tx, ty, half) =
            (list(f32::MAX), list(f32::MAX), list(0.0), list(0.0), list(0.0));
        Row { edge: vec![u32::MAX; x.len()], x, y, tx, ty, half }
    }

    fn put(&mut self, at: usize, id: u32, e: &Edge) {
        (self.x[at], self.y[at], self.tx[at], self.ty[at], self.half[at]) =
            (e.x, e.y, e.tx, e.ty, e.half);
        self.edge[at] = id;
    }
}

/// The position of a missing edge.
const FAR: Edge = Edge { x: f32::MAX, y: f32::MAX, tx: 0.0, ty: 0.0, half: 0.0, turn: 0.0 };

impl Edges {
    /// Returns for each grid pixel the nearest of the chosen edges and its distance in
    /// percent of the diagonal; `None` if no edges are chosen. The candidates are the
    /// transform's nearest edges of the pixel and its eight neighbours.
    pub fn nearest(&self, chosen: impl Fn(&Edge) -> bool) -> Option<Nearest> {
        self.search(None, chosen)
    }

    /// Like [`Edges::nearest`], but where the distance would be at least `percent` of the
    /// diagonal, it may be any number from there on, and the edge may be missing.
    pub fn nearest_within(&self, percent: f64, chosen: impl Fn(&Edge) -> bool) -> Option<Nearest> {
        // The transform measures between pixel centres, and from a sample's neighbours
        // too: half an edge's length and a few pixels bound the difference to the
        // distance from the sample to the edge.
        let half = self.edges.iter().map(|e| e.half).fold(0.0, f32::max);
        let reach = (percent / f64::from(self.percent) + f64::from(half)).ceil() + 4.0;
        self.search((reach <= FARTHEST as f64).then_some(reach as usize), chosen)
    }

    fn search(&self, reach: Option<usize>, chosen: impl Fn(&Edge) -> bool) -> Option<Nearest> {
        let (w, h) = (self.width as usize, self.height as usize);
        let mut first = vec![u32::MAX; w * h];
        for (i, e) in self.edges.iter().enumerate().rev().filter(|(_, e)| chosen(e)) {
            first[(e.y as usize).min(h - 1) * w + (e.x as usize).min(w - 1)] = i as u32;
        }
        let set: Vec<bool> = first.iter().map(|&i| i != u32::MAX).collect();
        if !set.contains(&true) {
            return None;
        }
        let (columns, mut envelope, mut line) =
            (Columns::of(w, h, &set), Envelope::default(), Vec::new());
        let mut fill = |y: usize, row: &mut Row| {
            let mut at = 0;
            let put = |found: Option<(usize, i32)>| {
                at += 1;
                let place =
                    found.map(|(column, down)| (y as i64 + i64::from(down)) as usize * w + column);
                match place.map(|p| first[p]) {
                    Some(id) => row.put(at, id, &self.edges[id as usize]),
                    None => row.put(at, u32::MAX, &FAR),
                }
            };
            match reach {
                Some(reach) => columns.within(y, reach, &mut line, put),
                None => columns.nearest(y, &mut envelope, put),
            }
        };
        let mut out = Nearest { distance: vec![0.0; w * h], edge: vec![0; w * h] };
        let mut rows = [Row::nothing(w), Row::nothing(w), Row::nothing(w)];
        fill(0, &mut rows[2]);
        for (y, (distance, edge)) in
            out.distance.chunks_exact_mut(w).zip(out.edge.chunks_exact_mut(w)).enumerate()
        {
            rows.rotate_left(1);
            if y + 1 < h {
                fill(y + 1, &mut rows[2])
            } else {
                rows[2] = Row::nothing(w)
            }
            vectorised(
                #[inline(always)]
                || closest(&rows, y as f32 + 0.5, self.percent, distance, edge),
            );
        }
        Some(out)
    }
}

/// A list from each of its first three positions on.
#[inline(always)]
fn three<T>(list: &[T], length: usize) -> [&[T]; 3] {
    [&list[..length], &list[1..][..length], &list[2..][..length]]
}

/// Finds the nearest of the edges found at the samples of a row and at their neighbours.
#[inline(always)]
fn closest(rows: &[Row; 3], y: f32, percent: f32, distance: &mut [f32], edge: &mut [u32]) {
    let w = distance.len();
    let edge = &mut edge[..w];
    distance.fill(f32::INFINITY);
    edge.fill(u32::MAX);
    for row in rows {
        let [x0, x1, x2] = three(&row.x, w);
        let [y0, y1, y2] = three(&row.y, w);
        let [tx0, tx1, tx2] = three(&row.tx, w);
        let [ty0, ty1, ty2] = three(&row.ty, w);
        let [half0, half1, half2] = three(&row.half, w);
        let [id0, id1, id2] = three(&row.edge, w);
        for i in 0..w {
            let (mut least, mut nearest) = (distance[i], edge[i]);
            let candidates = [
                (x0[i], y0[i], tx0[i], ty0[i], half0[i], id0[i]),
                (x1[i], y1[i], tx1[i], ty1[i], half1[i], id1[i]),
                (x2[i], y2[i], tx2[i], ty2[i], half2[i], id2[i]),
            ];
            for (ex, ey, tx, ty, half, id) in candidates {
                let d = Edge { x: ex, y: ey, tx, ty, half, turn: 0.0 }
                    .distance(i as u32 as f32 + 0.5, y);
                // Without branches, so that it vectorises.
                let nearer = (d < least) | ((d == least) & (id < nearest));
                least = if nearer { d } else { least };
                nearest = if nearer { id } else { nearest };
            }
            distance[i] = least;
            edge[i] = nearest;
        }
    }
    distance.iter_mut().for_each(|d| *d = (*d * percent).min(100.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_view_drops_what_cannot_be_scored() {
        let nan = f32::NAN;
        let e = ContourSlice {
            x: &[5.0, nan, 5.0, 5.0, -3.0, 0.0, 5.0],
            y: &[5.0, 5.0, 5.0, 5.0, 5.0, 5.0, f32::INFINITY],
            tx: &[1.0, 1.0, nan, 1.0, 1.0, 1.0, 1.0],
            ty: &[0.0; 7],
            length: &[1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0],
            width: 10,
            height: 10,
        };
        let kept: Vec<(usize, f32)> = e.in_view().map(|e| (e.index, e.weight)).collect();
        assert_eq!(kept, [(0, 1.0), (5, 0.5)]);
    }

    #[test]
    fn the_shortest_list_counts() {
        let long: &[f32] = &[1.0; 3];
        let all = ContourSlice {
            x: long,
            y: long,
            tx: long,
            ty: long,
            length: long,
            width: 9,
            height: 9,
        };
        let two: &[f32] = &[1.0; 2];
        for e in [
            ContourSlice { x: two, ..all },
            ContourSlice { y: two, ..all },
            ContourSlice { tx: two, ..all },
            ContourSlice { ty: two, ..all },
            ContourSlice { length: two, ..all },
        ] {
            assert_eq!((e.len(), e.in_view().count()), (2, 2));
        }
        assert_eq!(all.len(), 3);
    }

    #[test]
    fn sizes() {
        assert_eq!(diagonal(3, 4), 5.0);
        assert!(
            check_size(0, 4).is_err()
                && check_size(4, 16385).is_err()
                && check_size(1, 16384).is_ok()
        );
    }
}

#[cfg(test)]
mod nearest_tests {
    use super::*;
    use crate::vision::distance_transform::distance_transform;
    use crate::vision::testing::clutter;

    /// The nearest of the nine edges that the transform finds at a sample and next to it,
    /// measured one by one.
    fn plain(edges: &Edges, chosen: &dyn Fn(&Edge) -> bool) -> Vec<(f32, u32)> {
        let (w, h) = (edges.width as usize, edges.height as usize);
        let mut first = vec![u32::MAX; w * h];
        for (i, e) in edges.edges.iter().enumerate().rev().filter(|(_, e)| chosen(e)) {
            first[(e.y as usize).min(h - 1) * w + (e.x as usize).min(w - 1)] = i as u32;
        }
        let set: Vec<bool> = first.iter().map(|&i| i != u32::MAX).collect();
        let map = distance_transform(edges.width, edges.height, &set);
        let at = |i: usize| {
            let (x, y) = (i % w, i / w);
            let mut best = (f32::INFINITY, u32::MAX);
            for v in y.saturating_sub(1)..(y + 2).min(h) {
                for u in x.saturating_sub(1)..(x + 2).min(w) {
                    let id = first[map.nearest[v * w + u] as usize];
                    let d = edges.edges[id as usize].distance(x as f32 + 0.5, y as f32 + 0.5);
                    if d < best.0 || (d == best.0 && id < best.1) {
                        best = (d, id);
                    }
                }
            }
            ((best.0 * edges.percent).min(100.0), best.1)
        };
        (0..w * h).map(at).collect()
    }

    #[test]
    fn edges_are_those_found_one_by_one() {
        for (n, (w, h)) in [(3, (40, 30)), (60, (300, 120)), (400, (256, 257))] {
            let map = clutter(100, 80, n, n as u64).map();
            let edges = Edges::new(&map, w, h).unwrap();
            let chosen = |e: &Edge| e.turn > 2.0;
            let expected = plain(&edges, &chosen);
            let found = edges.nearest(chosen).unwrap();
            let near = edges.nearest_within(3.3, chosen).unwrap();
            for (i, &(d, id)) in expected.iter().enumerate() {
                assert_eq!((found.distance[i].to_bits(), found.edge[i]), (d.to_bits(), id), "{i}");
                if d < 3.3 {
                    assert_eq!(
                        (near.distance[i].to_bits(), near.edge[i]),
                        (d.to_bits(), id),
                        "{i}"
                    );
                } else {
                    assert!(near.distance[i] >= 3.3, "{i}");
                }
            }
            assert!(edges.nearest(|_| false).is_none());
        }
    }
}
