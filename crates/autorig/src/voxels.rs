//! The interior of a closed mesh on a grid of cells, with each cell's distance to the
//! outside, and shortest paths through the interior.
//!
//! A cell is inside if at least two of three axis-parallel rays through a point near its
//! centre say so; overlapping bodies form one interior. Only the largest connected
//! component is kept.

use glam::{DVec3, IVec3, Vec3};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The number of cells along the longest side of the mesh's bounding box.
const LONGEST: f64 = 48.0;
/// Where rays pass through a cell. The offset from the centre avoids the symmetry planes
/// and edges that meshes tend to have.
const OFF: [f64; 2] = [0.5137, 0.4871];

/// A grid of cells.
pub(super) struct Grid {
    /// The number of cells along each axis, including an empty one at either end.
    size: [usize; 3],
    /// The minimum corner of the grid.
    origin: DVec3,
    cell: f64,
    /// For each cell, the distance from its centre to that of the nearest outside cell,
    /// in cells; 0 outside.
    clearance: Vec<f64>,
}

impl Grid {
    /// Samples the interior of a mesh; `None` if no cell is inside.
    pub fn inside(positions: &[Vec3], triangles: &[[u32; 3]]) -> Option<Grid> {
        let bounds = pcadlang_scene::geom::Bounds::around(positions.iter().map(|p| p.as_dvec3()))?;
        let cell = bounds.size().max_element() / LONGEST;
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let size = bounds.size().to_array().map(|s| (s / cell).ceil() as usize + 2);
        let grid =
            Grid { size, origin: bounds.min - DVec3::splat(cell), cell, clearance: Vec::new() };
        let mut votes = vec![0u8; size.iter().product()];
        for axis in 0..3 {
            grid.vote(axis, positions, triangles, &mut votes);
        }
        let inside = grid.largest(&votes.iter().map(|v| *v >= 2).collect::<Vec<_>>());
        if !inside.contains(&true) {
            return None;
        }
        let clearance = grid.distances(&inside);
        Some(Grid { clearance, ..grid })
    }

    /// The edge length of a cell.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// The distance from a cell's centre to the outside, in cells; 0 outside.
    pub fn clearance(&self, i: usize) -> f64 {
        self.clearance[i]
    }

