//! One level of detail for the meshes of a topology: the vertices it keeps, and for each
//! omitted vertex the point of the coarse surface that was nearest when the level was
//! made.
//!
//! That point is given by barycentric coordinates in three kept vertices, so it moves
//! with them. In any other pose, its distance to the omitted vertex bounds the distance
//! from that vertex to the coarse surface. Invariant: indices fit the mesh that the level
//! was made from.

use super::Coarse;
use super::decimate::Coarsened;
use crate::geom::edges::{pair_edges, weld};
use crate::geom::{Edge, Edges, Mesh, NO_FACE, Topology};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// An omitted vertex, and the barycentric coordinates of the surface point that stands
/// for it.
#[derive(Clone, Copy, Debug)]
struct Bound {
    vertex: u32,
    corners: [u32; 3],
    shares: [f32; 3],
}

/// A level of detail; see the module's documentation.
#[derive(Clone, Debug)]
pub(in crate::geom) struct Level {
    topology: Arc<Topology>,
    /// For each of its vertices, the index in the fine mesh.
    pub vertices: Arc<[u32]>,
    /// The omitted vertices, by decreasing distance in the shape the level was made from.
    bounds: Vec<Bound>,
    /// The largest distance of an omitted vertex, in the mesh's units.
    pub deviation: f64,
}

impl Level {
    /// A level of a mesh with these positions and topology.
    pub(super) fn new(positions: &[Vec3], fine: &Topology, step: &Coarsened) -> Level {
        let mut own = vec![u32::MAX; positions.len()];
        step.triangles.iter().flatten().for_each(|v| own[*v as usize] = 0);
        let vertices: Arc<[u32]> =
            (0..positions.len() as u32).filter(|v| own[*v as usize] == 0).collect();
        vertices.iter().enumerate().for_each(|(i, v)| own[*v as usize] = i as u32);
        let triangles: Vec<[u32; 3]> =
            step.triangles.iter().map(|t| t.map(|v| own[v as usize])).collect();
        let point = weld(positions);
        let edges =
            if fine.edges.is_empty() { Edges::default() } else { edges(&point, &triangles, step) };
        let topology = Topology {
            triangles,
            parts: step.parts.clone(),
            part_count: fine.part_count,
            part_names: fine.part_names.clone(),
            edges,
            encloses: fine.encloses,
            ..Topology::default()
        };
        let near = Near::new(positions, &point, &step.triangles);
        let mut used = vec![false; positions.len()];
        fine.triangles.iter().flatten().for_each(|v| used[*v as usize] = true);
        let left_out = (0..positions.len()).filter(|v| used[*v] && own[*v] == u32::MAX);
        let mut bounds: Vec<(f64, Bound)> =
            left_out.map(|v| near.bound(v as u32, step.merged[v])).collect();
        bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
        let deviation = bounds.first().map_or(0.0, |b| b.0);
        Level {
            topology: Arc::new(topology),
            vertices,
            bounds: bounds.into_iter().map(|(_, bound)| bound).collect(),
            deviation,
        }
    }

    /// Drops the bounds, which only matter for other positions: a rigid mesh's are fixed.
    pub(super) fn rigid(self) -> Level {
        Level { bounds: Vec::new(), ..self }
    }

    /// Whether an omitted vertex may be farther than `most` from this level of a mesh
    /// with other positions. Positions that are NaN count as farther.
    pub fn exceeds(&self, positions: &[Vec3], most: f64) -> bool {
        let most = (most * most) as f32;
        let at = |v: u32| positions.get(v as usize).copied().unwrap_or(Vec3::NAN);
        self.bounds.iter().any(|Bound { vertex, corners: [a, b, c], shares }| {
            let there = at(*a) * shares[0] + at(*b) * shares[1] + at(*c) * shares[2];
            let far = there.distance_squared(at(*vertex));
            far > most || far.is_nan()
        })
    }

    /// Returns this level of a mesh.
    pub fn of(&self, mesh: &Mesh) -> Coarse {
        Coarse::of(mesh, Arc::clone(&self.vertices), Arc::clone(&self.topology))
    }
}

