//! Reads glTF 2.0 (Khronos, glTF 2.0 specification): the triangles of the default scene,
//! and skins as a rig.
//!
//! Supports `.glb` and `.gltf`, with buffers in the file, in other files, or in `data:`
//! URIs. Materials, the file's own normals, animations and morph targets are ignored; sparse
//! accessors and compressed meshes are refused. Cameras are read apart, by [`cameras`].
//! Invariant: every index is checked before it is used, so no input can cause a panic.

mod access;
mod cameras;
mod container;
mod json;
mod nodes;
mod shapes;
mod skin;

pub use cameras::{GltfCamera, cameras};
pub use container::{Read, is_gltf};

use super::armature::{Armature, Influence, Rig};
use super::{FileFrame, GeomError, Mesh};
use glam::Vec3;
use rustc_hash::FxHashMap;

/// The bits of a vertex's position and weights, with the joints.
type Same = ([u32; 3], [u16; 4], [u32; 4]);

/// The contents of a glTF file's scene, in scene units, +y up; bodies are in their bind
/// pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loaded {
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// The triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The part of each triangle.
    pub parts: Vec<u16>,
    /// The names of the parts: those of their nodes, or else of their meshes.
    pub names: Vec<String>,
    /// The joints, if a mesh has a skin; each has a keypoint of its name at its head.
    pub rig: Option<Rig>,
    /// The joints that move each vertex; `None` if its mesh has no skin and is not
    /// attached to a joint.
    pub influences: Vec<Option<Influence>>,
}

/// Reads a file. `read` reads the files that it refers to, by paths relative to it.
///
/// # Errors
/// [`GeomError::Invalid`]: bytes that are not glTF 2.0 or are truncated; unsupported
/// features (see the module's documentation); nodes that do not form a tree; references
/// to missing items or vertices; positions that are not finite; a skin without weights;
/// more than five million triangles, 65535 meshes or 4096 joints; no triangles.
pub fn load(bytes: &[u8], frame: &FileFrame, read: &Read) -> Result<Loaded, GeomError> {
    let (document, bin) = container::open(bytes)?;
    let data = access::Data::new(&document, bin, read)?;
    let nodes = nodes::Nodes::of(&document)?;
    let skeleton = skin::Skeleton::of(&data, &nodes)?;
    let rig = skeleton.rig(&data, &nodes, frame)?;
    shapes::collect(&data, &nodes, &skeleton, rig, frame)
}

impl Loaded {
    /// Returns everything as one mesh, in the bind pose.
    ///
    /// # Errors
    /// As [`Mesh::new`]: no triangle with positive area.
    pub fn mesh(self) -> Result<Mesh, GeomError> {
        Mesh::new(self.positions, self.triangles, self.parts)
    }

    /// Returns the meshes that joints move as a body; other meshes are omitted. Vertices
    /// that differ only in their texture coordinates or normals are merged.
    ///
    /// # Errors
    /// No skin; as [`Armature::new`]: weights that do not sum to 1.
    pub fn armature(self) -> Result<Armature, GeomError> {
        let Some(rig) = self.rig else {
            return Err(GeomError::invalid(
                "the glTF file has no skin, so it does not define which joint moves which vertices",
            ));
        };
        let mut known: FxHashMap<Same, u32> = FxHashMap::default();
        let (mut positions, mut influences) = (Vec::new(), Vec::new());
        let mut number = vec![None; self.positions.len()];
        for ((p, i), n) in self.positions.iter().zip(&self.influences).zip(&mut number) {
            let Some(i) = i else { continue };
            // Adding zero maps -0 to 0, so that the two are the same position.
            let place = (*p + Vec3::ZERO).to_array().map(f32::to_bits);
            let key = (place, i.joints, i.weights.map(f32::to_bits));
            *n = Some(*known.entry(key).or_insert_with(|| {
                positions.push(*p);
                influences.push(*i);
                positions.len() as u32 - 1
            }));
        }
        let number = |v: u32| number.get(v as usize).copied().flatten();
        let triangle = |t: &[u32; 3]| Some([number(t[0])?, number(t[1])?, number(t[2])?]);
        let triangles: Vec<[u32; 3]> = self.triangles.iter().filter_map(triangle).collect();
        Armature::new(rig, positions, triangles, influences)
    }
}
