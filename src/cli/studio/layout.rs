//! JSON and binary forms that several answers share.

use pcadlang::geom::{GeomError, Mesh, Solid};
use pcadlang::render::{Camera, Projection};
use serde_json::{Map, Value, json};
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

/// Returns a number as JSON: null if it is not finite.
pub fn finite(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

/// Returns a camera as JSON, with the angle of its picture's height in degrees, or, for a
/// parallel projection, the height in scene units.
pub fn camera(c: &Camera) -> Value {
    let target = c.eye + c.forward;
    let mut out = json!({
        "eye": c.eye.to_array(), "target": target.to_array(), "up": c.up.to_array(),
        "width_px": c.width, "height_px": c.height, "near": Camera::NEAR,
    });
    let height = f64::from(c.height);
    let centre = match c.projection {
        Projection::Pinhole { focal_px, cx, cy } => {
            out["fov_y"] = json!(2.0 * (0.5 * height / focal_px).atan().to_degrees());
            [cx, cy]
        }
        Projection::Orthographic { units_per_pixel, cx, cy } => {
            out["height"] = json!(height * units_per_pixel);
            [cx, cy]
        }
    };
    // The principal point as a shift of the picture's centre, in parts of its sides.
    out["shift"] = json!([centre[0] / f64::from(c.width) - 0.5, centre[1] / height - 0.5]);
    out
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

/// Returns a name that meshes with the same triangles share.
pub fn topology(mesh: &Mesh) -> String {
    let mut hasher = DefaultHasher::new();
    mesh.positions.len().hash(&mut hasher);
    mesh.topology.triangles.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}
