//! From a triangle soup to a mesh: welding, the edge table, creases, smooth normals.
//!
//! Invariant: the result depends only on the order of the faces, never on that of a hash
//! table; every edge of every face is in the table exactly once.

use super::mesh::{CREASE_DEGREES, MOST_PARTS, MOST_TRIANGLES};
use super::{Edge, GeomError, Mesh, NO_FACE, Topology};
use glam::{DVec3, Vec3};
use rustc_hash::FxHashMap;
use std::sync::Arc;

impl Mesh {
    /// Makes a mesh from positions and triangles, with the part of each triangle. Equal
    /// positions are merged into one point, and triangles without area are dropped.
    /// Normals are angle-weighted means over the faces around a point, up to creases.
    ///
    /// # Errors
    /// A position that is not finite; an index out of range; a part number of 65535; a
    /// number of parts that differs from that of triangles; more than five million
    /// triangles; no triangle with positive area.
    pub fn new(
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        parts: Vec<u16>,
    ) -> Result<Mesh, GeomError> {
        if triangles.len() > MOST_TRIANGLES {
            return Err(GeomError::invalid(format!(
                "the mesh has {} triangles; at most {MOST_TRIANGLES} are allowed",
                triangles.len()
            )));
        }
        if parts.len() != triangles.len() {
            return Err(GeomError::invalid("a mesh needs one part number per triangle"));
        }
        if parts.contains(&u16::MAX) {
            return Err(GeomError::invalid(format!(
                "a mesh has at most {MOST_PARTS} parts, numbered from 0"
            )));
        }
        if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
            return Err(GeomError::invalid(format!(
                "vertex {i} of the mesh is not finite: {}",
                positions[i]
            )));
        }
        if let Some(i) =
            triangles.iter().position(|t| t.iter().any(|v| *v as usize >= positions.len()))
        {
            let t = triangles[i];
            let message = format!(
                "triangle {i} of the mesh uses vertices {t:?}, but there are {}",
                positions.len()
            );
            return Err(GeomError::invalid(message));
        }
        build(&positions, &triangles, &parts)
            .ok_or_else(|| GeomError::invalid("all triangles of the mesh have zero area"))
    }
}

/// Builds a mesh; `None` if no triangle has positive area.
fn build(positions: &[Vec3], triangles: &[[u32; 3]], parts: &[u16]) -> Option<Mesh> {
    let weld = weld(positions);
    let mut faces = Vec::new();
    let mut kept_parts = Vec::new();
    let mut normals = Vec::new();
    for (t, part) in triangles.iter().zip(parts) {
        let w = t.map(|v| weld[v as usize]);
        if w[0] == w[1] || w[1] == w[2] || w[2] == w[0] {
            continue;
        }
        let p = w.map(|v| positions[v as usize].as_dvec3());
        let n = (p[1] - p[0]).cross(p[2] - p[0]);
        if n.length_squared() > 0.0 {
            faces.push(w);
            kept_parts.push(*part);
            normals.push(n.normalize());
        }
    }
    if faces.is_empty() {
        return None;
    }
    let edges = pair_edges(&faces, |a, b| {
        normals[a].dot(normals[b]) < libm::cos(CREASE_DEGREES.to_radians())
    });
    let groups = smoothing_groups(&faces, &edges);

    // One vertex for each point and each smoothing group around it.
    let mut index: FxHashMap<(u32, u32), u32> = FxHashMap::default();
    let (mut out_positions, mut sums) = (Vec::new(), Vec::<DVec3>::new());
    let mut out = Vec::with_capacity(faces.len());
    for (f, w) in faces.iter().enumerate() {
        let corners = [0, 1, 2].map(|c| {
            let vertex = *index.entry((w[c], groups[f * 3 + c])).or_insert_with(|| {
                out_positions.push(positions[w[c] as usize]);
                sums.push(DVec3::ZERO);
                sums.len() as u32 - 1
            });
            let at = |k: usize| positions[w[(c + k) % 3] as usize].as_dvec3();
            let (u, v) = ((at(1) - at(0)).normalize_or_zero(), (at(2) - at(0)).normalize_or_zero());
            sums[vertex as usize] += normals[f] * libm::acos(u.dot(v).clamp(-1.0, 1.0));
            vertex
        });
        out.push(corners);
    }
    let out_normals: Vec<Vec3> = sums.iter().map(|n| n.normalize_or(DVec3::Y).as_vec3()).collect();
    let edges = edges
        .into_iter()
        .map(|(f, c, g, crease)| Edge {
            vertices: [out[f][c], out[f][(c + 1) % 3]],
            faces: [f as u32, g],
            crease,
        })
        .collect();
    let part_count = kept_parts.iter().max().map_or(0, |p| p.saturating_add(1));
    let part_names = Vec::new();
    let topology = Topology {
        triangles: out,
        parts: kept_parts,
        part_count,
        part_names,
        edges,
        ..Topology::default()
    };
    Some(Mesh::of(out_positions, out_normals, Arc::new(topology)))
}

