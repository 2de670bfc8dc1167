//! Morph targets: offsets of a mesh's vertices by name, each with the weight that the file
//! draws it with.

use super::access::{Data, F32, I8, I16, U8, U16};
use super::json::{JsonMesh, Node, Primitive};
use crate::geom::GeomError;
use glam::{DVec3, Vec3};
use serde_json::Value;
use std::collections::BTreeSet;

/// The maximum number of offsets of all morphs together.
pub(super) const MOST_OFFSETS: usize = 50_000_000;

/// The maximum number of morphs, and of a mesh's targets.
pub(super) const MOST_MORPHS: usize = 4096;

/// A morph of a file's meshes, in scene units; meshes that have one of the same name and
/// weight share it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedMorph {
    /// The name: that in `targetNames`, or else `target_0`, `target_1`, ….
    pub name: String,
    /// The weight that the vertices of [`super::Loaded`] have it with.
    pub weight: f64,
    /// The vertices that it moves, with their offsets for a weight of 1.
    pub offsets: Vec<(u32, Vec3)>,
}

/// The names and weights of a mesh's targets, where a node draws it.
pub(super) fn targets(node: &Node, mesh: &JsonMesh) -> Result<Vec<(String, f64)>, GeomError> {
    let count = mesh.primitives.iter().map(|p| p.targets.len()).max().unwrap_or_default();
    if count > MOST_MORPHS {
        return Err(too_many());
    }
    let names = mesh.extras.as_ref().and_then(|x| x.get("targetNames"));
    let weights = node.weights.as_ref().or(mesh.weights.as_ref());
    let mut taken = BTreeSet::new();
    let mut one = |k: usize| {
        let given = names.and_then(|all| all.get(k)).and_then(Value::as_str);
        let base = given.filter(|s| !s.is_empty()).map_or(format!("target_{k}"), str::to_owned);
        let mut name = base.clone();
        let mut number = 2;
        while !taken.insert(name.clone()) {
            name = format!("{base}#{number}");
            number += 1;
        }
        (name, weights.and_then(|all| all.get(k)).copied().unwrap_or_default())
    };
    Ok((0..count).map(&mut one).collect())
}

/// Returns for each target of a primitive the vertices that it moves, with their offsets.
pub(super) fn offsets(
    data: &Data,
    primitive: &Primitive,
    vertices: usize,
    what: &str,
) -> Result<Vec<Vec<(u32, DVec3)>>, GeomError> {
    let mut total = 0;
    let mut one = |target: &indexmap::IndexMap<String, usize>| {
        let Some(index) = target.get("POSITION") else { return Ok(Vec::new()) };
        let all = data.elements_or_zeros(*index, "VEC3", &[F32, I8, U8, I16, U16])?;
        if all.count != vertices {
            return Err(GeomError::invalid(format!(
                "{what} has {vertices} vertices, but a morph target for {}",
                all.count
            )));
        }
        let mut moved = Vec::new();
        for i in all.written() {
            let by = DVec3::from_array(std::array::from_fn(|k| all.get(i, k)));
            if by != DVec3::ZERO {
                moved.push((i as u32, by));
            }
        }
        total += moved.len();
        if total > MOST_OFFSETS { Err(too_many()) } else { Ok(moved) }
    };
    primitive.targets.iter().map(&mut one).collect()
}

pub(super) fn too_many() -> GeomError {
    GeomError::invalid(format!(
        "the glTF file has more than {MOST_MORPHS} morph targets, or {MOST_OFFSETS} offsets in them"
    ))
}
