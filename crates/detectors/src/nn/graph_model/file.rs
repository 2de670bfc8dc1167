//! The JSON of a graph model: its nodes, and the names and types of its constants.

use super::super::NetworkError;
use super::super::file::format;
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::collections::HashMap;

type Result<T> = core::result::Result<T, NetworkError>;

/// The parts of `model.json` that are read.
#[derive(Deserialize)]
pub(super) struct Model {
    #[serde(rename = "modelTopology")]
    topology: Topology,
    #[serde(rename = "weightsManifest")]
    pub manifest: Vec<Group>,
    signature: Signature,
}

#[derive(Deserialize)]
struct Topology {
    node: Vec<Node>,
}

#[derive(Deserialize)]
struct Signature {
    outputs: Map<String, Value>,
}

/// Constants whose values are in the same files.
#[derive(Deserialize)]
pub(super) struct Group {
    pub weights: Vec<Weight>,
}

/// A constant's name, shape and type.
#[derive(Deserialize)]
pub(super) struct Weight {
    pub name: String,
    pub shape: Vec<usize>,
    pub dtype: String,
    pub quantization: Option<Quantization>,
}

#[derive(Deserialize)]
pub(super) struct Quantization {
    pub dtype: String,
}

/// An operator, a constant or the input.
#[derive(Deserialize)]
pub(super) struct Node {
    pub name: String,
    pub op: String,
    #[serde(default)]
    input: Vec<String>,
    #[serde(default)]
    attr: HashMap<String, Attribute>,
}

/// An attribute; which of these it has depends on its type.
#[derive(Deserialize)]
struct Attribute {
    /// In base 64.
    s: Option<String>,
    f: Option<f32>,
    b: Option<bool>,
    list: Option<List>,
    shape: Option<Shape>,
}

#[derive(Deserialize)]
struct List {
    #[serde(default)]
    i: Vec<Integer>,
}

#[derive(Deserialize)]
struct Shape {
    #[serde(default)]
    dim: Vec<Dimension>,
}

#[derive(Deserialize)]
struct Dimension {
    size: Integer,
}

/// Integers of 64 bits are strings.
#[derive(Deserialize)]
#[serde(untagged)]
enum Integer {
    Number(usize),
    Text(String),
}

impl Integer {
    fn size(&self) -> Option<usize> {
        match self {
            Integer::Number(n) => Some(*n),
            Integer::Text(t) => t.parse().ok(),
        }
    }
}

impl Node {
    /// Returns a text attribute; empty if it is missing.
    pub fn text(&self, name: &str) -> String {
        let coded = self.attr.get(name).and_then(|a| a.s.as_deref()).unwrap_or_default();
        String::from_utf8(BASE64_STANDARD.decode(coded).unwrap_or_default()).unwrap_or_default()
    }

    pub fn number(&self, name: &str) -> Option<f32> {
        self.attr.get(name)?.f
    }

    pub fn flag(&self, name: &str) -> bool {
        self.attr.get(name).and_then(|a| a.b).unwrap_or(false)
    }

    /// Returns a list of sizes.
    pub fn sizes(&self, name: &str) -> Option<Vec<usize>> {
        self.attr.get(name)?.list.as_ref()?.i.iter().map(Integer::size).collect()
    }

    /// Returns a shape without unknown sizes.
    pub fn shape(&self, name: &str) -> Option<Vec<usize>> {
        self.attr.get(name)?.shape.as_ref()?.dim.iter().map(|d| d.size.size()).collect()
    }
}

/// An output of a node: the node's index, and which of its outputs.
pub(super) type Source = (usize, usize);

/// The nodes, and what they read.
pub(super) struct Graph {
    pub nodes: Vec<Node>,
    /// For each node, what its inputs are.
    pub inputs: Vec<Vec<Source>>,
    pub outputs: Vec<Source>,
}

impl Model {
    pub fn parse(json: &[u8]) -> Result<Model> {
        serde_json::from_slice(json)
            .map_err(|e| NetworkError::Format(format!("not a TensorFlow.js graph model: {e}")))
    }

    /// Finds what nodes and outputs refer to by name.
    pub fn graph(self) -> Result<(Graph, Vec<Group>)> {
        let nodes = self.topology.node;
        let by_name: HashMap<&str, usize> =
            nodes.iter().enumerate().map(|(i, n)| (&n.name[..], i)).collect();
        if by_name.len() < nodes.len() {
            return Err(format("two nodes have the same name"));
        }
        let source = |name: &str| {
            let (node, which) = name.split_once(':').unwrap_or((name, "0"));
            let found = by_name.get(node).copied().zip(which.parse().ok());
            found.ok_or_else(|| NetworkError::Format(format!("there is no node {name}")))
        };
        // A name after ^ is of a node that is only to run before.
        let read =
            |n: &Node| n.input.iter().filter(|i| !i.starts_with('^')).map(|i| source(i)).collect();
        let inputs = nodes.iter().map(read).collect::<Result<_>>()?;
        let outputs = self.signature.outputs.values().map(|o| {
            source(
                o.get("name")
                    .and_then(Value::as_str)
                    .ok_or_else(|| format("an output has no name"))?,
            )
        });
        let outputs = outputs.collect::<Result<_>>()?;
        Ok((Graph { inputs, outputs, nodes }, self.manifest))
    }
}

impl Graph {
    /// Returns the nodes that the outputs need, each after those it reads.
    pub fn order(&self) -> Result<Vec<usize>> {
        #[derive(Clone, Copy, PartialEq)]
        enum State {
            New,
            Open,
            Done,
        }
        let mut states = vec![State::New; self.nodes.len()];
        let mut order = Vec::new();
        for (output, _) in &self.outputs {
            // Nodes that wait for their inputs, and the next input of each.
            let mut waiting = vec![(*output, 0)];
            while let Some((node, next)) = waiting.pop() {
                if states[node] == State::Done {
                    continue;
                }
                states[node] = State::Open;
                match self.inputs[node].get(next) {
                    Some((input, _)) => {
                        waiting.push((node, next + 1));
                        match states[*input] {
                            State::New => waiting.push((*input, 0)),
                            State::Open => return Err(format("a node needs its own result")),
                            State::Done => {}
                        }
                    }
                    None => {
                        states[node] = State::Done;
                        order.push(node);
                    }
                }
            }
        }
        Ok(order)
    }
}
