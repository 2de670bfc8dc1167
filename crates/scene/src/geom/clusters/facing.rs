//! A tree of faces by their tangent planes, for finding those that a silhouette crosses.
//!
//! Whether a vertex p with normal n faces a camera at e is the sign of n . (e - p). That is
//! linear in the four numbers (n, n . p), the plane through the vertex. So a box around
//! the planes of some faces gives the least and greatest facing of their vertices, exactly
//! for the box; silhouettes are where a hyperplane cuts the surface of all planes.

use super::shape::Shape;
use super::tree::{Builder, Item, Node};
use glam::{DVec3, Vec3};
use wide::f32x8;

/// The tree of a mesh's faces by the planes (normal, distance from `middle` along it) of
/// their vertices.
pub(crate) struct FacingTree {
    pub nodes: Vec<Node<4>>,
    pub leaves: Vec<Few>,
    pub root: u32,
    /// The point from which distances are measured: the middle of the mesh.
    pub middle: DVec3,
    /// The greatest of each coordinate of normals, in magnitude.
    pub normal: DVec3,
    /// The greatest of each coordinate of the vertices relative to `middle`, in magnitude.
    pub reach: DVec3,
}

/// A few faces with the planes of their vertices.
#[repr(align(64))]
pub(crate) struct Few {
    /// The planes, by coordinate; a vertex may be there more than once.
    pub planes: [[f32x8; 2]; 4],
    /// The corners of each face, as numbers of these vertices, four bits each; all 0 where
    /// there is no face.
    pub corners: [u16; Few::MOST],
    pub faces: [u32; Few::MOST],
    /// The numbers of the vertices in the mesh.
    pub vertices: [u32; Few::MOST],
}

impl Few {
    /// The most faces, and the most vertices.
    pub const MOST: usize = 16;

    /// `None` if there are too many vertices.
    fn new(
        mesh: Shape<'_>,
        faces: impl Iterator<Item = u32>,
        plane: impl Fn(u32) -> [f32; 4],
    ) -> Option<Few> {
        let (mut vertices, mut count) = ([0; Few::MOST], 0);
        let (mut corners, mut numbers) = ([0; Few::MOST], [0; Few::MOST]);
        for (i, face) in faces.enumerate() {
            numbers[i] = face;
            for (k, v) in mesh.triangles[face as usize].into_iter().enumerate() {
                let at = vertices[..count].iter().position(|w| *w == v).unwrap_or(count);
                *vertices.get_mut(at)? = v;
                count = count.max(at + 1);
                corners[i] |= (at as u16) << (4 * k);
            }
        }
        let first = vertices[0];
        vertices[count..].fill(first);
        let planes = vertices.map(plane);
        let row = |axis: usize, half: usize| {
            f32x8::new(std::array::from_fn(|i| planes[8 * half + i][axis]))
        };
        let planes = std::array::from_fn(|axis| [row(axis, 0), row(axis, 1)]);
        Some(Few { planes, corners, faces: numbers, vertices })
    }
}

impl FacingTree {
    /// All corners of the mesh's faces must exist.
    pub(super) fn new(mesh: Shape<'_>) -> FacingTree {
        let Shape { positions, normals, triangles } = mesh;
        let all = Item::around(0, positions.iter().map(|p| p.to_array()));
        let [low, high] = [all.low, all.high].map(|p| DVec3::from_array(p.map(f64::from)));
        let middle = (low + high) * 0.5;
        let plane = |v: u32| {
            let [p, n] = [positions, normals].map(|list| list[v as usize].as_dvec3());
            let along = n.dot(p - middle);
            let [x, y, z] = normals[v as usize].to_array();
            [x, y, z, along as f32]
        };
        let around = |face: u32| {
            let planes = triangles[face as usize].map(plane);
            let ends = planes.into_iter().flat_map(|[x, y, z, along]| {
                // Rounded outwards.
                [[x, y, z, along.next_down()], [x, y, z, along.next_up()]]
            });
            Item::around(face, ends)
        };
        let mut items: Vec<Item<4>> = (0..triangles.len() as u32).map(around).collect();
        let mut leaves = Vec::new();
        let leaf = |items: &[Item<4>]| {
            leaves.push(Few::new(mesh, items.iter().map(|item| item.id), plane)?);
            Some(leaves.len() as u32 - 1)
        };
        // Seen from some radii away a normal's change counts more than a step along it.
        let size = ((high - low).max_element() as f32).max(f32::MIN_POSITIVE);
        let weights = [1.0, 1.0, 1.0, 0.5 / size];
        let mut builder = Builder { nodes: Vec::new(), weights, most: Few::MOST, leaf };
        let root = builder.add(&mut items);
        let nodes = builder.nodes;
        let most = |list: &[Vec3], from: DVec3| {
            list.iter().fold(DVec3::ZERO, |most, v| most.max((v.as_dvec3() - from).abs()))
        };
        let (normal, reach) = (most(normals, DVec3::ZERO), most(positions, middle));
        FacingTree { nodes, leaves, root, middle, normal, reach }
    }
}