    /// The inside cells, in increasing order.
    pub fn cells(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.clearance.len()).filter(|i| self.clearance[*i] > 0.0)
    }

    /// The number of cells, inside or not.
    pub fn len(&self) -> usize {
        self.clearance.len()
    }

    /// The centre of a cell.
    pub fn middle(&self, i: usize) -> DVec3 {
        self.origin + (self.place(i).as_dvec3() + DVec3::splat(0.5)) * self.cell
    }

    fn place(&self, i: usize) -> IVec3 {
        let [w, h, _] = self.size;
        IVec3::new((i % w) as i32, (i / w % h) as i32, (i / (w * h)) as i32)
    }

    fn at(&self, p: IVec3) -> Option<usize> {
        let within = p.min_element() >= 0
            && p.to_array().iter().zip(self.size).all(|(x, s)| (*x as usize) < s);
        within.then(|| (p.z as usize * self.size[1] + p.y as usize) * self.size[0] + p.x as usize)
    }

    /// The neighbours of a cell, with centre-to-centre distances in cells.
    fn around(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let p = self.place(i);
        let steps =
            (0..27).filter(|k| *k != 13).map(|k| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
        steps.filter_map(move |d| self.at(p + d).map(|j| (j, f64::from(d.length_squared()).sqrt())))
    }

    /// The cells within a radius of a cell, in cells.
    pub fn ball(&self, i: usize, radius: f64) -> impl Iterator<Item = usize> + '_ {
        let (p, r) = (self.place(i), radius.floor() as i32);
        let line = move |z| (-r..=r).flat_map(move |y| (-r..=r).map(move |x| IVec3::new(x, y, z)));
        let all = (-r..=r)
            .flat_map(line)
            .filter(move |d| f64::from(d.length_squared()) <= radius * radius);
        all.filter_map(move |d| self.at(p + d))
    }

    /// Returns the inside cells connected to `from` through cells for which `keep` holds.
    pub fn flood(&self, from: usize, keep: impl Fn(usize) -> bool) -> Vec<usize> {
        let (mut seen, mut found) = (vec![false; self.len()], vec![from]);
        seen[from] = true;
        let mut next = 0;
        while let Some(i) = found.get(next).copied() {
            next += 1;
            for (j, _) in self.around(i) {
                if !seen[j] && self.clearance[j] > 0.0 && keep(j) {
                    seen[j] = true;
                    found.push(j);
                }
            }
        }
        found
    }

    /// Returns the cheapest paths from a cell to all other inside cells: the cost to
    /// each, and the previous cell. A step costs its length in cells times the mean of
    /// `cost` at its ends.
    pub fn shortest_paths(
        &self,
        from: usize,
        cost: impl Fn(usize) -> f64,
    ) -> (Vec<f64>, Vec<usize>) {
        let (mut far, mut before) = (vec![f64::INFINITY; self.len()], vec![from; self.len()]);
        // Costs are non-negative, so their bits sort in the same order.
        let mut heap = BinaryHeap::from([Reverse((0u64, from))]);
        far[from] = 0.0;
        while let Some(Reverse((bits, i))) = heap.pop() {
            if bits != far[i].to_bits() {
                continue;
            }
            for (j, length) in self.around(i) {
                if self.clearance[j] > 0.0 {
                    let by = far[i] + length * 0.5 * (cost(i) + cost(j));
                    if by < far[j] {
                        far[j] = by;
                        before[j] = i;
                        heap.push(Reverse((by.to_bits(), j)));
                    }
                }
            }
        }
        (far, before)
    }

    /// Adds a vote to every cell that rays along an axis find inside: where the signed
    /// crossings before the cell do not cancel.
    fn vote(&self, axis: usize, positions: &[Vec3], triangles: &[[u32; 3]], votes: &mut [u8]) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut crossings: Vec<Vec<(f64, i32)>> = vec![Vec::new(); self.size[u] * self.size[v]];
        for t in triangles {
            let p = t
                .map(|i| ((positions[i as usize].as_dvec3() - self.origin) / self.cell).to_array());
            let range = |k: usize, off: f64| {
                let (lo, hi) = p
                    .iter()
                    .fold((f64::INFINITY, 0.0f64), |(lo, hi), q| (lo.min(q[k]), hi.max(q[k])));
                ((lo - off).ceil().max(0.0) as usize)
                    ..((hi - off).floor() + 1.0).clamp(0.0, self.size[k] as f64) as usize
            };
            // Twice the signed area to the left of an edge, seen along the axis.
            let side = |a: &[f64; 3], b: &[f64; 3], x: f64, y: f64| {
                (b[u] - a[u]) * (y - a[v]) - (b[v] - a[v]) * (x - a[u])
            };
            for i in range(u, OFF[0]) {
                for j in range(v, OFF[1]) {
                    let (x, y) = (i as f64 + OFF[0], j as f64 + OFF[1]);
                    let w = [
                        side(&p[1], &p[2], x, y),
                        side(&p[2], &p[0], x, y),
                        side(&p[0], &p[1], x, y),
                    ];
                    let sign = if w.iter().all(|w| *w >= 0.0) {
                        1
                    } else if w.iter().all(|w| *w <= 0.0) {
                        -1
                    } else {
                        continue;
                    };
                    let sum = w[0] + w[1] + w[2];
                    if sum != 0.0 {
                        let depth =
                            (w[0] * p[0][axis] + w[1] * p[1][axis] + w[2] * p[2][axis]) / sum;
                        crossings[j * self.size[u] + i].push((depth, sign));
                    }
                }
            }
        }
        for (line, crossings) in crossings.iter_mut().enumerate() {
            crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (mut next, mut turns) = (0, 0);
            for k in 0..self.size[axis] {
                while let Some((_, sign)) = crossings.get(next).filter(|c| c.0 <= k as f64 + 0.5) {
                    turns += sign;
                    next += 1;
                }
                let mut place = IVec3::ZERO;
                (place[axis], place[u], place[v]) =
                    (k as i32, (line % self.size[u]) as i32, (line / self.size[u]) as i32);
                if let Some(i) = self.at(place).filter(|_| turns != 0) {
                    votes[i] += 1;
                }
            }
        }
    }

    /// Keeps only the largest component connected through faces; the first, if several
    /// are.
    fn largest(&self, inside: &[bool]) -> Vec<bool> {
        let (mut seen, mut best) = (vec![false; inside.len()], Vec::new());
        for start in 0..inside.len() {
            if !inside[start] || seen[start] {
                continue;
            }
            let (mut piece, mut next) = (vec![start], 0);
            seen[start] = true;
            while let Some(i) = piece.get(next).copied() {
                next += 1;
                for (j, _) in self.around(i).filter(|(_, length)| *length == 1.0) {
                    if inside[j] && !seen[j] {
                        seen[j] = true;
                        piece.push(j);
                    }
                }
            }
            if piece.len() > best.len() {
                best = piece;
            }
        }
        let mut out = vec![false; inside.len()];
        for i in best {
            out[i] = true;
        }
        out
    }

    /// The exact Euclidean distance transform, one axis at a time: minimises the squared
    /// step along the axis plus the result of the previous axes.
    fn distances(&self, inside: &[bool]) -> Vec<f64> {
        let mut square: Vec<f64> =
            inside.iter().map(|i| if *i { f64::INFINITY } else { 0.0 }).collect();
        for (axis, stride) in [1, self.size[0], self.size[0] * self.size[1]].into_iter().enumerate()
        {
            let n = self.size[axis];
            let mut line = vec![0.0; n];
            for first in (0..square.len()).filter(|i| i / stride % n == 0) {
                for (k, x) in line.iter_mut().enumerate() {
                    *x = square[first + k * stride];
                }
                for k in 0..n {
                    let from =
                        |(m, x): (usize, &f64)| x + (m as f64 - k as f64) * (m as f64 - k as f64);
                    square[first + k * stride] =
                        line.iter().enumerate().map(from).fold(f64::INFINITY, f64::min);
                }
            }
        }
        square.iter().map(|s| s.sqrt()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_scene::geom::{Affine, Solid, sphere};
    use std::sync::Arc;

    #[test]
    fn the_inside_of_two_overlapping_spheres_is_their_union() {
        let ball = Solid::new(Arc::new(sphere(1.0, 48).unwrap()));
        let shift = |x| Affine::new(DVec3::new(x, 0.0, 0.0), DVec3::ZERO, DVec3::ONE);
        let m =
            Solid::group(&[ball.placed(shift(-0.6)), ball.placed(shift(0.6))]).to_mesh().unwrap();
        let g = Grid::inside(&m.positions, &m.topology.triangles).unwrap();
        let depth = |p: DVec3| 1.0 - (p - DVec3::new(0.6 * p.x.signum(), 0.0, 0.0)).length();
        let mut cells = 0;
        for i in 0..g.len() {
            let d = depth(g.middle(i)) / g.cell();
            assert!(d.abs() < 1.0 || (d > 0.0) == (g.clearance(i) > 0.0), "{}", g.middle(i));
            cells += usize::from(g.clearance(i) > 0.0);
        }
        // The volume of two balls less that of their common lens: two caps of height h =
        // 0.4 with volume pi h^2 (3 - h) / 3 each.
        let volume = std::f64::consts::PI * (8.0 / 3.0 - 2.0 * 0.16 * 2.6 / 3.0);
        assert!((cells as f64 * g.cell().powi(3) / volume - 1.0).abs() < 0.03);
        // Clearance is the distance to the nearest outside cell, found here by exhaustive
        // search.
        for i in g.cells().step_by(997) {
            let near = (0..g.len())
                .filter(|j| g.clearance(*j) == 0.0)
                .map(|j| (g.middle(j) - g.middle(i)).length());
            assert!((near.fold(f64::INFINITY, f64::min) / g.cell() - g.clearance(i)).abs() < 1e-9);
        }
        let from = g.cells().next().unwrap();
        let (far, before) = g.shortest_paths(from, |_| 1.0);
        for i in g.cells() {
            assert!(far[i] * g.cell() >= (g.middle(i) - g.middle(from)).length() - 1e-9);
            assert!(i == from || far[before[i]] < far[i]);
        }
    }
}
