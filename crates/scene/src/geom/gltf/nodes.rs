//! The tree of nodes, with their transforms to the scene.

use super::container::name_of;
use super::json::{Document, Node};
use crate::geom::GeomError;
use glam::{DAffine3, DMat4, DQuat, DVec3};

/// The nodes of a document; lists without another order are by node.
pub(super) struct Nodes {
    /// The nodes, parents before children.
    pub order: Vec<usize>,
    pub parents: Vec<Option<usize>>,
    /// The transforms from the nodes' spaces to the scene.
    pub global: Vec<DAffine3>,
    /// True if each node belongs to the default scene, and neither it nor an ancestor is hidden
    /// (`KHR_node_visibility`).
    pub drawn: Vec<bool>,
}

impl Nodes {
    pub fn of(document: &Document) -> Result<Nodes, GeomError> {
        let nodes = &document.nodes;
        let name = |i: usize| nodes.get(i).map_or_else(String::new, |n| name_of(n, i));
        let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
        for (i, n) in nodes.iter().enumerate() {
            for c in &n.children {
                let Some(parent) = parents.get_mut(*c) else {
                    let message = format!(
                        "node `{}` has the child {c}, but there are {} nodes",
                        name(i),
                        nodes.len()
                    );
                    return Err(GeomError::invalid(message));
                };
                if let Some(other) = parent.replace(i) {
                    let (a, b) = (name(other), name(i));
                    return Err(GeomError::invalid(format!(
                        "node `{}` is a child of `{a}` and of `{b}`",
                        name(*c)
                    )));
                }
            }
        }
        let mut order: Vec<usize> = (0..nodes.len()).filter(|i| parents[*i].is_none()).collect();
        let mut at = 0;
        while at < order.len() {
            order.extend(&nodes[order[at]].children);
            at += 1;
        }
        if order.len() < nodes.len() {
            return Err(GeomError::invalid(format!(
                "the glTF file's nodes have a cycle: {}",
                cycle(&parents, &order, name)
            )));
        }
        let mut drawn = vec![false; nodes.len()];
        match document.scenes.get(document.scene.unwrap_or(0)) {
            Some(scene) => {
                for i in &scene.nodes {
                    let missing =
                        || GeomError::invalid(format!("the scene refers to the missing node {i}"));
                    *drawn.get_mut(*i).ok_or_else(missing)? = true;
                }
            }
            None if document.scenes.is_empty() => drawn.fill(true),
            None => return Err(GeomError::invalid("the glTF file's default scene is missing")),
        }
        let mut global = vec![DAffine3::IDENTITY; nodes.len()];
        for i in &order {
            let local = local(&nodes[*i]);
            global[*i] = parents[*i].map_or(local, |p| global[p] * local);
            if !global[*i].is_finite() {
                return Err(GeomError::invalid(format!(
                    "the position of node `{}` is not finite",
                    name(*i)
                )));
            }
            drawn[*i] |= parents[*i].is_some_and(|p| drawn[p]);
        }
        let hidden =
            |n: &Node| n.extensions.visibility.as_ref().is_some_and(|v| v.visible == Some(false));
        let mut shown = vec![true; nodes.len()];
        for i in &order {
            shown[*i] = !hidden(&nodes[*i]) && parents[*i].is_none_or(|p| shown[p]);
            drawn[*i] &= shown[*i];
        }
        Ok(Nodes { order, parents, global, drawn })
    }
}

/// Returns the transform from a node's space to its parent's.
fn local(n: &Node) -> DAffine3 {
    match &n.matrix {
        Some(m) => DAffine3::from_mat4(DMat4::from_cols_array(m)),
        None => placed(n.translation, n.rotation, n.scale),
    }
}

/// Returns the transform of a translation, a rotation (a quaternion, of any length) and a
/// scale, of which the last acts first.
pub(super) fn placed(
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
) -> DAffine3 {
    let rotation = rotation.map_or(DQuat::IDENTITY, |q| {
        let q = DQuat::from_array(q);
        let length = q.length();
        if length > 0.0 { q / length } else { DQuat::IDENTITY }
    });
    DAffine3::from_scale_rotation_translation(
        scale.map_or(DVec3::ONE, DVec3::from),
        rotation,
        translation.map_or(DVec3::ZERO, DVec3::from),
    )
}

/// Returns a cycle among the nodes that are not in `order`, as text.
fn cycle(parents: &[Option<usize>], order: &[usize], name: impl Fn(usize) -> String) -> String {
    let mut placed = vec![false; parents.len()];
    order.iter().for_each(|i| placed[*i] = true);
    let mut at = placed.iter().position(|p| !p).unwrap_or_default();
    // After that many steps up, `at` is on the cycle.
    for _ in 0..parents.len() {
        at = parents[at].unwrap_or(at);
    }
    let (start, mut names) = (at, vec![name(at)]);
    loop {
        at = parents[at].unwrap_or(start);
        names.push(name(at));
        if at == start || names.len() > 12 {
            return names.join(" -> ");
        }
    }
}
