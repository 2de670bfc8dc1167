//! Triangle meshes with smooth normals, part numbers and a table of edges.
//!
//! Meshes are immutable and shared by `Arc`. Vertices are split along creases, so that
//! each has one normal; edges know the faces on both sides across such splits. Meshes of
//! one shape share their [`Topology`].

use super::{Bounds, Normals, Patches, Sides};
use glam::Vec3;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Marks a missing second face in [`Edge::faces`].
pub const NO_FACE: u32 = u32::MAX;

/// An edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The end vertices, as numbered in the first face.
    pub vertices: [u32; 2],
    /// The adjacent faces; the second is [`NO_FACE`] on a boundary.
    pub faces: [u32; 2],
    /// True if the surface bends sharply here.
    pub crease: bool,
}

impl Edge {
    /// True if only one side has a face.
    pub fn is_boundary(&self) -> bool {
        self.faces[1] == NO_FACE
    }

    /// True if it shows as a line from every viewpoint: a crease or a boundary.
    pub fn is_sharp(&self) -> bool {
        self.crease || self.is_boundary()
    }
}

/// The edges of a mesh, each once, as a slice. Sharp edges, which show as lines from
/// every viewpoint, come first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edges {
    list: Vec<Edge>,
    /// The end index of each run of connected creases or boundaries.
    runs: Vec<usize>,
    open: bool,
}

impl Edges {
    /// Sorts edges: first the sharp ones, one connected line of creases or boundaries
    /// after another, then the others.
    pub fn new(list: Vec<Edge>) -> Edges {
        let (sharp, smooth): (Vec<Edge>, Vec<Edge>) = list.into_iter().partition(Edge::is_sharp);
        // Each edge starts as a line of its own, with boundaries and creases apart; where
        // two lines meet, the shorter is merged into the longer.
        let mut lines: Vec<Vec<Edge>> = Vec::new();
        let mut line_at: FxHashMap<(u32, bool), usize> = FxHashMap::default();
        for edge in sharp {
            let mut line = lines.len();
            lines.push(vec![edge]);
            let met = edge.vertices.map(|v| line_at.insert((v, edge.is_boundary()), line));
            for other in met.into_iter().flatten() {
                if other == line {
                    continue;
                }
                let (long, short) = if lines[other].len() < lines[line].len() {
                    (line, other)
                } else {
                    (other, line)
                };
                let moved = std::mem::take(&mut lines[short]);
                line_at.extend(
                    moved.iter().flat_map(|e| e.vertices.map(|v| ((v, e.is_boundary()), long))),
                );
                lines[long].extend(moved);
                line = long;
            }
        }
        let open = lines.iter().flatten().any(Edge::is_boundary);
        let (mut list, mut runs) = (Vec::new(), Vec::new());
        for line in lines.into_iter().filter(|line| !line.is_empty()) {
            list.extend(line);
            runs.push(list.len());
        }
        list.extend(smooth);
        Edges { list, runs, open }
    }

    /// The lines of connected creases or boundaries, one slice each.
    pub fn lines(&self) -> impl Iterator<Item = &[Edge]> {
        let firsts = std::iter::once(0).chain(self.runs.iter().copied());
        firsts.zip(&self.runs).map(|(first, past)| &self.list[first..*past])
    }

    /// True if there are boundary edges.
    pub fn open(&self) -> bool {
        self.open
    }
}

impl std::ops::Deref for Edges {
    type Target = [Edge];

    fn deref(&self) -> &[Edge] {
        &self.list
    }
}

impl FromIterator<Edge> for Edges {
    fn from_iter<I: IntoIterator<Item = Edge>>(edges: I) -> Edges {
        Edges::new(edges.into_iter().collect())
    }
}

/// The properties of a mesh that do not change when its vertices move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// The triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The part of each triangle.
    pub parts: Vec<u16>,
    /// The number of parts.
    pub part_count: u16,
    /// The names of parts by number. An empty string, or an index beyond the end, means
    /// that the part has no name.
    pub part_names: Vec<Arc<str>>,
    /// The edges.
    pub edges: Edges,
    /// True if the faces are known to enclose a body without crossing each other. Seen
    /// from outside, faces that point away from the camera are then hidden by others and
    /// need not be drawn. Meshes from files do not promise this.
    pub encloses: bool,
    /// The triangles in small groups.
    pub patches: Patches,
    /// The sides of the triangles.
    pub sides: Sides,
}

