//! What clusters are made from.

use glam::Vec3;

/// The lists of a mesh.
#[derive(Clone, Copy)]
pub(crate) struct Shape<'a> {
    pub positions: &'a [Vec3],
    /// A normal for each vertex.
    pub normals: &'a [Vec3],
    pub triangles: &'a [[u32; 3]],
}

impl Shape<'_> {
    /// Where the lists are in memory and how long they are: they differ if they were
    /// replaced.
    pub fn lists(&self) -> [(usize, usize); 3] {
        let Shape { positions, normals, triangles } = self;
        [
            (positions.as_ptr() as usize, positions.len()),
            (normals.as_ptr() as usize, normals.len()),
            (triangles.as_ptr() as usize, triangles.len()),
        ]
    }
}
