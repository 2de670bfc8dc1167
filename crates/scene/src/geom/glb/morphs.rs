//! States by morph targets: each state is a target, and the animation moves the weight from
//! one to the next.

use super::channels::Animation;
use super::document::Document;
use crate::geom::{GeomError, Mesh, Solid};
use glam::Vec3;
use serde_json::{Value, json};

/// Adds a node for each set of triangles that the states have.
pub fn add(d: &mut Document, animation: &mut Animation, states: &[Solid]) -> Result<(), GeomError> {
    let meshes: Vec<Mesh> = states.iter().map(Solid::to_mesh).collect::<Result<_, _>>()?;
    // The states with the same triangles, by the first of them.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, m) in meshes.iter().enumerate() {
        let same = |g: &&mut Vec<usize>| {
            let first = &meshes[g[0]];
            first.positions.len() == m.positions.len()
                && first.topology.triangles == m.topology.triangles
        };
        match groups.iter_mut().find(same) {
            Some(g) => g.push(i),
            None => groups.push(vec![i]),
        }
    }
    for group in &groups {
        let base = &meshes[group[0]];
        let (positions, normals) = (d.positions(&base.positions), d.vectors(&base.normals));
        let corners = d.corners(&base.topology.triangles);
        let apart = |a: &[Vec3], b: &[Vec3]| -> Vec<Vec3> {
            a.iter().zip(b).map(|(a, b)| *a - *b).collect()
        };
        let mut targets: Vec<Value> = Vec::new();
        for i in &group[1..] {
            let p = d.positions(&apart(&meshes[*i].positions, &base.positions));
            let n = d.vectors(&apart(&meshes[*i].normals, &base.normals));
            targets.push(json!({ "POSITION": p, "NORMAL": n }));
        }
        let mut primitive = json!({
            "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": corners,
        });
        let mut mesh = json!({});
        if !targets.is_empty() {
            mesh["weights"] = json!(vec![0.0; targets.len()]);
            primitive["targets"] = json!(targets);
        }
        mesh["primitives"] = json!([primitive]);
        let mesh = d.mesh(mesh);
        let node = d.node(json!({ "mesh": mesh, "scale": [1, 1, 1] }));
        if !targets.is_empty() {
            // While another mesh is shown, the weights do not matter.
            let weight = |state: usize| {
                let own = group.iter().position(|i| *i == state);
                (1..group.len()).map(move |k| if own == Some(k) { 1.0 } else { 0.0 })
            };
            let weights: Vec<f32> = (0..states.len()).flat_map(weight).collect();
            let output = d.numbers(&weights);
            let how = if groups.len() == 1 { "LINEAR" } else { "STEP" };
            animation.channel(node, "weights", output, how);
        }
        if groups.len() > 1 {
            let scale = |i: usize| if group.contains(&i) { Vec3::ONE } else { Vec3::ZERO };
            let output = d.animated_vectors(&(0..states.len()).map(scale).collect::<Vec<_>>());
            animation.channel(node, "scale", output, "STEP");
        }
    }
    Ok(())
}
