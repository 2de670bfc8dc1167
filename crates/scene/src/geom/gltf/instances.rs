//! Many copies of a node's mesh (`EXT_mesh_gpu_instancing`).

use super::access::{Data, F32, I8, I16, U8, U16};
use super::json::Node;
use super::nodes::placed;
use crate::geom::GeomError;
use crate::geom::mesh::MOST_PARTS;
use glam::DAffine3;

/// Returns the transform of each copy of a node's mesh to the node's space; of a node that does
/// not repeat its mesh, the identity.
pub(super) fn of(data: &Data, node: &Node, what: &str) -> Result<Vec<DAffine3>, GeomError> {
    // What copies of a skinned mesh are is not defined: a skin places its vertices itself.
    let Some(copies) = node.extensions.instancing.as_ref().filter(|_| node.skin.is_none()) else {
        return Ok(vec![DAffine3::IDENTITY]);
    };
    let numbers = [F32, I8, U8, I16, U16];
    let find = |name: &str, shape: &str| {
        let found = copies.attributes.get(name);
        found.map(|i| data.elements_or_zeros(*i, shape, &numbers)).transpose()
    };
    let (at, turn, scale) =
        (find("TRANSLATION", "VEC3")?, find("ROTATION", "VEC4")?, find("SCALE", "VEC3")?);
    let counts: Vec<usize> = [&at, &turn, &scale].into_iter().flatten().map(|e| e.count).collect();
    let Some(count) = counts.first().copied() else { return Ok(vec![DAffine3::IDENTITY]) };
    if counts.iter().any(|c| *c != count) {
        return Err(GeomError::invalid(format!(
            "the translations, rotations and scales of the copies of {what} differ in number: {counts:?}"
        )));
    }
    if count > MOST_PARTS {
        return Err(GeomError::invalid(format!(
            "{what} has {count} copies; at most {MOST_PARTS} are supported"
        )));
    }
    let one = |i: usize| {
        placed(
            at.as_ref().map(|e| std::array::from_fn(|k| e.get(i, k))),
            turn.as_ref().map(|e| std::array::from_fn(|k| e.get(i, k))),
            scale.as_ref().map(|e| std::array::from_fn(|k| e.get(i, k))),
        )
    };
    Ok((0..count).map(one).collect())
}
