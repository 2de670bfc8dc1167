//! Numbers and meshes as answers carry them.

use pcadlang_report::embedded::topology;
use pcadlang_scene::geom::{GeomError, Solid};
use serde_json::{Map, Value, json};

/// Returns a number as JSON: null if it is not finite.
pub fn finite(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

/// Returns the header and the data of a mesh: positions, normals, corners, parts.
///
/// # Errors
/// If the solid has no mesh, or one of more than `limit` triangles.
pub fn mesh(solid: &Solid, limit: Option<usize>) -> Result<(Map<String, Value>, Vec<u8>), String> {
    let mesh = solid.to_mesh().map_err(|e: GeomError| e.to_string())?;
    let triangles = &mesh.topology.triangles;
    if let Some(most) = limit.filter(|most| triangles.len() > *most) {
        return Err(format!("the mesh has {} triangles, more than {most}", triangles.len()));
    }
    let mut data = Vec::with_capacity(24 * mesh.positions.len() + 14 * triangles.len() + 2);
    for v in mesh.positions.iter().chain(&mesh.normals) {
        v.to_array().iter().for_each(|x| data.extend_from_slice(&x.to_le_bytes()));
    }
    triangles.iter().flatten().for_each(|i| data.extend_from_slice(&i.to_le_bytes()));
    let part = |i: usize| mesh.topology.parts.get(i).copied().unwrap_or(0);
    (0..triangles.len()).for_each(|i| data.extend_from_slice(&part(i).to_le_bytes()));
    data.resize(data.len().next_multiple_of(4), 0);
    let Value::Object(header) = json!({
        "type": "mesh", "vertices": mesh.positions.len(), "triangles": triangles.len(),
        "topology": topology(&mesh),
    }) else {
        return Err("no header".to_owned());
    };
    Ok((header, data))
}
