//! The parts that every glTF file has: buffer, views, accessors, nodes.

use glam::Vec3;
use serde_json::{Value, json};

/// Component types (glTF 2.0, section 3.6.2.2).
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// A file under way. Functions that add something return its index.
#[derive(Default)]
pub struct Document {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    animation: Option<Value>,
}

impl Document {
    /// Adds data as a buffer view and an accessor of it.
    fn accessor(&mut self, data: Vec<u8>, target: Option<u32>, accessor: Value) -> usize {
        let mut view =
            json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": data.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend(data);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(view);
        let mut accessor = accessor;
        accessor["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds positions of vertices, with their bounds.
    pub fn positions(&mut self, all: &[Vec3]) -> usize {
        let fold = |f: fn(Vec3, Vec3) -> Vec3| all.iter().copied().reduce(f).unwrap_or_default();
        let (min, max) = (fold(Vec3::min).to_array(), fold(Vec3::max).to_array());
        let data = bytes(all.iter().flat_map(|v| v.to_array()));
        self.accessor(
            data,
            Some(34962),
            json!({
                "componentType": FLOAT, "count": all.len(), "type": "VEC3", "min": min, "max": max,
            }),
        )
    }

    /// Adds vectors of vertices.
    pub fn vectors(&mut self, all: &[Vec3]) -> usize {
        let data = bytes(all.iter().flat_map(|v| v.to_array()));
        let accessor = json!({ "componentType": FLOAT, "count": all.len(), "type": "VEC3" });
        self.accessor(data, Some(34962), accessor)
    }

    /// Adds the corners of triangles.
    pub fn corners(&mut self, triangles: &[[u32; 3]]) -> usize {
        let data = triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let count = 3 * triangles.len();
        let accessor = json!({ "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" });
        self.accessor(data, Some(34963), accessor)
    }

    /// Adds the times of an animation, or the weights of its targets.
    pub fn numbers(&mut self, all: &[f32]) -> usize {
        let low = all.iter().copied().reduce(f32::min).unwrap_or_default();
        let high = all.iter().copied().reduce(f32::max).unwrap_or_default();
        self.accessor(bytes(all.iter().copied()), None, json!({
            "componentType": FLOAT, "count": all.len(), "type": "SCALAR", "min": [low], "max": [high],
        }))
    }

    /// Adds translations or scales of an animation.
    pub fn animated_vectors(&mut self, all: &[Vec3]) -> usize {
        let data = bytes(all.iter().flat_map(|v| v.to_array()));
        self.accessor(
            data,
            None,
            json!({ "componentType": FLOAT, "count": all.len(), "type": "VEC3" }),
        )
    }

    /// Adds a mesh.
    pub fn mesh(&mut self, mesh: Value) -> usize {
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// Adds a node of the scene.
    pub fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Sets the animation.
    pub fn animation(&mut self, animation: Value) {
        self.animation = Some(animation);
    }

    /// Returns the bytes of the file.
    pub fn finish(self) -> Vec<u8> {
        let mut document = json!({
            "asset": { "version": "2.0", "generator": "pcadlang" },
            "scene": 0,
            "scenes": [{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "buffers": [{ "byteLength": self.bin.len() }],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        // An empty list is not allowed.
        if let Some(animation) = self.animation {
            document["animations"] = json!([animation]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut out = Vec::with_capacity(28 + text.len() + self.bin.len());
        let word = |x: usize| (x as u32).to_le_bytes();
        out.extend_from_slice(b"glTF");
        out.extend_from_slice(&word(2));
        out.extend_from_slice(&word(28 + text.len() + self.bin.len()));
        out.extend_from_slice(&word(text.len()));
        out.extend_from_slice(b"JSON");
        out.extend_from_slice(&text);
        out.extend_from_slice(&word(self.bin.len()));
        out.extend_from_slice(b"BIN\0");
        out.extend_from_slice(&self.bin);
        out
    }
}

fn bytes(numbers: impl Iterator<Item = f32>) -> Vec<u8> {
    numbers.flat_map(f32::to_le_bytes).collect()
}
