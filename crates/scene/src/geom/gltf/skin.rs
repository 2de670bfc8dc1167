//! Skins: which nodes are joints, where they are at rest, and which joints move each
//! vertex.
//!
//! The rest pose is the bind pose, or that of the file's nodes. The matrix A from a skin's
//! vertices and joints to the scene is its root joint's global transform times inverse bind
//! matrix. It is the same for all joints if the file's nodes are in the bind pose, and usually
//! the identity. glTF moves a vertex by the sum of `w_j G_j B_j`. With `G_j` at rest equal to
//! `A B_j^-1`, this is [`Rig`]'s own rule for heads `A B_j^-1 0`, so rest frames can be
//! aligned with the world.
//!
//! In a posed file joints disagree, and the root joint is often posed as well. Then A is the
//! transform of the mesh's node or of the root's parent, or the identity, as exporters have it
//! ([`usual`]).

use super::Pose;
use super::access::{Data, F32, U8, U16};
use super::container::name_of;
use super::draco::Contents;
use super::nodes::Nodes;
use crate::geom::armature::{Influence, MOST_WEIGHTS, NamedJoint, Rig};
use crate::geom::{FileFrame, GeomError};
use glam::{DAffine3, DMat4, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// A skin's matrix closer than this to the identity is taken as the identity: the product
/// is only accurate to single precision.
const SAME: f64 = 1e-5;
/// Joints whose matrices differ by less than this, relative to the skeleton's size, are in
/// the same pose.
const STILL: f64 = 1e-4;

/// A skin that the scene uses.
pub(super) struct Placed {
    /// The transform from its vertices to the scene, in the bind pose.
    pub to_scene: DAffine3,
    /// Its joints, as indices into the skeleton.
    joints: Vec<usize>,
    /// The transforms from its vertices to the scene by each joint, in the pose of the
    /// file's nodes, if that is another.
    posed: Option<Vec<DAffine3>>,
}

impl Placed {
    /// Returns the transforms by joint, in rig order; `None` if the file's pose is the bind
    /// pose.
    pub fn posed(&self, rig: &Rig) -> Option<Vec<DAffine3>> {
        let posed = self.posed.as_ref()?;
        let mut all = vec![self.to_scene; rig.joints().len()];
        for (j, m) in self.joints.iter().zip(posed) {
            if let Some(place) = rig.placed(*j).and_then(|j| all.get_mut(j)) {
                *place = *m;
            }
        }
        Some(all)
    }
}

/// The joints of all skins that the scene uses.
#[derive(Default)]
pub(super) struct Skeleton {
    /// The joints' nodes.
    nodes: Vec<usize>,
    /// The transform from each joint's space to the scene, at rest.
    rest: Vec<DAffine3>,
    pose: Pose,
    /// The skins, by index in the file.
    pub skins: BTreeMap<usize, Placed>,
    /// For each node, the joint that it moves with: itself or the nearest ancestor.
    pub carrier: Vec<Option<usize>>,
}

fn inverse(m: DAffine3, what: impl Fn() -> String) -> Result<DAffine3, GeomError> {
    let inverse = m.inverse();
    let det = m.matrix3.determinant();
    if det != 0.0 && det.is_finite() && inverse.is_finite() {
        Ok(inverse)
    } else {
        Err(GeomError::invalid(what()))
    }
}

/// The distance between the joints that are farthest apart along an axis.
fn extent(heads: &[DVec3]) -> f64 {
    let (low, high) =
        heads.iter().fold((DVec3::MAX, DVec3::MIN), |(a, b), h| (a.min(*h), b.max(*h)));
    (high - low).max_element().max(0.0)
}

/// True if all joints place the vertices alike.
fn agree(by_joint: &[DAffine3], with: DAffine3, heads: &[DVec3]) -> bool {
    let size = with.matrix3.determinant().abs().cbrt();
    let near = |m: &DAffine3| {
        (m.matrix3 - with.matrix3).to_cols_array().iter().all(|x| x.abs() <= STILL * size)
            && (m.translation - with.translation).length() <= STILL * extent(heads).max(SAME)
    };
    by_joint.iter().all(near)
}

/// Returns the matrix from a skin's vertices to the scene in the bind pose: that of the root
/// joint, or where that is posed, the likely one that puts joints nearest to where the file has
/// them. The root is posed if it is turned by other than right angles, by which exporters
/// exchange axes, or if joints disagree and are less than half of the skeleton away.
fn usual(
    likely: [DAffine3; 3],
    root: DAffine3,
    agreed: bool,
    binds: &[DAffine3],
    heads: &[DVec3],
) -> DAffine3 {
    let away = |m: &DAffine3| {
        let squares = binds.iter().zip(heads).map(|(b, head)| {
            (m.transform_point3(b.inverse().translation) - *head).length_squared()
        });
        (squares.sum::<f64>() / heads.len() as f64).sqrt()
    };
    let size = root.matrix3.determinant();
    let fits = |m: &DAffine3| (m.matrix3.determinant() / size - 1.0).abs() < 0.01;
    let right_angles = |m: &DAffine3| {
        let turn = (m.matrix3.inverse() * root.matrix3).to_cols_array();
        turn.iter().all(|x| x.abs() < 1e-3 || (x.abs() - 1.0).abs() < 1e-3)
    };
    let found = likely.into_iter().filter(fits).map(|m| (away(&m), m));
    match found.min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((away, m)) if !right_angles(&m) || !agreed && away < extent(heads) / 2.0 => m,
        _ => root,
    }
}

