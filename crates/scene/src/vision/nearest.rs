//! The observed edge nearest to every sample of a grid, and its distance. Candidates are
//! the distance transform's nearest edges of a sample and of its eight neighbours; their
//! exact distances are computed several samples at a time. Invariant: the result is that
//! of measuring them one by one; among equally near edges the first one counts.

use super::distance_transform::{Columns, Envelope, FARTHEST};
use super::elements::{Edge, Edges};
use pcadlang_numerics::num::simd::vectorised;

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
