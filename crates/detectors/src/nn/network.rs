//! Networks: operators in execution order, and the tensors between them.

use super::NetworkError;
use super::operator::{Operator, Tensor};
use super::plan::Plan;
use core::ops::Range;
use std::collections::HashMap;

/// The memory in which networks run, one run after the other: tensors, and behind them what an
/// operator needs while it runs.
#[derive(Debug, Default)]
pub struct Memory(Vec<f32>);

/// The number of elements for which memory is asked at least. Allocators map so large a block
/// apart and give it back when it is freed, what was never used of it is never there, and they
/// do not take its size as a reason to keep smaller ones.
const ASKED: usize = if cfg!(target_family = "wasm") { 0 } else { 9 << 20 };

impl Memory {
    fn take(&mut self, size: usize) -> &mut [f32] {
        if self.0.len() < size {
            // The old block first.
            self.0 = Vec::new();
            self.0 = vec![0.0; size.max(ASKED)];
        }
        &mut self.0[..size]
    }
}

/// A network read from a file, of which its weights are a part.
#[derive(Debug)]
pub struct Network<'a> {
    layers: Vec<Layer<'a>>,
    /// The shape of each tensor.
    shapes: Vec<Vec<usize>>,
    constants: HashMap<usize, Vec<f32>>,
    input: usize,
    outputs: Vec<usize>,
    work: usize,
}

/// An operator with the tensors it reads and the one it writes.
#[derive(Debug)]
pub(super) struct Layer<'a> {
    pub operator: Operator<'a>,
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
    pub fn network<'a>(
        self,
        layers: Vec<Layer<'a>>,
        shapes: Vec<Vec<usize>>,
        constants: HashMap<usize, Vec<f32>>,
        input: usize,
        outputs: Vec<usize>,
    ) -> Network<'a> {
        Network { layers, shapes, constants, input, outputs, work: self.work }
    }
}

impl Network<'_> {
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
        let expected = self.input_len();
        if input.len() != expected {
            return Err(NetworkError::Input { expected, got: input.len() });
        }
        let (wanted, mut memory) = (vec![true; self.outputs.len()], Memory::default());
        let outputs = self.run_in(&mut memory, &wanted, |place| place.copy_from_slice(&input));
        Ok(outputs.into_iter().map(<[f32]>::to_vec).collect())
    }

    fn input_len(&self) -> usize {
        self.input_shape().iter().product()
    }

    /// Returns the outputs that are wanted, in the file's order, for an input that `fill` writes;
    /// others are empty, and what only they need is not computed.
    pub fn run_in<'m>(
        &'m self,
        memory: &'m mut Memory,
        wanted: &[bool],
        fill: impl FnOnce(&mut [f32]),
    ) -> Vec<&'m [f32]> {
        let kept = self.outputs.iter().zip(wanted).map(|(o, wanted)| wanted.then_some(*o));
        let kept: Vec<Option<usize>> = kept.collect();
        let plan = Plan::new(&self.layers, &self.shapes, self.input, &kept);
        let own = |(i, _): &(usize, Option<usize>)| {
            let Layer { operator, inputs, output } = &self.layers[*i];
            inputs.first().map_or(0, |t| operator.memory(&self.shapes[*t], &self.shapes[*output]))
        };
        let most = plan.steps.iter().map(own).max().unwrap_or(0);
        let (tensors, own) = memory.take(plan.size + most).split_at_mut(plan.size);
        fill(&mut tensors[plan.places[self.input].clone()]);
        for (i, within) in &plan.steps {
            let layer = &self.layers[*i];
            let place = plan.places[layer.output].clone();
            let (before, rest) = tensors.split_at_mut(place.start);
            let (out, after) = rest.split_at_mut(place.len());
            let tensor = |t: &usize| {
                let Range { start, end } = plan.places[*t];
                let values = match self.constants.get(t) {
                    Some(values) => values,
                    None if end <= place.start => &before[start..end],
                    None => &after[start - place.end..end - place.end],
                };
                Tensor { shape: &self.shapes[*t], values }
            };
            match within {
                Some(k) => {
                    let other = layer.inputs.iter().enumerate().find(|(j, _)| j != k);
                    layer.operator.run_within(other.map(|(_, t)| tensor(t)), out);
                }
                None => {
                    let inputs: Vec<Tensor> = layer.inputs.iter().map(tensor).collect();
                    layer.operator.run(&inputs, &self.shapes[layer.output], own, out);
                }
            }
        }
        let tensors = &*tensors;
        let output = |o: &Option<usize>| {
            o.map_or(&[][..], |o| match self.constants.get(&o) {
                Some(values) => values,
                None => &tensors[plan.places[o].clone()],
            })
        };
        kept.iter().map(output).collect()
    }
}
