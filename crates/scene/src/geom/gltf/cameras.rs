//! The cameras of a glTF file's default scene.

use super::container::{name_of, open};
use super::nodes::Nodes;
use crate::geom::GeomError;
use glam::DAffine3;

/// A camera, in the file's own coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct GltfCamera {
    /// Its node's name.
    pub name: String,
    /// From its coordinates (x right, y up, z backward) to the scene's.
    pub to_world: DAffine3,
    /// The angle of view from top to bottom in radians, between 0 and pi, and width over height if
    /// it is stated; `None` for an orthographic camera.
    pub perspective: Option<(f64, Option<f64>)>,
}

/// Returns the cameras, in the order of their nodes.
///
/// # Errors
/// Bytes that are not glTF 2.0; nodes that do not form a tree; an angle or ratio out of range.
pub fn cameras(bytes: &[u8]) -> Result<Vec<GltfCamera>, GeomError> {
    let (document, _) = open(bytes)?;
    let nodes = Nodes::of(&document)?;
    let mut all = Vec::new();
    for (i, node) in document.nodes.iter().enumerate().filter(|(i, _)| nodes.drawn[*i]) {
        let Some(number) = node.camera else { continue };
        let name = name_of(node, i);
        let camera = document.cameras.get(number).ok_or_else(|| {
            GeomError::invalid(format!("node `{name}` refers to the missing camera {number}"))
        })?;
        let perspective = camera.perspective.as_ref().map(|p| (p.yfov, p.aspect_ratio));
        if let Some((yfov, aspect)) = perspective
            && !(yfov > 0.0 && yfov < 3.1 && aspect.is_none_or(|a| a > 1e-3 && a < 1e3))
        {
            return Err(GeomError::invalid(format!(
                "camera `{name}` must have a yfov between 0 and pi, and a positive aspectRatio"
            )));
        }
        all.push(GltfCamera { name, to_world: nodes.global[i], perspective });
    }
    Ok(all)
}
