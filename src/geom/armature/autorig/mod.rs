//! Armatures made from a mesh that has none: a joint for each of its groups, or a
//! skeleton of its inside.
//!
//! Kulkarni et al. 2014, section 2.1.2, make one for a compositional mesh, "a tree with
//! the root node centered around the center of the mesh". Points at one place are one
//! vertex of the result, which is smooth as every armature is. There are no limits to
//! what a joint may do: those are a prior's business. Invariant: the result depends on
//! the mesh alone.

mod groups;
mod near;
mod skeleton;
mod skin;
#[cfg(test)]
mod tests;
mod tree;
mod voxels;

use super::{Armature, Influence, NamedJoint, Rig};
use crate::geom::{GeomError, Mesh, edges};
use glam::{DVec3, Vec3};

/// The most groups that [`by_groups`] takes.
pub const MOST_GROUPS: usize = 256;
/// The most triangles that [`by_groups`] takes: it compares groups with one another.
pub const MOST_GROUPED_TRIANGLES: usize = 20_000;
/// The most joints that [`by_skeleton`] makes.
pub const MOST_BONES: usize = 256;

/// An armature with a joint for each part of the mesh (an OBJ file's object or group),
/// called as the part is, or else `part_1`, `part_2`, ….
///
/// Parts are neighbours where they touch, overlap, or are nearer than a hundredth of the
/// diagonal of the mesh's box; their joint is the mean of the vertices in contact,
/// half-way across a gap. The part whose centre (the mean over its area) is nearest to
/// the mesh's is the root; the others hang on it by the shortest paths over centres and
/// joints, and what touches nothing by its nearest part. A vertex goes with its part, and
/// within the contact, up to half as far again, with the neighbours' joints too.
/// Keypoints: each joint's head.
///
/// # Errors
/// Fewer than two parts, or more than [`MOST_GROUPS`]; more than
/// [`MOST_GROUPED_TRIANGLES`].
pub fn by_groups(mesh: &Mesh) -> Result<Armature, GeomError> {
    let (positions, triangles) = welded(mesh);
    let rig = groups::rig(&positions, &triangles, mesh)?;
    finish(rig.joints, positions, triangles, rig.influences)
}

/// An armature on a curve skeleton of what a closed mesh encloses: `root` and `bone_1`,
/// `bone_2`, …, at most `most` joints.
///
/// The inside is sampled on a grid of 48 cells along the longest side. From the cell that
/// is central and far from the surface run paths that keep to the middle, to the farthest
/// cell first and then to the farthest of those that no path is near (after Sato et al.
/// 2000, "TEASAR: tree-structure extraction algorithm for accurate and robust
/// skeletons"). Joints are where paths part and where they bend. A vertex goes with the
/// bones near it: the nearest one, its parent, children and siblings, by squares of
/// inverse distances. Keypoints: each joint's head.
///
/// # Errors
/// A mesh that is not closed, or so thin that no cell is inside; `most` not from 1 to
/// [`MOST_BONES`].
pub fn by_skeleton(mesh: &Mesh, most: usize) -> Result<Armature, GeomError> {
    if !(1..=MOST_BONES).contains(&most) {
        return Err(GeomError::invalid(format!(
            "a skeleton has 1 to {MOST_BONES} bones, not {most}"
        )));
    }
    let open = mesh.topology.edges.iter().filter(|e| e.is_boundary()).count();
    if open > 0 {
        return Err(GeomError::invalid(format!(
            "a skeleton needs a closed mesh; this one has {open} open edges"
        )));
    }
    let (positions, triangles) = welded(mesh);
    let grid = voxels::Grid::inside(&positions, &triangles).ok_or_else(|| {
        GeomError::invalid("a skeleton needs a mesh with an interior; this one is too thin")
    })?;
    let bones = tree::bones(skeleton::curves(&grid), grid.cell(), most);
    let influences = skin::by_distance(&positions, &bones);
    finish(bones, positions, triangles, influences)
}

/// The mesh with each point once, in the order of first use.
fn welded(mesh: &Mesh) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let first = edges::weld(&mesh.positions);
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut positions = Vec::new();
    let mut of = |v: u32| {
        let f = first[v as usize] as usize;
        if number[f] == u32::MAX {
            number[f] = positions.len() as u32;
            positions.push(mesh.positions[f]);
        }
        number[f]
    };
    let triangles = mesh.topology.triangles.iter().map(|t| t.map(&mut of)).collect();
    (positions, triangles)
}

/// A joint, parents by number and before their children.
#[derive(Clone, Debug)]
struct Bone {
    name: String,
    parent: Option<usize>,
    head: DVec3,
    tail: DVec3,
}

fn finish(
    bones: Vec<Bone>,
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    influences: Vec<Influence>,
) -> Result<Armature, GeomError> {
    let points = bones.iter().map(|b| (b.name.clone(), b.name.clone(), b.head)).collect();
    let parent = |b: &Bone| b.parent.and_then(|p| bones.get(p)).map(|p| p.name.clone());
    let joints = bones.iter().map(|b| NamedJoint {
        name: b.name.clone(),
        parent: parent(b),
        head: b.head,
        tail: b.tail,
    });
    let rig = Rig::new(joints.collect())?.with_keypoints(points)?;
    Armature::new(rig, positions, triangles, influences)
}
