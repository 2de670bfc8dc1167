//! Networks: operators in execution order, and the tensors between them.

use super::NetworkError;
use super::operator::{Operator, Tensor};
use std::collections::HashMap;

/// A network read from a file.
#[derive(Debug)]
pub struct Network {
    layers: Vec<Layer>,
    /// The shape of each tensor.
    shapes: Vec<Vec<usize>>,
    constants: HashMap<usize, Vec<f32>>,
    input: usize,
    outputs: Vec<usize>,
    /// For each tensor, the last step that reads it; `usize::MAX` for outputs.
    last: Vec<usize>,
    work: usize,
}

/// An operator with the tensors it reads and the one it writes.
#[derive(Debug)]
pub(super) struct Layer {
    pub operator: Operator,
    pub inputs: Vec<usize>,
    pub output: usize,
}

/// The maximum number of elements in one tensor, and in all constants together.
pub(super) const MOST_NUMBERS: usize = 1 << 26;
/// The maximum number of elements in all computed tensors, and of multiplications: about
/// ten times those of the largest person detector.
const MOST_COMPUTED: usize = 1 << 29;
const MOST_WORK: usize = 1 << 36;

/// Counts what a network that is being read will compute, up to the limits.
#[derive(Debug, Default)]
pub(super) struct Effort {
    computed: usize,
    work: usize,
}

impl Effort {
    /// Adds an operator with inputs of these shapes and an output of this size.
    pub fn add(
        &mut self,
        operator: &Operator,
        inputs: &[&[usize]],
        size: usize,
    ) -> Result<(), NetworkError> {
        self.computed = self.computed.saturating_add(size);
        self.work = self.work.saturating_add(operator.work(inputs, size));
        if self.computed > MOST_COMPUTED || self.work > MOST_WORK {
            return Err(NetworkError::TooLarge("it needs too many operations".into()));
        }
        Ok(())
    }

    /// Returns the network of operators that were added, each after those it reads.
    pub fn network(
        self,
        layers: Vec<Layer>,
        shapes: Vec<Vec<usize>>,
        constants: HashMap<usize, Vec<f32>>,
        input: usize,
        outputs: Vec<usize>,
    ) -> Network {
        let mut last = vec![0; shapes.len()];
        layers.iter().enumerate().for_each(|(i, s)| s.inputs.iter().for_each(|t| last[*t] = i));
        outputs.iter().for_each(|o| last[*o] = usize::MAX);
        Network { layers, shapes, constants, input, outputs, last, work: self.work }
    }
}

impl Network {
    /// The shape of the input, usually 1, height, width, channels.
    pub fn input_shape(&self) -> &[usize] {
        &self.shapes[self.input]
    }

    /// The shapes of the outputs, in the file's order.
    pub fn output_shapes(&self) -> impl ExactSizeIterator<Item = &[usize]> {
        self.outputs.iter().map(|o| &self.shapes[*o][..])
    }

    /// The approximate number of multiplications of a run.
    pub fn work(&self) -> usize {
        self.work
    }

    /// Returns the outputs for an input, in the file's order. Numbers are in the
    /// order of their shape, those along its last dimension together.
    ///
    /// # Errors
    /// If the input's length does not match its shape.
    pub fn run(&self, input: Vec<f32>) -> Result<Vec<Vec<f32>>, NetworkError> {
        let expected = self.input_shape().iter().product();
        if input.len() != expected {
            return Err(NetworkError::Input { expected, got: input.len() });
        }
        let mut values: Vec<Option<Vec<f32>>> = vec![None; self.shapes.len()];
        values[self.input] = Some(input);
        // Buffers of tensors that are no longer needed.
        let mut free: Vec<Vec<f32>> = Vec::new();
        for (i, layer) in self.layers.iter().enumerate() {
            let shape = &self.shapes[layer.output];
            let mut out = reuse(&mut free, shape.iter().product());
            let tensor = |t: &usize| {
                let values = values[*t].as_ref().or_else(|| self.constants.get(t));
                Tensor { shape: &self.shapes[*t], values: values.map_or(&[], |v| v) }
            };
            let inputs: Vec<Tensor> = layer.inputs.iter().map(tensor).collect();
            layer.operator.run(&inputs, shape, &mut out);
            values[layer.output] = Some(out);
            for t in layer.inputs.iter().filter(|t| self.last[**t] == i) {
                free.extend(values[*t].take());
            }
        }
        Ok(self.outputs.iter().map(|o| values[*o].clone().unwrap_or_default()).collect())
    }
}

/// Returns a list of this length with arbitrary values, reusing the smallest buffer that
/// is large enough, and not more than twice that. If none is, the largest is freed, so that
/// they do not pile up.
fn reuse(free: &mut Vec<Vec<f32>>, len: usize) -> Vec<f32> {
    let fits = free
        .iter()
        .enumerate()
        .filter(|(_, v)| v.capacity() >= len && v.capacity() / 2 <= len)
        .min_by_key(|(_, v)| v.capacity());
    match fits.map(|(i, _)| i) {
        Some(i) => {
            let mut v = free.swap_remove(i);
            v.resize(len, 0.0);
            v
        }
        None => {
            let largest = (0..free.len()).max_by_key(|i| free[*i].capacity());
            if let Some(i) = largest {
                drop(free.swap_remove(i));
            }
            vec![0.0; len]
        }
    }
}