impl Skeleton {
    pub fn of(data: &Data, nodes: &Nodes, pose: Pose) -> Result<Skeleton, GeomError> {
        let all = &data.document.nodes;
        // The skins, with the first node that uses each.
        let mut used = BTreeMap::new();
        for (i, n) in all.iter().enumerate().filter(|(i, n)| nodes.drawn[*i] && n.mesh.is_some()) {
            n.skin.map(|s| used.entry(s).or_insert(i));
        }
        let mut out = Skeleton { carrier: vec![None; all.len()], pose, ..Skeleton::default() };
        let mut rank = vec![0; all.len()];
        nodes.order.iter().enumerate().for_each(|(k, i)| rank[*i] = k);
        let mut number = vec![None; all.len()];
        for (s, user) in used {
            let missing = || GeomError::invalid(format!("the glTF file has no skin {s}"));
            let skin = data.document.skins.get(s).ok_or_else(missing)?;
            if let Some(j) = skin.joints.iter().find(|j| **j >= all.len()) {
                return Err(GeomError::invalid(format!(
                    "skin {s} refers to the missing node {j} as a joint"
                )));
            }
            let first = (0..skin.joints.len()).min_by_key(|k| rank[skin.joints[*k]]);
            let Some(first) = first else {
                return Err(GeomError::invalid(format!("skin {s} of the glTF file has no joints")));
            };
            let binds = match skin.inverse_bind_matrices {
                None => vec![DAffine3::IDENTITY; skin.joints.len()],
                Some(a) => {
                    let e = data.elements(a, "MAT4", &[F32])?;
                    let (has, needs) = (e.count, skin.joints.len());
                    if has < needs {
                        let message =
                            format!("skin {s} has {needs} joints, but {has} inverse bind matrices");
                        return Err(GeomError::invalid(message));
                    }
                    let one = |i| DMat4::from_cols_array(&std::array::from_fn(|k| e.get(i, k)));
                    (0..needs).map(|i| DAffine3::from_mat4(one(i))).collect()
                }
            };
            let by_joint: Vec<DAffine3> =
                skin.joints.iter().zip(&binds).map(|(j, b)| nodes.global[*j] * *b).collect();
            let heads: Vec<DVec3> =
                skin.joints.iter().map(|j| nodes.global[*j].translation).collect();
            let mut to_scene = by_joint[first];
            let parent = nodes.parents[skin.joints[first]];
            let above = parent.map_or(DAffine3::IDENTITY, |p| nodes.global[p]);
            let likely = [nodes.global[user], above, DAffine3::IDENTITY];
            let agreed = agree(&by_joint, to_scene, &heads);
            to_scene = usual(likely, to_scene, agreed, &binds, &heads);
            let still = agree(&by_joint, to_scene, &heads);
            if to_scene.abs_diff_eq(DAffine3::IDENTITY, SAME) {
                to_scene = DAffine3::IDENTITY;
            }
            let mut joints = Vec::with_capacity(skin.joints.len());
            for (j, bind) in skin.joints.iter().zip(&binds) {
                let name = || {
                    format!(
                        "the inverse bind matrix of joint `{}` is singular",
                        name_of(&all[*j], *j)
                    )
                };
                let rest = match pose {
                    Pose::Bind => to_scene * inverse(*bind, name)?,
                    Pose::File => nodes.global[*j],
                };
                joints.push(*number[*j].get_or_insert_with(|| {
                    out.nodes.push(*j);
                    out.rest.push(rest);
                    out.nodes.len() - 1
                }));
            }
            let posed = (!still).then_some(by_joint);
            out.skins.insert(s, Placed { to_scene, joints, posed });
        }
        for i in &nodes.order {
            out.carrier[*i] = number[*i].or_else(|| nodes.parents[*i].and_then(|p| out.carrier[p]));
        }
        Ok(out)
    }

    /// Returns the rest transform of a mesh without a skin: attached to its carrier
    /// joint, or else its node's transform.
    pub fn place(&self, data: &Data, nodes: &Nodes, node: usize) -> Result<DAffine3, GeomError> {
        let global = nodes.global[node];
        let Some(j) = self.carrier[node].filter(|_| self.pose == Pose::Bind) else {
            return Ok(global);
        };
        let joint = self.nodes[j];
        let name =
            || format!("the node `{}` has no volume", name_of(&data.document.nodes[joint], joint));
        Ok(self.rest[j] * (inverse(nodes.global[joint], name)? * global))
    }

