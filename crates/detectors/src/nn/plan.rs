//! Where the tensors of a run are in its memory: those that are needed at the same time apart,
//! others in the same place.

use super::network::Layer;
use core::ops::Range;

/// What a run computes, and where.
#[derive(Debug)]
pub(super) struct Plan {
    /// The layers that are needed, in order, each with the index of the input in whose place its
    /// output is, if it is.
    pub steps: Vec<(usize, Option<usize>)>,
    /// For each tensor, its place; empty if it is not needed or constant.
    pub places: Vec<Range<usize>>,
    /// The size of the memory.
    pub size: usize,
}

/// A place, from the step that fills it to the last one that reads it.
struct Block {
    len: usize,
    first: usize,
    last: usize,
    start: usize,
}

impl Plan {
    /// Plans the computation of some outputs.
    pub fn new(
        layers: &[Layer],
        shapes: &[Vec<usize>],
        input: usize,
        outputs: &[Option<usize>],
    ) -> Plan {
        let mut last: Vec<Option<usize>> = vec![None; shapes.len()];
        outputs.iter().flatten().for_each(|o| last[*o] = Some(layers.len()));
        let mut needed = Vec::new();
        for (i, layer) in layers.iter().enumerate().rev() {
            if last[layer.output].is_some() {
                needed.push(i);
                layer.inputs.iter().for_each(|t| last[*t] = last[*t].max(Some(i)));
            }
        }
        let len = |t: usize| shapes[t].iter().product::<usize>();
        let block = |t: usize, first: usize| Block {
            len: len(t),
            first,
            last: last[t].unwrap_or(first),
            start: 0,
        };
        let mut blocks = vec![block(input, 0)];
        let mut in_block: Vec<Option<usize>> = vec![None; shapes.len()];
        in_block[input] = Some(0);
        let mut steps = Vec::new();
        for i in needed.into_iter().rev() {
            let layer = &layers[i];
            // An input of the same size that nobody reads later.
            let ends = |t: &usize| {
                let is_alone = layer.inputs.iter().filter(|u| *u == t).count() == 1;
                let ends = in_block[*t].is_some() && last[*t] == Some(i) && is_alone;
                ends && len(*t) == len(layer.output)
            };
            let within = match layer.operator.works_within() {
                true => layer.inputs.iter().position(ends),
                false => None,
            };
            let made = match within.and_then(|k| in_block[layer.inputs[k]]) {
                Some(b) => {
                    blocks[b].last = last[layer.output].unwrap_or(i);
                    b
                }
                None => {
                    blocks.push(block(layer.output, i));
                    blocks.len() - 1
                }
            };
            in_block[layer.output] = Some(made);
            steps.push((i, within));
        }
        let size = place(&mut blocks);
        let places = in_block.iter().map(|b| match b {
            Some(b) => blocks[*b].start..blocks[*b].start + blocks[*b].len,
            None => 0..0,
        });
        Plan { steps, places: places.collect(), size }
    }
}

/// Places blocks, the longest first, each as far to the front as those that are needed at the
/// same time let it; returns the end of all.
fn place(blocks: &mut [Block]) -> usize {
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|b| core::cmp::Reverse(blocks[*b].len));
    let mut placed: Vec<usize> = Vec::new();
    for b in order {
        let (first, last) = (blocks[b].first, blocks[b].last);
        let mut start = 0;
        // Ordered by their starts.
        for other in placed.iter().map(|o| &blocks[*o]) {
            if other.first <= last && first <= other.last {
                if start + blocks[b].len <= other.start {
                    break;
                }
                start = start.max(other.start + other.len);
            }
        }
        blocks[b].start = start;
        let at = placed.partition_point(|o| blocks[*o].start <= start);
        placed.insert(at, b);
    }
    blocks.iter().map(|b| b.start + b.len).max().unwrap_or(0)
}
