//! Reads glTF 2.0 (Khronos, glTF 2.0 specification): the triangles of the default scene,
//! skins as a rig, and morph targets.
//!
//! Supports `.glb` and `.gltf`, with buffers in the file, in other files, or in `data:`
//! URIs; sparse accessors; views compressed with meshopt and primitives compressed with
//! Draco; copies of a node's mesh. Materials, the file's own normals and animations are
//! ignored; cameras are read apart, by [`cameras`]. Invariant: every index is checked before it
//! is used, so no input can cause a panic.

mod access;
mod cameras;
mod container;
mod draco;
mod extensions;
mod instances;
mod json;
mod meshopt;
mod morphs;
mod nodes;
mod shapes;
mod skin;
#[cfg(test)]
mod tests;

pub use cameras::{GltfCamera, cameras};
pub use container::{Read, is_gltf};
pub use morphs::LoadedMorph;

use super::armature::{Armature, Influence, Morph, Rig};
use super::{FileFrame, GeomError, Mesh, face_outward};
use glam::{DVec3, Vec3};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// The bits of a vertex's position and weights, with the joints, and a number for how morphs
/// move it.
type Same = ([u32; 3], [u16; 4], [u32; 4], u32);

/// The pose of bodies with a skin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pose {
    /// The one in which the mesh was bound to the joints.
    #[default]
    Bind,
    /// That of the file's nodes, which viewers show.
    File,
}

/// The contents of a glTF file's scene, in scene units, +y up.
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
    /// The morphs of the meshes that joints move.
    pub morphs: Vec<LoadedMorph>,
    /// What users should know of how the file was read.
    pub remarks: Vec<String>,
}

/// Reads a file. `read` reads the files that it refers to, by paths relative to it.
///
/// # Errors
/// [`GeomError::Invalid`]: bytes that are not glTF 2.0 or are truncated; unsupported
/// features (see the module's documentation); nodes that do not form a tree; references
/// to missing items or vertices; positions that are not finite; a skin without weights;
/// more than five million triangles, 65535 meshes, 4096 joints or 50 million offsets of morphs;
/// no triangles.
pub fn load(bytes: &[u8], frame: &FileFrame, pose: Pose, read: &Read) -> Result<Loaded, GeomError> {
    let (document, bin) = container::open(bytes)?;
    let data = access::Data::new(&document, bin, read)?;
    let nodes = nodes::Nodes::of(&document)?;
    let skeleton = skin::Skeleton::of(&data, &nodes, pose)?;
    let rig = skeleton.rig(&data, &nodes, frame)?;
    let mut loaded = shapes::collect(&data, &nodes, &skeleton, rig, frame, pose)?;
    loaded.remarks.extend(extensions::remark(&document));
    let moves =
        |c: &json::Channel| c.target.node.is_some_and(|n| nodes.drawn.get(n) == Some(&true));
    if pose == Pose::File && document.animations.iter().any(|a| a.channels.iter().any(moves)) {
        loaded.remarks.push(
            "the animations of the glTF file are not read, only the pose that its nodes have \
             without them"
                .into(),
        );
    }
    Ok(loaded)
}

impl Loaded {
    /// Turns over closed bodies that are inside out; see [`face_outward`].
    #[must_use]
    pub fn outward(mut self) -> Loaded {
        self.remarks.extend(face_outward(&self.positions, &mut self.triangles, &self.parts));
        self
    }

    /// Returns everything as one mesh.
    ///
    /// # Errors
    /// As [`Mesh::new`]: no triangle with positive area.
    pub fn mesh(self) -> Result<Mesh, GeomError> {
        let mut mesh = Mesh::new(self.positions, self.triangles, self.parts)?;
        let names = self.names.iter().map(|name| Arc::from(&**name));
        Arc::make_mut(&mut mesh.topology).part_names = names.collect();
        Ok(mesh)
    }

    /// Returns the meshes that joints move as a body, with their morphs; other meshes are
    /// omitted. Vertices that differ only in their texture coordinates or normals are merged.
    ///
    /// # Errors
    /// No skin; as [`Armature::new`]: weights that do not sum to 1; more than 50 million offsets of
    /// morphs.
    pub fn armature(self) -> Result<Armature, GeomError> {
        let Some(rig) = self.rig else {
            return Err(GeomError::invalid(
                "the glTF file has no skin, so it does not define which joint moves which vertices",
            ));
        };
        let mut known: FxHashMap<Same, u32> = FxHashMap::default();
        let (mut positions, mut influences) = (Vec::new(), Vec::new());
        let mut number = vec![None; self.positions.len()];
        let moved = moved_alike(&self.morphs, self.positions.len());
        let vertices = self.positions.iter().zip(&self.influences).zip(moved);
        for (((p, i), moved), n) in vertices.zip(&mut number) {
            let Some(i) = i else { continue };
            // Adding zero maps -0 to 0, so that the two are the same position.
            let place = (*p + Vec3::ZERO).to_array().map(f32::to_bits);
            let key = (place, i.joints, i.weights.map(f32::to_bits), moved);
            *n = Some(*known.entry(key).or_insert_with(|| {
                positions.push(*p);
                influences.push(*i);
                positions.len() as u32 - 1
            }));
        }
        let number = |v: u32| number.get(v as usize).copied().flatten();
        let triangle = |t: &[u32; 3]| Some([number(t[0])?, number(t[1])?, number(t[2])?]);
        let triangles: Vec<[u32; 3]> = self.triangles.iter().filter_map(triangle).collect();
        let (vertices, joints) = (positions.len(), rig.joints().len());
        if vertices.saturating_mul(self.morphs.len()) > morphs::MOST_OFFSETS {
            return Err(morphs::too_many());
        }
        let body = Armature::new(rig, positions, triangles, influences)?;
        if self.morphs.is_empty() {
            return Ok(body);
        }
        let morph = |m: &LoadedMorph| {
            let mut all = vec![[0.0; 3]; vertices];
            for (v, by) in &m.offsets {
                if let Some(place) = number(*v).and_then(|v| all.get_mut(v as usize)) {
                    *place = by.to_array();
                }
            }
            Morph {
                name: Arc::from(&*m.name),
                weight: m.weight,
                vertices: all,
                heads: vec![DVec3::ZERO; joints],
                tails: vec![DVec3::ZERO; joints],
            }
        };
        body.with_morphs(self.morphs.iter().map(morph).collect())
    }
}

/// Returns for each vertex a number, the same for those that all morphs move alike.
fn moved_alike(morphs: &[LoadedMorph], vertices: usize) -> Vec<u32> {
    let mut numbers = vec![0; vertices];
    let mut known: FxHashMap<(u32, usize, [u32; 3]), u32> = FxHashMap::default();
    for (k, m) in morphs.iter().enumerate() {
        for (v, by) in &m.offsets {
            let Some(number) = numbers.get_mut(*v as usize) else { continue };
            let next = known.len() as u32 + 1;
            let by = (*by + Vec3::ZERO).to_array().map(f32::to_bits);
            *number = *known.entry((*number, k, by)).or_insert(next);
        }
    }
    numbers
}
