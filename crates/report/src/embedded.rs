//! Draws as meshes for the viewer of a page, small enough to lie in the page: positions of
//! 16 bits, differences between neighbours, compressed.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use pcadlang_scene::geom::{Mesh, Solid};
use pcadlang_scene::render::{Camera, Projection};
use serde_json::{Map, Value, json};
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::io::Write;

/// The largest coordinate of a position between the bounds.
const STEPS: f64 = 65535.0;
/// All positions together have at most this many bytes before compression.
const ROOM: usize = 2_500_000;

/// A draw to show.
#[derive(Clone, Debug)]
pub struct EmbeddedDraw {
    /// Its chain, from 1.
    pub chain: Option<u32>,
    /// Its place in the chain, from 1.
    pub draw: Option<u64>,
    /// Its log joint density.
    pub log_joint: f64,
    /// Its label, if it is not named by its position.
    pub label: Option<String>,
    /// Its scene.
    pub solid: Solid,
}

/// Returns the camera as the viewer reads it: the angle of the picture's height in degrees
/// or, for a parallel projection, the height in scene units; and where the principal point
/// is beside the picture's centre, in parts of its sides.
pub fn camera(c: &Camera) -> Value {
    let target = c.eye + c.forward;
    let mut out = json!({
        "eye": c.eye.to_array(), "target": target.to_array(), "up": c.up.to_array(),
        "width_px": c.width, "height_px": c.height, "near": Camera::NEAR,
    });
    let height = f64::from(c.height);
    let centre = match c.projection {
        Projection::Pinhole { focal_px, cx, cy } => {
            out["fov_y"] = json!(2.0 * libm::atan(0.5 * height / focal_px).to_degrees());
            [cx, cy]
        }
        Projection::Orthographic { units_per_pixel, cx, cy } => {
            out["height"] = json!(height * units_per_pixel);
            [cx, cy]
        }
    };
    out["shift"] = json!([centre[0] / f64::from(c.width) - 0.5, centre[1] / height - 0.5]);
    out
}