    /// Returns the rig, with a keypoint at each joint's head; `None` if there are no
    /// joints.
    pub fn rig(
        &self,
        data: &Data,
        nodes: &Nodes,
        frame: &FileFrame,
    ) -> Result<Option<Rig>, GeomError> {
        if self.nodes.is_empty() {
            return Ok(None);
        }
        let names = self.names(data);
        let parent: Vec<Option<usize>> =
            self.nodes.iter().map(|n| nodes.parents[*n].and_then(|p| self.carrier[p])).collect();
        let heads: Vec<DVec3> = self.rest.iter().map(|r| frame.apply(r.translation)).collect();
        let mut below = vec![(DVec3::ZERO, 0u32); heads.len()];
        for (p, h) in parent.iter().zip(&heads) {
            if let Some(p) = p {
                below[*p] = (below[*p].0 + *h, below[*p].1 + 1);
            }
        }
        let tail = |j: usize| match (below[j], parent[j]) {
            ((sum, n @ 1..), _) => sum / f64::from(n),
            // A leaf bone continues its parent's direction, at half the length.
            (_, Some(p)) => heads[j] + (heads[j] - heads[p]) * 0.5,
            _ => heads[j],
        };
        let joint = |j: usize| NamedJoint {
            name: names[j].clone(),
            parent: parent[j].map(|p| names[p].clone()),
            head: heads[j],
            tail: tail(j),
        };
        let rig = Rig::new((0..heads.len()).map(joint).collect())?;
        let points = names.iter().zip(&heads).map(|(n, h)| (n.clone(), n.clone(), *h));
        rig.with_keypoints(points.collect()).map(Some)
    }

    /// Returns unique names of the joints.
    fn names(&self, data: &Data) -> Vec<String> {
        let given = |n: usize| data.document.nodes[n].name.clone().filter(|s| !s.is_empty());
        let mut taken: BTreeSet<String> = self.nodes.iter().filter_map(|n| given(*n)).collect();
        let (mut counts, mut names) = (BTreeMap::new(), Vec::with_capacity(self.nodes.len()));
        for (j, n) in self.nodes.iter().enumerate() {
            let base = given(*n).unwrap_or_else(|| format!("joint_{j}"));
            let count = counts.entry(base.clone()).or_insert(0u32);
            *count += 1;
            let mut name = base.clone();
            if *count > 1 || (given(*n).is_none() && taken.contains(&base)) {
                *count = (*count).max(2);
                name = format!("{base}#{count}");
                while taken.contains(&name) {
                    *count += 1;
                    name = format!("{base}#{count}");
                }
            }
            taken.insert(name.clone());
            names.push(name);
        }
        names
    }
}

/// Returns the joints that move each vertex of a primitive, in rig order: the four
/// heaviest of `JOINTS_0` and `JOINTS_1`.
pub(super) fn influences(
    contents: &Contents,
    what: &str,
    vertices: usize,
    skin: &Placed,
    rig: &Rig,
) -> Result<Vec<Influence>, GeomError> {
    let mut sets = Vec::new();
    for k in 0..2 {
        let find = |name: &str, components: &[u32]| {
            contents.attribute(&format!("{name}_{k}"), "VEC4", components)
        };
        match (find("JOINTS", &[U8, U16])?, find("WEIGHTS", &[F32, U8, U16])?) {
            (Some(joints), Some(weights)) => {
                let set = (joints, weights);
                let (joints, weights) = (set.0.count, set.1.count);
                if joints != vertices || weights != vertices {
                    return Err(GeomError::invalid(format!(
                        "{what} has {vertices} vertices, but JOINTS_{k} for {joints} and WEIGHTS_{k} for {weights}"
                    )));
                }
                sets.push(set);
            }
            _ if k == 0 => {
                return Err(GeomError::invalid(format!(
                    "{what} has a skin, but no weights (JOINTS_0 and WEIGHTS_0)"
                )));
            }
            _ => break,
        }
    }
    let one = |v: usize| {
        let mut found = Vec::with_capacity(8);
        for (joints, weights) in &sets {
            found.extend(
                (0..4).map(|k| (joints.whole(v, k), weights.get(v, k))).filter(|(_, w)| *w != 0.0),
            );
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found.truncate(MOST_WEIGHTS);
        let sum: f64 = found.iter().map(|(_, w)| *w).sum();
        let mut out = Influence::default();
        for (k, (j, w)) in found.iter().enumerate() {
            let placed = skin
                .joints
                .get(*j)
                .and_then(|j| rig.placed(*j))
                .and_then(|j| u16::try_from(j).ok());
            out.joints[k] = placed.ok_or_else(|| {
                let n = skin.joints.len();
                GeomError::invalid(format!(
                    "vertex {v} of {what} is moved by joint {j}, but its skin has {n} joints"
                ))
            })?;
            out.weights[k] = (w / sum) as f32;
        }
        Ok(out)
    };
    (0..vertices).map(one).collect()
}