/// A triangle mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// A unit normal for each vertex.
    pub normals: Normals,
    /// The triangles, parts and edges.
    pub topology: Arc<Topology>,
}

/// The angle between faces, in degrees, above which an edge is a crease.
pub const CREASE_DEGREES: f64 = 40.0;
/// The maximum number of triangles of a mesh.
pub const MOST_TRIANGLES: usize = 5_000_000;
/// The minimum size of an object, in scene units; below it, single-precision vertex data
/// degenerate.
pub(super) const SMALLEST: f64 = 1e-30;
/// The maximum number of parts of a mesh; `u16::MAX` is not a part number.
pub const MOST_PARTS: usize = u16::MAX as usize;

impl Mesh {
    /// Puts a mesh together from its vertices, a unit normal for each, and the rest.
    pub fn of(positions: Vec<Vec3>, normals: impl Into<Normals>, topology: Arc<Topology>) -> Mesh {
        Mesh { positions, normals: normals.into(), topology }
    }

    /// Returns the bounding box.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::around(self.positions.iter().map(|p| p.as_dvec3()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_meshes_are_refused() {
        let p = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        assert!(Mesh::new(p.clone(), vec![[0, 1, 2]], vec![0]).is_ok());
        let e = Mesh::new(p.clone(), vec![[0, 1, 3]], vec![0]).unwrap_err().to_string();
        assert_eq!(e, "triangle 0 of the mesh uses vertices [0, 1, 3], but there are 3");
        assert!(Mesh::new(p.clone(), vec![[0, 1, 1]], vec![0]).is_err());
        assert!(
            Mesh::new(
                vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, f32::NAN, 0.0)],
                vec![[0, 1, 2]],
                vec![0]
            )
            .is_err()
        );
        assert!(Mesh::new(p.clone(), vec![], vec![]).is_err());
        assert!(Mesh::new(p.clone(), vec![[0, 1, 2]], vec![]).is_err());
        let e = Mesh::new(p.clone(), vec![[0, 1, 2]], vec![u16::MAX]).unwrap_err().to_string();
        assert_eq!(e, "a mesh has at most 65535 parts, numbered from 0");
        let e = Mesh::new(p, vec![[0, 1, 2]; MOST_TRIANGLES + 1], vec![]).unwrap_err().to_string();
        assert_eq!(e, "the mesh has 5000001 triangles; at most 5000000 are allowed");
    }

    #[test]
    fn a_single_triangle_has_three_boundary_edges() {
        let m = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], vec![0]).unwrap();
        assert_eq!(m.topology.edges.len(), 3);
        assert!(m.topology.edges.iter().all(|e| e.faces[1] == NO_FACE));
        assert!(m.normals.iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
    }

    #[test]
    fn lines_of_edges_hang_together() {
        // Two loops of four boundary edges, in an order that connects them late, a
        // separate crease, and one smooth edge.
        let edge = |a: u32, b: u32, crease: bool, other: u32| Edge {
            vertices: [a, b],
            faces: [0, other],
            crease,
        };
        let open = |a, b| edge(a, b, false, NO_FACE);
        let list = [
            open(0, 1),
            open(10, 11),
            edge(1, 2, false, 5),
            open(2, 3),
            open(12, 13),
            edge(0, 20, true, 5),
            open(1, 2),
            open(11, 12),
            open(3, 0),
            open(13, 10),
        ];
        let edges: Edges = list.into_iter().collect();
        let mut lines: Vec<(usize, u32)> = edges
            .lines()
            .map(|l| (l.len(), l.iter().flat_map(|e| e.vertices).max().unwrap_or(0)))
            .collect();
        lines.sort_unstable();
        assert_eq!(lines, [(1, 20), (4, 3), (4, 13)]);
        assert_eq!((edges.len(), edges.open(), edges[9]), (10, true, list[2]));
        assert!(!Edges::default().open() && Edges::default().lines().next().is_none());
    }
}