/// Returns a normal for each vertex of a surface without creases: the area-weighted mean
/// over the adjacent faces. Unlike angle weights, this is cheap enough to compute for
/// every shape of a body.
pub(super) fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for t in triangles {
        let p = t.map(|v| positions[v as usize].as_dvec3());
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        for v in t {
            sums[*v as usize] += normal;
        }
    }
    sums.iter().map(|n| n.normalize_or(DVec3::Y).as_vec3()).collect()
}

/// Returns, for each vertex, the first vertex at the same position.
pub fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first: FxHashMap<[u32; 3], u32> = FxHashMap::default();
    let key = |p: &Vec3| [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
    positions.iter().enumerate().map(|(i, p)| *first.entry(key(p)).or_insert(i as u32)).collect()
}

/// Returns every edge once: its first face and the corner there, its second face, and
/// whether it is a crease. More than two faces at an edge form pairs; one left over makes
/// a boundary.
pub(super) fn pair_edges(
    faces: &[[u32; 3]],
    is_crease: impl Fn(usize, usize) -> bool,
) -> Vec<(usize, usize, u32, bool)> {
    let mut open: FxHashMap<(u32, u32), usize> = FxHashMap::default();
    let mut edges: Vec<(usize, usize, u32, bool)> = Vec::with_capacity(faces.len() * 3 / 2);
    for (f, w) in faces.iter().enumerate() {
        for c in 0..3 {
            let (a, b) = (w[c], w[(c + 1) % 3]);
            let key = (a.min(b), a.max(b));
            match open.remove(&key) {
                Some(e) => {
                    let first = edges[e].0;
                    edges[e].2 = f as u32;
                    edges[e].3 = is_crease(first, f);
                }
                None => {
                    open.insert(key, edges.len());
                    edges.push((f, c, NO_FACE, false));
                }
            }
        }
    }
    edges
}

