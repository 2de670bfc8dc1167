//! States by skeletal animation: each body is a skinned mesh at rest, whose joints move.

use super::channels::Animation;
use super::document::Document;
use crate::geom::{Instance, RestJoint, Skinned, Solid};
use glam::{DAffine3, DMat4, DQuat, DVec3, Mat4, Quat, Vec3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A transform may differ from its translation, rotation and scale by this much, as a part
/// of its own size; glTF cannot express the shear that is left over.
const SHEAR: f64 = 1e-3;

/// A body in one state.
struct PlacedBody {
    body: Arc<dyn Skinned>,
    /// Where its root is.
    placed: DAffine3,
    /// The transform of each joint.
    transforms: Vec<DAffine3>,
}

/// A translation, a rotation and a scale.
#[derive(Clone, Copy)]
struct Parts {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

/// Adds every body of the states with its joints, and with morph targets where its shape
/// changes; adds nothing and returns false if anything in them is not a body, or a body has
/// another skin in some of them.
pub fn add(d: &mut Document, animation: &mut Animation, states: &[Solid]) -> bool {
    let Some(states) = states.iter().map(bodies).collect::<Option<Vec<_>>>() else { return false };
    // Joints are animated about the shape of the last state, the best one of a film.
    let Some(last) = states.last().filter(|s| !s.is_empty()) else { return false };
    let is_same = |s: &Vec<PlacedBody>| {
        s.len() == last.len()
            && s.iter().zip(last).all(|(a, b)| a.body.identity() == b.body.identity())
    };
    if !states.iter().all(is_same) {
        return false;
    }
    let of = |i: usize| states.iter().map(|s| &s[i]).collect::<Vec<_>>();
    let motions: Option<Vec<_>> = (0..last.len()).map(|i| motion(&of(i))).collect();
    let Some(motions) = motions else { return false };
    for (i, motion) in motions.iter().enumerate() {
        add_body(d, animation, &of(i), motion);
    }
    true
}

/// Returns the bodies of a state, if it consists of bodies.
fn bodies(state: &Solid) -> Option<Vec<PlacedBody>> {
    let mut all: Vec<PlacedBody> = Vec::new();
    // The parts of a body follow each other in order, and share its placement.
    let mut before = 0;
    for Instance { skin, affine, .. } in state.instances() {
        let skin = skin.as_ref()?;
        let is_next = all.last().is_none_or(|b| {
            b.body.identity() != skin.body.identity() || b.placed != affine.0 || skin.part <= before
        });
        if is_next {
            let transforms = skin.transforms.iter().map(wide).collect();
            all.push(PlacedBody { body: Arc::clone(&skin.body), placed: affine.0, transforms });
        }
        before = skin.part;
        // A part may be left from an earlier pose, in which its own joints were the same.
        let body = all.last_mut()?;
        for joint in skin.body.joints_of_part(skin.part).iter().map(|j| usize::from(*j)) {
            body.transforms[joint] = wide(&skin.transforms[joint]);
        }
    }
    Some(all)
}

fn wide(t: &glam::Affine3A) -> DAffine3 {
    let m = t.matrix3;
    DAffine3 {
        matrix3: glam::DMat3::from_cols(
            m.x_axis.as_dvec3(),
            m.y_axis.as_dvec3(),
            m.z_axis.as_dvec3(),
        ),
        translation: t.translation.as_dvec3(),
    }
}

/// Returns, for the root and each joint of a body, its motion over the states, relative to
/// its parent; `None` if a motion has shear.
fn motion(states: &[&PlacedBody]) -> Option<Vec<Vec<Parts>>> {
    let joints = states.last()?.body.joints();
    let at_rest = |j: usize| DAffine3::from_translation(joints[j].head);
    let mut all = vec![states.iter().map(|s| parts(s.placed)).collect::<Option<Vec<_>>>()?];
    for (j, joint) in joints.iter().enumerate() {
        let of = |s: &&PlacedBody| {
            let own = s.transforms[j] * at_rest(j);
            let parent = joint.parent.map_or(DAffine3::IDENTITY, |p| s.transforms[p] * at_rest(p));
            parts(parent.inverse() * own)
        };
        all.push(states.iter().map(of).collect::<Option<Vec<_>>>()?);
    }
    Some(all)
}

fn parts(t: DAffine3) -> Option<Parts> {
    let (scale, rotation, translation) = t.to_scale_rotation_translation();
    let back = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
    let apart = (DMat4::from(back) - DMat4::from(t)).to_cols_array();
    let size = scale.abs().max_element();
    let is_near = apart.iter().all(|x| x.abs() <= SHEAR * size) && translation.is_finite();
    is_near.then_some(Parts { translation, rotation, scale })
}

fn add_body(
    d: &mut Document,
    animation: &mut Animation,
    states: &[&PlacedBody],
    motion: &[Vec<Parts>],
) {
    let Some(PlacedBody { body, .. }) = states.last() else { return };
    let rest: Vec<RestJoint> = body.joints();
    let root = d.root(json!({ "name": "body" }));
    let nodes: Vec<usize> = rest.iter().map(|j| d.node(json!({ "name": &*j.name }))).collect();
    let mut children: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (j, joint) in rest.iter().enumerate() {
        children.entry(joint.parent.map_or(root, |p| nodes[p])).or_default().push(nodes[j]);
    }
    for (node, of) in children {
        d.node_mut(node)["children"] = json!(of);
    }
    for (node, states) in std::iter::once(root).chain(nodes.iter().copied()).zip(motion) {
        animate(d, animation, node, states);
    }
    // From the body's own coordinates to those of a joint at rest.
    let inverse: Vec<Mat4> =
        rest.iter().map(|j| Mat4::from_translation(-j.head.as_vec3())).collect();
    let inverse = d.matrices(&inverse);
    let skin =
        d.skin(json!({ "joints": nodes, "inverseBindMatrices": inverse, "skeleton": nodes[0] }));
    let (joints, weights): (Vec<_>, Vec<_>) = body.weights().into_iter().unzip();
    let [joints, weights] = d.influences(&joints, &weights);
    let (positions, normals) = (d.positions(body.positions()), d.vectors(body.normals()));
    let corners = d.corners(body.triangles());
    let (targets, shown) = shapes(d, states);
    let mut primitive = json!({
        "attributes": {
            "POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights,
        },
        "indices": corners,
    });
    let mut mesh = json!({});
    if !targets.is_empty() {
        mesh["weights"] = json!(vec![0.0; targets.len()]);
        primitive["targets"] = json!(targets);
    }
    mesh["primitives"] = json!([primitive]);
    let mesh = d.mesh(mesh);
    // Where the mesh's own node is does not matter: the joints place it.
    let node = d.root(json!({ "mesh": mesh, "skin": skin }));
    if !targets.is_empty() {
        let output = d.numbers(&shown);
        animation.channel(node, "weights", output, "LINEAR");
    }
}

/// Adds a morph target for each shape at rest that differs from that of the last state.
/// Returns the targets, and the weight of each in each state.
fn shapes(d: &mut Document, states: &[&PlacedBody]) -> (Vec<Value>, Vec<f32>) {
    let Some(last) = states.last() else { return Default::default() };
    let mut shapes: Vec<&Arc<dyn Skinned>> = Vec::new();
    let mut own: Vec<Option<usize>> = Vec::new();
    for state in states {
        let known = shapes.iter().position(|s| s.positions() == state.body.positions());
        own.push(match known {
            _ if state.body.positions() == last.body.positions() => None,
            Some(i) => Some(i),
            None => {
                shapes.push(&state.body);
                Some(shapes.len() - 1)
            }
        });
    }
    let mut targets = Vec::new();
    for shape in &shapes {
        let pairs = shape.positions().iter().zip(last.body.positions());
        let apart: Vec<Vec3> = pairs.map(|(a, b)| *a - *b).collect();
        targets.push(json!({ "POSITION": d.positions(&apart) }));
    }
    let weight = |own: &Option<usize>| {
        let own = *own;
        (0..shapes.len()).map(move |k| if own == Some(k) { 1.0 } else { 0.0 })
    };
    (targets, own.iter().flat_map(weight).collect())
}

/// Places a node as in the first state, and animates what differs in later ones.
fn animate(d: &mut Document, animation: &mut Animation, node: usize, states: &[Parts]) {
    let translations: Vec<Vec3> = states.iter().map(|s| s.translation.as_vec3()).collect();
    let scales: Vec<Vec3> = states.iter().map(|s| s.scale.as_vec3()).collect();
    let mut rotations: Vec<Quat> =
        states.iter().map(|s| s.rotation.normalize().as_quat()).collect();
    // Of the two quaternions of a rotation the one nearer to that before, so that the way
    // between them is the short one.
    for i in 1..rotations.len() {
        if rotations[i].dot(rotations[i - 1]) < 0.0 {
            rotations[i] = -rotations[i];
        }
    }
    let at: &mut Value = d.node_mut(node);
    at["translation"] = json!(translations[0].to_array());
    at["rotation"] = json!(rotations[0].to_array());
    at["scale"] = json!(scales[0].to_array());
    let moves = |all: &[Vec3]| all.iter().any(|v| *v != all[0]);
    if moves(&translations) {
        let output = d.animated_vectors(&translations);
        animation.channel(node, "translation", output, "LINEAR");
    }
    if rotations.iter().any(|q| *q != rotations[0]) {
        let output = d.rotations(&rotations);
        animation.channel(node, "rotation", output, "LINEAR");
    }
    if moves(&scales) {
        let output = d.animated_vectors(&scales);
        animation.channel(node, "scale", output, "LINEAR");
    }
}

#[cfg(test)]
mod tests {
    use super::super::animation::write_animation;
    use super::*;
    use crate::geom::Affine;
    use crate::geom::armature::{Armature, Influence, JointPose, NamedJoint, Rig, Rules};

    /// A strip of four joints in a row, with two vertices a joint.
    fn worm() -> Arc<Armature> {
        let joint = |i: usize| NamedJoint {
            name: format!("j{i}"),
            parent: (i > 0).then(|| format!("j{}", i - 1)),
            head: DVec3::Y * i as f64,
            tail: DVec3::Y * (i as f64 + 1.0),
        };
        let rig = Rig::new((0..4).map(joint).collect()).unwrap();
        let positions: Vec<Vec3> =
            (0..8).map(|i| Vec3::new((i % 2) as f32, (i / 2) as f32 + 0.5, 0.0)).collect();
        let triangles = (0..6).map(|i| [i, i + 1, i + 2]).collect();
        let influences = (0..8u16).map(|i| {
            let (own, next) = (i / 2, (i / 2 + 1).min(3));
            let weights = if own == next { [1.0, 0.0, 0.0, 0.0] } else { [0.75, 0.25, 0.0, 0.0] };
            Influence { joints: [own, next, 0, 0], weights }
        });
        Arc::new(Armature::new(rig, positions, triangles, influences.collect()).unwrap())
    }

    /// Where glTF puts the vertices of a body (section 3.7.3.3: the sum over joints of
    /// weight, node matrix and inverse bind matrix), from the motion of its nodes.
    fn skinned(body: &Armature, motion: &[Vec<Parts>], state: usize) -> Vec<DVec3> {
        let affine = |p: &Parts| {
            DAffine3::from_scale_rotation_translation(p.scale, p.rotation, p.translation)
        };
        let mut global: Vec<DAffine3> = Vec::new();
        for (j, joint) in body.rig().joints().iter().enumerate() {
            let parent = joint.parent.map_or(affine(&motion[0][state]), |p| global[p]);
            global.push(parent * affine(&motion[1 + j][state]));
        }
        let at = |(p, i): (&Vec3, &Influence)| {
            let of = |(j, w): (usize, f64)| {
                let head = body.rig().joints()[j].head;
                global[j].transform_point3(p.as_dvec3() - head) * w
            };
            i.joints().map(of).sum()
        };
        body.positions().iter().zip(body.influences()).map(at).collect()
    }

    #[test]
    fn joints_put_every_vertex_where_the_body_has_it() {
        let body = worm();
        let turn = |x: f64| JointPose::turned(DVec3::new(0.3 * x, -0.2 * x, x));
        let poses: Vec<Vec<JointPose>> = (0..3)
            .map(|k| (0..4).map(|j| turn(0.3 * f64::from(k) * f64::from(j + 1))).collect())
            .collect();
        let by =
            Affine::new(DVec3::new(1.0, 2.0, -3.0), DVec3::new(0.1, 0.5, 0.2), DVec3::splat(1.5));
        let solids: Vec<Solid> =
            poses.iter().map(|p| body.posed(p, &Rules::default()).unwrap().placed(by)).collect();
        let states: Vec<Vec<PlacedBody>> = solids.iter().map(|s| bodies(s).unwrap()).collect();
        let of: Vec<&PlacedBody> = states.iter().map(|s| &s[0]).collect();
        let motion = motion(&of).unwrap();
        for (k, solid) in solids.iter().enumerate() {
            let placed = skinned(&body, &motion, k);
            // Parts have copies of vertices, in an order of their own.
            for v in solid.vertices() {
                let nearest = placed.iter().map(|p| p.distance(v)).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-5, "state {k}: {v} is {nearest} away");
            }
        }
        let glb = write_animation(&solids, 0.1).unwrap();
        let length = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
        let d: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        assert_eq!(d["skins"][0]["joints"].as_array().unwrap().len(), 4);
        let rotated = d["animations"][0]["channels"].as_array().unwrap();
        assert!(
            rotated
                .iter()
                .all(|c| c["target"]["path"] == "rotation" || c["target"]["path"] == "translation")
        );
        assert!(rotated.len() >= 4);
    }

    #[test]
    fn two_bodies_keep_their_own_joints() {
        let body = worm();
        let at = |x: f64, turn: f64| {
            let pose = vec![JointPose::turned(DVec3::Z * turn); 4];
            let placed = Affine::new(DVec3::X * x, DVec3::ZERO, DVec3::ONE);
            body.posed(&pose, &Rules::default()).unwrap().placed(placed)
        };
        let both = Solid::group(&[at(0.0, 0.1), at(0.0, -0.4)]);
        let found = bodies(&both).unwrap();
        assert_eq!(found.len(), 2);
        assert_ne!(found[0].transforms, found[1].transforms);
        assert!(
            bodies(&Solid::group(&[
                at(0.0, 0.1),
                Solid::new(Arc::new(crate::geom::cuboid(DVec3::ONE).unwrap()))
            ]))
            .is_none()
        );
    }
}
