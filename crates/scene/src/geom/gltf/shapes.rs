//! The triangles of a scene: those of every node's mesh, transformed to the scene, with a
//! part for each node, or for each copy that it makes.

use super::access::{Data, F32, I8, I16, MOST_ELEMENTS, U8, U16, U32};
use super::container::name_of;
use super::draco::Contents;
use super::json::{JsonMesh, Primitive};
use super::morphs::{self, LoadedMorph, MOST_MORPHS, MOST_OFFSETS};
use super::nodes::Nodes;
use super::skin::{Placed, Skeleton, influences};
use super::{Loaded, Pose, Rig, instances};
use crate::geom::armature::Influence;
use crate::geom::mesh::{MOST_PARTS, MOST_TRIANGLES};
use crate::geom::{FileFrame, GeomError};
use glam::{DAffine3, DVec3, Vec3};
use rustc_hash::FxHashMap;

/// Collects the triangles of all nodes in the default scene.
pub(super) fn collect(
    data: &Data,
    nodes: &Nodes,
    skeleton: &Skeleton,
    rig: Option<Rig>,
    frame: &FileFrame,
    pose: Pose,
) -> Result<Loaded, GeomError> {
    let loaded = Loaded { rig, ..Loaded::default() };
    let mut out = Collected { loaded, apart: 0.0, offsets: 0, known: FxHashMap::default() };
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
        let what = format!("mesh `{name}`");
        let skin = node.skin.and_then(|s| skeleton.skins.get(&s));
        let to_scene = match skin {
            Some(skin) => skin.to_scene,
            None => skeleton.place(data, nodes, i)?,
        };
        let targets = morphs::targets(node, mesh)?;
        let shapes = shapes(data, mesh, &what, skin, &targets, out.loaded.rig.as_ref())?;
        let carrier = skeleton.carrier[i].and_then(|j| out.loaded.rig.as_ref()?.placed(j));
        let carried = carrier
            .and_then(|j| u16::try_from(j).ok())
            .map(|j| Influence { joints: [j, 0, 0, 0], weights: [1.0, 0.0, 0.0, 0.0] });
        let by_joint = skin.and_then(|s| s.posed(out.loaded.rig.as_ref()?));
        for (k, copy) in instances::of(data, node, &what)?.into_iter().enumerate() {
            // Which side is outside follows from the node's own transform, though a skin ignores
            // it for positions (glTF 2.0, section 3.7.4).
            let global = nodes.global[i] * copy;
            let place = Place {
                to_scene: to_scene * copy,
                by_joint: by_joint.as_deref(),
                pose,
                frame,
                mirrored: global.matrix3.determinant() < 0.0,
                carried,
            };
            let before = out.loaded.triangles.len();
            for shape in &shapes {
                out.add(shape, &place, &targets, &what)?;
            }
            let called = if k == 0 { name.clone() } else { format!("{name}#{}", k + 1) };
            out.part(before, called)?;
        }
    }
    let out = out.finish(pose);
    if out.triangles.is_empty() {
        return Err(GeomError::invalid("the scene of the glTF file has no triangles"));
    }
    Ok(out)
}

/// The triangles of a primitive in its own space.
struct Shape {
    positions: Vec<DVec3>,
    /// Indices into the positions.
    faces: Vec<[u32; 3]>,
    /// The joints that move each vertex, if the mesh has a skin.
    influences: Option<Vec<Influence>>,
    /// For each morph target the vertices that it moves, with their offsets.
    offsets: Vec<Vec<(u32, DVec3)>>,
}

/// Where a shape is drawn.
struct Place<'a> {
    to_scene: DAffine3,
    /// For a skin in another pose, the transforms by joint.
    by_joint: Option<&'a [DAffine3]>,
    pose: Pose,
    frame: &'a FileFrame,
    mirrored: bool,
    /// The joint that a mesh without a skin moves with.
    carried: Option<Influence>,
}

/// Reads the primitives of a mesh that consist of triangles; vertices have the default weights of
/// the morph targets.
fn shapes(
    data: &Data,
    mesh: &JsonMesh,
    what: &str,
    skin: Option<&Placed>,
    targets: &[(String, f64)],
    rig: Option<&Rig>,
) -> Result<Vec<Shape>, GeomError> {
    let mut all = Vec::new();
    for p in &mesh.primitives {
        let contents = Contents::of(data, p, what)?;
        let Some((mut positions, faces)) = triangles(data, p, &contents, what)? else { continue };
        let influences = match (skin, rig) {
            (Some(skin), Some(rig)) => {
                Some(influences(&contents, what, positions.len(), skin, rig)?)
            }
            _ => None,
        };
        let offsets = morphs::offsets(data, p, positions.len(), what)?;
        for (moved, (_, weight)) in offsets.iter().zip(targets).filter(|(_, t)| t.1 != 0.0) {
            for (v, by) in moved {
                positions[*v as usize] += *by * *weight;
            }
        }
        all.push(Shape { positions, faces, influences, offsets });
    }
    Ok(all)
}

/// What [`Shape`] has first.
type Triangles = (Vec<DVec3>, Vec<[u32; 3]>);

