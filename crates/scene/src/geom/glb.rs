//! Writes binary glTF 2.0 files (Khronos, glTF 2.0 specification, section 4.4):
//! positions, normals, triangles.
//!
//! One mesh, one node, no materials and no parts. Invariant: both chunks are complete and
//! aligned to four bytes.

use super::Mesh;
use serde_json::json;

/// Returns the bytes of a `.glb` file.
pub fn write(mesh: &Mesh) -> Vec<u8> {
    let mut bin =
        Vec::with_capacity(mesh.positions.len() * 24 + mesh.topology.triangles.len() * 12);
    let floats = |bin: &mut Vec<u8>, vs: &[glam::Vec3]| {
        vs.iter().for_each(|v| {
            v.to_array().iter().for_each(|x| bin.extend_from_slice(&x.to_le_bytes()))
        });
    };
    floats(&mut bin, &mesh.positions);
    let normals_at = bin.len();
    floats(&mut bin, &mesh.normals);
    let indices_at = bin.len();
    mesh.topology.triangles.iter().flatten().for_each(|i| bin.extend_from_slice(&i.to_le_bytes()));
    let (count, corners) = (mesh.positions.len(), mesh.topology.triangles.len() * 3);
    let fold = |f: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
        mesh.positions.iter().fold([start; 3], |m, p| [f(m[0], p.x), f(m[1], p.y), f(m[2], p.z)])
    };
    let (min, max) = if count == 0 {
        ([0.0; 3], [0.0; 3])
    } else {
        (fold(f32::min, f32::MAX), fold(f32::max, f32::MIN))
    };
    let document = json!({
        "asset": { "version": "2.0", "generator": "pcadlang" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2 }] }],
        "buffers": [{ "byteLength": bin.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": normals_at, "target": 34962 },
            { "buffer": 0, "byteOffset": normals_at, "byteLength": indices_at - normals_at, "target": 34962 },
            { "buffer": 0, "byteOffset": indices_at, "byteLength": bin.len() - indices_at, "target": 34963 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "min": min, "max": max },
            { "bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3" },
            { "bufferView": 2, "componentType": 5125, "count": corners, "type": "SCALAR" },
        ],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = Vec::with_capacity(28 + text.len() + bin.len());
    let word = |x: usize| (x as u32).to_le_bytes();
    out.extend_from_slice(b"glTF");
    out.extend_from_slice(&word(2));
    out.extend_from_slice(&word(28 + text.len() + bin.len()));
    out.extend_from_slice(&word(text.len()));
    out.extend_from_slice(b"JSON");
    out.extend_from_slice(&text);
    out.extend_from_slice(&word(bin.len()));
    out.extend_from_slice(b"BIN\0");
    out.extend_from_slice(&bin);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_whole_and_aligned() {
        let m = crate::geom::cuboid(glam::DVec3::ONE).unwrap();
        let glb = write(&m);
        let word = |at: usize| {
            u32::from_le_bytes([glb[at], glb[at + 1], glb[at + 2], glb[at + 3]]) as usize
        };
        assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
        let json_length = word(12);
        assert_eq!((json_length % 4, &glb[16..20]), (0, &b"JSON"[..]));
        let document: serde_json::Value =
            serde_json::from_slice(&glb[20..20 + json_length]).unwrap();
        assert_eq!(word(20 + json_length), 24 * 24 + 36 * 4);
        assert_eq!(document["accessors"][0]["min"], json!([-0.5, -0.5, -0.5]));
        assert_eq!(document["accessors"][2]["count"], 36);
        assert_eq!(&glb[24 + json_length..28 + json_length], b"BIN\0");
    }

    #[test]
    fn the_numbers_are_the_mesh_s() {
        let m = crate::geom::sphere(0.7, 6).unwrap();
        let glb = write(&m);
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
