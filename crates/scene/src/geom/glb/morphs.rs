//! States by morph targets: each state is a target, and the animation moves the weight from
//! one to the next. At rest the file shows the last state.

use super::channels::Animation;
use super::document::Document;
use crate::geom::{GeomError, Mesh, Object, Solid};
use glam::Vec3;
use serde_json::{Value, json};

/// Adds nodes for each set of triangles that the states have, one for each object. The
/// animation shows the states of these numbers.
pub fn add(
    d: &mut Document,
    animation: &mut Animation,
    states: &[Solid],
    shown: &[usize],
) -> Result<(), GeomError> {
    let states: Vec<Vec<Object>> = states.iter().map(Solid::objects).collect::<Result<_, _>>()?;
    // The states with the same triangles, the last first.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, own) in states.iter().enumerate().rev() {
        match groups.iter_mut().find(|g| same_shape(&states[g[0]], own)) {
            Some(g) => g.push(i),
            None => groups.push(vec![i]),
        }
    }
    for (number, group) in groups.iter().enumerate() {
        // While other meshes are shown, the weights do not matter.
        let weight = |state: &usize| {
            let own = group.iter().position(|i| i == state);
            (1..group.len()).map(move |k| if own == Some(k) { 1.0 } else { 0.0 })
        };
        let weights: Vec<f32> = shown.iter().flat_map(weight).collect();
        let weights = (group.len() > 1).then(|| d.numbers(&weights));
        let scale = |state: &usize| if group.contains(state) { Vec3::ONE } else { Vec3::ZERO };
        let scales: Vec<Vec3> = shown.iter().map(scale).collect();
        let scales = (groups.len() > 1).then(|| d.animated_vectors(&scales));
        for (k, base) in states[group[0]].iter().enumerate() {
            let targets: Vec<&Mesh> = group[1..].iter().map(|i| &states[*i][k].mesh).collect();
            let name = match number {
                0 => base.name.to_string(),
                n => format!("{}_earlier_{n}", base.name),
            };
            let mesh = morphed(d, &name, &base.mesh, &targets);
            let at_rest = if number == 0 { [1; 3] } else { [0; 3] };
            let node = d.node(json!({ "name": name, "mesh": mesh, "scale": at_rest }));
            if let Some(weights) = weights {
                let how = if groups.len() == 1 { "LINEAR" } else { "STEP" };
                animation.channel(node, "weights", weights, how);
            }
            if let Some(scales) = scales {
                animation.channel(node, "scale", scales, "STEP");
            }
        }
    }
    Ok(())
}

/// True if the vertices of two states differ in their places only.
fn same_shape(a: &[Object], b: &[Object]) -> bool {
    let same = |(a, b): (&Object, &Object)| {
        a.name == b.name
            && a.mesh.positions.len() == b.mesh.positions.len()
            && a.mesh.topology.triangles == b.mesh.topology.triangles
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// Adds a mesh with the differences of others as its targets.
fn morphed(d: &mut Document, name: &str, base: &Mesh, others: &[&Mesh]) -> usize {
    let (positions, normals) = (d.positions(&base.positions), d.vectors(&base.normals));
    let corners = d.corners(&base.topology.triangles);
    let apart =
        |a: &[Vec3], b: &[Vec3]| -> Vec<Vec3> { a.iter().zip(b).map(|(a, b)| *a - *b).collect() };
    let mut primitive = json!({
        "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": corners,
    });
    let mut mesh = json!({ "name": name });
    if !others.is_empty() {
        let target = |other: &&Mesh| {
            let p = d.positions(&apart(&other.positions, &base.positions));
            let n = d.vectors(&apart(&other.normals, &base.normals));
            json!({ "POSITION": p, "NORMAL": n })
        };
        primitive["targets"] = others.iter().map(target).collect::<Value>();
        mesh["weights"] = json!(vec![0.0; others.len()]);
    }
    mesh["primitives"] = json!([primitive]);
    d.mesh(mesh)
}
