//! The triangles of a mesh file as the file numbers them, and its reader by kind.

use super::file_kinds::{self, Kind};
use super::{FileFrame, GeomError, Mesh, face_outward, obj, ply, stl};
use glam::Vec3;
use std::sync::Arc;

/// Vertices and triangles with the file's own numbering, and the part of each triangle. Every
/// index in `triangles` is one of `positions`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFile {
    /// The vertices in the file's order, whether used or not.
    pub positions: Vec<Vec3>,
    /// The triangles; polygons are cut.
    pub triangles: Vec<[u32; 3]>,
    /// The number of each triangle's part (object, group or solid), in order of first use.
    pub parts: Vec<u16>,
    /// The names of the parts by number; empty for faces before the first of them.
    pub part_names: Vec<Arc<str>>,
    /// What users should know of how the file was read.
    pub remarks: Vec<String>,
}

impl MeshFile {
    /// Reads an OBJ, STL or PLY file. `file` is its name: a binary STL file has nothing in it
    /// that says what it is.
    ///
    /// # Errors
    /// As the readers of these kinds; any other kind of file, which is named with a way to
    /// convert it.
    pub fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, GeomError> {
        match file_kinds::kind(file, bytes) {
            Kind::Obj => obj::indexed(bytes),
            Kind::Stl => stl::indexed(bytes),
            Kind::Ply => ply::indexed(bytes),
            Kind::Other(other) => Err(GeomError::invalid(other.as_mesh())),
        }
    }

    /// Maps the vertices from the file's frame to the scene's.
    pub fn placed(mut self, frame: &FileFrame) -> MeshFile {
        for p in &mut self.positions {
            *p = frame.apply(p.as_dvec3()).as_vec3();
        }
        self
    }

    /// Turns over closed bodies that are inside out; see [`face_outward`].
    pub fn outward(mut self) -> MeshFile {
        self.remarks.extend(face_outward(&self.positions, &mut self.triangles, &self.parts));
        self
    }

    /// Returns the mesh; see [`Mesh::new`] for errors.
    ///
    /// # Errors
    /// A vertex that is not finite in the scene's units; no triangle with positive area.
    pub fn mesh(self) -> Result<Mesh, GeomError> {
        let mut mesh = Mesh::new(self.positions, self.triangles, self.parts)?;
        Arc::make_mut(&mut mesh.topology).part_names = self.part_names;
        Ok(mesh)
    }
}
