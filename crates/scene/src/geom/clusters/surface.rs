//! A tree of boxes around faces, for finding those that a line of sight meets.

use super::shape::Shape;
use super::tree::{Builder, Item, Node, WIDE};
use glam::DVec3;
use wide::f32x8;

/// A tree of a mesh's faces by their place.
pub(crate) struct SurfaceTree {
    pub nodes: Vec<Node<3>>,
    pub leaves: Vec<Faces>,
    pub root: u32,
    /// The middle of the box around all vertices, and half of its extent.
    pub middle: DVec3,
    pub half: DVec3,
}

/// Up to [`WIDE`] faces.
#[repr(align(32))]
pub(crate) struct Faces {
    /// The coordinates of each corner along each axis; NaN where there is no face.
    pub corners: [[f32x8; 3]; 3],
    /// At least the longest edge of each face (its sum of absolute coordinates).
    pub size: f32x8,
    /// The numbers of the faces.
    pub faces: [u32; WIDE],
}

impl SurfaceTree {
    /// All corners of the mesh's faces must exist.
    pub(super) fn new(mesh: Shape<'_>) -> SurfaceTree {
        let triangles = mesh.triangles;
        let corners = |face: u32| triangles[face as usize].map(|v| mesh.positions[v as usize]);
        let mut items: Vec<Item<3>> = (0..triangles.len() as u32)
            .map(|face| Item::around(face, corners(face).map(|p| p.to_array())))
            .collect();
        let mut leaves = Vec::with_capacity(items.len().div_ceil(WIDE));
        let leaf = |items: &[Item<3>]| {
            let nowhere = [[[f32::NAN; WIDE]; 3]; 3];
            let (mut rows, mut size, mut faces) = (nowhere, [0.0; WIDE], [0; WIDE]);
            for (i, item) in items.iter().enumerate() {
                let corners = corners(item.id);
                for (own, corner) in rows.iter_mut().zip(corners) {
                    (0..3).for_each(|axis| own[axis][i] = corner[axis]);
                }
                let edge = |k: usize| (corners[(k + 1) % 3] - corners[k]).abs().element_sum();
                size[i] = 1.000_001 * edge(0).max(edge(1)).max(edge(2));
                faces[i] = item.id;
            }
            let corners = rows.map(|corner| corner.map(f32x8::new));
            leaves.push(Faces { corners, size: f32x8::new(size), faces });
            Some(leaves.len() as u32 - 1)
        };
        let mut builder = Builder { nodes: Vec::new(), weights: [1.0; 3], most: WIDE, leaf };
        let root = builder.add(&mut items);
        let nodes = builder.nodes;
        let all = Item::around(0, mesh.positions.iter().map(|p| p.to_array()));
        let [low, high] = [all.low, all.high].map(|p| DVec3::from_array(p.map(f64::from)));
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 * (1.0 + 1e-12));
        SurfaceTree { nodes, leaves, root, middle, half }
    }
}
