//! Automatic rigging: armatures for meshes that have none, with a joint per group or
//! along a curve skeleton of the interior.
//!
//! Kulkarni et al. 2014, section 2.1.2, make one for a compositional mesh, "a tree with
//! the root node centered around the center of the mesh". Coincident points are merged
//! into one vertex of the result, which is smooth, as every armature is. Joints have no
//! limits; those belong to a prior. Invariant: the result depends on the mesh alone.
use crate::{groups, skeleton, skin, tree, voxels};
use glam::{DVec3, Vec3};
use pcadlang_scene::geom::armature::{Armature, Influence, NamedJoint, Rig};
use pcadlang_scene::geom::{GeomError, Mesh, weld};

/// The maximum number of groups for [`by_groups`].
pub const MOST_GROUPS: usize = 256;
/// The maximum number of triangles for [`by_groups`], which compares groups pairwise.
pub const MOST_GROUPED_TRIANGLES: usize = 20_000;
/// The maximum number of joints of [`by_skeleton`].
pub const MOST_BONES: usize = 256;

/// Returns an armature with a joint for each part of the mesh (an OBJ file's object or
/// group). A joint has its part's name, or else `part_1`, `part_2`, ….
///
/// Parts are neighbours if they touch, overlap, or are closer than a hundredth of the
/// diagonal of the mesh's bounding box. Their joint is the mean of the vertices in
/// contact, half-way across any gap. The part whose centre (its area-weighted mean) is
/// nearest to the mesh's centre is the root. The others attach to it by the shortest
/// paths through centres and joints; a part that touches nothing attaches to its nearest
/// part. A vertex follows its own part, and within the contact, and up to half as far
/// again, also the neighbours' joints. Keypoints are the joints' heads.
///
/// # Errors
/// Fewer than two parts, or more than [`MOST_GROUPS`]; more than
/// [`MOST_GROUPED_TRIANGLES`].
pub fn by_groups(mesh: &Mesh) -> Result<Armature, GeomError> {
    let (positions, triangles) = welded(mesh);
    let rig = groups::rig(&positions, &triangles, mesh)?;
    finish(rig.joints, positions, triangles, rig.influences)
}

/// Returns an armature on a curve skeleton of a closed mesh's interior: `root` and
/// `bone_1`, `bone_2`, …, at most `most` joints.
///
/// The interior is sampled on a grid with 48 cells along the longest side. Paths that
/// keep to the middle start from a central cell far from the surface. The first goes to
/// the farthest cell, and each later one to the farthest cell that is not near a path
/// (after Sato et al. 2000, "TEASAR: tree-structure extraction algorithm for accurate and
/// robust skeletons"). Joints are where paths branch and where they bend. A vertex
/// follows its nearest bone and that bone's parent, children and siblings, by squares of
/// inverse distances. Keypoints are the joints' heads.
///
/// # Errors
/// A mesh that is not closed, or is so thin that no cell is inside; `most` outside 1 to
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

/// Merges coincident points; vertices are in order of first use.
fn welded(mesh: &Mesh) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let first = weld(&mesh.positions);
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

/// A joint. Parents are given by index and come before their children.
#[derive(Clone, Debug)]
pub(crate) struct Bone {
    pub name: String,
    pub parent: Option<usize>,
    pub head: DVec3,
    pub tail: DVec3,
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
