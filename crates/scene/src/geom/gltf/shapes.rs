//! The triangles of a scene: those of every node's mesh, transformed to the scene, with a
//! part for each node.

use super::access::{Data, F32, I8, I16, MOST_ELEMENTS, U8, U16, U32};
use super::container::name_of;
use super::json::Primitive;
use super::nodes::Nodes;
use super::skin::{Skeleton, influences};
use super::{Loaded, Rig};
use crate::geom::armature::Influence;
use crate::geom::mesh::{MOST_PARTS, MOST_TRIANGLES};
use crate::geom::{FileFrame, GeomError};
use glam::{DAffine3, DVec3};

/// Collects the triangles of all nodes in the default scene.
pub(super) fn collect(
    data: &Data,
    nodes: &Nodes,
    skeleton: &Skeleton,
    rig: Option<Rig>,
    frame: &FileFrame,
) -> Result<Loaded, GeomError> {
    let mut out = Loaded { rig, ..Loaded::default() };
    for (i, node) in data.document.nodes.iter().enumerate().filter(|(i, _)| nodes.drawn[*i]) {
        let Some(m) = node.mesh else { continue };
        let missing = || {
            GeomError::invalid(format!(
                "node `{}` refers to the missing mesh {m}",
                name_of(node, i)
            ))
        };
        let mesh = data.document.meshes.get(m).ok_or_else(missing)?;
        let called = [&node.name, &mesh.name].into_iter().flatten().find(|s| !s.is_empty());
        let name = called.cloned().unwrap_or_else(|| format!("mesh_{m}"));
        let skin = node.skin.and_then(|s| skeleton.skins.get(&s));
        let to_scene = match skin {
            Some(skin) => skin.to_scene,
            None => skeleton.place(data, nodes, i)?,
        };
        let what = format!("mesh `{name}`");
        let before = out.triangles.len();
        for p in &mesh.primitives {
            let first = out.positions.len();
            let Some(mut faces) = add(data, p, &what, &to_scene, frame, &mut out)? else {
                continue;
            };
            // Which side is outside follows from the node's own transform, though a skin ignores
            // it for positions (glTF 2.0, section 3.7.4).
            if nodes.global[i].matrix3.determinant() < 0.0 {
                faces.iter_mut().for_each(|f| f.swap(1, 2));
            }
            let count = out.positions.len() - first;
            match (skin, &out.rig) {
                (Some(skin), Some(rig)) => {
                    let own = influences(data, p, &what, count, skin, rig)?;
                    out.influences.extend(own.into_iter().map(Some));
                }
                (_, rig) => {
                    let carrier = skeleton.carrier[i].and_then(|j| rig.as_ref()?.placed(j));
                    let whole = carrier
                        .and_then(|j| u16::try_from(j).ok())
                        .map(|j| Influence { joints: [j, 0, 0, 0], weights: [1.0, 0.0, 0.0, 0.0] });
                    out.influences.resize(out.positions.len(), whole);
                }
            }
            out.triangles.extend(faces);
        }
        if out.triangles.len() > before {
            if out.names.len() >= MOST_PARTS {
                return Err(GeomError::invalid(format!(
                    "the glTF file has more than {MOST_PARTS} meshes"
                )));
            }
            out.parts.resize(out.triangles.len(), out.names.len() as u16);
            out.names.push(name);
        }
    }
    if out.triangles.is_empty() {
        return Err(GeomError::invalid("the scene of the glTF file has no triangles"));
    }
    Ok(out)
}

/// Adds a primitive's vertices and returns its triangles, with indices into all vertices;
/// `None` for points or lines.
fn add(
    data: &Data,
    p: &Primitive,
    what: &str,
    to_scene: &DAffine3,
    frame: &FileFrame,
    out: &mut Loaded,
) -> Result<Option<Vec<[u32; 3]>>, GeomError> {
    let mode = p.mode.unwrap_or(4);
    match mode {
        0..=3 => return Ok(None),
        4..=6 => {}
        _ => {
            return Err(GeomError::invalid(format!(
                "{what} has mode {mode}, which glTF does not define"
            )));
        }
    }
    let Some(positions) = p.attributes.get("POSITION") else { return Ok(None) };
    let positions = data.elements(*positions, "VEC3", &[F32, I8, U8, I16, U16])?;
    let (first, count) = (out.positions.len(), positions.count);
    if first + count > MOST_ELEMENTS {
        return Err(GeomError::invalid(format!(
            "the glTF file has more than {MOST_ELEMENTS} vertices"
        )));
    }
    let corners: Vec<u32> = match p.indices {
        None => (0..count as u32).collect(),
        Some(i) => {
            let e = data.elements(i, "SCALAR", &[U8, U16, U32])?;
            (0..e.count).map(|i| e.whole(i, 0) as u32).collect()
        }
    };
    if let Some(c) = corners.iter().find(|c| **c as usize >= count) {
        return Err(GeomError::invalid(format!("{what} uses vertex {c}, but it has {count}")));
    }
    let mut faces: Vec<[u32; 3]> = match mode {
        4 => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        5 => {
            let turned = |(i, c): (usize, &[u32])| {
                if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] }
            };
            corners.windows(3).enumerate().map(turned).collect()
        }
        _ => corners
            .get(1..)
            .unwrap_or_default()
            .windows(2)
            .map(|c| [c[0], c[1], corners[0]])
            .collect(),
    };
    if out.triangles.len() + faces.len() > MOST_TRIANGLES {
        return Err(GeomError::invalid(format!(
            "the glTF file has more than {MOST_TRIANGLES} triangles"
        )));
    }
    for f in &mut faces {
        *f = f.map(|c| c + first as u32);
    }
    for v in 0..count {
        let at = DVec3::from_array(std::array::from_fn(|k| positions.get(v, k)));
        let at = frame.apply(to_scene.transform_point3(at)).as_vec3();
        if !at.is_finite() {
            return Err(GeomError::invalid(format!("vertex {v} of {what} is not finite")));
        }
        out.positions.push(at);
    }
    Ok(Some(faces))
}
