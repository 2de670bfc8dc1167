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

/// Returns a file with what few files have: copies of a mesh, a body in another pose than its
/// bind pose, morph targets of which one is sparse, each with a weight, and a hidden node.
pub fn everything() -> Vec<u8> {
    let mut w = Writer::default();
    let square = w.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let corners = w.bytes("SCALAR", &[0, 1, 2, 0, 2, 3]);
    let up = w.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
    let (sparse, places) = (w.floats("VEC3", &[0.0, 3.0, 0.0]), w.bytes("SCALAR", &[2]));
    let joints = w.bytes("VEC4", &[0, 1, 0, 0].repeat(4));
    let weights = w.floats(
        "VEC4",
        &[[1.0, 0.0], [1.0, 0.0], [0.25, 0.75], [0.0, 1.0]].map(|[a, b]| [a, b, 0.0, 0.0]).concat(),
    );
    let at = w.floats("VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let turned = w.shorts("VEC4", &[0, 0, 0, 32767, 0, 0, 23170, 23170, 0, 0, 0, 32767]);
    let scaled = w.floats("VEC3", &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 3.0, -1.0]);
    let targets = json!([{ "POSITION": up }, { "POSITION": 99 }]);
    let attributes = json!({ "POSITION": square, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let mut d = json!({
        "scenes": [{ "nodes": [0, 1, 2, 4] }],
        "nodes": [
            { "mesh": 0, "skin": 0, "name": "body" },
            { "name": "root", "children": [3] },
            { "mesh": 1, "name": "many", "extensions": { "EXT_mesh_gpu_instancing": {
                "attributes": { "TRANSLATION": at, "ROTATION": turned, "SCALE": scaled } } } },
            { "name": "tip", "rotation": [0, 0, 0.6, 0.8] },
            { "mesh": 1, "name": "unseen", "extensions": { "KHR_node_visibility": { "visible": false } } },
        ],
        "meshes": [
            { "primitives": [{ "attributes": attributes, "indices": corners, "targets": targets }],
              "weights": [0.5, 1], "extras": { "targetNames": ["lift", "point"] } },
            { "primitives": [{ "attributes": { "POSITION": square }, "indices": corners }] },
        ],
        "skins": [{ "joints": [1, 3] }],
        "extensionsUsed": ["EXT_mesh_gpu_instancing", "KHR_node_visibility"],
    });
    let bytes = w.document(&mut d);
    let all = d["accessors"].as_array_mut().unwrap();
    (all[turned]["componentType"], all[turned]["normalized"]) = (5122.into(), true.into());
    let (index, view) = (all.len(), |k: usize| all[k]["bufferView"].clone());
    let sparse = json!({ "componentType": 5126, "type": "VEC3", "count": 4, "sparse": {
        "count": 1, "indices": { "bufferView": view(places), "componentType": 5121 }, "values": { "bufferView": view(sparse) } } });
    all.push(sparse);
    d["meshes"][0]["primitives"][0]["targets"][1]["POSITION"] = index.into();
    packed(&d, &bytes)
}
