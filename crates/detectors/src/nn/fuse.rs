//! Merges operators that follow a convolution into it, which saves passes over its result.

use super::network::Layer;
use super::operator::Operator;
use super::shape::Clip;
use std::collections::HashMap;

/// Merges biases added to a convolution's result, and a leaky ReLU of that, into the
/// convolution, where nothing else reads what is between them.
pub(super) fn fuse(
    layers: Vec<Layer>,
    constants: &HashMap<usize, Vec<f32>>,
    outputs: &[usize],
) -> Vec<Layer> {
    let mut readers = HashMap::<usize, usize>::new();
    for t in layers.iter().flat_map(|l| &l.inputs).chain(outputs) {
        *readers.entry(*t).or_default() += 1;
    }
    let mut fused = Vec::<Layer>::with_capacity(layers.len());
    let mut made = HashMap::<usize, usize>::new();
    for layer in layers {
        let before = layer.inputs.first().filter(|t| readers.get(t) == Some(&1));
        let before = before.and_then(|t| made.get(t)).copied();
        if let Some(i) = before
            && merge(&layer, &mut fused[i], constants)
        {
            made.insert(layer.output, i);
            fused[i].output = layer.output;
            continue;
        }
        made.insert(layer.output, fused.len());
        fused.push(layer);
    }
    fused
}

/// Returns whether a layer was merged into the one whose result it reads.
fn merge(layer: &Layer, before: &mut Layer, constants: &HashMap<usize, Vec<f32>>) -> bool {
    let Operator::Convolution(convolution) = &mut before.operator else { return false };
    match (&layer.operator, &layer.inputs[..]) {
        (Operator::Add(clip), [_, biases]) if *clip == Clip::NONE => {
            constants.get(biases).is_some_and(|b| convolution.add_biases(b))
        }
        (Operator::LeakyRelu(slope), _) => convolution.make_leaky(*slope),
        _ => false,
    }
}
