//! Writes binary glTF 2.0 files (Khronos, glTF 2.0 specification, section 4.4): objects, each a
//! mesh and a node with its name, or several states of a scene as an animation.
//!
//! No materials. Invariant: both chunks are complete and aligned to four bytes.

mod animation;
mod channels;
mod document;
mod morphs;

use super::Object;
pub use animation::write_animation;
use document::Document;
use serde_json::json;

/// Returns the bytes of a `.glb` file of some objects.
pub fn write(objects: &[Object]) -> Vec<u8> {
    let mut d = Document::default();
    for Object { name, mesh } in objects {
        let positions = d.positions(&mesh.positions);
        let normals = d.vectors(&mesh.normals);
        let corners = d.corners(&mesh.topology.triangles);
        let mesh = d.mesh(json!({
            "name": name,
            "primitives": [{
                "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": corners,
            }],
        }));
        d.node(json!({ "name": name, "mesh": mesh }));
    }
    d.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_whole_and_aligned() {
        let m = crate::geom::cuboid(glam::DVec3::ONE).unwrap();
        let glb = write(&[m.clone().into()]);
        let word = |at: usize| {
            u32::from_le_bytes([glb[at], glb[at + 1], glb[at + 2], glb[at + 3]]) as usize
        };
        assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
        let json_length = word(12);
        assert_eq!((json_length % 4, &glb[16..20]), (0, &b"JSON"[..]));
        let document: serde_json::Value =
            serde_json::from_slice(&glb[20..20 + json_length]).unwrap();
        assert_eq!(word(20 + json_length), 24 * 24 + 36 * 4);
        assert_eq!(document["nodes"][0]["name"], "object");
        assert_eq!(document["accessors"][0]["min"], json!([-0.5, -0.5, -0.5]));
        assert_eq!(document["accessors"][2]["count"], 36);
        assert_eq!(&glb[24 + json_length..28 + json_length], b"BIN\0");
    }

    #[test]
    fn the_numbers_are_the_mesh_s() {
        let m = crate::geom::sphere(0.7, 6).unwrap();
        let glb = write(&[m.clone().into()]);
        let start = 28 + u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
        let words: Vec<[u8; 4]> =
            glb[start..].chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect();
        let n = m.positions.len();
        let floats: Vec<f32> = words[..6 * n].iter().map(|w| f32::from_le_bytes(*w)).collect();
        let flat = |vs: &[glam::Vec3]| vs.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        assert_eq!(
            (&floats[..3 * n], &floats[3 * n..]),
            (&flat(&m.positions)[..], &flat(&m.normals)[..])
        );
        let corners: Vec<u32> = words[6 * n..].iter().map(|w| u32::from_le_bytes(*w)).collect();
        assert_eq!(corners, m.topology.triangles.as_flattened());
        let document: serde_json::Value = serde_json::from_slice(&glb[20..start - 8]).unwrap();
        for axis in 0..3 {
            let most = m.positions.iter().map(|p| p[axis]).fold(f32::MIN, f32::max);
            assert_eq!(document["accessors"][0]["max"][axis].as_f64().unwrap() as f32, most);
        }
        let views = document["bufferViews"].as_array().unwrap();
        assert!(views.iter().all(|v| v["byteOffset"].as_u64().unwrap() % 4 == 0));
        let end =
            views[2]["byteOffset"].as_u64().unwrap() + views[2]["byteLength"].as_u64().unwrap();
        assert_eq!(document["buffers"][0]["byteLength"].as_u64(), Some(end));
    }
}