fn edges(point: &[u32], triangles: &[[u32; 3]], step: &Coarsened) -> Edges {
    let welded: Vec<[u32; 3]> =
        step.triangles.iter().map(|t| t.map(|v| point[v as usize])).collect();
    let all = pair_edges(&welded, |_, _| false).into_iter().map(|(f, c, g, _)| {
        let (a, b) = (welded[f][c], welded[f][(c + 1) % 3]);
        let crease = g != NO_FACE && step.creases.contains(&(a.min(b), a.max(b)));
        Edge {
            vertices: [triangles[f][c], triangles[f][(c + 1) % 3]],
            faces: [f as u32, g],
            crease,
        }
    });
    all.collect()
}

/// Nearest-point queries on a surface.
struct Near<'a> {
    positions: &'a [Vec3],
    point: &'a [u32],
    triangles: &'a [[u32; 3]],
    /// The triangles around each point: those of point `p` are
    /// `list[first[p]..first[p + 1]]`.
    first: Vec<u32>,
    list: Vec<u32>,
}

impl<'a> Near<'a> {
    fn new(positions: &'a [Vec3], point: &'a [u32], triangles: &'a [[u32; 3]]) -> Near<'a> {
        let corners =
            || triangles.iter().enumerate().flat_map(|(f, t)| t.iter().map(move |v| (f, *v)));
        let mut first = vec![0u32; positions.len() + 1];
        corners().for_each(|(_, v)| first[point[v as usize] as usize + 1] += 1);
        (0..positions.len()).for_each(|p| first[p + 1] += first[p]);
        let (mut next, mut list) = (first.clone(), vec![0; 3 * triangles.len()]);
        for (f, v) in corners() {
            let at = &mut next[point[v as usize] as usize];
            list[*at as usize] = f as u32;
            *at += 1;
        }
        Near { positions, point, triangles, first, list }
    }

    fn around(&self, vertex: u32) -> &[u32] {
        let p = self.point[vertex as usize] as usize;
        &self.list[self.first[p] as usize..self.first[p + 1] as usize]
    }

    /// Returns the point nearest to a vertex on the triangles around `merged`, then moves
    /// to adjacent triangles while it lies on the rim of one and gets nearer. Also
    /// returns its distance, which is infinite if there are no triangles.
    fn bound(&self, vertex: u32, merged: u32) -> (f64, Bound) {
        let p = self.at(vertex);
        let mut best =
            (f64::INFINITY, Bound { vertex, corners: [u32::MAX; 3], shares: [f32::NAN; 3] });
        self.around(merged).iter().for_each(|f| best = self.nearer(p, *f, best));
        while best.1.shares.contains(&0.0) {
            let before = best.0;
            let ends =
                best.1.corners.into_iter().zip(best.1.shares).filter(|(_, share)| *share > 0.0);
            ends.flat_map(|(v, _)| self.around(v)).for_each(|f| best = self.nearer(p, *f, best));
            if best.0 >= before {
                break;
            }
        }
        (best.0.sqrt(), best.1)
    }

    /// Returns the nearer of the best point so far and a triangle's nearest point, with
    /// its squared distance.
    fn nearer(&self, p: DVec3, face: u32, best: (f64, Bound)) -> (f64, Bound) {
        let corners = self.triangles[face as usize];
        let shares = nearest(p, corners.map(|v| self.at(v)));
        let there = corners.iter().zip(shares).map(|(v, s)| self.at(*v) * s).sum::<DVec3>();
        let d = there.distance_squared(p);
        if d < best.0 {
            (d, Bound { corners, shares: shares.map(|s| s as f32), ..best.1 })
        } else {
            best
        }
    }

    fn at(&self, v: u32) -> DVec3 {
        self.positions[v as usize].as_dvec3()
    }
}

/// Returns the barycentric coordinates of a triangle's point nearest to `p` (Ericson
/// 2005, *Real-time collision detection*, 5.1.5).
fn nearest(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}
