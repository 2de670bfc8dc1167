//! From the files of a TensorFlow.js graph model to a network: nodes in the order in which
//! they run, with their constants, and checks that they fit together.

mod assemble;
mod constants;
mod file;

use super::NetworkError;
use super::assemble::Rejection;
use super::file::format;
use super::fuse::fuse;
use super::network::Network;
use assemble::{Assembly, Value};
use file::Model;

impl<'a> Network<'a> {
    /// Reads the network of a TensorFlow.js graph model: the bytes of its `model.json`, and
    /// those of its files of weights, one after the other. Inputs and outputs have the
    /// model's dimensions, in the model's order; the outputs are those of its signature.
    /// `image` is the height and width of another input, if channels come first, with which
    /// sizes to which images are scaled grow in proportion.
    ///
    /// # Errors
    /// If the files are not of the format or do not belong together, or the network has
    /// unsupported operators or is too large.
    pub fn read_graph_model(
        json: &[u8],
        weights: &'a [u8],
        image: Option<[usize; 2]>,
    ) -> Result<Network<'a>, NetworkError> {
        let (graph, manifest) = Model::parse(json)?.graph()?;
        let constants = constants::read(manifest, weights)?;
        let mut assembly = Assembly::default();
        assembly.image = image;
        let mut values: Vec<Vec<Value>> = vec![Vec::new(); graph.nodes.len()];
        for index in graph.order()? {
            let node = &graph.nodes[index];
            let made = graph.inputs[index]
                .iter()
                .map(|(n, which)| values[*n].get(*which).ok_or("an input does not exist".into()))
                .collect::<Result<Vec<_>, Rejection>>()
                .and_then(|inputs| assembly.node(node, &inputs, &constants));
            values[index] = made.map_err(|e| match e {
                Rejection::File(e) => e,
                Rejection::Operator(why) => {
                    let name = format!("{} ({})", node.name, node.op);
                    NetworkError::Operator { index, name, why }
                }
            })?;
        }
        let mut outputs = Vec::new();
        for (node, which) in &graph.outputs {
            match values[*node].get(*which) {
                Some(Value::Tensor(view)) => outputs.push(assembly.plain(view)?),
                _ => return Err(format("an output is never computed")),
            }
        }
        let input = assembly.input.ok_or_else(|| format("no output depends on an input"))?;
        let Assembly { layers, effort, mut shapes, constants, .. } = assembly;
        let layers = fuse(layers, &mut shapes, &constants, &outputs);
        if outputs.is_empty() {
            return Err(format("it has no output"));
        }
        Ok(effort.network(layers, shapes, constants, input, outputs))
    }
}