/// Returns the smoothing group of each corner of each face: corners at one point are in
/// one group if their faces are connected around the point without crossing a crease.
fn smoothing_groups(faces: &[[u32; 3]], edges: &[(usize, usize, u32, bool)]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..faces.len() as u32 * 3).collect();
    fn root(parent: &mut [u32], mut x: u32) -> u32 {
        while parent[x as usize] != x {
            parent[x as usize] = parent[parent[x as usize] as usize];
            x = parent[x as usize];
        }
        x
    }
    for (f, c, g, crease) in edges {
        if *g == NO_FACE || *crease {
            continue;
        }
        for corner in [*c, (c + 1) % 3] {
            let point = faces[*f][corner];
            if let Some(other) = faces[*g as usize].iter().position(|w| *w == point) {
                let (a, b) = (
                    root(&mut parent, (f * 3 + corner) as u32),
                    root(&mut parent, g * 3 + other as u32),
                );
                parent[a.max(b) as usize] = a.min(b);
            }
        }
    }
    (0..parent.len() as u32).map(|x| root(&mut parent, x)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two halves of unit squares that share an edge on the z axis; the second is rotated
    /// up by an angle.
    fn hinge(degrees: f32) -> Mesh {
        let (s, c) = degrees.to_radians().sin_cos();
        let p = vec![
            Vec3::ZERO,
            Vec3::Z,
            Vec3::X,
            Vec3::Z,
            Vec3::new(-0.0, 0.0, 0.0),
            Vec3::new(-c, s, 0.0),
        ];
        Mesh::new(p, vec![[0, 1, 2], [3, 4, 5]], vec![0, 3]).unwrap()
    }

    #[test]
    fn equal_positions_are_one_point_and_sharp_edges_split_it() {
        for (degrees, crease, vertices) in
            [(0.0, false, 4), (39.0, false, 4), (41.0, true, 6), (150.0, true, 6)]
        {
            let m = hinge(degrees);
            assert_eq!(m.positions.len(), vertices, "{degrees} degrees");
            let shared: Vec<&Edge> =
                m.topology.edges.iter().filter(|e| e.faces[1] != NO_FACE).collect();
            assert_eq!((m.topology.edges.len(), shared.len()), (5, 1));
            assert_eq!((shared[0].faces, shared[0].crease), ([0, 1], crease));
            assert_eq!(
                shared[0].vertices,
                [m.topology.triangles[0][0], m.topology.triangles[0][1]]
            );
            assert_eq!((m.topology.parts.as_slice(), m.topology.part_count), (&[0, 3][..], 4));
        }
        // Smooth: both faces have the same angle at the origin, so the normal there
        // bisects the 39 degrees.
        let m = hinge(39.0);
        let (s, c) = 19.5f32.to_radians().sin_cos();
        assert!(
            (m.normals[m.topology.triangles[0][0] as usize] - Vec3::new(s, c, 0.0)).length() < 1e-6
        );
    }

    #[test]
    fn normals_are_weighted_by_angle() {
        // A right angle counts the same whether one face or two cover it, on either side
        // of the crease-free ridge.
        let up = Vec3::new(0.0, 0.2, 0.0);
        let p = vec![up, Vec3::new(0.0, 0.2, 1.0), Vec3::X, Vec3::new(1.0, 0.0, 1.0), -Vec3::X];
        let one = Mesh::new(p.clone(), vec![[0, 1, 2], [0, 4, 1]], vec![0; 2]).unwrap();
        let two = Mesh::new(
            p.iter().copied().chain([(up + p[1]) * 0.25 + Vec3::X * 0.5]).collect(),
            vec![[0, 1, 5], [0, 5, 2], [0, 4, 1]],
            vec![0; 3],
        )
        .unwrap();
        let at_top = |m: &Mesh| m.normals[m.positions.iter().position(|q| *q == up).unwrap()];
        assert!(at_top(&one).x.abs() < 1e-6, "equal angles on both sides");
        assert!((at_top(&one) - at_top(&two)).length() < 2e-2);
    }

    #[test]
    fn three_faces_at_an_edge_make_a_pair_and_a_boundary() {
        let p = vec![Vec3::ZERO, Vec3::Z, Vec3::X, -Vec3::X, Vec3::Y];
        let m = Mesh::new(p, vec![[0, 1, 2], [1, 0, 3], [0, 1, 4], [2, 2, 0]], vec![0; 4]).unwrap();
        assert_eq!(m.topology.triangles.len(), 3, "the face without area is dropped");
        assert_eq!(m.topology.edges.len(), 8);
        let sides: usize =
            m.topology.edges.iter().map(|e| if e.faces[1] == NO_FACE { 1 } else { 2 }).sum();
        assert_eq!(sides, 9, "every side of every face is in the table once");
    }
}