/// Returns a name that meshes with the same triangles share.
pub fn topology(mesh: &Mesh) -> String {
    let mut hasher = DefaultHasher::new();
    mesh.positions.len().hash(&mut hasher);
    mesh.topology.triangles.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// Returns what the viewer shows: a camera, and the first of the draws with as many others,
/// evenly spaced, as there is room for. Draws without a mesh are left out. `None` if no
/// draw has one that fits.
pub fn embedded(view: &Camera, draws: &[EmbeddedDraw]) -> Option<Value> {
    let mut meshes: Vec<(&EmbeddedDraw, Mesh)> =
        draws.iter().filter_map(|d| Some((d, d.solid.to_mesh().ok()?))).collect();
    meshes.retain(|(_, m)| !m.positions.is_empty() && m.positions.iter().all(|p| p.is_finite()));
    let largest = meshes.iter().map(|(_, m)| 6 * m.positions.len()).max()?;
    let most = ROOM / largest;
    if most == 0 {
        return None;
    }
    let every = (meshes.len() - 1).div_ceil((most - 1).max(1)).max(1);
    let meshes: Vec<_> = meshes
        .into_iter()
        .enumerate()
        .filter(|(i, _)| *i == 0 || (most > 1 && (i - 1) % every == 0))
        .map(|(_, m)| m)
        .collect();
    let all = || meshes.iter().flat_map(|(_, m)| &m.positions);
    let low = all().copied().reduce(glam::Vec3::min)?.as_dvec3();
    let high = all().copied().reduce(glam::Vec3::max)?.as_dvec3();
    let mut topologies: Map<String, Value> = Map::new();
    let mut shown = Vec::new();
    for (draw, mesh) in &meshes {
        let name = topology(mesh);
        let corners = mesh.topology.triangles.iter().flatten().flat_map(|i| i.to_le_bytes());
        topologies
            .entry(name.clone())
            .or_insert_with(|| json!(packed(&corners.collect::<Vec<_>>())));
        shown.push(json!({
            "chain": draw.chain, "draw": draw.draw, "label": draw.label,
            "log_joint": draw.log_joint.is_finite().then_some(draw.log_joint),
            "topology": name, "positions": packed(&differences(mesh, low, high)),
        }));
    }
    Some(json!({
        "camera": camera(view), "low": low.to_array(), "high": high.to_array(),
        "topologies": topologies, "draws": shown,
    }))
}

/// Returns positions as steps between the bounds: all x, then all y, then all z, each as
/// the difference from the one before.
fn differences(mesh: &Mesh, low: glam::DVec3, high: glam::DVec3) -> Vec<u8> {
    let mut out = Vec::with_capacity(6 * mesh.positions.len());
    for axis in 0..3 {
        let (from, width) = (low[axis], (high[axis] - low[axis]).max(f64::MIN_POSITIVE));
        let mut before = 0u16;
        for p in &mesh.positions {
            let share = (f64::from(p[axis]) - from) / width;
            let step = (share * STEPS).round().clamp(0.0, STEPS) as u16;
            out.extend_from_slice(&step.wrapping_sub(before).to_le_bytes());
            before = step;
        }
    }
    out
}

/// Compresses bytes (zlib, RFC 1950) and writes them in base64.
pub(crate) fn packed(bytes: &[u8]) -> String {
    // Differences have few long matches: looking for better ones takes ten times as long.
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(4));
    // Writing to memory does not fail.
    let _ = encoder.write_all(bytes);
    BASE64_STANDARD.encode(encoder.finish().unwrap_or_default())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::{DVec3, Vec3};
    use pcadlang_scene::geom::{Affine, sphere};
    use std::io::Read;
    use std::sync::Arc;

    fn draw(x: f64) -> EmbeddedDraw {
        let ball = Solid::new(Arc::new(sphere(1.0, 40).unwrap()));
        let solid = ball.placed(Affine::new(DVec3::X * x, DVec3::ZERO, DVec3::ONE));
        EmbeddedDraw { chain: Some(1), draw: Some(3), log_joint: -x, label: None, solid }
    }

    pub(crate) fn unpacked(v: &Value) -> Vec<u8> {
        let bytes = BASE64_STANDARD.decode(v.as_str().unwrap()).unwrap();
        let mut out = Vec::new();
        flate2::read::ZlibDecoder::new(&bytes[..]).read_to_end(&mut out).unwrap();
        out
    }

    #[test]
    fn positions_come_back_to_a_step() {
        let all = [draw(0.0), draw(0.5), draw(4.0)];
        let scene = embedded(&Camera::default_for(64, 48), &all).unwrap();
        let number = |key: &str, axis: usize| scene[key][axis].as_f64().unwrap();
        assert_eq!(scene["topologies"].as_object().unwrap().len(), 1, "the triangles are shared");
        for (shown, d) in scene["draws"].as_array().unwrap().iter().zip(&all) {
            let mesh = d.solid.to_mesh().unwrap();
            let bytes = unpacked(&shown["positions"]);
            let n = mesh.positions.len();
            assert_eq!(bytes.len(), 6 * n);
            for axis in 0..3 {
                let (low, high) = (number("low", axis), number("high", axis));
                let mut q = 0u16;
                for (i, p) in mesh.positions.iter().enumerate() {
                    let at = 2 * (axis * n + i);
                    q = q.wrapping_add(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
                    let back = low + f64::from(q) / STEPS * (high - low);
                    assert!((back - f64::from(p[axis])).abs() <= (high - low) / STEPS);
                }
            }
        }
        let corners =
            unpacked(&scene["topologies"][scene["draws"][0]["topology"].as_str().unwrap()]);
        assert_eq!(corners.len(), 12 * all[0].solid.to_mesh().unwrap().topology.triangles.len());
    }

    #[test]
    fn many_draws_are_thinned_to_the_room() {
        let all: Vec<_> = (0..900).map(|i| draw(f64::from(i) * 0.01)).collect();
        let scene = embedded(&Camera::default_for(64, 48), &all).unwrap();
        let shown = scene["draws"].as_array().unwrap();
        let size = 6 * all[0].solid.to_mesh().unwrap().positions.len();
        assert!(shown.len() * size <= ROOM && shown.len() > ROOM / size / 3, "{}", shown.len());
        assert_eq!(shown[0]["log_joint"], 0.0, "the first one is always there");
        let far = EmbeddedDraw { solid: Solid::of(Arc::new([])), ..draw(0.0) };
        assert!(embedded(&Camera::default_for(4, 4), &[far]).is_none());
    }

    #[test]
    fn the_camera_has_the_angle_of_its_height() {
        let c = Camera::default_for(200, 100);
        let fov = camera(&c)["fov_y"].as_f64().unwrap();
        let top = c.unproject(100.0, 0.0, 8.0);
        let angle = Vec3::new(top.x as f32, top.y as f32, -8.0).angle_between(Vec3::NEG_Z);
        assert!((fov - 2.0 * f64::from(angle).to_degrees()).abs() < 1e-3, "{fov}");
        assert_eq!(camera(&c)["shift"], json!([0.0, 0.0]));
    }
}