/// Returns a primitive's vertices and triangles; `None` for points or lines.
fn triangles(
    data: &Data,
    p: &Primitive,
    contents: &Contents,
    what: &str,
) -> Result<Option<Triangles>, GeomError> {
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
    let positions = contents.attribute("POSITION", "VEC3", &[F32, I8, U8, I16, U16])?;
    let Some(positions) = positions else { return Ok(None) };
    let count = positions.count;
    let (corners, mode): (Vec<u32>, u32) = match (contents.corners(), p.indices) {
        // Draco gives a list of triangles, also of a strip.
        (Some(corners), _) => (corners, 4),
        (None, None) => ((0..count as u32).collect(), mode),
        (None, Some(i)) => {
            let e = data.elements(i, "SCALAR", &[U8, U16, U32])?;
            ((0..e.count).map(|i| e.whole(i, 0) as u32).collect(), mode)
        }
    };
    if let Some(c) = corners.iter().find(|c| **c as usize >= count) {
        return Err(GeomError::invalid(format!("{what} uses vertex {c}, but it has {count}")));
    }
    let faces: Vec<[u32; 3]> = match mode {
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
    let at = |v| DVec3::from_array(std::array::from_fn(|k| positions.get(v, k)));
    Ok(Some(((0..count).map(at).collect(), faces)))
}

struct Collected {
    loaded: Loaded,
    /// The greatest distance of a vertex in the file's pose from that in the bind pose.
    apart: f64,
    /// The number of offsets of all morphs.
    offsets: usize,
    /// The morphs by name in the file and weight.
    known: FxHashMap<(String, u64), usize>,
}

impl Collected {
    fn add(
        &mut self,
        shape: &Shape,
        place: &Place,
        targets: &[(String, f64)],
        what: &str,
    ) -> Result<(), GeomError> {
        let out = &mut self.loaded;
        let first = out.positions.len();
        if first + shape.positions.len() > MOST_ELEMENTS {
            return Err(GeomError::invalid(format!(
                "the glTF file has more than {MOST_ELEMENTS} vertices"
            )));
        }
        if out.triangles.len() + shape.faces.len() > MOST_TRIANGLES {
            return Err(GeomError::invalid(format!(
                "the glTF file has more than {MOST_TRIANGLES} triangles"
            )));
        }
        for (v, p) in shape.positions.iter().enumerate() {
            let mut at = place.to_scene.transform_point3(*p);
            if let Some(posed) = shape.posed(v, place, |m| m.transform_point3(*p)) {
                self.apart = self.apart.max(place.frame.apply(posed - at).length());
                if place.pose == Pose::File {
                    at = posed;
                }
            }
            let at = place.frame.apply(at).as_vec3();
            if !at.is_finite() {
                return Err(GeomError::invalid(format!("vertex {v} of {what} is not finite")));
            }
            out.positions.push(at);
        }
        let corner = |c: u32| c + first as u32;
        out.triangles.extend(shape.faces.iter().map(|f| match place.mirrored {
            false => f.map(corner),
            true => [f[0], f[2], f[1]].map(corner),
        }));
        match &shape.influences {
            Some(own) => out.influences.extend(own.iter().copied().map(Some)),
            None => out.influences.resize(out.positions.len(), place.carried),
        }
        if shape.influences.is_none() && place.carried.is_none() {
            return Ok(());
        }
        let moved = shape.offsets.iter().zip(targets).filter(|(moved, _)| !moved.is_empty());
        for (moved, (name, weight)) in moved {
            self.offsets += moved.len();
            if self.offsets > MOST_OFFSETS || out.morphs.len() > MOST_MORPHS {
                return Err(morphs::too_many());
            }
            let offsets = moved.iter().map(|(v, by)| {
                let plain = || place.to_scene.transform_vector3(*by);
                let posed = shape.posed(*v as usize, place, |m| m.transform_vector3(*by));
                let by = posed.filter(|_| place.pose == Pose::File).unwrap_or_else(plain);
                (corner(*v), place.frame.apply(by).as_vec3())
            });
            let number = *self.known.entry((name.clone(), weight.to_bits())).or_insert_with(|| {
                let mut called = name.clone();
                let mut number = 2;
                while out.morphs.iter().any(|m| m.name == called) {
                    called = format!("{name}#{number}");
                    number += 1;
                }
                out.morphs.push(LoadedMorph { name: called, weight: *weight, offsets: vec![] });
                out.morphs.len() - 1
            });
            out.morphs[number].offsets.extend(offsets);
        }
        Ok(())
    }

    /// Makes the triangles from number `before` on a part.
    fn part(&mut self, before: usize, name: String) -> Result<(), GeomError> {
        let out = &mut self.loaded;
        if out.triangles.len() > before {
            if out.names.len() >= MOST_PARTS {
                return Err(GeomError::invalid(format!(
                    "the glTF file has more than {MOST_PARTS} meshes"
                )));
            }
            out.parts.resize(out.triangles.len(), out.names.len() as u16);
            out.names.push(name);
        }
        Ok(())
    }

    /// Returns what was collected, with a remark if the file is posed.
    fn finish(self, pose: Pose) -> Loaded {
        let mut out = self.loaded;
        let (low, high) =
            out.positions.iter().fold((Vec3::MAX, Vec3::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
        if self.apart > 1e-3 * f64::from((high - low).max_element()) {
            let (read, other, the_other) = match pose {
                Pose::File => ("the pose of its nodes", "bind", "the bind pose"),
                Pose::Bind => ("its bind pose", "file", "that of its nodes"),
            };
            out.remarks.push(format!(
                "the glTF file is posed: {read} is read; `pose = \"{other}\"` reads {the_other}, \
                 where vertices are up to {:.3} away",
                self.apart
            ));
        }
        out
    }
}

impl Shape {
    /// Returns the weighted sum of what the joints of a vertex make of it; `None` if the mesh is
    /// not posed.
    fn posed(&self, v: usize, place: &Place, of: impl Fn(&DAffine3) -> DVec3) -> Option<DVec3> {
        let joints = place.by_joint?;
        let own = self.influences.as_ref()?.get(v)?;
        own.joints().next()?;
        own.joints().map(|(j, w)| Some(of(joints.get(j)?) * w)).sum()
    }
}
