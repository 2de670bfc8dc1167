//! A small writer of glTF files for tests.

use glam::{DMat3, DVec3};
use pcadlang_scene::geom::armature::Armature;
use serde_json::{Value, json};

/// Bytes with their buffer views and accessors, one view per accessor.
#[derive(Default)]
pub struct Writer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Writer {
    fn add(&mut self, shape: &str, component: u32, size: usize, bytes: &[u8]) -> usize {
        let width = match shape {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let number = self.accessors.len();
        self.views.push(
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }),
        );
        let count = bytes.len() / (width * size);
        self.accessors.push(json!({ "bufferView": number, "componentType": component, "type": shape, "count": count }));
        self.bytes.extend_from_slice(bytes);
        number
    }

    /// Adds an accessor of floats and returns its index.
    pub fn floats(&mut self, shape: &str, values: &[f32]) -> usize {
        self.add(shape, 5126, 4, &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
    }

    /// Adds an accessor of bytes.
    pub fn bytes(&mut self, shape: &str, values: &[u8]) -> usize {
        self.add(shape, 5121, 1, values)
    }

    /// Adds an accessor of 16-bit integers.
    pub fn shorts(&mut self, shape: &str, values: &[u16]) -> usize {
        self.add(shape, 5123, 2, &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
    }

    /// Adds an accessor of 32-bit integers.
    pub fn words(&mut self, shape: &str, values: &[u32]) -> usize {
        self.add(shape, 5125, 4, &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
    }

    /// Adds the accessors and views to a document, and returns the buffer.
    pub fn document(self, document: &mut Value) -> Vec<u8> {
        document["asset"] = json!({ "version": "2.0" });
        document["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        document["bufferViews"] = self.views.into();
        document["accessors"] = self.accessors.into();
        self.bytes
    }
}

/// Returns a GLB file of a document and the accessors of a writer.
pub fn glb(writer: Writer, mut document: Value) -> Vec<u8> {
    let bytes = writer.document(&mut document);
    packed(&document, &bytes)
}

/// Returns a GLB file of a complete document and its buffer.
pub fn packed(document: &Value, bytes: &[u8]) -> Vec<u8> {
    let (mut text, mut bytes) = (document.to_string().into_bytes(), bytes.to_vec());
    text.resize(text.len().next_multiple_of(4), b' ');
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    for word in [2, 28 + text.len() + bytes.len(), text.len()] {
        out.extend((word as u32).to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(text);
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bytes);
    out
}

/// Returns a body as a skinned GLB file: positions are multiplied by `to_file`, and the
/// joints are below a node with the properties `root`.
pub fn skinned(body: &Armature, to_file: DMat3, root: &Value) -> Vec<u8> {
    let mut w = Writer::default();
    let at = |p: DVec3| (to_file * p).to_array();
    let flat = |p: &glam::Vec3| at(p.as_dvec3()).map(|x| x as f32);
    let positions = w.floats("VEC3", &body.positions().iter().flat_map(flat).collect::<Vec<f32>>());
    let indices = w.words("SCALAR", body.triangles().as_flattened());
    let joints =
        w.shorts("VEC4", &body.influences().iter().flat_map(|i| i.joints).collect::<Vec<u16>>());
    let weights =
        w.floats("VEC4", &body.influences().iter().flat_map(|i| i.weights).collect::<Vec<f32>>());
    let all = body.rig().joints();
    let bind = |h: DVec3| {
        let [x, y, z] = at(-h).map(|x| x as f32);
        [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
    };
    let binds = w.floats("MAT4", &all.iter().flat_map(|j| bind(j.head)).collect::<Vec<f32>>());
    // The joints' nodes come first, so that their indices agree; then the mesh, then the
    // root node.
    let children =
        |of: Option<usize>| (0..all.len()).filter(|c| all[*c].parent == of).collect::<Vec<usize>>();
    let mut nodes: Vec<Value> = (0..all.len())
        .map(|j| {
            let start = all[j].parent.map_or(DVec3::ZERO, |p| all[p].head);
            let mut node = json!({ "name": &*all[j].name, "translation": at(all[j].head - start) });
            if !children(Some(j)).is_empty() {
                node["children"] = children(Some(j)).into();
            }
            node
        })
        .collect();
    nodes.push(json!({ "mesh": 0, "skin": 0, "name": "body" }));
    let mut above = root.clone();
    above["children"] = [children(None), vec![all.len()]].concat().into();
    nodes.push(above);
    let attributes = json!({ "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let document = json!({
        "scene": 0,
        "scenes": [{ "nodes": [all.len() + 1] }],
        "nodes": nodes,
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices }] }],
        "skins": [{ "joints": (0..all.len()).collect::<Vec<usize>>(), "inverseBindMatrices": binds }],
    });
    glb(w, document)
}
