//! Merges operators that precede or follow another one into it, which saves passes over
//! tensors, and their memory.

use super::network::Layer;
use super::operator::Operator;
use super::shape::Clip;
use std::collections::HashMap;

/// Merges biases added to a convolution's result, and a leaky ReLU of that, into the
/// convolution, and what pads an image into the window that moves over it, where nothing else
/// reads what is between them.
pub(super) fn fuse<'a>(
    layers: Vec<Layer<'a>>,
    shapes: &mut [Vec<usize>],
    constants: &HashMap<usize, Vec<f32>>,
    outputs: &[usize],
) -> Vec<Layer<'a>> {
    let mut readers = HashMap::<usize, usize>::new();
    for t in layers.iter().flat_map(|l| &l.inputs).chain(outputs) {
        *readers.entry(*t).or_default() += 1;
    }
    let mut fused = Vec::<Option<Layer>>::with_capacity(layers.len());
    let mut made = HashMap::<usize, usize>::new();
    for mut layer in layers {
        let before = layer.inputs.first().filter(|t| readers.get(t) == Some(&1));
        let before = before.and_then(|t| made.get(t)).copied();
        if let Some(i) = before
            && let Some(earlier) = &mut fused[i]
        {
            if merge(&layer, earlier, constants) {
                made.insert(layer.output, i);
                earlier.output = layer.output;
                continue;
            }
            if take_padding(&mut layer, earlier, shapes) {
                fused[i] = None;
            } else {
                pad_later(&mut layer, earlier, shapes);
            }
        }
        made.insert(layer.output, fused.len());
        fused.push(Some(layer));
    }
    fused.into_iter().flatten().collect()
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

/// Returns whether the window of a layer was made to begin outside its image, as far as the
/// layer before pads that.
fn take_padding(layer: &mut Layer, before: &Layer, shapes: &[Vec<usize>]) -> bool {
    let Operator::Pad { before: [top, left, 0], value } = before.operator else { return false };
    let (window, outside) = match &mut layer.operator {
        Operator::Convolution(c) => (&mut c.window, 0.0),
        Operator::Depthwise(c) => (&mut c.window, 0.0),
        Operator::Pool { window, largest: true, .. } => (window, f32::NEG_INFINITY),
        _ => return false,
    };
    let ([from], [to]) = (&before.inputs[..], &layer.inputs[..]) else { return false };
    if value != outside || window.same || shapes[*from].last() != shapes[*to].last() {
        return false;
    }
    window.shift = [top, left];
    layer.inputs.clone_from(&before.inputs);
    true
}

/// Reorders the dimensions of an image before it is padded, not after.
fn pad_later<'a>(layer: &mut Layer<'a>, before: &mut Layer<'a>, shapes: &mut [Vec<usize>]) {
    let (Operator::Pad { before: widths, value }, Operator::Transpose(order)) =
        (&before.operator, &layer.operator)
    else {
        return;
    };
    let [0, ..] = order[..] else { return };
    let [from] = before.inputs[..] else { return };
    let moved = [1, 2, 3].map(|i| order.get(i).and_then(|d| widths.get(d - 1)).copied());
    let [Some(a), Some(b), Some(c)] = moved else { return };
    shapes[before.output] = order.iter().map(|d| shapes[from][*d]).collect();
    let pad = Operator::Pad { before: [a, b, c], value: *value };
    before.operator = core::mem::replace(&mut layer.operator, pad);
}
