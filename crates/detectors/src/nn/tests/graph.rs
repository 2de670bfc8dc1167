//! Writes graph models for tests.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::{Map, Value, json};

/// A graph model with the input `x`.
#[derive(Clone)]
pub struct Graph {
    pub nodes: Vec<Value>,
    pub constants: Vec<Value>,
    pub bytes: Vec<u8>,
    pub outputs: Vec<&'static str>,
}

/// A list of sizes as an attribute: integers of 64 bits are strings.
pub fn sizes(all: &[usize]) -> Value {
    json!({ "list": { "i": all.iter().map(usize::to_string).collect::<Vec<_>>() } })
}

pub fn text(s: &str) -> Value {
    json!({ "s": BASE64_STANDARD.encode(s) })
}

/// Attributes of a window that moves by `stride` over an image with channels last.
pub fn window(stride: [usize; 2], padding: &str) -> Value {
    let strides = sizes(&[1, stride[0], stride[1], 1]);
    json!({ "strides": strides, "padding": text(padding), "data_format": text("NHWC") })
}

impl Graph {
    pub fn new(shape: &[usize], outputs: &[&'static str]) -> Graph {
        let dim: Vec<Value> = shape.iter().map(|n| json!({ "size": n.to_string() })).collect();
        let input = json!({ "name": "x", "op": "Placeholder", "attr": { "shape": { "shape": { "dim": dim } } } });
        let (constants, bytes) = (Vec::new(), Vec::new());
        Graph { nodes: vec![input], constants, bytes, outputs: outputs.to_vec() }
    }

    pub fn node(mut self, name: &str, op: &str, inputs: &[&str], attr: Value) -> Graph {
        self.nodes.push(json!({ "name": name, "op": op, "input": inputs, "attr": attr }));
        self
    }

    fn constant(mut self, name: &str, about: Value, bytes: impl Iterator<Item = u8>) -> Graph {
        let mut about = about;
        about["name"] = name.into();
        self.constants.push(about);
        self.bytes.extend(bytes);
        self.node(name, "Const", &[], json!({}))
    }

    pub fn halves(self, name: &str, shape: &[usize], values: &[f32]) -> Graph {
        let kind = json!({ "dtype": "float16", "original_dtype": "float32" });
        let about = json!({ "shape": shape, "dtype": "float32", "quantization": kind });
        let bytes = values.iter().flat_map(|v| half::f16::from_f32(*v).to_le_bytes());
        self.constant(name, about, bytes)
    }

    pub fn floats(self, name: &str, shape: &[usize], values: &[f32]) -> Graph {
        let about = json!({ "shape": shape, "dtype": "float32" });
        self.constant(name, about, values.iter().flat_map(|v| v.to_le_bytes()))
    }

    pub fn integers(self, name: &str, shape: &[usize], values: &[i32]) -> Graph {
        let about = json!({ "shape": shape, "dtype": "int32" });
        self.constant(name, about, values.iter().flat_map(|v| v.to_le_bytes()))
    }

    /// A transposition to this order.
    pub fn transposed(self, name: &str, input: &str, order: &[i32]) -> Graph {
        let of = format!("{name}/perm");
        let graph = self.integers(&of, &[order.len()], order);
        graph.node(name, "Transpose", &[input, &of], json!({}))
    }

    /// Returns the JSON and the weights.
    pub fn files(&self) -> (Vec<u8>, Vec<u8>) {
        let output = |o: &&'static str| (format!("{o}:0"), json!({ "name": o }));
        let outputs: Map<String, Value> = self.outputs.iter().map(output).collect();
        let model = json!({
            "format": "graph-model",
            "signature": { "outputs": outputs },
            "modelTopology": { "node": self.nodes },
            "weightsManifest": [{ "paths": ["weights.bin"], "weights": self.constants }],
        });
        (model.to_string().into_bytes(), self.bytes.clone())
    }
}

/// A convolution of a row of three pixels, whose channel comes first, with the weights 1
/// and -2 and the bias 0.5; a leaky ReLU, and channels first again.
pub fn small() -> Graph {
    Graph::new(&[1, 1, 1, 3], &["y"])
        .transposed("last", "x", &[0, 2, 3, 1])
        .halves("weights", &[1, 2, 1, 1], &[1.0, -2.0])
        .floats("bias", &[1], &[0.5])
        .node("c", "Conv2D", &["last", "weights"], window([1, 1], "VALID"))
        .node("b", "AddV2", &["c", "bias"], json!({}))
        .transposed("first", "b", &[0, 3, 1, 2])
        .node("l", "LeakyRelu", &["first"], json!({ "alpha": { "f": 0.25 } }))
        .node("y", "Identity", &["l"], json!({}))
}

/// Two channels, first, of 2 x 2 pixels: padded with -infinity and pooled by 3 x 3 with
/// stride 2; its two channels apart, one by a sigmoid, one enlarged and made a list whose
/// length is computed.
pub fn split() -> Graph {
    let mut pool = window([2, 2], "VALID");
    pool["ksize"] = sizes(&[1, 3, 3, 1]);
    Graph::new(&[1, 2, 2, 2], &["s", "r"])
        .integers("widths", &[4, 2], &[0, 0, 0, 0, 1, 1, 1, 1])
        .halves("low", &[], &[f32::NEG_INFINITY])
        .node("p", "PadV2", &["x", "widths", "low"], json!({}))
        .transposed("last", "p", &[0, 2, 3, 1])
        .node("m", "MaxPool", &["last"], pool)
        .transposed("first", "m", &[0, 3, 1, 2])
        .integers("parts", &[2], &[1, 1])
        .integers("axis", &[], &[1])
        .node("both", "SplitV", &["first", "parts", "axis"], json!({}))
        .node("s", "Sigmoid", &["both"], json!({}))
        .transposed("one", "both:1", &[0, 2, 3, 1])
        .integers("size", &[2], &[1, 2])
        .node(
            "e",
            "ResizeBilinear",
            &["one", "size"],
            json!({ "half_pixel_centers": { "b": true } }),
        )
        .integers("where", &[0, 1], &[])
        .integers("length", &[1], &[2])
        .integers("values", &[0], &[])
        .integers("zero", &[], &[0])
        .node("zeros", "SparseToDense", &["where", "length", "values", "zero"], json!({}))
        .integers("free", &[2], &[1, -1])
        .node("shape", "AddV2", &["free", "zeros"], json!({}))
        .node("r", "Reshape", &["e", "shape"], json!({}))
}
